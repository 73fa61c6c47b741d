//! The price of variance: lambda = S / C, from what samples have counted.
//!
//! ```text
//! S = V + R,  C = F + K        V: variance of one camera sample for other reasons (choice of virtual lights, direct light, edges in the pixel)
//!                              R: by selection and roulette          F: cost that is always there, K: that of looks and rays at virtual lights
//! lambda' = lambda (V K) / (R F)
//! ```
//!
//! As lambda grows R does with its root and K falls with it, R K staying the same where nothing is clamped; (V + R) (F + K) is least where V K = R F,
//! and there lambda = S / C. The plain iteration lambda' = S / C has the same fixed point but hardly moves towards it while R and K are the larger parts;
//! this one is there in one step. A step is at most [`STEP`], for where probabilities are clamped.
//! Costs are in shadow rays: of the eye, of direct light, of what a pass prepares (shared by its pixels), looks and bounds at fixed prices. Sums are whole
//! numbers, so that the order in which threads add them does not matter. Lambda changes before passes 1, 2, 4, 8, ... only (DESIGN.md, rule 1).
//! Source: METHODS 1.B (global optimum). Verified by tests in this file.

use crate::transport::strategies::{LOOK, Tally};
use std::sync::atomic::{AtomicU64, Ordering};

/// What it costs to ask the bound of a group of lights, in shadow rays.
const NODE: f64 = 0.1;
/// What a camera sample costs beside its rays.
const SAMPLE: f64 = 4.0;
/// Units of variance per square of the mean radiance.
const FINE: f64 = (1u64 << 24) as f64;
/// Largest variance of one sample that is noted, in squares of the mean radiance: outliers decide nothing.
const MOST: f64 = 1e4;
/// Share of the noisiest pixels that say nothing about the price: what other paths than those to virtual lights do to a few bright pixels would
/// make it up for all the rest (error x time in cornell-spheres 0.048 with a hundredth left out).
const FIREFLIES: f64 = 0.1;
/// Largest factor of one step.
const STEP: f64 = 8.0;

/// Variance of a sample of a pixel, mean over the picture.
#[derive(Clone, Copy, Debug)]
pub enum Seen {
    /// It is not known.
    Nothing,
    /// Among samples with the same virtual lights.
    OnePass(f64),
    /// Among samples with virtual lights of their own.
    Passes(f64),
}

impl Seen {
    /// The mean of variances of many pixels, without the noisiest of them: fireflies.
    pub fn mean(mut all: Vec<f64>) -> Option<f64> {
        all.sort_by(f64::total_cmp);
        all.truncate((all.len() as f64 * (1.0 - FIREFLIES)).ceil() as usize);
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    }
}

/// Sums since the last reading.
#[derive(Debug, Default)]
pub struct Meter {
    samples: AtomicU64,
    roulette: AtomicU64,
    set: AtomicU64,
    /// In hundredths of shadow rays.
    lights: AtomicU64,
    other: AtomicU64,
    /// Radiance that variances are measured by.
    unit: f64,
}

impl Meter {
    /// A meter for pictures of about this mean radiance.
    pub fn new(unit: f64) -> Self {
        Meter { unit: if unit > 0.0 { unit } else { 1.0 }, ..Meter::default() }
    }

    /// Adds a camera sample: its tally, and its rays beside those to virtual lights.
    pub fn add(&self, tally: &Tally, other_rays: u64) {
        let fine = |v: f64| ((v / (self.unit * self.unit)).min(MOST) * FINE) as u64;
        let c = tally.counts();
        let lights = c.shadow_rays as f64 + c.looks as f64 * f64::from(LOOK) + c.nodes as f64 * NODE;
        self.samples.fetch_add(1, Ordering::Relaxed);
        self.roulette.fetch_add(fine(tally.roulette), Ordering::Relaxed);
        self.set.fetch_add(fine(tally.set), Ordering::Relaxed);
        self.lights.fetch_add((lights * 100.0) as u64, Ordering::Relaxed);
        self.other.fetch_add((other_rays as f64 + SAMPLE) as u64 * 100, Ordering::Relaxed);
    }

    /// The factor by which lambda should change, and the sums begin anew. `shared`: cost per sample of what the pass prepares; `seen`: what is known
    /// of the variance of a sample, all reasons together. `None` if nothing was added.
    pub fn read(&mut self, shared: f64, seen: Seen) -> Option<f64> {
        let take = |v: &mut AtomicU64| std::mem::take(v.get_mut()) as f64;
        let n = take(&mut self.samples);
        let [r, set, k, f] = [&mut self.roulette, &mut self.set, &mut self.lights, &mut self.other].map(take);
        if n == 0.0 || k == 0.0 || set == 0.0 {
            return None;
        }
        let [r, set] = [r, set].map(|v| v / FINE / n);
        let [k, f] = [k, f].map(|c| c / 100.0 / n);
        let beside = |v: f64| (v / (self.unit * self.unit) - r).max(0.0);
        let other = match seen {
            Seen::Nothing => set,
            Seen::OnePass(v) => set + beside(v),
            Seen::Passes(v) => set.max(beside(v)),
        };
        let factor = other * k / (r * (f + shared));
        // Without variance by chance the price can rise.
        Some(if factor.is_nan() { 1.0 } else { factor.clamp(1.0 / STEP, STEP) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A meter that has seen a sum over lights in which R = a sqrt(lambda) and K = a / sqrt(lambda): dR = -lambda dK, as of a price.
    fn metered(lambda: f64, unit: f64) -> Meter {
        let meter = Meter::new(unit);
        let (a, v) = (0.7, 0.02);
        let mut tally = Tally::default();
        (tally.roulette, tally.set) = (a * lambda.sqrt() * unit * unit, v * unit * unit);
        tally.looked((a / lambda.sqrt() / f64::from(LOOK)) as u64);
        (0..100).for_each(|_| meter.add(&tally, 6));
        meter
    }

    #[test]
    fn lambda_goes_to_variance_over_cost() {
        for unit in [1e-4, 1.0, 1e4] {
            for start in [1e-7, 1e-3, 0.1] {
                let mut lambda = start;
                for _ in 0..8 {
                    lambda *= metered(lambda, unit).read(5.0, Seen::Nothing).unwrap();
                }
                let (s, c) = (0.02 + 0.7 * lambda.sqrt(), 6.0 + SAMPLE + 5.0 + 0.7 / lambda.sqrt());
                assert!((lambda / (s / c) - 1.0).abs() < 0.05, "{unit} {start}: {lambda}, S / C is {}", s / c);
            }
        }
    }

    #[test]
    fn a_few_fireflies_are_not_the_mean() {
        let mut all = vec![1.0; 1000];
        (0..10).for_each(|i| all[97 * i] = 1e9);
        assert_eq!((Seen::mean(all), Seen::mean(Vec::new())), (Some(1.0), None));
    }

    #[test]
    fn noise_of_other_kinds_raises_the_price_and_sums_begin_anew() {
        let mut meter = metered(1e-3, 1.0);
        let quiet = meter.read(5.0, Seen::Nothing).unwrap();
        assert_eq!(meter.read(5.0, Seen::Nothing), None);
        // Roulette has 0.022 of it, the choice of lights 0.02.
        for seen in [Seen::OnePass(0.12), Seen::Passes(0.12)] {
            let noisy = metered(1e-3, 1.0).read(5.0, seen).unwrap();
            assert!(noisy > 1.5 * quiet, "{seen:?}: {noisy} {quiet}");
        }
    }
}
