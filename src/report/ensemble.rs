//! Error, bias and variance of a configuration, from independent runs of it.
//!
//! With X_s the pictures of n runs (seeds s), A and B two independent halves of a reference (or A = B = R where there is
//! only one), w = 1 / (3 (R^2 + 0.01)) and <.> the sum over channels, averaged over the pixels that count:
//!
//! error      E   = mean over s of      <w (X_s - A)(X_s - B)>: the relMSE that one run has on average
//! bias^2     b^2 = mean over s != t of <w (X_s - A)(X_t - B)>: what stays however many runs are averaged
//! variance   V   = E - b^2: equal to <w s^2>, s^2 the unbiased variance between runs of each pixel
//!
//! All three are unbiased; b^2 is the squared error of the mean of all runs less its own variance V / n, and may come out
//! negative where there is no bias. With one reference picture its noise is part of E and b^2; with two halves of neither, but
//! for what it does to w: a reference much noisier than sqrt(R^2 + 0.01) weighs its dark outliers too much.
//! Standard error of b^2: jackknife over the runs (Efron & Stein 1981), from three runs on.
//! Bias of the mean: mean(X_s) / mean(R) - 1 with Student's interval over the runs, and the bound of two one-sided tests:
//! with 95 % confidence the absolute bias is below it. The reference's own error is not in these intervals.
//! Verified by the tests below: synthetic pictures of known bias and variance, and a companion that must fail.

use crate::image::metrics::{RELATIVE_EPSILON, Reference};
use crate::math::Rgb;
use crate::math::stats::student_t_half_width;
use rayon::prelude::*;
use serde::Serialize;

/// Confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// Error of one run on average, and its parts. `None` where there are too few runs to tell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Split {
    /// relMSE of each run, untrimmed.
    pub runs: Vec<f64>,
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation.
    pub sd: Option<f64>,
    /// Squared bias, in the unit of relMSE.
    pub bias_sq: Option<f64>,
    /// Standard error of the squared bias.
    pub bias_sq_error: Option<f64>,
    /// Variance, in the unit of relMSE.
    pub variance: Option<f64>,
}

/// A mean over runs with its interval, per cent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The mean, per cent.
    pub percent: f64,
    /// Half width of the 95 % interval, percentage points.
    pub half_width: Option<f64>,
    /// With 95 % confidence the absolute value is below this (two one-sided tests), per cent.
    pub bound: Option<f64>,
}

impl Split {
    /// The split of `pictures`, each prepared by [`Reference::prepare`].
    pub fn new(pictures: &[Vec<Rgb>], reference: &Reference) -> Split {
        let n = pictures.len();
        let pairs: Vec<(usize, usize)> = (0..n).flat_map(|s| (s..n).map(move |t| (s, t))).collect();
        // Each product is summed in pixel order by one thread: the same bits for any number of them.
        let products: Vec<f64> =
            pairs.par_iter().map(|&(s, t)| product(&pictures[s], &pictures[t], reference)).collect();
        let mut gram = vec![0.0; n * n];
        for (&(s, t), &k) in pairs.iter().zip(&products) {
            (gram[s * n + t], gram[t * n + s]) = (k, k);
        }
        let runs: Vec<f64> = (0..n).map(|s| gram[s * n + s]).collect();
        let mean = mean(&runs);
        let bias_sq = off_diagonal(&gram, n, None);
        Split {
            mean,
            sd: standard_deviation(&runs),
            bias_sq,
            bias_sq_error: jackknife(n, |left_out| off_diagonal(&gram, n, Some(left_out))),
            variance: bias_sq.map(|b| mean - b),
            runs,
        }
    }
}

/// Sum over channels of w (X - A)(Y - B), made symmetric in X and Y, averaged over the pixels that count.
fn product(x: &[Rgb], y: &[Rgb], reference: &Reference) -> f64 {
    let (mut sum, mut counted) = (0.0, 0usize);
    for i in (0..x.len()).filter(|&i| reference.counted[i]) {
        let r = reference.mean[i];
        let (a, b) = reference.halves.as_ref().map_or((r, r), |[a, b]| (a[i], b[i]));
        for c in 0..3 {
            let [x, y, a, b, r] = [x[i], y[i], a, b, r].map(|v| f64::from(v[c]));
            sum += 0.5 * ((x - a) * (y - b) + (y - a) * (x - b)) / (r * r + RELATIVE_EPSILON);
        }
        counted += 1;
    }
    sum / (3 * counted.max(1)) as f64
}

/// Mean of the entries off the diagonal, without one row and column; `None` without any entry.
fn off_diagonal(gram: &[f64], n: usize, left_out: Option<usize>) -> Option<f64> {
    let kept = || (0..n).filter(|&i| Some(i) != left_out);
    let values: Vec<f64> = kept().flat_map(|s| kept().filter(move |&t| t != s).map(move |t| gram[s * n + t])).collect();
    (!values.is_empty()).then(|| mean(&values))
}

