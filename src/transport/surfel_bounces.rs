//! All bounces between surfels: E = D + C + G + T E (`surfel_light.rs`), solved.
//!
//! Without a limit by sweeps in the order of the surfels (Gauss-Seidel), which converge at least like albedo^k, to 1e-4 of the mean. Where paths have a
//! greatest length, one sweep over all of them (Jacobi) for each bounce, and the light of each number of bounces is kept:
//!
//! ```text
//! E_0 = D,    E_b(j) = D_j + C_j + G_l + sum_r T_lr E_{b - 1 - v(r)}(s(r)),     v: mirrors and panes on the way of ray r
//! ```
//!
//! A record's ray takes E_{b - v} of what it has reached.
//! Not handled   caustics by more than one mirror or pane, and what glossy vertices scatter behind some, count from b = 1 on
//! Verified by tests/photon.rs (`mirrors_on_the_way_of_gather_rays_count_for_the_depth`), tests/irradiance_cache.rs

use super::reached::Reached;
use super::surfel_light::{Entry, SurfelLight};
use crate::math::{Rgb, luminance};

/// Sweeps end when no surfel changes by more than this share of the mean irradiance.
const CONVERGED: f32 = 1e-4;
/// Most sweeps: with the least albedo 0.98 of a closed white room this leaves 0.2 % of the light.
const MAX_SWEEPS: u32 = 300;
/// Limits of bounces up to which surfaces on the way of a ray count: of more, one or two fewer do not show.
const MOST_LEVELS: u32 = 15;

impl SurfelLight {
    /// Irradiance of what a chain of rays from a record has reached: where paths have a greatest length, that of the bounces which the chain
    /// leaves.
    pub fn by(&self, reached: Reached) -> Rgb {
        let (k, last) = (reached.surfel(), self.settings.bounces.unwrap_or(0) as usize);
        let values = match (self.levels.is_empty(), last.checked_sub(reached.detour())) {
            (true, _) => &self.total,
            (false, None) => return Rgb::ZERO,
            (false, Some(bounces)) => self.levels.get(bounces).unwrap_or(&self.total),
        };
        values.get(k).copied().unwrap_or(Rgb::ZERO)
    }

    /// Solves for the irradiance of all surfels: a function of their direct light and rows alone.
    pub fn solve(&mut self) {
        self.levels.clear();
        if let Some(bounces) = self.settings.bounces.filter(|&n| n < MAX_SWEEPS) {
            self.bounce(bounces);
            return;
        }
        self.indirect.copy_from_slice(&self.scattered);
        self.follow(0);
        self.sweeps(0, MAX_SWEEPS);
    }

    /// The first terms of the Neumann series, light of so many bounces and no more: each sweep reads those before alone (Jacobi).
    fn bounce(&mut self, bounces: u32) {
        let by_levels = bounces <= MOST_LEVELS;
        let longest = self.entries.iter().map(|e| e.reached.detour()).max().filter(|_| by_levels).unwrap_or(0);
        self.indirect.fill(Rgb::ZERO);
        self.total.copy_from_slice(&self.own);
        if by_levels {
            // Without a bounce there is no segment to spare for a caustic either.
            self.levels.push(self.own.iter().zip(&self.caustic).map(|(own, caustic)| *own - *caustic).collect());
        }
        for bounce in 1..=bounces as usize {
            for k in (0..self.total.len()).filter(|&k| self.gatherer[k] as usize == k) {
                self.indirect[k] = self.scattered[k] + self.gathered_within(k, bounce);
            }
            let (mut change, mut sum) = (0f32, 0f32);
            for (k, total) in self.total.iter_mut().enumerate() {
                let value = self.own[k] + self.indirect[self.gatherer[k] as usize];
                change = change.max((value - *total).abs().max_element());
                sum += luminance(value);
                *total = value;
            }
            if change <= CONVERGED * sum / self.total.len() as f32 && bounce > longest {
                break;
            }
            if by_levels {
                self.levels.push(self.total.clone());
            }
        }
    }

    /// What the rays of large surfel `k` bring of light of `bounces` bounces, the one at `k` included.
    fn gathered_within(&self, k: usize, bounces: usize) -> Rgb {
        if self.levels.is_empty() {
            return self.gathered(k);
        }
        let light = |e: &Entry| {
            let values = &self.levels[(bounces - 1).checked_sub(e.reached.detour())?];
            Some(e.weight * values[e.reached.surfel()])
        };
        self.row(k).iter().filter_map(light).sum()
    }

    fn row(&self, k: usize) -> &[Entry] {
        let begin = if k == 0 { 0 } else { self.row_ends[k - 1] as usize };
        &self.entries[begin..self.row_ends[k] as usize]
    }

    /// What the rays of large surfel `k` bring of the light of other surfels.
    fn gathered(&self, k: usize) -> Rgb {
        self.row(k).iter().map(|e| e.weight * self.total[e.reached.surfel()]).sum()
    }

    /// Importance of surfels whose own importance is `own`: the adjoint of `sweeps` bounces.
    pub(super) fn importance(&self, own: Vec<f32>, sweeps: u32) -> Vec<f32> {
        let mut importance = own.clone();
        for _ in 0..sweeps.min(self.settings.bounces.unwrap_or(u32::MAX)) {
            let mut gathered = vec![0.0; own.len()];
            importance.iter().zip(&self.gatherer).for_each(|(j, l)| gathered[*l as usize] += j);
            importance.copy_from_slice(&own);
            for (k, j) in gathered.into_iter().enumerate().filter(|(_, j)| *j > 0.0) {
                self.row(k).iter().for_each(|e| importance[e.reached.surfel()] += luminance(e.weight) * j);
            }
        }
        importance
    }

    /// Gauss-Seidel sweeps over the large surfels from `start` on, which the others follow.
    pub(super) fn sweeps(&mut self, start: usize, limit: u32) {
        if self.entries.is_empty() || limit == 0 {
            return self.follow(start);
        }
        for _ in 0..limit {
            let (mut change, mut sum, mut count) = (0f32, 0f32, 0u32);
            for k in (start..self.total.len()).filter(|&k| self.gatherer[k] as usize == k) {
                self.indirect[k] = self.scattered[k] + self.gathered(k);
                let value = self.own[k] + self.indirect[k];
                change = change.max((value - self.total[k]).abs().max_element());
                sum += luminance(value);
                count += 1;
                self.total[k] = value;
            }
            // Some rays meet surfels of small cells too.
            self.follow(start);
            if change <= CONVERGED * sum / count.max(1) as f32 {
                break;
            }
        }
    }

    /// Gives the surfels from `start` on that have no rays of their own what the rays of theirs bring.
    pub(super) fn follow(&mut self, start: usize) {
        for k in start..self.total.len() {
            self.total[k] = self.own[k] + self.indirect[self.gatherer[k] as usize];
        }
    }
}
