//! Pictures and maps within a page: PNG files as `data:` addresses, false colours with their legends.

use crate::image::diff::heat;
use crate::image::metrics::{RELATIVE_EPSILON, Reference};
use crate::image::{png_file, srgb};
use crate::math::Rgb;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// Relative errors at both ends of the logarithmic error map.
const ERROR_RANGE: [f32; 2] = [0.01, 1.0];

/// A picture ready for a page.
#[derive(Clone, Debug)]
pub struct Embedded {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Its `data:` address.
    pub address: String,
}

/// A false-colour picture and what its colours mean.
#[derive(Clone, Debug)]
pub struct FalseColor {
    /// The picture.
    pub picture: Embedded,
    /// Colours from the low to the high end.
    pub colors: Vec<[u8; 3]>,
    /// Texts at equal distances along the colours.
    pub ticks: Vec<String>,
}

impl Embedded {
    /// A picture of 8-bit sRGB codes; `None` if there are not `width * height` triples.
    pub fn of_codes(width: usize, height: usize, codes: &[u8]) -> Option<Embedded> {
        let bytes = png_file::encode_codes(width, height, codes).ok()?;
        Some(Embedded { width, height, address: format!("data:image/png;base64,{}", STANDARD.encode(bytes)) })
    }

    /// A picture of linear RGB times 2^`exposure`.
    pub fn of_pixels(width: usize, height: usize, pixels: &[Rgb], exposure: f32) -> Option<Embedded> {
        let scale = exposure.exp2();
        let codes: Vec<u8> = pixels.iter().flat_map(|p| (*p * scale).to_array()).map(srgb::encode_u8).collect();
        Embedded::of_codes(width, height, &codes)
    }
}

/// Absolute relative error |I-R| / sqrt(R^2 + 0.01), mean of the channels, on a logarithmic scale.
pub fn error_map(pixels: &[Rgb], reference: &Reference) -> Option<FalseColor> {
    let [low, high] = ERROR_RANGE;
    let value = |i: usize| {
        let e = relative_error(pixels[i], reference.mean[i]);
        if e > 0.0 { (e / low).ln() / (high / low).ln() } else { 0.0 }
    };
    let codes: Vec<u8> =
        (0..pixels.len()).flat_map(|i| if reference.counted[i] { heat(value(i)) } else { [128; 3] }).collect();
    let picture = Embedded::of_codes(reference.width, reference.height, &codes)?;
    let percent = |e: f32| format!("{} %", 100.0 * e);
    Some(FalseColor {
        picture,
        colors: (0..9).map(|i| heat(i as f32 / 8.0)).collect(),
        ticks: vec![
            format!("{} and less", percent(low)),
            percent((low * high).sqrt()),
            format!("{} and more", percent(high)),
        ],
    })
}

/// |I-R| / sqrt(R^2 + 0.01), mean of the channels.
pub fn relative_error(p: Rgb, r: Rgb) -> f32 {
    (0..3).map(|c| (p[c] - r[c]).abs() / (r[c] * r[c] + RELATIVE_EPSILON as f32).sqrt()).sum::<f32>() / 3.0
}

/// Values from 0 (or `range`'s start) to the largest in heat colours, linear; `None` if they are not a picture's.
pub fn density_map(values: &[f32], width: usize, height: usize, range: [f32; 2]) -> Option<FalseColor> {
    let [low, high] = range;
    let scale = if high > low { 1.0 / (high - low) } else { 0.0 };
    let codes: Vec<u8> = values.iter().flat_map(|v| heat((v - low) * scale)).collect();
    let number = |v: f32| if v.abs() >= 100.0 || v.fract() == 0.0 { format!("{v:.0}") } else { format!("{v:.3}") };
    Some(FalseColor {
        picture: Embedded::of_codes(width, height, &codes)?,
        colors: (0..9).map(|i| heat(i as f32 / 8.0)).collect(),
        ticks: vec![number(low), number(0.5 * (low + high)), number(high)],
    })
}

