//! FLIP: how different two pictures look when one flips between them.
//!
//! Source: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images" (LDR version). Both pictures pass through
//! the eye's contrast sensitivity in the opponent space YCxCz (section 4.1.1), then their colour difference is measured by HyAB with
//! Hunt's adjustment (4.1.2) and compressed to [0, 1] (4.1.3); differences of edges and points (4.2) raise it: the result is
//! color^(1 - feature) (4.3). 0 means equal, 1 as different as green and blue.
//!
//! Input is linear RGB, clamped to [0, 1] (what an sRGB screen can show). Beyond the border the picture's edge goes on.
//! Not handled: HDR-FLIP (exposures), tone mapping. Checked against the authors' program: see the tests.

use rayon::prelude::*;

use crate::math::Rgb;

/// The paper's viewing condition: 0.7 m from a 0.7 m wide screen of 3840 pixels, 0.7 (3840 / 0.7) pi / 180.
pub const PIXELS_PER_DEGREE: f32 = 67.020_643;

/// Exponent of the colour difference.
const QC: f32 = 0.7;
/// Colour differences below this share of the largest ...
const PC: f32 = 0.4;
/// ... are mapped to below this.
const PT: f32 = 0.95;
/// Exponent of the feature difference.
const QF: f32 = 0.5;
/// Width of the feature detector in degrees.
const FEATURE_WIDTH: f32 = 0.082;

/// Terms a, b of the contrast sensitivity functions of Y, Cx, Cz (table 1 of the paper): sum of
/// a sqrt(pi / b) exp(-pi^2 x^2 / b) with x in degrees.
const SENSITIVITY: [[(f32, f32); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];

/// FLIP error of every pixel, in [0, 1].
///
/// # Panics
/// If the pictures do not have `width * height` pixels each.
pub fn flip(image: &[Rgb], reference: &[Rgb], width: usize, height: usize, pixels_per_degree: f32) -> Vec<f32> {
    assert!(image.len() == width * height && reference.len() == image.len(), "sizes");
    let size = Size { width, height };
    let [a, b] = [image, reference].map(|p| Prepared::new(p, size, pixels_per_degree));
    let largest = largest_difference();
    (0..image.len())
        .into_par_iter()
        .map(|i| {
            let color = compress(hyab(a.lab[i], b.lab[i]).powf(QC), largest);
            let edge = (a.features[i].0 - b.features[i].0).abs();
            let point = (a.features[i].1 - b.features[i].1).abs();
            let feature = (edge.max(point) * std::f32::consts::FRAC_1_SQRT_2).powf(QF);
            color.powf(1.0 - feature).clamp(0.0, 1.0)
        })
        .collect()
}

#[derive(Clone, Copy)]
struct Size {
    width: usize,
    height: usize,
}

/// One picture, ready to be compared.
struct Prepared {
    /// Filtered by contrast sensitivity, in Hunt-adjusted L*a*b*.
    lab: Vec<Rgb>,
    /// Strength of edges and of points.
    features: Vec<(f32, f32)>,
}

impl Prepared {
    fn new(pixels: &[Rgb], size: Size, pixels_per_degree: f32) -> Self {
        let clamped = |p: &Rgb| Rgb::from_array(p.to_array().map(|v| if v > 0.0 { v.min(1.0) } else { 0.0 }));
        let opponent: Vec<Rgb> = pixels.par_iter().map(|p| ycxcz(xyz(clamped(p)))).collect();
        Prepared {
            lab: sensitivity_filter(&opponent, size, pixels_per_degree)
                .par_iter()
                .map(|&p| {
                    let rgb = rgb(xyz_of_ycxcz(p)).clamp(Rgb::ZERO, Rgb::ONE);
                    hunt(lab(xyz(rgb)))
                })
                .collect(),
            features: features(&opponent, size, pixels_per_degree),
        }
    }
}

/// Blurs each opponent channel by the eye's point spread.
fn sensitivity_filter(opponent: &[Rgb], size: Size, pixels_per_degree: f32) -> Vec<Rgb> {
    let pi = std::f32::consts::PI;
    let widest = SENSITIVITY.iter().flatten().fold(0.0f32, |m, t| m.max(t.1));
    let radius = (3.0 * (widest / (2.0 * pi * pi)).sqrt() * pixels_per_degree).ceil() as i32;
    let gaussian = |b: f32| -> Vec<f32> {
        (-radius..=radius)
            .map(|i| {
                let x = i as f32 / pixels_per_degree;
                (-pi * pi * x * x / b).exp()
            })
            .collect()
    };
    let mut result = vec![Rgb::ZERO; opponent.len()];
    for (channel, terms) in SENSITIVITY.iter().enumerate() {
        let terms: Vec<(f32, Vec<f32>)> =
            terms.iter().filter(|t| t.0 > 0.0).map(|&(a, b)| (a * (pi / b).sqrt(), gaussian(b))).collect();
        // Each term is separable, their sum is not; it is normalised as a whole.
        let total: f32 = terms.iter().map(|(a, g)| a * g.iter().sum::<f32>().powi(2)).sum();
        let plane: Vec<f32> = opponent.iter().map(|p| p[channel]).collect();
        for (a, g) in &terms {
            let blurred = convolve(&plane, size, g, g);
            for (r, v) in result.iter_mut().zip(&blurred) {
                r[channel] += v * (a / total);
            }
        }
    }
    result
}

/// Strength of edges (first derivative) and points (second) of the achromatic channel.
fn features(opponent: &[Rgb], size: Size, pixels_per_degree: f32) -> Vec<(f32, f32)> {
    let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
    let radius = (3.0 * deviation).ceil() as i32;
    let weights = |f: &dyn Fn(f32) -> f32| -> Vec<f32> {
        let gauss = |x: f32| (-x * x / (2.0 * deviation * deviation)).exp();
        normalised((-radius..=radius).map(|i| f(i as f32) * gauss(i as f32)).collect())
    };
    let smooth = weights(&|_| 1.0);
    let first = weights(&|x| -x);
    let second = weights(&|x| x * x / (deviation * deviation) - 1.0);
    let plane: Vec<f32> = opponent.iter().map(|p| (p.x + 16.0) / 116.0).collect();
    let [edge_x, edge_y] = [(&first, &smooth), (&smooth, &first)].map(|(x, y)| convolve(&plane, size, x, y));
    let [point_x, point_y] = [(&second, &smooth), (&smooth, &second)].map(|(x, y)| convolve(&plane, size, x, y));
    let pixel = |i: usize| (edge_x[i].hypot(edge_y[i]), point_x[i].hypot(point_y[i]));
    (0..plane.len()).into_par_iter().map(pixel).collect()
}

/// Positive weights are scaled to the sum 1, negative ones to -1.
fn normalised(mut weights: Vec<f32>) -> Vec<f32> {
    let positive: f32 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f32 = -weights.iter().filter(|w| **w < 0.0).sum::<f32>();
    for w in &mut weights {
        *w /= if *w > 0.0 { positive } else { negative.max(f32::MIN_POSITIVE) };
    }
    weights
}

/// Separable correlation with kernels of equal odd length along x and y; the border goes on.
fn convolve(plane: &[f32], size: Size, kernel_x: &[f32], kernel_y: &[f32]) -> Vec<f32> {
    let Size { width, height } = size;
    let radius = kernel_x.len() / 2;
    let mut rows = vec![0.0; plane.len()];
    rows.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, row)| {
        // The row with its border repeated, so that the inner loop has no branches.
        let mut padded = vec![row[0]; radius];
        padded.extend_from_slice(row);
        padded.resize(width + 2 * radius, row[width - 1]);
        for (x, o) in out.iter_mut().enumerate() {
            *o = padded[x..].iter().zip(kernel_x).map(|(p, k)| p * k).sum();
        }
    });
    let mut result = vec![0.0f32; plane.len()];
    result.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (i, k) in kernel_y.iter().enumerate() {
            let from = (y + i).saturating_sub(radius).min(height - 1) * width;
            for (o, p) in out.iter_mut().zip(&rows[from..from + width]) {
                *o += k * p;
            }
        }
    });
    result
}

