//! A few camera samples that find out how lights are best sampled in this picture.
//!
//! A camera sample with n samples of each light that is partly visible has the variance V_r + V_l / n and the cost c_r + n c_l: V_l is the noise of
//! one light sample alone, V_r that of all else (edges, textures, glossy reflections, interpolation). Where pixels get as many camera samples as
//! they want, N ~ sqrt(V / C) of each, the product of the picture's error and its cost is the square of
//!
//! ```text
//! S(n) = sum over pixels of sqrt((V_r + V_l / n) (c_r + n c_l))
//! ```
//!
//! and n is best where that is least. V_l shows in two samples of one camera ray, V_l / n + V_r in two of one pixel. Errors are relative, as
//! [`crate::image::metric`] counts them, and those of a pair bounded: outliers must not decide.
//!
//! Verdicts on visibility cost as much as [`VERDICT`] shadow rays and save up to n.
//! Source      the allocation of samples among strata (Neyman 1934), here with a cost of each; the estimate from pairs is ours
//! Bias        none: other random numbers than the picture's
//! Not handled paths that part behind the first surface (glossy lobes): their noise counts as that of lights
//! Verified by `tests`

use super::eye::Eye;
use super::looks::{OUTLIER, any_pixel, ray, relative_square};
use crate::integrators::Counts;
use crate::math::{Sampler, luminance};
use crate::scene::camera::CameraRay;
use rayon::prelude::*;

/// Pixels that are looked at.
const PIXELS: u64 = 256;
/// First of the streams of random numbers.
const STREAM: u64 = 0x9107;
/// Most light samples of a camera sample, on average.
const MOST_LIGHT_SAMPLES: f64 = 10.0;
/// Least samples of one light.
const LEAST: u32 = 2;
/// What a verdict costs, in shadow rays.
const VERDICT: f64 = 4.0;
/// Share of verdicts from which on most lights need no samples.
const MOSTLY: f64 = 0.5;
/// What a camera sample costs besides its rays, in shadow rays.
const SHADING: f64 = 2.0;

/// Three samples of a pixel: the first two along one camera ray, the last along another.
#[derive(Clone, Copy, Debug, Default)]
struct Look {
    /// Luminance of the first and the last.
    all: [f64; 2],
    /// That of light straight from lamps of the first two.
    direct: [f64; 2],
    /// Light samples and rays (of all three).
    light_samples: f64,
    rays: f64,
}

/// A pixel: relative variances and costs of a camera sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Pixel {
    /// V_l and V_r.
    by_light: f64,
    by_others: f64,
    /// c_l and c_r, in rays.
    light: f64,
    others: f64,
}

/// What was found out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pilot {
    /// Samples of a light where there were several.
    samples: u32,
    pixels: Vec<Pixel>,
    /// Light samples per camera sample.
    light_samples: f64,
    /// Verdicts per camera sample, and those of them that told what is visible.
    verdicts: f64,
    told: f64,
}

impl Pilot {
    /// Looks at pixels of `window` (x, y, width, height). `samples`: of a light where there are several.
    pub fn new(eye: &Eye, window: [u32; 4], samples: u32, seed: u64) -> Self {
        let look = |k: u64| {
            let mut rngs = [0, 1, 2].map(|stream| Sampler::new(seed, STREAM + stream, k));
            let pixel = any_pixel(window, &mut rngs[2]);
            let (first, second) = (ray(eye, pixel, &mut rngs[0]), ray(eye, pixel, &mut rngs[1]));
            let mut counts = Counts::default();
            let mut sample = |ray: &CameraRay, rng: &mut Sampler| {
                let (radiance, features) = eye.sample(ray, rng, &mut counts);
                (f64::from(luminance(radiance)), f64::from(luminance(features.makeup.direct)))
            };
            let (a, direct) = sample(&first, &mut rngs[0]);
            let (_, other) = sample(&first, &mut rngs[2]);
            let (b, _) = sample(&second, &mut rngs[1]);
            let (light_samples, rays) = (counts.direct.light_samples as f64, counts.rays as f64);
            (Look { all: [a, b], direct: [direct, other], light_samples, rays }, counts)
        };
        let found: Vec<(Look, Counts)> = (0..PIXELS).into_par_iter().map(look).collect();
        let mut counts = Counts::default();
        found.iter().for_each(|(_, own)| counts += *own);
        let looks: Vec<Look> = found.into_iter().map(|(look, _)| look).collect();
        let n = 3.0 * PIXELS as f64;
        let d = counts.direct;
        Pilot {
            samples,
            pixels: pixels(&looks, samples),
            light_samples: d.light_samples as f64 / n,
            verdicts: (d.visible + d.blocked + d.partial + d.unknown) as f64 / n,
            told: (d.visible + d.blocked) as f64 / n,
        }
    }

    /// The best number of samples of a light where there are several, at most as many as were taken here. Where most verdicts are of use, these are few
    /// points: too few in this sample to weigh them up.
    pub fn light_samples(&self) -> u32 {
        let share = MOST_LIGHT_SAMPLES / self.light_samples.max(MOST_LIGHT_SAMPLES);
        let most = ((f64::from(self.samples) * share).round() as u32).max(LEAST).min(self.samples);
        if self.verdicts > 0.0 && self.told >= MOSTLY * self.verdicts {
            return most;
        }
        let best = (LEAST.min(most)..=most).min_by(|&a, &b| self.badness(a).total_cmp(&self.badness(b)));
        best.unwrap_or(most)
    }

