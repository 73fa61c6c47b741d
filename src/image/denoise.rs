//! The filter of the noise that is left: pixels average those neighbours from which they differ by noise alone.
//!
//! Estimate    every pixel c moves towards the best F of non-local means of three bandwidths ([`super::nl_means`]), as far as that is of use by
//!             Stein's unbiased estimate of the squared error of c + a (F - c),
//!
//! ```text
//! SURE(a) = v - 2 a T + a^2 M,    T = v (1 - dF/dc),    M = (F - c)^2,    least at a = T / M, v - T^2 / M
//! ```
//!
//! dF/dc = share of the pixel itself, and how the weights change with it; a is a little longer (`FARTHER`), at most 1. T and M are relative to the
//! picture's brightness and averaged over squares of pixels (3 to each side), and so are the steps: where noise and structure are alike the
//! one fades into the other, without patches
//! Variance    of a sample: the film's, or the median over the neighbours if that is greater: few samples may be alike by luck. Of their mean: that
//!             over their number, times what stratification leaves of it, which halves of them tell, averaged over squares of pixels. Where
//!             pixels have one sample, neighbours tell (`second_differences.rs`)
//! Source      Li, Wu, Chuang 2012, "SURE-based Optimization for Adaptive Sampling and Reconstruction"; Stein 1981
//! Bias        none where there is no noise; elsewhere as long as it is estimated to be less than the noise it takes away, and it vanishes with
//!             that. Bright samples of long-tailed noise lose light, since their weights and values are of one piece: up to 0.05 % of the mean in
//!             rooms, 1 to 2 % where fireflies rule
//! Not handled noise that neighbours share (irradiance records, kernels of photons); what second differences (`second_differences.rs`) take for
//!             noise where pixels have one sample
//! Verified by `tests`

use super::film::{Film, PixelSums};
use super::guide::Guide;
use super::nl_means::{CANDIDATES, Candidate, DARK, Planes, mean};
use super::{box_means, second_differences};
use crate::math::{Rgb, luminance};
use rayon::prelude::*;

/// Pixels to each side over which estimates of the error are averaged.
const AVERAGED: usize = 3;

/// Least share that stratification may leave of a variance.
const LEAST: f64 = 1e-3;
/// Samples up to which pixels believe their neighbours in full.
const FEW: f32 = 4.0;
/// How much farther pixels go than T / M, at most to F: averages over few pixels scatter about what they should be, and of long-tailed noise v is
/// mostly too small. Errors over those with 1: penumbra and many-lights after 2 passes 0.95 and 0.96, living-room 0.98, rooms of diffuse walls 1.00.
const FARTHER: f64 = 1.3;
/// Pixels of one task, at least.
const CHUNK: usize = 1024;

/// A filtered picture.
#[derive(Clone, Debug)]
pub struct Denoised {
    /// Radiance, row-major.
    pub picture: Vec<Rgb>,
    /// Variance that is left of a pixel, mean over the channels: without what the filter blurs.
    pub variance: Vec<f64>,
}