/// Linear sRGB to XYZ (D65), rows.
const TO_XYZ: [[f32; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];
/// XYZ of white, the row sums of [`TO_XYZ`].
const WHITE: Rgb = Rgb::new(0.950_428_6, 1.0, 1.088_900_3);

fn xyz(rgb: Rgb) -> Rgb {
    Rgb::from_array(TO_XYZ.map(|row| Rgb::from_array(row).dot(rgb)))
}

fn rgb(xyz: Rgb) -> Rgb {
    const TO_RGB: [[f32; 3]; 3] = [
        [3.241_003_2, -1.537_399_0, -0.498_615_9],
        [-0.969_224_3, 1.875_930_0, 0.041_554_2],
        [0.055_639_4, -0.204_011_2, 1.057_149],
    ];
    Rgb::from_array(TO_RGB.map(|row| Rgb::from_array(row).dot(xyz)))
}

fn ycxcz(xyz: Rgb) -> Rgb {
    let v = xyz / WHITE;
    Rgb::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z))
}

fn xyz_of_ycxcz(c: Rgb) -> Rgb {
    let y = (c.x + 16.0) / 116.0;
    Rgb::new(y + c.y / 500.0, y, y - c.z / 200.0) * WHITE
}

fn lab(xyz: Rgb) -> Rgb {
    const DELTA: f32 = 6.0 / 29.0;
    let f = (xyz / WHITE)
        .to_array()
        .map(|t| if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 });
    Rgb::new(116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2]))
}

/// Hunt's effect: colours lose chroma in the dark.
fn hunt(lab: Rgb) -> Rgb {
    let scale = 0.01 * lab.x;
    Rgb::new(lab.x, scale * lab.y, scale * lab.z)
}

fn hyab(a: Rgb, b: Rgb) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// The compressed difference between pure green and pure blue.
fn largest_difference() -> f32 {
    let [green, blue] = [Rgb::Y, Rgb::Z].map(|c| hunt(lab(xyz(c))));
    hyab(green, blue).powf(QC)
}

/// Maps [0, PC largest] to [0, PT] and the rest to [PT, 1].
fn compress(difference: f32, largest: f32) -> f32 {
    let knee = PC * largest;
    if difference < knee { PT / knee * difference } else { PT + (difference - knee) / (largest - knee) * (1.0 - PT) }
}

#[cfg(test)]
#[path = "flip_tests.rs"]
mod tests;
