//! Irradiance from the leaves of the photon tree, eight photons at a time.
//!
//! ```text
//! E(x) = sum_i e_i w_i(x)     e_i: flux, peak of the kernel and quotient of cosines of photon i;  w_i = 1 - q_i, 0 where it does not count
//! ```
//!
//! What the sum needs of a photon lies beside its kernel, one array per coefficient, so that vector units weigh four photons at once and add
//! them up in eight lanes. Where something stands within a kernel the lane is looked at alone, but only for points as far from the photon
//! as the nearest thing that stands there. Lanes are added in their order in the end: the same bits for any number of threads.
//! Source: the estimate is that of [`super::photon_map`]; this is its layout. Bias: none of its own.
//! Verified by `tests/lanes.rs`: the same sum photon by photon.

use super::eight::{Eight, Wide, all, dot, splat3, total};
use super::obstacle::{NONE, Obstacles};
use super::photon_map::NORMAL_CONE;
use super::photon_tree::{LeafVisitor, PhotonTree};
use crate::math::{Rgb, Vec3};

/// What a query needs of a photon.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Flux times the peak of its kernel (nearest photons: flux).
    pub power: Rgb,
    /// Towards where it came from.
    pub wi: Vec3,
    /// Normal of its surface, on the side it came from.
    pub n: Vec3,
    /// See [`Photon::shading`](super::photon::Photon::shading).
    pub shading: f32,
    /// Segments of its way.
    pub segments: u32,
    /// Index of what stands within its kernel.
    pub obstacle: u32,
    /// q from which on that may hide the photon.
    pub clear: f32,
}

/// Eight photons of a leaf.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Lanes {
    e: [Eight; 3],
    n: [Eight; 3],
    segments: Eight,
    /// Lanes with an obstacle, as bits.
    obstructed: u32,
}

/// The lanes of all leaves of a tree, in order.
#[derive(Clone, Debug)]
pub struct PhotonLanes {
    leaves: Vec<Lanes>,
}

/// A point that is asked for, the unit normal of its surface, and the longest way that counts, segments.
#[derive(Clone, Copy, Debug)]
pub struct Query {
    /// Point.
    pub x: Vec3,
    /// Normal, on the side of the surface that is asked for.
    pub n: Vec3,
    /// Most segments.
    pub most: u32,
}

impl PhotonLanes {
    /// The lanes of a tree's leaves.
    pub fn new(tree: &PhotonTree<Arrival>) -> Self {
        PhotonLanes { leaves: tree.map_leaves(Lanes::new) }
    }

    /// Irradiance at a point.
    #[inline]
    pub fn irradiance(&self, tree: &PhotonTree<Arrival>, obstacles: &Obstacles, query: &Query) -> Rgb {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function enables.
            return unsafe { self.sum_avx2(tree, obstacles, query) };
        }
        self.sum::<Eight>(tree, obstacles, query)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn sum_avx2(&self, tree: &PhotonTree<Arrival>, obstacles: &Obstacles, query: &Query) -> Rgb {
        self.sum::<super::eight::Avx2>(tree, obstacles, query)
    }

    /// The same by the lanes of `W`.
    #[inline(always)]
    pub(super) fn sum<W: Wide>(&self, tree: &PhotonTree<Arrival>, obstacles: &Obstacles, query: &Query) -> Rgb {
        let mut sum = Sum {
            leaves: &self.leaves,
            obstacles,
            x: query.x,
            n: splat3(query.n),
            most: W::splat(query.most as f32),
            sums: [W::splat(0.0); 3],
        };
        tree.visit_leaves(query.x, &mut sum);
        let [red, green, blue] = sum.sums;
        Rgb::new(total(red.store()), total(green.store()), total(blue.store()))
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.leaves.as_slice())
    }
}

impl Lanes {
    /// Of eight photons at most; lanes without one add nothing.
    fn new(items: &[Arrival]) -> Self {
        let mut lanes = Lanes { e: [all(0.0); 3], n: [all(0.0); 3], segments: all(0.0), obstructed: 0 };
        for (k, a) in items.iter().enumerate() {
            let e = a.power * a.shading;
            for axis in 0..3 {
                (lanes.e[axis][k / 4][k % 4], lanes.n[axis][k / 4][k % 4]) = (e[axis], a.n[axis]);
            }
            lanes.segments[k / 4][k % 4] = a.segments as f32;
            lanes.obstructed |= u32::from(a.obstacle != NONE) << k;
        }
        lanes
    }
}

/// Irradiance at a point, lane by lane.
struct Sum<'a, W> {
    leaves: &'a [Lanes],
    obstacles: &'a Obstacles,
    x: Vec3,
    n: [W; 3],
    most: W,
    sums: [W; 3],
}

impl<W: Wide> LeafVisitor<Arrival, W> for Sum<'_, W> {
    #[inline(always)]
    fn leaf(&mut self, leaf: usize, mut w: W, items: &[Arrival]) {
        let lanes = &self.leaves[leaf];
        if lanes.obstructed != 0 {
            w = W::load(&hidden(w.store(), lanes.obstructed, items, self.obstacles, self.x));
        }
        let faces = W::splat(NORMAL_CONE).at_most(dot(&lanes.n, &self.n));
        let counts = W::both(W::both(W::splat(0.0).below(w), faces), W::load(&lanes.segments).at_most(self.most));
        let w = w.kept(counts);
        let (sums, e) = (&mut self.sums, &lanes.e);
        sums[0] = sums[0].plus(W::load(&e[0]).times(w));
        sums[1] = sums[1].plus(W::load(&e[1]).times(w));
        sums[2] = sums[2].plus(W::load(&e[2]).times(w));
    }
}

/// Weights without those of photons that `x` does not see, of those with an obstacle.
fn hidden(mut w: Eight, obstructed: u32, items: &[Arrival], obstacles: &Obstacles, x: Vec3) -> Eight {
    let mut looked_at = obstructed;
    while looked_at != 0 {
        let k = looked_at.trailing_zeros() as usize;
        looked_at &= looked_at - 1;
        let (a, w) = (&items[k], &mut w[k / 4][k % 4]);
        if *w > 0.0 && 1.0 - *w >= a.clear && obstacles.hides(a.obstacle, x) {
            *w = 0.0;
        }
    }
    w
}