/// Filters the picture. Where there is no noise it comes out as it is.
pub fn denoise(film: &Film) -> Denoised {
    let noisy = film.picture(1);
    let (width, height) = (film.width as usize, film.height as usize);
    let guides: Vec<_> = film.pixels().iter().map(PixelSums::guide).collect();
    let mut variance = variances(film.pixels(), width, height);
    of_single_samples(film.pixels(), &noisy, &guides, width, &mut variance);
    if variance.iter().all(|v| *v == Rgb::ZERO) || noisy.iter().any(|c| !c.is_finite()) {
        return Denoised { variance: variance.iter().map(|v| f64::from(mean(*v))).collect(), picture: noisy };
    }
    let level = noisy.iter().map(|c| luminance(*c)).sum::<f32>() / noisy.len() as f32;
    let candidates = Planes::new(width, &noisy, &variance, &guides, level).candidates();
    let dark = DARK * level;
    // By the widest average, which has the least noise.
    let square = |i: usize| {
        let level = luminance(candidates[i][0].color);
        f64::from(level * level + dark * dark).max(f64::MIN_POSITIVE)
    };
    let squares: Vec<f64> = (0..noisy.len()).into_par_iter().with_min_len(CHUNK).map(square).collect();
    let averaged = |of: &(dyn Fn(usize) -> f32 + Sync)| {
        let one = |(i, square): (usize, &f64)| f64::from(of(i)) / square;
        let errors: Vec<f64> = squares.par_iter().enumerate().with_min_len(CHUNK).map(one).collect();
        box_means(&errors, width, AVERAGED)
    };
    let mut best: Vec<Step> = vec![Step::default(); noisy.len()];
    for k in 0..CANDIDATES {
        let taken = averaged(&|i| taken(variance[i], &candidates[i][k]));
        let moved = averaged(&|i| moved(noisy[i], &candidates[i][k]));
        for (best, (taken, moved)) in best.iter_mut().zip(taken.into_iter().zip(moved)) {
            let step = Step::new(k, taken, moved);
            if step.gain > best.gain {
                *best = step;
            }
        }
    }
    let mut picture = noisy.clone();
    // Shares of the way, and of the pixels themselves in the averages there.
    let mut ways = vec![[0.0f32; 2]; noisy.len()];
    for k in 0..CANDIDATES {
        let shares: Vec<f64> = best.iter().map(|s| if s.candidate == k { s.length } else { 0.0 }).collect();
        let shares = box_means(&shares, width, AVERAGED);
        for (i, share) in shares.into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
            let (share, to) = (share as f32, &candidates[i][k]);
            picture[i] += (to.color - noisy[i]) * share;
            ways[i][0] += share;
            ways[i][1] += share * to.own;
        }
    }
    let left = ways.iter().zip(&variance).map(|([way, own], v)| {
        // ((1 - a) c + a F) has the variance v ((1 - a)^2 + (2 a (1 - a) + a^2) own): c and F have the pixel's own share in common.
        let stays = (1.0 - way) * (1.0 - way) + (2.0 - way) * own;
        f64::from(stays * mean(*v))
    });
    let left = left.collect();
    Denoised { picture, variance: left }
}

/// How far a pixel moves towards a candidate.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    candidate: usize,
    /// a of the way.
    length: f64,
    /// By how much that lowers Stein's estimate of the error.
    gain: f64,
}

impl Step {
    /// To `candidate`, from averages of v (1 - dF/dc) and of (F - c)^2.
    fn new(candidate: usize, taken: f64, moved: f64) -> Self {
        let length = if taken > 0.0 { (FARTHER * taken / moved.max(f64::MIN_POSITIVE)).min(1.0) } else { 0.0 };
        Step { candidate, length, gain: length * (2.0 * taken - length * moved) }
    }
}

/// Covariance of the noise and of what a candidate takes away, mean over the channels.
fn taken(v: Rgb, candidate: &Candidate) -> f32 {
    mean(v) * (1.0 - candidate.derivative)
}

/// Square of what a candidate takes away.
fn moved(c: Rgb, candidate: &Candidate) -> f32 {
    let moved = candidate.color - c;
    mean(moved * moved)
}

/// Variance of the mean of each pixel.
fn variances(pixels: &[PixelSums], width: usize, height: usize) -> Vec<Rgb> {
    let known: Vec<Option<Rgb>> = pixels.iter().map(of_one_sample).collect();
    let of = |i: usize| {
        let (x, y) = (i % width, i / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let near = rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x));
        let near: arrayvec::ArrayVec<Rgb, 9> = near.map(|j| known[j].unwrap_or(Rgb::ZERO)).collect();
        let (own, n) = (known[i].unwrap_or(Rgb::ZERO), pixels[i].count().max(1) as f32);
        own.max(median(&near) * (FEW / n).min(1.0)) / n
    };
    let left = stratified(pixels, width);
    (0..pixels.len()).into_par_iter().with_min_len(CHUNK).map(|i| of(i) * left[i]).collect()
}

