//! The price of variance: lambda = S / C, from what samples have counted.
//!
//! S: variance of one camera sample, by the choice of virtual lights and by roulette; C: its cost in shadow rays, all of them: eye, light, what a
//! pass prepares (shared by its pixels), lights looked at and groups asked at fixed prices. Sums are whole numbers, so that the order in which
//! threads add them does not matter. Lambda changes before passes 1, 2, 4, 8, ... only (DESIGN.md, rule 1).

use crate::transport::strategies::{LOOK, Tally};
use std::sync::atomic::{AtomicU64, Ordering};

/// What it costs to ask the bound of a group of lights, in shadow rays.
const NODE: f64 = 0.03;
/// Units of variance per square of the mean radiance.
const FINE: f64 = (1u64 << 24) as f64;
/// Largest variance of one sample that is noted, in squares of the mean radiance: outliers decide nothing.
const MOST: f64 = 1e5;

/// Sums since the last reading.
#[derive(Debug, Default)]
pub struct Meter {
    samples: AtomicU64,
    variance: AtomicU64,
    /// In hundredths of shadow rays.
    cost: AtomicU64,
    /// Radiance that variances are measured by.
    unit: f64,
}

impl Meter {
    /// A meter for pictures of about this mean radiance.
    pub fn new(unit: f64) -> Self {
        Meter { unit: if unit > 0.0 { unit } else { 1.0 }, ..Meter::default() }
    }

    /// Adds a camera sample: its tally, and its rays beside those of virtual lights.
    pub fn add(&self, tally: &Tally, other_rays: u64) {
        let variance = ((tally.roulette + tally.set) / (self.unit * self.unit)).min(MOST);
        let c = tally.counts();
        let cost = (other_rays + c.shadow_rays) as f64 + c.looks as f64 * f64::from(LOOK) + c.nodes as f64 * NODE;
        self.samples.fetch_add(1, Ordering::Relaxed);
        self.variance.fetch_add((variance * FINE) as u64, Ordering::Relaxed);
        self.cost.fetch_add((cost * 100.0) as u64, Ordering::Relaxed);
    }

    /// Lambda, and the sums begin anew; `shared`: cost per sample of what the pass prepares. `None` if nothing was added or nothing varies.
    pub fn read(&mut self, shared: f64) -> Option<f32> {
        let take = |v: &mut AtomicU64| std::mem::take(v.get_mut()) as f64;
        let (n, variance, cost) = (take(&mut self.samples), take(&mut self.variance), take(&mut self.cost));
        if n == 0.0 || variance == 0.0 {
            return None;
        }
        let per_sample = cost / 100.0 / n + shared;
        Some((variance / FINE / n * self.unit * self.unit / per_sample.max(1.0)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lambda_is_variance_over_cost_and_scales_with_the_square_of_radiance() {
        for unit in [1e-6, 1.0, 1e6] {
            let mut meter = Meter::new(unit);
            assert_eq!(meter.read(0.0), None);
            for _ in 0..100 {
                let mut tally = Tally::default();
                (tally.roulette, tally.set) = (2.0 * unit * unit, unit * unit);
                meter.add(&tally, 10);
            }
            let lambda = f64::from(meter.read(5.0).unwrap());
            assert!((lambda / (unit * unit) - 0.2).abs() < 1e-4, "{unit}: {lambda}");
            assert_eq!(meter.read(0.0), None, "sums begin anew");
        }
    }
}
