//! All photons whose kernels cover a point: a stabbing query.
//!
//! Photons are put in classes by the power of two of their reach (a large kernel would blow up the box of every group that it is in),
//! within each sorted along a Z-order curve (Morton 1966) and grouped by eights, and these by eights again: the tree is implied by the
//! order, complete but for its last nodes, and needs no pointers. A node holds the boxes of its eight children; a leaf eight ellipsoids, one
//! array per coefficient, so that vector units test eight at a time. Building is a sort, O(n log n) whatever the photons' arrangement:
//! duplicates and axis-aligned walls are nothing special. A query visits in the order of the tree: sums have the same bits for any
//! number of threads.
//! Source: for the order Lauterbach et al. 2009, "Fast BVH Construction on GPUs"; classes by reach: METHODS 3.B.
//! Verified against brute force by `tests/tree.rs`.

use super::footprint_kernel::Ellipsoid;
use crate::math::Vec3;
use rayon::prelude::*;

/// Children of a node, and photons of a leaf.
const WIDTH: usize = 8;
/// Levels of a tree of 2^32 photons.
const MOST_LEVELS: usize = 11;
/// Bits of a coordinate on the curve.
const BITS: u32 = 19;
/// Greatest factor between the reaches of a class, as its binary logarithm.
const CLASS_LOG2: i32 = 1;

/// Boxes of eight children: lower and upper ends along x, y, z. Empty where there is no child.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Node {
    lo: [[f32; WIDTH]; 3],
    hi: [[f32; WIDTH]; 3],
}

/// Eight ellipsoids: centres, and the three rows of q's square root.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Leaf {
    p: [[f32; WIDTH]; 3],
    rows: [[[f32; WIDTH]; 3]; 3],
}

const EMPTY: Node = Node { lo: [[f32::INFINITY; WIDTH]; 3], hi: [[f32::NEG_INFINITY; WIDTH]; 3] };
/// Far from everything: q is infinite or NaN, never below 1.
const NOWHERE: Leaf = Leaf { p: [[f32::INFINITY; WIDTH]; 3], rows: [[[1.0; WIDTH]; 3]; 3] };

/// The tree of one class of reach.
#[derive(Clone, Debug)]
struct Class {
    /// Levels of nodes from the leaves' parents up to the root.
    levels: Vec<Vec<Node>>,
    leaves: Vec<Leaf>,
    /// Index of its first item.
    first: usize,
}

/// Ellipsoids with something attached to each.
#[derive(Clone, Debug)]
pub struct PhotonTree<T> {
    classes: Vec<Class>,
    /// Attachments, in the order of the leaves.
    items: Vec<T>,
}

impl<T> Default for PhotonTree<T> {
    fn default() -> Self {
        PhotonTree { classes: Vec::new(), items: Vec::new() }
    }
}

impl<T: Copy + Send + Sync> PhotonTree<T> {
    /// Builds the tree over `ellipsoids`, each with its item. Ellipsoids that are not finite are left out.
    pub fn build(ellipsoids: &[Ellipsoid], item: impl Fn(usize) -> T + Sync) -> Self {
        let sane = |e: &Ellipsoid| e.p.is_finite() && e.radii[0].is_finite() && e.rows.iter().all(|r| r.is_finite());
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let sane_ones = ellipsoids.iter().filter(|e| sane(e));
        let (lo, hi) = sane_ones.fold(empty, |(lo, hi), e| (lo.min(e.p), hi.max(e.p)));
        let scale = ((1u32 << BITS) - 1) as f32 / (hi - lo).max_element().max(f32::MIN_POSITIVE);
        let key = |e: &Ellipsoid| {
            let [x, y, z] = ((e.p - lo) * scale).to_array().map(|c| spread_bits(c as u64));
            (u64::from(size_class(e.radii[0])) << (3 * BITS)) | x | (y << 1) | (z << 2)
        };
        let with_keys = ellipsoids.par_iter().enumerate().filter(|(_, e)| sane(e));
        let mut order: Vec<(u64, u32)> = with_keys.map(|(i, e)| (key(e), i as u32)).collect();
        order.par_sort_unstable();

        let mut classes = Vec::new();
        let mut first = 0;
        while first < order.len() {
            let class = order[first].0 >> (3 * BITS);
            let count = order[first..].partition_point(|(k, _)| k >> (3 * BITS) == class);
            classes.push(Class::build(ellipsoids, &order[first..first + count], first));
            first += count;
        }
        PhotonTree { classes, items: order.par_iter().map(|&(_, i)| item(i as usize)).collect() }
    }

    /// Calls `visit` with the item and 1 - q of each ellipsoid that covers `x`, always in the same order.
    #[inline]
    pub fn visit(&self, x: Vec3, mut visit: impl FnMut(&T, f32)) {
        for class in &self.classes {
            class.visit(x, |index, weight| visit(&self.items[index], weight));
        }
    }

    /// Number of items.
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Memory of the tree, bytes.
    pub fn bytes(&self) -> usize {
        let of = |c: &Class| {
            size_of_val(c.leaves.as_slice()) + c.levels.iter().map(|l| size_of_val(l.as_slice())).sum::<usize>()
        };
        size_of_val(self.items.as_slice()) + self.classes.iter().map(of).sum::<usize>()
    }
}