/// Upper left corners of up to `n` windows of `side` x `side` pixels, apart from one another, where the configurations'
/// relative errors differ most (or are largest, if there is one configuration only).
pub fn crops(pictures: &[&[Rgb]], reference: &Reference, side: usize, n: usize) -> Vec<(usize, usize)> {
    let (w, h) = (reference.width, reference.height);
    let (sx, sy) = (side.min(w), side.min(h));
    // Sums over windows from a table of sums over all rectangles at the upper left.
    let tables: Vec<Vec<f64>> = pictures
        .iter()
        .map(|p| {
            let mut table = vec![0.0; (w + 1) * (h + 1)];
            for y in 0..h {
                let mut row = 0.0;
                for x in 0..w {
                    let i = y * w + x;
                    if reference.counted[i] {
                        // Capped: one firefly must not draw all attention.
                        row += f64::from(relative_error(p[i], reference.mean[i]).min(1.0));
                    }
                    table[(y + 1) * (w + 1) + x + 1] = table[y * (w + 1) + x + 1] + row;
                }
            }
            table
        })
        .collect();
    let sum = |t: &[f64], x: usize, y: usize| {
        let at = |x: usize, y: usize| t[y * (w + 1) + x];
        at(x + sx, y + sy) - at(x, y + sy) - at(x + sx, y) + at(x, y)
    };
    let difference = |x: usize, y: usize| {
        let sums = tables.iter().map(|t| sum(t, x, y));
        let (low, high) = sums.fold((f64::INFINITY, 0.0f64), |(l, h), s| (l.min(s), h.max(s)));
        if tables.len() > 1 { high - low } else { high }
    };
    let step = (side / 8).max(1);
    let mut found: Vec<(f64, (usize, usize))> = (0..=h - sy)
        .step_by(step)
        .flat_map(|y| (0..=w - sx).step_by(step).map(move |x| (x, y)))
        .map(|(x, y)| (difference(x, y), (x, y)))
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<(usize, usize)> = Vec::new();
    for (_, (x, y)) in found {
        if chosen.len() < n && chosen.iter().all(|&(a, b)| x.abs_diff(a) >= sx || y.abs_diff(b) >= sy) {
            chosen.push((x, y));
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Picture, read};
    use std::path::Path;

    fn reference(w: usize, h: usize) -> Reference {
        Reference::new(&Picture::new(w, h, vec![Rgb::splat(0.5); w * h]), None).unwrap()
    }

    #[test]
    fn embedded_pictures_decode_to_what_went_in() {
        let codes: Vec<u8> = (0..12 * 5 * 3).map(|i| (i * 7) as u8).collect();
        let embedded = Embedded::of_codes(12, 5, &codes).unwrap();
        let text = embedded.address.strip_prefix("data:image/png;base64,").unwrap();
        let picture = read::decode(Path::new("embedded"), &STANDARD.decode(text).unwrap(), false).unwrap();
        let got: Vec<u8> =
            picture.pixels.iter().flat_map(|p| p.to_array()).map(|v| (v * 255.0).round() as u8).collect();
        assert_eq!((picture.width(), got), (12, codes));
        assert!(Embedded::of_codes(3, 3, &[0; 5]).is_none());
    }

    #[test]
    fn crops_lie_where_configurations_differ() {
        let (w, h) = (64, 48);
        let r = reference(w, h);
        let mut a = vec![Rgb::splat(0.5); w * h];
        let mut b = a.clone();
        // Both are equally wrong at the left; only one is at the right.
        for y in 0..16 {
            for x in 0..16 {
                (a[y * w + x], b[y * w + x]) = (Rgb::ONE, Rgb::ONE);
                b[(y + 20) * w + x + 40] = Rgb::splat(0.6);
            }
        }
        let found = crops(&[&a, &b], &r, 16, 3);
        assert_eq!((found[0], found.len()), ((40, 20), 3));
        assert!(found.iter().all(|&(x, y)| x + 16 <= w && y + 16 <= h));
        // Alone, the worst place counts.
        assert_eq!(crops(&[&b], &r, 16, 1), [(0, 0)]);
        // A picture smaller than the window is one crop.
        assert_eq!(crops(&[&[Rgb::ONE; 6]], &reference(3, 2), 16, 3), [(0, 0)]);
    }

    #[test]
    fn maps_follow_their_legends() {
        let r = reference(3, 1);
        let size = (0.25f32 + 0.01).sqrt();
        let pixels = [0.0, 0.1, 9.0].map(|e: f32| Rgb::splat(0.5 + e * size));
        let map = error_map(&pixels, &r).unwrap();
        let text = map.picture.address.strip_prefix("data:image/png;base64,").unwrap();
        let shown = read::decode(Path::new("map"), &STANDARD.decode(text).unwrap(), false).unwrap();
        let codes = |i: usize| shown.pixels[i].to_array().map(|v| (v * 255.0).round() as u8);
        assert_eq!([codes(0), codes(1), codes(2)], [heat(0.0), heat(0.5), heat(1.0)]);
        assert_eq!(map.ticks, ["1 % and less", "10 %", "100 % and more"]);
        let density = density_map(&[1.0, 2.0, 3.0], 3, 1, [1.0, 3.0]).unwrap();
        assert_eq!(density.ticks, ["1", "2", "3"]);
        assert!(density_map(&[1.0], 3, 1, [0.0, 1.0]).is_none());
    }
}
