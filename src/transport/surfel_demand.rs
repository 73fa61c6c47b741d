//! Light samples where the picture wants them: more for surfels on which much of it rests and whose direct light is uncertain.
//!
//! ```text
//!   V_r   = sum over surfels s of (w_rs / E_r)^2 var_s / m_s      relative variance of record r by light samples; w_rs: what a unit of
//!                                                                 irradiance of s brings to it; var_s: of one of the m_s samples
//!   J     = h + T^T J,  h_s = sum over r of w_rs / E_r            importance of surfels: the adjoint of `surfel_light.rs`
//!   dm_s ~ J_s sqrt(var_s),  sum dm = (mean sqrt(V) / TARGET)^2 - 1 times sum m           (Neyman), no more than MOST times
//! ```
//!
//! Behind a gap or a door that is ajar light hangs on few surfels, and their light on those near a window.
//! Source      Pattanaik & Mudur 1993, "The Potential Equation" (importance as the adjoint); Neyman 1934 (shares)
//! Bias        hardly any: var_s is the mean over the other surfels of the neighbourhood, so that the samples of s do not decide about their number
//!             but by their part of E_r, which is small where many surfels light a record; surfels that get as many further samples as they had forget
//!             those. It goes to 0 with the noise
//! Verified by tests/surfels.rs (the mean is that without further samples, the variance falls)

use super::World;
use super::gather_ray::RayCounts;
use super::surfel_direct::{MANY_PLACES, direct, places_of};
use super::surfel_light::SurfelLight;
use crate::math::sampler::hash;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Aim for the relative standard deviation of a record by light samples.
const TARGET: f32 = 0.05;
/// Most further samples over those of all surfels, and of one surfel over its own.
const MOST: (f32, f32) = (1.5, 256.0);
/// Sweeps of importance: light goes on, and tells less and less.
const SWEEPS: u32 = 6;
/// Surfels that one task works on.
const CHUNK: usize = 16;
/// Stream of random numbers.
const FURTHER: u64 = 0x5d8;

/// What records want of surfels.
#[derive(Clone, Debug, Default)]
pub struct Demand {
    /// w / E by surfel, of one record after the other.
    shares: Vec<(u32, f32)>,
    /// End of each record's in `shares`.
    ends: Vec<usize>,
}

impl Demand {
    /// Adds a record: its surfels, in any order, each with what a unit of its irradiance brings over the record's.
    pub fn add(&mut self, mut shares: Vec<(u32, f32)>) {
        shares.sort_unstable_by_key(|(s, _)| *s);
        self.shares.extend(
            shares.chunk_by(|a, b| a.0 == b.0).map(|same| (same[0].0, same.iter().map(|(_, w)| w).sum::<f32>())),
        );
        self.ends.push(self.shares.len());
    }

    /// Mean over records of the relative standard deviation by light samples, `variance(s)` that of surfel s.
    fn deviation(&self, variance: impl Fn(usize) -> f32) -> f32 {
        let (mut sum, mut begin) = (0.0, 0);
        for &end in &self.ends {
            let of_record = self.shares[begin..end].iter().map(|&(s, w)| w * w * variance(s as usize));
            sum += of_record.sum::<f32>().sqrt();
            begin = end;
        }
        sum / self.ends.len().max(1) as f32
    }
}

impl SurfelLight {
    /// Takes further light samples; whether any. [`Self::solve`] is due then.
    pub fn sharpen(&mut self, world: &World, demand: &Demand) -> bool {
        let variances = self.variances_around();
        let deviation = demand.deviation(|s| variances[s] / self.samples[s].max(1) as f32);
        let excess = (deviation / TARGET).powi(2) - 1.0;
        if !(excess > 0.0) {
            return false;
        }
        let taken: u64 = self.samples.iter().map(|m| u64::from(*m)).sum();
        let mut own = vec![0.0; self.own.len()];
        demand.shares.iter().for_each(|(s, w)| own[*s as usize] += w);
        let importance = self.importance(own, SWEEPS);
        let weights: Vec<f32> = importance.iter().zip(&variances).map(|(j, var)| j * var.sqrt()).collect();
        let scale = excess.min(MOST.0) * taken as f32 / weights.iter().sum::<f32>();
        if !(scale > 0.0 && scale.is_finite()) {
            return false;
        }
        let key = hash(self.settings.seed, FURTHER);
        let surfels = &self.surfels;
        let further: Vec<_> = weights
            .par_iter()
            .zip(&self.samples)
            .enumerate()
            .with_min_len(CHUNK)
            .map(|(k, (weight, taken))| {
                let mut counts = RayCounts::default();
                // Other numbers than the samples before had.
                let key = hash(key, u64::from(*taken));
                let more = (scale * weight).min(MOST.1 * *taken as f32).round() as u32;
                let found = (more > 0).then(|| {
                    let places = places_of(world, surfels, k, (more, MANY_PLACES), key, k as u64, &mut counts);
                    direct(world, &places, more, key, k as u64, &mut counts).mean
                });
                (more, found.filter(|light| light.is_finite()), counts)
            })
            .collect();
        for (k, (more, found, counts)) in further.into_iter().enumerate() {
            self.counts += counts;
            let Some(found) = found else { continue };
            // As many or more stand for themselves: the samples before are in E.
            let kept = if more < self.samples[k] { self.samples[k] } else { 0 };
            let before = self.own[k] - self.caustic[k];
            self.own[k] += (found - before) * (more as f32 / (more + kept) as f32);
            self.samples[k] = more + kept;
        }
        true
    }

    /// Variance of one light sample (luminance) at each surfel: the mean over the others of its neighbourhood, where there are none over all.
    fn variances_around(&self) -> Vec<f32> {
        let mut sums = BTreeMap::<u64, (f32, u32)>::new();
        let keys: Vec<u64> = (0..self.variance.len()).map(|k| self.surfels.neighbourhood(k)).collect();
        for (key, variance) in keys.iter().zip(&self.variance) {
            let sum = sums.entry(*key).or_default();
            *sum = (sum.0 + variance, sum.1 + 1);
        }
        let mean = self.variance.iter().sum::<f32>() / self.variance.len().max(1) as f32;
        let around = |(key, own): (&u64, &f32)| match sums.get(key) {
            Some(&(sum, count)) if count > 1 => ((sum - own) / (count - 1) as f32).max(0.0),
            _ => mean,
        };
        keys.iter().zip(&self.variance).map(around).collect()
    }
}