/// Puts in the variance of pixels that have one sample, by what their neighbours tell.
fn of_single_samples(pixels: &[PixelSums], colors: &[Rgb], guides: &[Guide], width: usize, variance: &mut [Rgb]) {
    if pixels.iter().all(|p| p.count() != 1) {
        return;
    }
    let of_luminance = second_differences::variances(colors, guides, width);
    for i in (0..pixels.len()).filter(|&i| pixels[i].count() == 1) {
        // Coloured surfaces have coloured noise.
        let albedo = guides[i].albedo.max(Rgb::splat(1e-3));
        let tint = (albedo / luminance(albedo)).min(Rgb::splat(3.0));
        variance[i] = tint * tint * of_luminance[i];
    }
}

/// What stratification leaves of the variance of each pixel's mean: a share.
fn stratified(pixels: &[PixelSums], width: usize) -> Vec<f32> {
    let relative = |v: [f64; 3], p: &PixelSums| {
        let [v, mean] = [v, p.mean()].map(|c| c.iter().sum::<f64>());
        if v > 0.0 { v / (v + mean * mean) } else { 0.0 }
    };
    let (parts, whole): (Vec<f64>, Vec<f64>) = pixels
        .iter()
        .map(|p| p.variance_of_halves().map_or((0.0, 0.0), |halves| (relative(halves, p), relative(p.variance(), p))))
        .unzip();
    let [parts, whole] = [parts, whole].map(|v| box_means(&v, width, AVERAGED));
    let share =
        |(parts, whole): (&f64, &f64)| if *whole > 0.0 { (parts / whole).clamp(LEAST, 1.0) as f32 } else { 1.0 };
    parts.iter().zip(&whole).map(share).collect()
}

/// Variance of one sample of a pixel, if it had several.
fn of_one_sample(pixel: &PixelSums) -> Option<Rgb> {
    let variance = || Rgb::from_array(pixel.variance().map(|v| (v * f64::from(pixel.count())) as f32));
    Some(pixel).filter(|p| p.count() > 1).map(|_| variance()).filter(|v| v.is_finite())
}