/// Standard error of an estimate from its values without each run in turn.
fn jackknife(n: usize, without: impl Fn(usize) -> Option<f64>) -> Option<f64> {
    let values: Vec<f64> = (0..n).map(without).collect::<Option<_>>()?;
    let centre = mean(&values);
    let squares: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
    Some((squares * (n - 1) as f64 / n as f64).sqrt())
}

/// Bias of the image mean, all channels together, of each run against the reference: a fraction.
pub fn mean_biases(pictures: &[Vec<Rgb>], reference: &Reference) -> Vec<f64> {
    let truth = image_mean(&reference.mean, reference);
    pictures.iter().map(|p| if truth == 0.0 { 0.0 } else { image_mean(p, reference) / truth - 1.0 }).collect()
}

/// Mean over counted pixels and channels.
pub fn image_mean(pixels: &[Rgb], reference: &Reference) -> f64 {
    let counted = (0..pixels.len()).filter(|&i| reference.counted[i]);
    let (sum, n) = counted.fold((0.0, 0usize), |(sum, n), i| {
        let p = pixels[i];
        (sum + f64::from(p.x) + f64::from(p.y) + f64::from(p.z), n + 3)
    });
    sum / n.max(1) as f64
}

impl Interval {
    /// Mean of independent values (fractions) with Student's interval.
    pub fn of_mean(values: &[f64]) -> Interval {
        let n = values.len();
        let error = standard_deviation(values).map(|sd| sd / (n as f64).sqrt());
        Interval::new(mean(values), error, n.saturating_sub(1) as u32)
    }

    /// Difference of two means of independent values, the first less the second, in units of `scale`, after Welch.
    pub fn of_difference(a: &[f64], b: &[f64], scale: f64) -> Interval {
        let part = |v: &[f64]| standard_deviation(v).map(|sd| sd * sd / v.len() as f64);
        let difference = (mean(a) - mean(b)) / scale;
        let (Some(va), Some(vb)) = (part(a), part(b)) else {
            return Interval::new(difference, None, 0);
        };
        // Welch & Satterthwaite's degrees of freedom, rounded down: a little too wide rather than too narrow.
        let weight = va * va / (a.len() - 1) as f64 + vb * vb / (b.len() - 1) as f64;
        let dof = if weight > 0.0 { ((va + vb).powi(2) / weight).min(1e6) as u32 } else { 1 };
        Interval::new(difference, Some((va + vb).sqrt() / scale.abs()), dof)
    }

    fn new(value: f64, error: Option<f64>, dof: u32) -> Interval {
        // A one-sided test at level a uses the two-sided quantile at 2 a.
        let width = |confidence: f64| error.map(|e| 100.0 * e * student_t_half_width(confidence, dof));
        Interval {
            percent: 100.0 * value,
            half_width: width(CONFIDENCE),
            bound: width(2.0 * CONFIDENCE - 1.0).map(|w| 100.0 * value.abs() + w),
        }
    }
}