    /// S(n).
    fn badness(&self, n: u32) -> f64 {
        let n = f64::from(n);
        let one = |p: &Pixel| ((p.by_others + p.by_light / n) * (p.others + n * p.light)).sqrt();
        self.pixels.iter().map(one).sum()
    }

    /// Whether verdicts are worth their price where a light gets so many samples.
    pub fn verdicts_pay(&self, samples: u32) -> bool {
        self.told * f64::from(samples) >= VERDICT * self.verdicts
    }
}

/// What three samples of each pixel tell, with `samples` of a light.
fn pixels(looks: &[Look], samples: u32) -> Vec<Pixel> {
    // Samples that are no numbers are the film's concern.
    let looks: Vec<&Look> = looks.iter().filter(|l| l.all.iter().chain(&l.direct).all(|v| v.is_finite())).collect();
    let mean = looks.iter().map(|l| l.all[0] + l.all[1]).sum::<f64>() / (2.0 * looks.len().max(1) as f64);
    let relative = |[a, b]: [f64; 2], of: f64| (0.5 * relative_square(a - b, of, mean)).min(OUTLIER);
    let one = |look: &&Look| {
        let of = 0.5 * (look.all[0] + look.all[1]);
        let by_lights = relative(look.direct, of);
        Pixel {
            by_light: by_lights * f64::from(samples),
            by_others: (relative(look.all, of) - by_lights).max(0.0),
            light: look.light_samples / 3.0 / f64::from(samples),
            others: look.rays / 3.0 + SHADING,
        }
    };
    looks.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 100 pixels of a kind.
    fn pilot(by_light: f64, by_others: f64) -> Pilot {
        let pixel = Pixel { by_light, by_others, light: 0.5, others: 4.0 };
        Pilot { samples: 16, pixels: vec![pixel; 100], light_samples: 8.0, verdicts: 0.0, told: 0.0 }
    }

    #[test]
    fn the_number_of_samples_is_that_of_the_closed_form_where_pixels_are_alike() {
        for (by_light, by_others) in [(1.0, 0.1), (0.2, 0.3), (4.0, 0.1), (1e-3, 1.0)] {
            let best = f64::sqrt(by_light * 4.0 / (by_others * 0.5)).clamp(2.0, 16.0);
            let found = pilot(by_light, by_others).light_samples();
            assert!((f64::from(found) - best).abs() <= 1.0, "{by_light} {by_others}: {found}, {best}");
        }
        assert_eq!(pilot(0.1, 0.0).light_samples(), 16);
        assert_eq!(Pilot { samples: 1, ..pilot(0.0, 0.1) }.light_samples(), 1);
        assert_eq!(Pilot { light_samples: 40.0, ..pilot(0.1, 0.0) }.light_samples(), 4);
    }

    /// Noisy edges elsewhere get camera samples of their own.
    #[test]
    fn pixels_without_noise_of_lights_do_not_lower_their_number() {
        let mut p = pilot(0.1, 0.0);
        p.pixels.extend([Pixel { by_light: 0.0, by_others: 1.0, light: 0.0, others: 4.0 }; 100]);
        assert_eq!(p.light_samples(), 16);
    }

    #[test]
    fn where_verdicts_are_of_use_the_number_stays() {
        let with = |told| Pilot { verdicts: 1.0, told, ..pilot(1e-3, 1.0) };
        assert_eq!((with(0.6).light_samples(), with(0.4).light_samples()), (16, 2));
        assert!(with(0.3).verdicts_pay(16) && !with(0.2).verdicts_pay(16) && !with(0.4).verdicts_pay(2));
    }

    #[test]
    fn light_alone_is_told_from_all_else() {
        let mut looks = Vec::new();
        for k in 0..4000u64 {
            let mut rng = Sampler::new(5, 0, k);
            let [a, b, c, d] = rng.next_4d().map(f64::from);
            // Uniform numbers of variance 1/12: 0.1 of them by lights, 0.3 by all else, on a mean of 1.
            let (l, m) = (0.1 * (a - 0.5), 0.1 * (b - 0.5));
            let all = [1.0 + l + 0.3 * (c - 0.5), 1.0 + m + 0.3 * (d - 0.5)];
            looks.push(Look { all, direct: [0.5 + l, 0.5 + m], light_samples: 48.0, rays: 6.0 });
        }
        let found = pixels(&looks, 16);
        let mean = |of: fn(&Pixel) -> f64| found.iter().map(of).sum::<f64>() / found.len() as f64;
        assert!((mean(|p| p.by_light) / (16.0 * 0.01 / 12.0) - 1.0).abs() < 0.06);
        // Differences that come out negative count as none.
        assert!((1.0..1.12).contains(&(mean(|p| p.by_others) / (0.09 / 12.0))), "{}", mean(|p| p.by_others));
        assert_eq!((found[0].light, found[0].others), (1.0, 4.0));
        looks.push(Look { all: [f64::NAN, 1.0], ..Look::default() });
        looks.push(Look { all: [1e6, 1.0], direct: [1.0, 0.0], ..Look::default() });
        let found = pixels(&looks, 16);
        assert!(found.len() == 4001 && found.iter().all(|p| p.by_others <= OUTLIER));
        assert!(found[0].by_light > 0.0);
        assert!(pixels(&[], 16).is_empty());
    }
}