/// Class of a reach: its binary exponent in steps of [`CLASS_LOG2`], within seven bits.
fn size_class(reach: f32) -> u8 {
    let exponent = (reach.max(f32::MIN_POSITIVE).to_bits() >> 23) as i32 - 127;
    (exponent.div_euclid(CLASS_LOG2) + 64).clamp(0, 127) as u8
}

/// Bits of `x` with two zeros between each.
fn spread_bits(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

impl Class {
    fn build(ellipsoids: &[Ellipsoid], order: &[(u64, u32)], first: usize) -> Self {
        let leaf = |group: &[(u64, u32)]| {
            let (mut leaf, mut lo, mut hi) = (NOWHERE, Vec3::INFINITY, Vec3::NEG_INFINITY);
            for (k, &(_, i)) in group.iter().enumerate() {
                let e = &ellipsoids[i as usize];
                // Wider than the rounding of the box and of q.
                let half = e.half_box() * (1.0 + 1e-5) + e.p.abs() * (2.0 * f32::EPSILON);
                (lo, hi) = (lo.min(e.p - half), hi.max(e.p + half));
                for axis in 0..3 {
                    leaf.p[axis][k] = e.p[axis];
                    for row in 0..3 {
                        leaf.rows[row][axis][k] = e.rows[row][axis];
                    }
                }
            }
            (leaf, (lo, hi))
        };
        let (leaves, mut boxes): (Vec<Leaf>, Vec<(Vec3, Vec3)>) = order.par_chunks(WIDTH).map(leaf).unzip();
        let mut levels = Vec::new();
        while levels.is_empty() || boxes.len() > 1 {
            let node = |group: &[(Vec3, Vec3)]| {
                let (mut node, mut lo, mut hi) = (EMPTY, Vec3::INFINITY, Vec3::NEG_INFINITY);
                for (k, b) in group.iter().enumerate() {
                    (lo, hi) = (lo.min(b.0), hi.max(b.1));
                    for axis in 0..3 {
                        node.lo[axis][k] = b.0[axis];
                        node.hi[axis][k] = b.1[axis];
                    }
                }
                (node, (lo, hi))
            };
            let (nodes, above): (Vec<Node>, Vec<_>) = boxes.par_chunks(WIDTH).map(node).unzip();
            levels.push(nodes);
            boxes = above;
        }
        Class { levels, leaves, first }
    }

    #[inline]
    fn visit(&self, x: Vec3, mut visit: impl FnMut(usize, f32)) {
        let top = self.levels.len() - 1;
        // Children still to be visited, and the node they belong to, per level.
        let mut masks = [0u32; MOST_LEVELS];
        let mut nodes = [0usize; MOST_LEVELS];
        let mut level = top;
        masks[top] = covered(&self.levels[top][0], x);
        loop {
            if masks[level] == 0 {
                if level == top {
                    return;
                }
                level += 1;
                continue;
            }
            let child = nodes[level] * WIDTH + masks[level].trailing_zeros() as usize;
            masks[level] &= masks[level] - 1;
            if level == 0 {
                let mut w = [0.0; WIDTH];
                let mut mask = weights(&self.leaves[child], x, &mut w);
                while mask != 0 {
                    let k = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    visit(self.first + child * WIDTH + k, w[k]);
                }
            } else {
                level -= 1;
                nodes[level] = child;
                masks[level] = covered(&self.levels[level][child], x);
            }
        }
    }
}

/// Children whose boxes hold `x`.
#[inline(always)]
fn covered(node: &Node, x: Vec3) -> u32 {
    let x = x.to_array();
    let mut inside = [true; WIDTH];
    for axis in 0..3 {
        for k in 0..WIDTH {
            inside[k] &= (node.lo[axis][k] <= x[axis]) & (x[axis] <= node.hi[axis][k]);
        }
    }
    (0..WIDTH).fold(0, |m, k| m | u32::from(inside[k]) << k)
}

/// 1 - q of eight ellipsoids at `x`, and which of them are positive.
// A function of its own: inlined, lanes are taken apart and computed one by one.
#[inline(never)]
fn weights(leaf: &Leaf, x: Vec3, w: &mut [f32; WIDTH]) -> u32 {
    let x = x.to_array();
    let mut d = [[0.0f32; WIDTH]; 3];
    for axis in 0..3 {
        for k in 0..WIDTH {
            d[axis][k] = x[axis] - leaf.p[axis][k];
        }
    }
    let mut q = [0.0f32; WIDTH];
    for row in &leaf.rows {
        for k in 0..WIDTH {
            let s = row[0][k] * d[0][k] + row[1][k] * d[1][k] + row[2][k] * d[2][k];
            q[k] += s * s;
        }
    }
    for k in 0..WIDTH {
        w[k] = 1.0 - q[k];
    }
    (0..WIDTH).fold(0, |m, k| m | u32::from(w[k] > 0.0) << k)
}