/// Mean; 0 of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Standard deviation of the population that the values come from; `None` of fewer than two.
pub fn standard_deviation(values: &[f64]) -> Option<f64> {
    let centre = mean(values);
    let squares: f64 = values.iter().map(|v| (v - centre).powi(2)).sum();
    (values.len() > 1).then(|| (squares / (values.len() - 1) as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Picture;
    use crate::math::Sampler;

    const SIDE: usize = 48;

    /// A standard normal number (Box & Muller).
    fn normal(seed: u64, i: usize) -> f32 {
        let u = Sampler::new(seed, i as u64, 0).next_4d();
        (-2.0 * (1.0 - u[0]).ln()).sqrt() * (std::f32::consts::TAU * u[1]).cos()
    }

    fn truth(i: usize) -> f32 {
        0.2 + 0.6 * (i % SIDE) as f32 / SIDE as f32
    }

    /// Pictures whose pixels are (1 + bias) R + noise sqrt(R^2 + 0.01) g, so that relMSE's parts are known in closed form.
    fn pictures(n: usize, bias: f32, noise: f32) -> Vec<Vec<Rgb>> {
        let pixel = |s: usize, i: usize| {
            let r = truth(i);
            let size = (r * r + RELATIVE_EPSILON as f32).sqrt();
            Rgb::splat(r + size * (bias + noise * normal(s as u64, i)))
        };
        (0..n).map(|s| (0..SIDE * SIDE).map(|i| pixel(s, i)).collect()).collect()
    }

    /// The truth, or two halves of it with noise of their own.
    fn reference(noise: Option<f32>) -> Reference {
        let half = |seed: u64| {
            let value = |i: usize| truth(i) + noise.unwrap_or(0.0) * normal(seed, i);
            Picture::new(SIDE, SIDE, (0..SIDE * SIDE).map(|i| Rgb::splat(value(i))).collect())
        };
        let b = noise.map(|_| half(1001));
        Reference::new(&half(1000), b.as_ref()).unwrap()
    }

    #[test]
    fn bias_and_variance_of_known_pictures_come_apart() {
        // 8 runs of 2304 pixels: V = 0.04 to 1 % (sd sqrt(2 / 18432)), b^2 to about V sqrt(2 / (56 * 2304)) = 1.6e-4.
        let split = Split::new(&pictures(8, 0.1, 0.2), &reference(None));
        let (bias_sq, variance) = (split.bias_sq.unwrap(), split.variance.unwrap());
        assert!((bias_sq - 0.01).abs() < 1.5e-3, "{bias_sq}");
        assert!((variance - 0.04).abs() < 2e-3, "{variance}");
        assert!((split.mean - bias_sq - variance).abs() < 1e-12);
        assert!((split.mean - 0.05).abs() < 3e-3 && split.runs.len() == 8);
        let error = split.bias_sq_error.unwrap();
        assert!((1e-5..2e-3).contains(&error), "{error}");

        // The companion: without bias the same noise must not be taken for one ...
        let none = Split::new(&pictures(8, 0.0, 0.2), &reference(None));
        assert!(none.bias_sq.unwrap().abs() < 4.0 * none.bias_sq_error.unwrap().max(1.6e-4), "{none:?}");
        // ... and the naive estimate, the error of the mean picture, would be V / n = 0.005 and fail that.
        assert!(0.04 / 8.0 > 4.0 * none.bias_sq_error.unwrap().max(1.6e-4));
    }

    #[test]
    fn noise_of_two_halves_does_not_count_and_of_one_picture_does() {
        let runs = pictures(6, 0.0, 0.1);
        let halves = Split::new(&runs, &reference(Some(0.05)));
        assert!((halves.mean - 0.01).abs() < 0.0025, "{halves:?}");
        assert!(halves.bias_sq.unwrap().abs() < 0.0025, "{halves:?}");
        let mut one = reference(Some(0.05));
        one.halves = None;
        // The mean of 0.0025 / 2 / (R^2 + 0.01) over R from 0.2 to 0.8 is 0.007.
        let one = Split::new(&runs, &one).bias_sq.unwrap();
        assert!((0.006..0.011).contains(&one), "{one}");
    }

    #[test]
    fn too_few_runs_say_so_and_masked_pixels_do_not_count() {
        let one = Split::new(&pictures(1, 0.1, 0.2), &reference(None));
        assert!(one.sd.is_none() && one.bias_sq.is_none() && one.variance.is_none() && one.bias_sq_error.is_none());
        let mut masked = reference(None);
        masked.counted = (0..SIDE * SIDE).map(|i| i % 2 == 0).collect();
        let mut runs = pictures(3, 0.1, 0.0);
        runs.iter_mut().for_each(|p| p.iter_mut().skip(1).step_by(2).for_each(|v| *v = Rgb::splat(1e6)));
        let split = Split::new(&runs, &masked);
        assert!((split.bias_sq.unwrap() - 0.01).abs() < 1e-6 && split.variance.unwrap().abs() < 1e-12);
    }

    #[test]
    fn intervals_hold_the_truth_as_often_as_they_say() {
        // 400 experiments of 5 values with mean 0.02: the 95 % interval holds it in 380 +- 4.4 of them.
        let experiment =
            |e: u64, mean: f64| -> Vec<f64> { (0..5).map(|i| mean + 0.01 * f64::from(normal(7000 + e, i))).collect() };
        let inside = |i: &Interval, truth: f64| (i.percent - 100.0 * truth).abs() <= i.half_width.unwrap();
        let held = (0..400).filter(|&e| inside(&Interval::of_mean(&experiment(e, 0.02)), 0.02)).count();
        assert!((366..=393).contains(&held), "{held}");
        let held = (0..400)
            .filter(|&e| inside(&Interval::of_difference(&experiment(e, 0.02), &experiment(e + 400, 0.0), 2.0), 0.01))
            .count();
        assert!((366..=396).contains(&held), "{held}");
        // A wrong truth is thrown out far more often than that.
        let wrong = (0..400).filter(|&e| inside(&Interval::of_mean(&experiment(e, 0.02)), 0.0)).count();
        assert!(wrong < 200, "{wrong}");
        let i = Interval::of_mean(&[0.01, 0.02, 0.03]);
        assert!((i.percent - 2.0).abs() < 1e-12 && i.bound.unwrap() > i.percent);
        // t = 4.3027, error = 1 / sqrt(3) points.
        assert!((i.half_width.unwrap() - 4.302_652_73 / 3f64.sqrt()).abs() < 1e-6);
        assert!(Interval::of_mean(&[0.1]).half_width.is_none());
    }
}
