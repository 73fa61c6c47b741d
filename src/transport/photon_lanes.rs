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

use super::obstacle::{NONE, Obstacles};
use super::photon_map::NORMAL_CONE;
use super::photon_tree::{Eight, PhotonTree, all};
use crate::math::{Rgb, Vec3, Vec4};

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

/// Normal and longest way of a query.
#[derive(Clone, Copy)]
struct Query {
    n: [Vec4; 3],
    most: Vec4,
}

impl PhotonLanes {
    /// The lanes of a tree's leaves.
    pub fn new(tree: &PhotonTree<Arrival>) -> Self {
        PhotonLanes { leaves: tree.map_leaves(Lanes::new) }
    }

    /// Irradiance at `x` on the side of the unit normal `n`, by photons of `most` segments at most.
    pub fn irradiance(&self, tree: &PhotonTree<Arrival>, obstacles: &Obstacles, x: Vec3, n: Vec3, most: u32) -> Rgb {
        let query = Query { n: n.to_array().map(Vec4::splat), most: Vec4::splat(most as f32) };
        let mut sums = [all(0.0); 3];
        tree.visit_leaves(x, |leaf, mut w, items| {
            let lanes = &self.leaves[leaf];
            let mut looked_at = lanes.obstructed;
            while looked_at != 0 {
                let k = looked_at.trailing_zeros() as usize;
                looked_at &= looked_at - 1;
                let (a, w) = (&items[k], &mut w[k / 4][k % 4]);
                if *w > 0.0 && 1.0 - *w >= a.clear && obstacles.hides(a.obstacle, x) {
                    *w = 0.0;
                }
            }
            add(lanes, &query, &w, &mut sums);
        });
        let total = |[a, b]: Eight| (a + b).to_array().iter().sum();
        Rgb::from_array(sums.map(total))
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

/// Adds what eight photons of weights `w` bring.
#[inline(always)]
fn add(lanes: &Lanes, query: &Query, w: &Eight, sums: &mut [Eight; 3]) {
    for h in 0..2 {
        let cos = lanes.n[0][h] * query.n[0] + lanes.n[1][h] * query.n[1] + lanes.n[2][h] * query.n[2];
        let counts = w[h].cmpgt(Vec4::ZERO) & cos.cmpge(Vec4::splat(NORMAL_CONE)) & lanes.segments[h].cmple(query.most);
        let w = Vec4::select(counts, w[h], Vec4::ZERO);
        for (sum, e) in sums.iter_mut().zip(&lanes.e) {
            sum[h] += e[h] * w;
        }
    }
}