/// Median by channel, the lower one of two; 0 of nothing.
fn median(values: &[Rgb]) -> Rgb {
    let one = |c: usize| {
        let mut channel: arrayvec::ArrayVec<f32, 9> = values.iter().map(|v| v[c]).collect();
        channel.sort_unstable_by(f32::total_cmp);
        channel.get(channel.len().saturating_sub(1) / 2).copied().unwrap_or(0.0)
    };
    Rgb::new(one(0), one(1), one(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::film::{Features, FilmSample};
    use crate::math::sampler::{hash, unit_f32};
    use crate::math::{Sampler, Vec3};

    const SIDE: u32 = 48;

    /// A film of `n` samples a pixel: `truth` and uniform noise of the standard deviation `sigma`, the normal of `side`.
    fn film(n: u64, sigma: f32, truth: impl Fn(u32, u32) -> f32, side: impl Fn(u32) -> Vec3) -> Film {
        film_of(n, sigma, truth, side, |pixel, k| unit_f32(hash(pixel, k)))
    }

    /// The same with the random numbers `number` (of pixel and sample).
    fn film_of(
        n: u64,
        sigma: f32,
        truth: impl Fn(u32, u32) -> f32,
        side: impl Fn(u32) -> Vec3,
        number: impl Fn(u64, u64) -> f32,
    ) -> Film {
        let mut film = Film::new([0, 0, SIDE, SIDE], false);
        for (y, x) in (0..SIDE * SIDE).map(|i| (i / SIDE, i % SIDE)) {
            for k in 0..n {
                let u = number(u64::from(y * SIDE + x), k) - 0.5;
                let radiance = Rgb::splat(truth(x, y) + sigma * u * f32::sqrt(12.0));
                let mut features = Features::default();
                features.guide.see(Rgb::ONE, Rgb::splat(0.5), side(x), 3.0);
                film.add(x, y, &FilmSample { radiance, weight: 1.0, features });
            }
        }
        film
    }

    /// Mean squared error of the noisy and of the filtered picture, and the variance that the filter says it leaves.
    fn errors(film: &Film, truth: impl Fn(u32, u32) -> f32) -> [f64; 3] {
        let done = denoise(film);
        let error = |picture: &[Rgb]| {
            let one = |(i, c): (usize, &Rgb)| f64::from(c.x - truth(i as u32 % SIDE, i as u32 / SIDE)).powi(2);
            picture.iter().enumerate().map(one).sum::<f64>() / picture.len() as f64
        };
        let own = done.variance.iter().sum::<f64>() / done.variance.len() as f64;
        [error(&film.picture(1)), error(&done.picture), own]
    }

    #[test]
    fn noise_on_smooth_surfaces_goes_and_the_mean_stays() {
        let ramp = |x: u32, y: u32| 0.5 + 0.004 * x as f32 + 0.002 * y as f32;
        let film = film(4, 0.2, ramp, |_| Vec3::Z);
        let [noisy, filtered, own] = errors(&film, ramp);
        assert!((noisy / 0.01 - 1.0).abs() < 0.1, "{noisy}");
        assert!(filtered < 0.1 * noisy, "{filtered} of {noisy}");
        assert!((0.3..3.0).contains(&(own / filtered)), "{own} for {filtered}");
        let mean = |picture: &[Rgb]| picture.iter().map(|c| f64::from(c.x)).sum::<f64>() / picture.len() as f64;
        let (before, after) = (mean(&film.picture(1)), mean(&denoise(&film).picture));
        assert!((after / before - 1.0).abs() < 2e-3, "{before} {after}");
    }

    #[test]
    fn stratified_samples_are_not_taken_for_noisy_ones() {
        // Contrasts far below the standard deviation of independent samples, and above that of stratified ones.
        let checks = |x: u32, y: u32| if (x / 2 + y / 2).is_multiple_of(2) { 0.48 } else { 0.52 };
        for n in [16, 17, 31, 32] {
            let stratified = |pixel, k| Sampler::new(5, pixel, k).next_2d().x;
            let film = film_of(n, 0.3, checks, |_| Vec3::Z, stratified);
            let [noisy, filtered, _] = errors(&film, checks);
            assert!(noisy < 0.1 * 0.09 / n as f64, "{n}: the test has no power: {noisy}");
            // Blurred, checks have 4e-4; halves make four times of what they make together, at worst.
            assert!(filtered < 2.5 * noisy, "{n}: {filtered} of {noisy}");
        }
    }

    #[test]
    fn steins_estimate_is_the_error() {
        let ramp = |x: u32, y: u32| 0.5 + 0.01 * x as f32 + 0.005 * y as f32;
        let film = film(4, 0.2, ramp, |_| Vec3::Z);
        let noisy = film.picture(1);
        let variance = vec![Rgb::splat(0.01); noisy.len()];
        let guides: Vec<_> = film.pixels().iter().map(PixelSums::guide).collect();
        let candidates = Planes::new(SIDE as usize, &noisy, &variance, &guides, 0.5).candidates();
        for k in 0..CANDIDATES {
            let (mut error, mut estimate) = (0.0, 0.0);
            for (i, c) in candidates.iter().enumerate() {
                error += (c[k].color.x - ramp(i as u32 % SIDE, i as u32 / SIDE)).powi(2);
                estimate += mean(variance[i]) - 2.0 * taken(variance[i], &c[k]) + moved(noisy[i], &c[k]);
            }
            let n = noisy.len() as f32;
            // Both in units of the variance; the mean of (F - c)^2 - v alone is noisy by sqrt(2 / n).
            let (error, estimate) = (error / n / 0.01, estimate / n / 0.01);
            assert!((error - estimate).abs() < 0.06 + 0.15 * error, "{k}: {estimate} for {error}");
        }
    }

    #[test]
    fn steps_are_as_long_as_noise_is_of_what_they_take_away() {
        // Noise alone; noise and three times as much structure; less moved than noise explains; nothing to be won.
        for (taken, moved, length) in [(0.9, 0.9, 1.0), (0.5, 2.0, 0.25 * FARTHER), (0.9, 0.5, 1.0), (-0.1, 1.0, 0.0)] {
            let step = Step::new(0, taken, moved);
            let estimate = |a: f64| 1.0 - 2.0 * a * taken + a * a * moved;
            assert!((step.length - length).abs() < 1e-12 && (1.0 - step.gain - estimate(length)).abs() < 1e-12);
            // Better than none of the step and than all of it.
            assert!(estimate(length) <= estimate(0.0) && estimate(length) <= estimate(1.0) + 1e-12, "{taken} {moved}");
        }
    }

    #[test]
    fn single_samples_are_filtered_by_what_neighbours_tell() {
        let edge = |x: u32, y: u32| if 2 * x + y < 70 { 0.5 } else { 0.1 };
        for n in [1, 2] {
            let [noisy, filtered, _] = errors(&film(n, 0.05, edge, |_| Vec3::Z), edge);
            assert!(filtered < 0.3 * noisy, "{n}: {filtered} of {noisy}");
        }
        let clean = film(1, 0.0, edge, |_| Vec3::Z);
        let [_, filtered, _] = errors(&clean, edge);
        // But for steps along the edge, 0.16 the square of its height.
        assert!(filtered < 0.16 * 0.01, "{filtered}");
    }

    #[test]
    fn guides_keep_apart_what_noise_hides() {
        // Stripes a standard deviation apart, on surfaces that face different ways.
        let is_odd = |x: u32| x / 4 % 2 == 1;
        let stripes = |x: u32, _: u32| if is_odd(x) { 0.5 } else { 0.6 };
        let ways = |x: u32| if is_odd(x) { Vec3::Z } else { Vec3::X };
        let [noisy, apart, _] = errors(&film(4, 0.2, stripes, ways), stripes);
        let [_, blurred, _] = errors(&film(4, 0.2, stripes, |_| Vec3::Z), stripes);
        assert!(apart < 0.15 * noisy && blurred > 1.3 * apart, "{noisy} {apart} {blurred}");
    }

    #[test]
    fn structure_without_guides_is_kept_as_noise_vanishes() {
        let checks = |x: u32, y: u32| if (x / 2 + y / 2).is_multiple_of(2) { 0.4 } else { 0.6 };
        let [noisy, filtered, _] = errors(&film(4, 0.02, checks, |_| Vec3::Z), checks);
        // Equal checks are averaged, others are not.
        assert!(filtered < noisy, "{filtered} of {noisy}");
        // Noise above the contrast: hardly worse than leaving it alone, as the estimate of the error decides.
        let [noisy, filtered, _] = errors(&film(4, 0.3, checks, |_| Vec3::Z), checks);
        assert!(filtered < 1.02 * noisy, "{filtered} of {noisy}");
    }

    #[test]
    fn pictures_without_noise_are_left_alone() {
        let ramp = |x: u32, _: u32| 0.1 * x as f32;
        let clean = film(3, 0.0, ramp, |_| Vec3::Z);
        assert_eq!(denoise(&clean).picture, clean.picture(1));
        let empty = Film::new([0, 0, 3, 2], false);
        assert_eq!(denoise(&empty).picture, vec![Rgb::ZERO; 6]);
    }
}
