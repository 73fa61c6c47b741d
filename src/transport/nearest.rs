//! The nearest photons around a point: the classical estimator, and the baseline that footprint kernels are held against.
//!
//! ```text
//! E(x) = sum_i flux_i 2 / (pi r^2) (1 - d_i^2 / r^2)       r: distance to the k-th nearest photon
//! ```
//!
//! The farthest photon has no weight, so k - 1 count; given r they lie evenly within it where density is even, and the kernel integrates
//! to 1: no bias there. With fewer than k photons within the greatest radius, r is that radius and all of them count.
//! The kd-tree is kiddo's. It holds the photons rotated: on axis-aligned walls a split along the normal would separate nothing.
//! Source: Jensen 1996; k - 1: Mack & Rosenblatt 1979, as of METHODS 3.E.
//! Bias: blur by r; at corners r reaches photons of other walls, which do not count. Verified by `tests/nearest.rs` against brute force.

use super::obstacle::NONE;
use super::photon::Photon;
use super::photon_lanes::Arrival;
use crate::math::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::f32::consts::PI;
use std::num::NonZero;

/// Nine times a rotation that brings no axis near another.
const TURN: [Vec3; 3] = [Vec3::new(1.0, 8.0, -4.0), Vec3::new(-4.0, 4.0, 7.0), Vec3::new(8.0, 1.0, 4.0)];

/// `p` as kd-trees hold it, in a frame in which axis-aligned walls are not at right angles to an axis.
pub(super) fn turned(p: Vec3) -> [f32; 3] {
    TURN.map(|row| row.dot(p) / 9.0)
}

/// Photons for nearest-neighbour queries.
#[derive(Debug)]
pub struct NearestPhotons {
    tree: Option<ImmutableKdTree<f32, 3>>,
    arrivals: Vec<Arrival>,
    k: NonZero<usize>,
    greatest: f32,
}

impl NearestPhotons {
    /// For queries of the `k` nearest (2 at least) within the radius `greatest`.
    pub fn build(photons: &[Photon], k: u32, greatest: f32) -> Self {
        let usable: Vec<&Photon> = photons.iter().filter(|p| p.p.is_finite()).collect();
        let arrival = |p: &&Photon| {
            let Photon { wi, n, flux, shading, segments, .. } = **p;
            Arrival { power: flux, wi, n, shading, segments, obstacle: NONE, clear: 0.0 }
        };
        let arrivals = usable.iter().map(arrival).collect();
        let points: Vec<[f32; 3]> = usable.iter().map(|p| turned(p.p)).collect();
        // Building fails for points that are not finite only, and these are out.
        let tree = (!points.is_empty()).then(|| ImmutableKdTree::new_from_slice(&points).ok()).flatten();
        NearestPhotons { tree, arrivals, k: NonZero::new(k.max(2) as usize).unwrap_or(NonZero::<usize>::MIN), greatest }
    }

    /// Calls `visit` with each photon that counts and its weight, per area.
    pub fn visit(&self, x: Vec3, visit: &mut impl FnMut(&Arrival, f32)) {
        let Some(tree) = &self.tree else { return };
        let most = self.greatest * self.greatest;
        let query = turned(x);
        let found = tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(self.k).within(most).unsorted().execute();
        let full = found.len() == self.k.get();
        let r2 = if full { found.iter().fold(0.0, |r: f32, q| r.max(q.distance)) } else { most };
        if !(r2 > 0.0) {
            return;
        }
        for q in found.iter() {
            let weight = 2.0 / (PI * r2) * (1.0 - q.distance / r2);
            if weight > 0.0 {
                visit(&self.arrivals[q.item as usize], weight);
            }
        }
    }

    /// Number of photons.
    pub fn len(&self) -> usize {
        self.arrivals.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.arrivals.is_empty()
    }

    /// Memory of photons and tree, bytes (the tree's share is an estimate: a point and an index each).
    pub fn bytes(&self) -> usize {
        self.arrivals.len() * (size_of::<Arrival>() + 17)
    }
}
