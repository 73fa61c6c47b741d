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
/// Largest factor of one step.
const STEP: f64 = 8.0;

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

    /// The factor by which lambda should change, and the sums begin anew. `shared`: cost per sample of what the pass prepares; `picture`: variance
    /// of a sample as the picture shows it, all reasons together, if known. `None` if nothing was added.
    pub fn read(&mut self, shared: f64, picture: Option<f64>) -> Option<f64> {
        let take = |v: &mut AtomicU64| std::mem::take(v.get_mut()) as f64;
        let n = take(&mut self.samples);
        let [r, set, k, f] = [&mut self.roulette, &mut self.set, &mut self.lights, &mut self.other].map(take);
        if n == 0.0 || k == 0.0 || set == 0.0 {
            return None;
        }
        let [r, set] = [r, set].map(|v| v / FINE / n);
        let [k, f] = [k, f].map(|c| c / 100.0 / n);
        let seen = picture.map_or(0.0, |v| v / (self.unit * self.unit) - r);
        let factor = set.max(seen) * k / (r * (f + shared));
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
                    lambda *= metered(lambda, unit).read(5.0, None).unwrap();
                }
                let (s, c) = (0.02 + 0.7 * lambda.sqrt(), 6.0 + SAMPLE + 5.0 + 0.7 / lambda.sqrt());
                assert!((lambda / (s / c) - 1.0).abs() < 0.05, "{unit} {start}: {lambda}, S / C is {}", s / c);
            }
        }
    }

    #[test]
    fn noise_of_other_kinds_raises_the_price_and_sums_begin_anew() {
        let mut meter = metered(1e-3, 1.0);
        let quiet = meter.read(5.0, None).unwrap();
        assert_eq!(meter.read(5.0, None), None);
        let noisy = metered(1e-3, 1.0).read(5.0, Some(0.12)).unwrap();
        assert!(noisy > 1.5 * quiet, "{noisy} {quiet}");
    }
}
