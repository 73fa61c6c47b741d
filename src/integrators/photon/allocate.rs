//! Where the samples of later passes go: to the pixels that are still noisy.
//!
//! A pass of n_i samples in pixel i leaves the error sum_i e_i / n_i, e_i = sigma_i^2 / (I_i^2 + 0.01) the squared relative deviation of one
//! sample; for a given sum of the n_i it is least where n_i is in proportion to sqrt(e_i) (Neyman 1934). sigma^2 and I are those of
//! the film, averaged over neighbours ([`RADIUS`]), so that a pixel's own luck does not decide about it. Where the picture is filtered in the
//! end, sigma_i^2 / n_i is the variance that the filter leaves (cf. Rousselle, Knaus & Zwicker 2012, who add its bias): smooth surfaces want few
//! samples, their borders many. Pixels in which the detector finds an edge are averaged apart from those where it finds none.
//!
//! Bias: pixels whose first samples were alike by chance get fewer of the later ones, and rare bright samples get diluted where they
//! fell. Averaging over neighbours makes that small, and every pixel keeps [`LEAST`] samples per pass; still, where noise has long
//! tails the mean comes out low: 1.6 % have been seen in a furnace lit by a lamp all around that is sampled by area.
//! Verified by tests in this file and tests/photon.rs (mean against uniform samples).

use crate::image::box_means;
use crate::image::denoise::denoise;
use crate::image::film::{Film, PixelSums};
use crate::math::sampler::{hash, unit_f32};

/// Samples per pass and pixel, on average.
const MEAN: f64 = 1.5;
/// Least and most samples per pass in a pixel; fewer than one by chance.
const LEAST: f64 = 0.35;
const MOST: f64 = 16.0;
/// Neighbours that are averaged, in pixels to each side.
const RADIUS: usize = 3;

/// Samples per pass for every pixel of the film, row-major. `crossed`: whether an edge is predicted in a pixel; `filtered`: the picture will be. A
/// pixel of one sample says nothing yet: it gets another.
pub fn samples_per_pass(film: &Film, crossed: &[bool], filtered: bool) -> Vec<f32> {
    let luminance = |c: [f64; 3]| (c[0] + c[1] + c[2]) / 3.0;
    let left = filtered.then(|| denoise(film).variance);
    // Of one sample; pixels with a single one know nothing of their own.
    let variance = |(i, p): (usize, &PixelSums)| match (p.count(), &left) {
        (0 | 1, _) => (0.0, 0.0),
        (n, Some(left)) => (left[i] * f64::from(n), 1.0),
        (n, None) => (luminance(p.variance()) * f64::from(n), 1.0),
    };
    let (variance, known): (Vec<f64>, Vec<f64>) = film.pixels().iter().enumerate().map(variance).unzip();
    let brightness: Vec<f64> = film.pixels().iter().map(|p| luminance(p.mean())).collect();
    let mut wanted = vec![0.0; brightness.len()];
    // Those with edges and those without each know their own kind.
    for kind in [false, true] {
        let is_one = |i: usize| crossed.get(i).copied().unwrap_or(false) == kind;
        let sums = |v: &dyn Fn(usize) -> f64| {
            let of_kind: Vec<f64> = (0..wanted.len()).map(|i| if is_one(i) { v(i) } else { 0.0 }).collect();
            box_means(&of_kind, film.width as usize, RADIUS)
        };
        let [all, known, variance, brightness] =
            [sums(&|_| 1.0), sums(&|i| known[i]), sums(&|i| variance[i]), sums(&|i| brightness[i])];
        for i in (0..wanted.len()).filter(|&i| is_one(i) && known[i] > 0.0) {
            let (v, brightness) = (variance[i] / known[i], brightness[i] / all[i]);
            wanted[i] = (v / (brightness.powi(2) + 0.01)).max(0.0).sqrt();
        }
    }
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
    use crate::math::{Rgb, Vec3};

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
        let n = samples_per_pass(&film(0.5), &[], false);
        let mean = n.iter().sum::<f32>() / n.len() as f32;
        assert!((mean - MEAN as f32).abs() < 0.01, "{mean}");
        assert_eq!(n[20 * 5], LEAST as f32);
        assert!(n[20 * 5 + 16] > 2.0, "{}", n[20 * 5 + 16]);
    }

    #[test]
    fn a_picture_without_noise_is_left_nearly_alone() {
        let n = samples_per_pass(&film(0.0), &[], false);
        assert!(n.iter().all(|&n| n == LEAST as f32));
    }

    #[test]
    fn predicted_edges_are_a_kind_of_their_own() {
        // The left half is noisy in every fifth column, where edges are said to be.
        let mut film = film(0.0);
        let crossed: Vec<bool> = (0..200).map(|i| i % 20 < 10 && i % 5 == 2).collect();
        for k in 0..8u64 {
            for i in (0..200).filter(|&i| crossed[i as usize]) {
                let radiance = Rgb::splat(unit_f32(hash(k, u64::from(i))));
                film.add(i % 20, i / 20, &FilmSample { radiance, weight: 1.0, features: Features::default() });
            }
        }
        for filtered in [false, true] {
            let n = samples_per_pass(&film, &crossed, filtered);
            let least = |of: bool| {
                let kind = n.iter().zip(&crossed).filter(|(_, c)| **c == of).map(|(n, _)| *n);
                kind.fold(f32::INFINITY, f32::min)
            };
            assert!(least(true) > 4.0, "{filtered} {}", least(true));
            assert_eq!(least(false), LEAST as f32);
            let blurred = samples_per_pass(&film, &[], filtered);
            assert!(blurred[20 * 5 + 3] > 2.0 * LEAST as f32, "{filtered}: neighbours of columns share their noise");
        }
    }

    #[test]
    fn filtered_pictures_want_samples_where_the_filter_does_not_reach() {
        // Noise on a smooth surface, and as much in lone pixels whose normals are like no other.
        let mut film = Film::new([0, 0, 24, 24], false);
        let is_lone = |x: u32, y: u32| x % 8 == 3 && y % 8 == 3;
        for (x, y, k) in (0..24 * 24 * 4).map(|i| (i % 24, i / 24 % 24, i / 576)) {
            let radiance = Rgb::splat(0.3 + 0.4 * unit_f32(hash(u64::from(k), u64::from(y * 24 + x))));
            let mut features = Features::default();
            features.guide.see(Rgb::ONE, Rgb::splat(0.5), if is_lone(x, y) { Vec3::X } else { Vec3::Z }, 1.0);
            film.add(x, y, &FilmSample { radiance, weight: 1.0, features });
        }
        let crossed: Vec<bool> = (0..24 * 24).map(|i| is_lone(i % 24, i / 24)).collect();
        let share = |filtered| {
            let n = samples_per_pass(&film, &crossed, filtered);
            n[11 * 24 + 11] / n[12 * 24 + 14]
        };
        assert!(share(true) > 3.0 * share(false), "{} {}", share(true), share(false));
    }

    #[test]
    fn rounding_keeps_the_mean() {
        let sum: u32 = (0..10_000).map(|i| rounded(2.3, i, 7, 1)).sum();
        // Deviation sqrt(0.21 x 10^4) = 46.
        assert!((f64::from(sum) - 23_000.0).abs() < 4.0 * 46.0, "{sum}");
        assert_eq!(rounded(1.0, 3, 0, 0), 1);
    }
}
