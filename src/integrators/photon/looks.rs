//! Looks at a few pixels of the picture by which settings are found out (`pilot.rs`, `caustic_count.rs`, `renewed_cache.rs`).
//!
//! Errors are relative, as [`crate::image::metric`] counts them, and those of a pixel bounded: outliers must not decide.
//! Verified by `tests`

use super::eye::Eye;
use crate::integrators::Counts;
use crate::math::{Sampler, Vec2, luminance};
use crate::scene::camera::CameraRay;
use rayon::prelude::*;

/// Share of the mean luminance to which errors are relative in darker places.
const DARK: f64 = 0.1;
/// Most that one look counts: outliers must not decide.
pub(super) const OUTLIER: f64 = 1.0;
/// Pixels that are looked at with two maps.
const PIXELS: u64 = 512;
/// First of the streams of random numbers.
const STREAM: u64 = 0x00ca_0571;

/// A pixel of `window` (x, y, width, height).
pub(super) fn any_pixel(window: [u32; 4], rng: &mut Sampler) -> Vec2 {
    let [x, y, width, height] = window.map(|v| v as f32);
    (Vec2::new(x, y) + rng.next_2d() * Vec2::new(width, height)).floor()
}

/// A camera ray of a pixel.
pub(super) fn ray(eye: &Eye, pixel: Vec2, rng: &mut Sampler) -> CameraRay {
    let (at, lens) = (rng.next_2d(), rng.next_2d());
    eye.world.scene.camera.ray(pixel + at, lens)
}

/// Square of a difference, relative to `of` in a picture of luminance `mean`.
pub(super) fn relative_square(difference: f64, of: f64, mean: f64) -> f64 {
    let square = of * of + (DARK * mean) * (DARK * mean);
    if square > 0.0 { difference * difference / square } else { 0.0 }
}

/// What two maps of photons, or two caches, and the samples of a few pixels tell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Mean squared relative difference between samples of the same random numbers with one and with the other.
    pub difference: f64,
    /// Relative variance of a camera sample.
    pub sample: f64,
    /// Rays of a camera sample, shadow rays among them.
    pub rays: f64,
}

/// Samples of one pixel.
struct Look {
    /// Luminance by the first map, by the second with the same random numbers, by the second with others.
    values: [f64; 3],
    /// Whether the first two had the irradiance cache answer as often, so that they took the same way.
    alike: bool,
    rays: f64,
}

/// What a sample of a pixel brings (luminance), and what it counts.
fn sample(eye: &Eye, pixel: Vec2, rng: &mut Sampler) -> (f64, Counts) {
    let mut counts = Counts::default();
    let ray = ray(eye, pixel, rng);
    (f64::from(luminance(eye.sample(&ray, rng, &mut counts).0)), counts)
}

/// Rays that samples took, shadow rays among them.
fn rays(counts: &Counts) -> f64 {
    (counts.rays + counts.direct.shadow_rays) as f64
}

/// Rays of a camera sample in `window`, shadow rays among them.
pub(super) fn rays_per_sample(eye: &Eye, window: [u32; 4], seed: u64) -> f64 {
    let look = |k: u64| {
        let pixel = any_pixel(window, &mut Sampler::new(seed, STREAM, k));
        rays(&sample(eye, pixel, &mut Sampler::new(seed, STREAM + 3, k)).1)
    };
    let counted: Vec<f64> = (0..PIXELS).into_par_iter().map(look).collect();
    counted.iter().sum::<f64>() / PIXELS as f64
}

impl Found {
    /// Looks at pixels of `window` (x, y, width, height) with the maps of one pass and of another.
    pub fn new([first, second]: [&Eye; 2], window: [u32; 4], seed: u64) -> Self {
        let look = |k: u64| {
            let pixel = any_pixel(window, &mut Sampler::new(seed, STREAM, k));
            let sample = |eye, stream| sample(eye, pixel, &mut Sampler::new(seed, STREAM + stream, k));
            let [(a, counts_a), (b, counts_b), (c, counts_c)] =
                [sample(first, 1), sample(second, 1), sample(second, 2)];
            Look {
                values: [a, b, c],
                alike: counts_a.cache_misses == counts_b.cache_misses,
                rays: 0.5 * (rays(&counts_b) + rays(&counts_c)),
            }
        };
        let looks: Vec<Look> = (0..PIXELS).into_par_iter().map(look).collect();
        found(&looks)
    }
}

/// What samples of pixels tell. Where one of two caches has a gap, the noise of samples is all that is to be seen.
fn found(looks: &[Look]) -> Found {
    // Samples that are no numbers are the film's concern.
    let looks: Vec<&Look> = looks.iter().filter(|l| l.values.iter().all(|v| v.is_finite())).collect();
    let count = looks.len().max(1) as f64;
    let mean = looks.iter().map(|l| 0.5 * (l.values[1] + l.values[2])).sum::<f64>() / count;
    let relative = |d: f64, l: &Look| relative_square(d, 0.5 * (l.values[1] + l.values[2]), mean).min(OUTLIER);
    let difference = |l: &&Look| if l.alike { relative(l.values[0] - l.values[1], l) } else { 0.0 };
    Found {
        difference: looks.iter().map(difference).sum::<f64>() / count,
        sample: looks.iter().map(|l| 0.5 * relative(l.values[1] - l.values[2], l)).sum::<f64>() / count,
        rays: looks.iter().map(|l| l.rays).sum::<f64>() / count,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(values: [f64; 3]) -> Look {
        Look { values, alike: true, rays: 3.0 }
    }

    #[test]
    fn noise_of_maps_is_told_from_that_of_samples() {
        let mut looks = Vec::new();
        for k in 0..4000 {
            let [a, b, c, d] = Sampler::new(3, 0, k).next_4d().map(|u| f64::from(u) - 0.5);
            // Uniform numbers of variance 1/12 on a mean of 1: 0.1 of them by each map, 0.3 by samples.
            looks.push(look([1.0 + 0.1 * a + 0.3 * c, 1.0 + 0.1 * b + 0.3 * c, 1.0 + 0.1 * b + 0.3 * d]));
        }
        let seen = found(&looks);
        assert!((seen.difference / (2.0 * 0.01 / 12.0) - 1.0).abs() < 0.06, "{seen:?}");
        assert!((seen.sample / (0.09 / 12.0) - 1.0).abs() < 0.06, "{seen:?}");
        looks.extend([[f64::NAN, 1.0, 1.0], [1e9, 1.0, 1.0]].map(look));
        let with = found(&looks);
        assert!(with.difference - seen.difference < 2.0 * OUTLIER / 4000.0 && with.difference > seen.difference);
        assert_eq!(found(&[]), Found::default());
        // Gaps of one cache say nothing of the difference, and something of samples.
        let all = looks.len();
        looks.extend((0..all).map(|k| Look {
            values: [1.0, 1.0 + 0.3 * (k % 3) as f64, 1.0],
            alike: false,
            rays: 9.0,
        }));
        let gaps = found(&looks);
        assert!((gaps.difference / with.difference - 0.5).abs() < 0.01, "{gaps:?}");
        assert!(gaps.sample > 2.0 * with.sample && (gaps.rays - 6.0).abs() < 0.01, "{gaps:?}");
    }
}
