//! Where the samples of later passes go: to the pixels that are still noisy.
//!
//! A pass of n_i samples in pixel i leaves the error sum_i e_i / n_i, e_i = sigma_i^2 / (I_i^2 + 0.01) the squared relative deviation of one
//! sample; for a given sum of the n_i it is least where n_i is in proportion to sqrt(e_i) (Neyman 1934). sigma^2 and I are those of
//! the film, averaged over neighbours ([`RADIUS`]), so that a pixel's own luck does not decide about it.
//!
//! Bias: pixels whose first samples were alike by chance get fewer of the later ones, and rare bright samples get diluted where they
//! fell. Averaging over neighbours makes that small, and every pixel keeps [`LEAST`] samples per pass; still, where noise has long
//! tails the mean comes out low: 1.6 % have been seen in a furnace lit by a lamp all around that is sampled by area.
//! Verified by tests in this file and tests/photon.rs (mean against uniform samples).

use crate::image::film::Film;
use crate::math::sampler::{hash, unit_f32};

/// Samples per pass and pixel, on average.
const MEAN: f64 = 1.5;
/// Least and most samples per pass in a pixel; fewer than one by chance.
const LEAST: f64 = 0.35;
const MOST: f64 = 16.0;
/// Neighbours that are averaged, in pixels to each side.
const RADIUS: usize = 3;

/// Samples per pass for every pixel of the film, row-major. A pixel of one sample says nothing yet: it gets another.
pub fn samples_per_pass(film: &Film) -> Vec<f32> {
    let (width, height) = (film.width as usize, film.height as usize);
    let luminance = |c: [f64; 3]| (c[0] + c[1] + c[2]) / 3.0;
    let mean: Vec<f64> = film.pixels().iter().map(|p| luminance(p.mean())).collect();
    // Of one sample; pixels with a single one know nothing of their own.
    let (variance, known): (Vec<f64>, Vec<f64>) = film
        .pixels()
        .iter()
        .map(|p| match p.count() {
            0 | 1 => (0.0, 0.0),
            n => (luminance(p.variance()) * f64::from(n), 1.0),
        })
        .unzip();
    let [mean, variance, known] = [mean, variance, known].map(|v| box_sums(&v, width, height));
    let area = box_sums(&vec![1.0; width * height], width, height);
    let wanted: Vec<f64> = (0..width * height)
        .map(|i| {
            let m = mean[i] / area[i];
            let v = variance[i] / known[i].max(1.0);
            (v / (m * m + 0.01)).max(0.0).sqrt()
        })
        .collect();
    let scale = scale(&wanted);
    let one_sample = |i: usize| film.pixels()[i].count() < 2;
    let share = |(i, w): (usize, &f64)| (w * scale).clamp(if one_sample(i) { 1.0 } else { LEAST }, MOST) as f32;
    wanted.iter().enumerate().map(share).collect()
}

/// The factor that makes the clamped numbers have the mean [`MEAN`].
fn scale(wanted: &[f64]) -> f64 {
    let mean = |k: f64| wanted.iter().map(|w| (w * k).clamp(LEAST, MOST)).sum::<f64>() / wanted.len().max(1) as f64;
    let (mut low, mut high) = (0.0, 1e9);
    for _ in 0..80 {
        let middle = if low > 0.0 { f64::sqrt(low * high) } else { high * 1e-12 };
        if mean(middle) < MEAN { low = middle } else { high = middle }
    }
    high
}

/// Sums over squares of 2 [`RADIUS`] + 1 pixels, cut off at the border.
fn box_sums(v: &[f64], width: usize, height: usize) -> Vec<f64> {
    let along = |v: &[f64], n: usize, stride: usize, at: usize, start: usize| -> f64 {
        let first = at.saturating_sub(RADIUS);
        (first..(at + RADIUS + 1).min(n)).map(|k| v[start + k * stride]).sum()
    };
    let rows: Vec<f64> = (0..width * height).map(|i| along(v, width, 1, i % width, i - i % width)).collect();
    (0..width * height).map(|i| along(&rows, height, width, i / width, i % width)).collect()
}

/// `samples` as a whole number, rounded up or down by chance, the same chance for the same pixel and pass.
pub fn rounded(samples: f32, pixel: u64, pass: u64, seed: u64) -> u32 {
    let u = unit_f32(hash(hash(seed, pixel), pass));
    let whole = samples.floor();
    whole as u32 + u32::from(u < samples - whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::film::{Features, FilmSample};
    use crate::math::Rgb;

    /// A film whose left half is constant and whose right half is noisy.
    fn film(noise: f32) -> Film {
        let mut film = Film::new([0, 0, 20, 10], false);
        for k in 0..8u64 {
            for y in 0..10 {
                for x in 0..20 {
                    let u = unit_f32(hash(k, u64::from(y * 20 + x))) - 0.5;
                    let v = if x < 10 { 0.5 } else { 0.5 + noise * u };
                    let sample = FilmSample { radiance: Rgb::splat(v), weight: 1.0, features: Features::default() };
                    film.add(x, y, &sample);
                }
            }
        }
        film
    }

    #[test]
    fn noise_attracts_samples_and_the_mean_is_kept() {
        let n = samples_per_pass(&film(0.5));
        let mean = n.iter().sum::<f32>() / n.len() as f32;
        assert!((mean - MEAN as f32).abs() < 0.01, "{mean}");
        assert_eq!(n[20 * 5], LEAST as f32);
        assert!(n[20 * 5 + 16] > 2.0, "{}", n[20 * 5 + 16]);
    }

    #[test]
    fn a_picture_without_noise_is_left_nearly_alone() {
        let n = samples_per_pass(&film(0.0));
        assert!(n.iter().all(|&n| n == LEAST as f32));
    }

    #[test]
    fn rounding_keeps_the_mean() {
        let sum: u32 = (0..10_000).map(|i| rounded(2.3, i, 7, 1)).sum();
        // Deviation sqrt(0.21 x 10^4) = 46.
        assert!((f64::from(sum) - 23_000.0).abs() < 4.0 * 46.0, "{sum}");
        assert_eq!(rounded(1.0, 3, 0, 0), 1);
    }
}
