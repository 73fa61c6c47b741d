//! Pictures of errors, as 8-bit RGB codes for [`super::png_file::write_codes`].

use super::flip;
use super::metrics::Reference;
use crate::math::Rgb;

/// Code of pixels that do not count.
const MASKED: [u8; 3] = [128, 128, 128];

/// Signed relative error (I-R) / sqrt(R^2 + 0.01), mean of the channels: white where equal, red where `pixels` are too
/// bright, blue where too dark, full colour at an error of `scale` (0.5: 50 per cent).
pub fn signed(pixels: &[Rgb], reference: &Reference, scale: f32) -> Vec<u8> {
    let color = |i: usize| {
        let (p, r) = (pixels[i], reference.mean[i]);
        let size = |c: usize| (r[c] * r[c] + super::metrics::RELATIVE_EPSILON as f32).sqrt();
        let error = (0..3).map(|c| (p[c] - r[c]) / size(c)).sum::<f32>() / 3.0;
        let t = (error / scale).clamp(-1.0, 1.0);
        let pale = (255.0 * (1.0 - t.abs()) + 0.5) as u8;
        if t >= 0.0 { [255, pale, pale] } else { [pale, pale, 255] }
    };
    codes(reference, color)
}

/// Heat map of LDR FLIP: black is equal, then violet, orange, and white at 1.
pub fn flip_map(pixels: &[Rgb], reference: &Reference) -> Vec<u8> {
    let (w, h) = (reference.width, reference.height);
    let map = flip::flip(pixels, &reference.mean, w, h, flip::PIXELS_PER_DEGREE);
    codes(reference, |i| heat(map[i]))
}

fn codes(reference: &Reference, color: impl Fn(usize) -> [u8; 3]) -> Vec<u8> {
    let pixel = |i: usize| if reference.counted[i] { color(i) } else { MASKED };
    (0..reference.counted.len()).flat_map(pixel).collect()
}

/// Colours of growing lightness for values in [0, 1].
pub fn heat(value: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [80.0, 20.0, 120.0], [200.0, 60.0, 100.0], [255.0, 160.0, 60.0], [255.0, 255.0, 230.0]];
    let at = value.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let i = (at as usize).min(STOPS.len() - 2);
    let t = at - i as f32;
    std::array::from_fn(|c| (STOPS[i][c] * (1.0 - t) + STOPS[i + 1][c] * t + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Picture;

    #[test]
    fn red_is_too_bright_blue_too_dark_grey_is_masked() {
        let mut picture = Picture::new(5, 1, vec![Rgb::ONE; 5]);
        picture.mask = Some(vec![true, true, true, true, false]);
        let reference = Reference::new(&picture, None).unwrap();
        let pixels = [1.0, 9.0, 0.0, 1.0 + 0.1 * 1.01f32.sqrt(), 9.0].map(Rgb::splat);
        let codes = signed(&pixels, &reference, 0.5);
        let expected = [[255, 255, 255], [255, 0, 0], [0, 0, 255], [255, 204, 204], MASKED];
        assert_eq!(codes, expected.concat());
    }

    #[test]
    fn heat_grows_lighter() {
        let lightness = |v: f32| heat(v).iter().map(|&c| c as u32).sum::<u32>();
        assert!((0..100).all(|i| lightness(i as f32 / 100.0) < lightness((i + 1) as f32 / 100.0)));
        let picture = Picture::new(16, 16, vec![Rgb::splat(0.5); 256]);
        let reference = Reference::new(&picture, None).unwrap();
        assert!(flip_map(&picture.pixels, &reference).iter().all(|&c| c == 0));
        assert!(flip_map(&[Rgb::X; 256], &reference).iter().all(|&c| c > 0));
    }
}
