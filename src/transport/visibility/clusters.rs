//! Clusters of oriented points in six dimensions.
//!
//! ```text
//! x6 = (p / l, w n)          l: diagonal of the points' box, w = [`NORMAL_WEIGHT`]: |x6 - y6|^2 = |dp|^2 / l^2 + w^2 |dn|^2
//! ```
//!
//! The cluster whose box has the longest side is cut through the middle of that side, until there are as many as wanted or nothing can be
//! cut; empty halves do not count. Cutting at the middle, not at the median, keeps clusters of sparse regions: they need a cache point too.
//! Source: Ou & Pellacini 2011 as used by Nabata et al., section 3.1 (which leaves the scale of normals open: METHODS 1.A g).
//! Bias: none, clusters steer only. Verified by tests in this file.

use crate::math::Vec3;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// How much normals count: half a turn is as far as this times twice the diagonal of the points' box.
pub const NORMAL_WEIGHT: f32 = 0.15;

/// A place in the space of positions and normals.
pub type Point6 = [f32; 6];

/// The place of the position `p` with the unit normal `n`; `scale` is 1 / l.
pub fn point6(p: Vec3, n: Vec3, scale: f32) -> Point6 {
    let (p, n) = (p * scale, n * NORMAL_WEIGHT);
    [p.x, p.y, p.z, n.x, n.y, n.z]
}

/// 1 / l of points: the inverse of the diagonal of their box; 1 for less than two different points.
pub fn scale(points: impl Iterator<Item = Vec3>) -> f32 {
    let (lo, hi) = points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let diagonal = (hi - lo).length();
    if diagonal > 0.0 && diagonal.is_finite() { 1.0 / diagonal } else { 1.0 }
}

struct Cluster {
    /// Places of the points in the list.
    range: std::ops::Range<usize>,
    axis: usize,
    middle: f32,
    side: f32,
    /// Breaks ties.
    serial: usize,
}

impl PartialEq for Cluster {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Cluster {}
impl PartialOrd for Cluster {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Cluster {
    fn cmp(&self, other: &Self) -> Ordering {
        self.side.total_cmp(&other.side).then(other.serial.cmp(&self.serial))
    }
}

/// Longest side of the box around some of the points: (side, axis, middle).
pub fn longest_side(points: &[Point6], list: &[u32]) -> (f32, usize, f32) {
    let (mut lo, mut hi) = ([f32::INFINITY; 6], [f32::NEG_INFINITY; 6]);
    for &i in list {
        for (k, &x) in points[i as usize].iter().enumerate() {
            lo[k] = lo[k].min(x);
            hi[k] = hi[k].max(x);
        }
    }
    let axis = (0..6).max_by(|&a, &b| (hi[a] - lo[a]).total_cmp(&(hi[b] - lo[b])).then(b.cmp(&a))).unwrap_or(0);
    (hi[axis] - lo[axis], axis, lo[axis] + 0.5 * (hi[axis] - lo[axis]))
}

/// Up to `wanted` clusters: lists of indices into `points`, none of them empty, each point in one. Points must be finite.
pub fn clusters(points: &[Point6], wanted: usize) -> Vec<Vec<u32>> {
    let mut list: Vec<u32> = (0..points.len() as u32).collect();
    let mut serial = 0;
    let mut make = |list: &[u32], range: std::ops::Range<usize>| {
        let (side, axis, middle) = longest_side(points, &list[range.clone()]);
        serial += 1;
        Cluster { range, axis, middle, side, serial }
    };
    let mut open = BinaryHeap::new();
    if !points.is_empty() {
        open.push(make(&list, 0..points.len()));
    }
    while open.len() < wanted.max(1) {
        let Some(longest) = open.peek() else { break };
        if !(longest.side > 0.0) {
            break;
        }
        let Some(c) = open.pop() else { break };
        let part = &mut list[c.range.clone()];
        // A stable partition: the order of points decides nothing but itself.
        part.sort_by_key(|&i| points[i as usize][c.axis] > c.middle);
        let below = part.iter().take_while(|&&i| points[i as usize][c.axis] <= c.middle).count();
        let cut = if below == 0 || below == part.len() { part.len() / 2 } else { below } + c.range.start;
        open.push(make(&list, c.range.start..cut));
        open.push(make(&list, cut..c.range.end));
    }
    let mut all: Vec<Cluster> = open.into_vec();
    all.sort_by_key(|c| c.range.start);
    all.into_iter().map(|c| list[c.range].to_vec()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32};

    fn random(n: u64) -> Vec<Point6> {
        let u = |i: u64, k: u64| unit_f32(hash(i, k));
        (0..n).map(|i| point6(Vec3::new(u(i, 0), u(i, 1), u(i, 2)), Vec3::Y, 0.5)).collect()
    }

    #[test]
    fn every_point_is_in_one_cluster_and_there_are_as_many_as_wanted() {
        let points = random(5000);
        for wanted in [1, 2, 7, 300] {
            let found = clusters(&points, wanted);
            assert_eq!(found.len(), wanted);
            let mut seen = vec![false; points.len()];
            for i in found.iter().flatten() {
                assert!(!std::mem::replace(&mut seen[*i as usize], true), "twice");
            }
            assert!(seen.iter().all(|s| *s));
        }
    }

    #[test]
    fn clusters_are_compact_and_opposite_normals_part_first() {
        let points = random(4096);
        let longest = clusters(&points, 512).iter().map(|c| longest_side(&points, c).0).fold(0.0, f32::max);
        // 512 boxes of side 1/8 of 0.5 fill the cube.
        assert!(longest < 1.5 * 0.5 / 8.0, "{longest}");
        let wall = |n: Vec3| (0..50).map(move |i| point6(Vec3::X * (0.001 * i as f32), n, 1.0));
        let both: Vec<Point6> = wall(Vec3::Y).chain(wall(-Vec3::Y)).collect();
        let found = clusters(&both, 2);
        assert!(found.iter().all(|c| c.len() == 50 && c.iter().all(|i| (*i < 50) == (c[0] < 50))));
    }

    #[test]
    fn degenerate_sets_end() {
        assert!(clusters(&[], 5).is_empty());
        let same = vec![[1.0; 6]; 10];
        assert_eq!(clusters(&same, 5).len(), 1);
    }
}
