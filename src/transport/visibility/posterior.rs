//! How far cache points can be believed: the probability that a light is visible, given what the nearest cache points saw.
//!
//! ```text
//! m = (w m_0 + V) / (w + T),   m_0 = (b + 1/2) / (k + 1)      b of k cache points that can tell see the light
//! E v = E v^2 = m,   E (v - m)^2 = m (1 - m)
//! ```
//!
//! V of T shadow rays traced so far found the light visible, in a bucket of like cases: (k, b), distance of the nearest cache point, and how
//! far the normals differ. m_0 is the mean of a Beta posterior under Jeffreys' prior, which counts as w = `PRIOR` rays. Rays count from the pass
//! after the one that traced them on ([`Posterior::fold`]): what steers a sum must not depend on the sum.
//! Source: METHODS 1.A e, 1.B (online calibration). Bias: none, predictions steer only.
//! Determinism: counts are whole numbers, so that the order in which threads add them does not matter.
//! Verified by tests in this file.

use crate::math::Prediction;
use std::sync::atomic::{AtomicU64, Ordering};

/// Most cache points that are asked.
pub const MOST_NEIGHBOURS: usize = 3;
/// Pairs (k, b) with 0 <= b <= k <= 3.
pub const AGREEMENTS: usize = 10;
/// Classes of distance times classes of normals.
const SURROUNDINGS: usize = DISTANCES.len() * NORMALS.len();
/// Upper limits of the nearest cache point's distance, in typical distances between cache points.
const DISTANCES: [f32; 4] = [0.25, 0.5, 1.0, f32::INFINITY];
/// Lower limits of the cosine between normals.
const NORMALS: [f32; 3] = [0.99, 0.8, -2.0];
/// Rays that the prior counts as.
const PRIOR: f32 = 16.0;

/// Index of the case that `b` of `k` cache points see a light.
pub fn agreement(b: u32, k: u32) -> usize {
    (k * (k + 1) / 2 + b) as usize
}

/// The class of a place, by the distance of its nearest cache point (in typical distances) and the cosine between their normals.
pub fn surrounding(distance: f32, cos: f32) -> usize {
    let d = DISTANCES.iter().position(|&limit| distance <= limit).unwrap_or(DISTANCES.len() - 1);
    let n = NORMALS.iter().position(|&limit| cos >= limit).unwrap_or(NORMALS.len() - 1);
    d * NORMALS.len() + n
}

/// Predictions of all cases at one place.
pub type Predictions = [Prediction; AGREEMENTS];

/// What rays have shown so far.
#[derive(Debug)]
pub struct Posterior {
    table: Vec<Predictions>,
    /// Visible and traced since the beginning, by surrounding and agreement.
    counts: Vec<[AtomicU64; 2]>,
}

impl Default for Posterior {
    fn default() -> Self {
        let counts = (0..SURROUNDINGS * AGREEMENTS).map(|_| [AtomicU64::new(0), AtomicU64::new(0)]).collect();
        let mut posterior = Posterior { table: Vec::new(), counts };
        posterior.fold();
        posterior
    }
}

impl Posterior {
    /// Notes that `visible` of `traced` shadow rays found their light visible, for later passes.
    pub fn note(&self, surrounding: usize, agreement: usize, visible: u64, traced: u64) {
        let count = &self.counts[surrounding * AGREEMENTS + agreement];
        count[0].fetch_add(visible, Ordering::Relaxed);
        count[1].fetch_add(traced, Ordering::Relaxed);
    }

    /// Takes all that was noted into account. To be called between passes.
    pub fn fold(&mut self) {
        let prediction = |case: usize, at: usize| {
            let [v, t] = [0, 1].map(|i| self.counts[at * AGREEMENTS + case][i].load(Ordering::Relaxed) as f32);
            let k = (0..=MOST_NEIGHBOURS as u32).rev().find(|&k| agreement(0, k) <= case).unwrap_or(0);
            let b = case - agreement(0, k);
            let prior = (b as f32 + 0.5) / (k as f32 + 1.0);
            Prediction::of_probability((PRIOR * prior + v) / (PRIOR + t))
        };
        self.table = (0..SURROUNDINGS).map(|at| std::array::from_fn(|case| prediction(case, at))).collect();
    }

    /// The predictions for a class of places.
    pub fn predictions(&self, surrounding: usize) -> &Predictions {
        &self.table[surrounding]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_have_numbers_of_their_own() {
        let all: Vec<usize> = (0..=3).flat_map(|k| (0..=k).map(move |b| agreement(b, k))).collect();
        assert_eq!(all, (0..AGREEMENTS).collect::<Vec<_>>());
        let places = [0.0, 0.3, 0.7, 9.0].map(|d| [1.0, 0.9, -1.0].map(|c| surrounding(d, c)));
        assert_eq!(places.concat(), (0..SURROUNDINGS).collect::<Vec<_>>());
        assert_eq!(surrounding(f32::INFINITY, f32::NAN), SURROUNDINGS - 1);
    }

    #[test]
    fn the_prior_is_jeffreys_and_rays_replace_it_from_the_next_pass_on() {
        let mut posterior = Posterior::default();
        let q = |p: &Posterior, b, k| p.predictions(2)[agreement(b, k)];
        assert_eq!(q(&posterior, 3, 3).q, 3.5 / 4.0);
        assert!((q(&posterior, 3, 3).residual - 0.109).abs() < 1e-3, "nearly the paper's 0.1");
        assert_eq!(q(&posterior, 0, 0).q, 0.5);
        for i in 0..10_000 {
            posterior.note(2, agreement(3, 3), u64::from(i % 50 != 0), 1);
        }
        assert_eq!(q(&posterior, 3, 3).q, 3.5 / 4.0, "not yet");
        posterior.fold();
        assert!((q(&posterior, 3, 3).q - 0.98).abs() < 1e-3);
        assert!((q(&posterior, 3, 3).residual - 0.98 * 0.02).abs() < 1e-3);
        assert_eq!(q(&posterior, 2, 3).q, 2.5 / 4.0, "other cases stay");
    }
}
