//! All photons whose kernels cover a point: a stabbing query.
//!
//! Photons are put in classes by the power of two of their reach (a large kernel would blow up the box of every group that it is in),
//! within each sorted along a Z-order curve (Morton 1966) and grouped by eights, and these by eights again: the tree is implied by the
//! order, complete but for its last nodes, and needs no pointers. A node holds the boxes of its eight children; a leaf eight ellipsoids, one
//! array per coefficient, so that vector units test four of them at a time. Building is a sort, O(n log n) whatever the photons' arrangement:
//! duplicates and axis-aligned walls are nothing special. A query visits in the order of the tree: sums have the same bits for any
//! number of threads.
//! Source: for the order Lauterbach et al. 2009, "Fast BVH Construction on GPUs"; classes by reach: METHODS 3.B.
//! Verified against brute force by `tests/tree.rs`.

use super::footprint_kernel::Ellipsoid;
use crate::math::{Vec3, Vec4};
use rayon::prelude::*;

/// Children of a node, and photons of a leaf.
pub const WIDTH: usize = 8;
/// Levels of a tree of 2^32 photons.
const MOST_LEVELS: usize = 11;
/// Bits of a coordinate on the curve.
const BITS: u32 = 19;
/// Greatest factor between the reaches of a class, as its binary logarithm.
const CLASS_LOG2: i32 = 1;

/// A number of each of eight.
pub type Eight = [Vec4; 2];

/// Eight times the same.
pub const fn all(x: f32) -> Eight {
    [Vec4::splat(x); 2]
}

/// Boxes of eight children: lower and upper ends along x, y, z. Empty where there is no child.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Node {
    lo: [Eight; 3],
    hi: [Eight; 3],
}

/// Eight ellipsoids: centres, and the three rows of q's square root.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Leaf {
    p: [Eight; 3],
    rows: [[Eight; 3]; 3],
}

const EMPTY: Node = Node { lo: [all(f32::INFINITY); 3], hi: [all(f32::NEG_INFINITY); 3] };
/// Far from everything: q is infinite or NaN, never below 1.
const NOWHERE: Leaf = Leaf { p: [all(f32::INFINITY); 3], rows: [[all(1.0); 3]; 3] };

/// The tree of one class of reach.
#[derive(Clone, Debug)]
struct Class {
    /// Levels of nodes from the leaves' parents up to the root.
    levels: Vec<Vec<Node>>,
    leaves: Vec<Leaf>,
    /// Index of its first item.
    first: usize,
    /// Number of its items.
    count: usize,
    /// Index of its first leaf among those of all classes.
    first_leaf: usize,
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
        let (mut first, mut first_leaf) = (0, 0);
        while first < order.len() {
            let class = order[first].0 >> (3 * BITS);
            let count = order[first..].partition_point(|(k, _)| k >> (3 * BITS) == class);
            classes.push(Class::build(ellipsoids, &order[first..first + count], (first, first_leaf)));
            first += count;
            first_leaf += count.div_ceil(WIDTH);
        }
        PhotonTree { classes, items: order.par_iter().map(|&(_, i)| item(i as usize)).collect() }
    }

    /// Calls `visit` with the item and 1 - q of each ellipsoid that covers `x`, always in the same order.
    #[inline]
    pub fn visit(&self, x: Vec3, mut visit: impl FnMut(&T, f32)) {
        for class in &self.classes {
            class.visit_leaves(x, |leaf, w| {
                let mut mask = positive(&w);
                while mask != 0 {
                    let k = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    visit(&self.items[class.first + leaf * WIDTH + k], w[k / 4][k % 4]);
                }
            });
        }
    }

    /// Calls `visit` for each leaf that may have an ellipsoid which covers `x`, always in the same order: with its number as in
    /// [`Self::map_leaves`], 1 - q of its ellipsoids (not positive: outside, may be NaN), and their items, fewer than lanes in the last one.
    #[inline]
    pub fn visit_leaves(&self, x: Vec3, mut visit: impl FnMut(usize, Eight, &[T])) {
        for class in &self.classes {
            let end = class.first + class.count;
            class.visit_leaves(x, |leaf, w| {
                let first = class.first + leaf * WIDTH;
                visit(class.first_leaf + leaf, w, &self.items[first..(first + WIDTH).min(end)]);
            });
        }
    }

    /// Something of the items of each leaf, in order.
    pub fn map_leaves<U: Send>(&self, of: impl Fn(&[T]) -> U + Sync) -> Vec<U> {
        let of_class =
            |c: &Class| self.items[c.first..c.first + c.count].par_chunks(WIDTH).map(&of).collect::<Vec<U>>();
        self.classes.iter().flat_map(of_class).collect()
    }

    /// All items, in the order of the leaves.
    pub fn items_mut(&mut self) -> &mut [T] {
        &mut self.items
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
    fn build(ellipsoids: &[Ellipsoid], order: &[(u64, u32)], (first, first_leaf): (usize, usize)) -> Self {
        let leaf = |group: &[(u64, u32)]| {
            let (mut leaf, mut lo, mut hi) = (NOWHERE, Vec3::INFINITY, Vec3::NEG_INFINITY);
            for (k, &(_, i)) in group.iter().enumerate() {
                let e = &ellipsoids[i as usize];
                // Wider than the rounding of the box and of q.
                let half = e.half_box() * (1.0 + 1e-5) + e.p.abs() * (2.0 * f32::EPSILON);
                (lo, hi) = (lo.min(e.p - half), hi.max(e.p + half));
                for axis in 0..3 {
                    leaf.p[axis][k / 4][k % 4] = e.p[axis];
                    for row in 0..3 {
                        leaf.rows[row][axis][k / 4][k % 4] = e.rows[row][axis];
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
                        node.lo[axis][k / 4][k % 4] = b.0[axis];
                        node.hi[axis][k / 4][k % 4] = b.1[axis];
                    }
                }
                (node, (lo, hi))
            };
            let (nodes, above): (Vec<Node>, Vec<_>) = boxes.par_chunks(WIDTH).map(node).unzip();
            levels.push(nodes);
            boxes = above;
        }
        Class { levels, leaves, first, first_leaf, count: order.len() }
    }

    #[inline]
    fn visit_leaves(&self, x: Vec3, mut visit: impl FnMut(usize, Eight)) {
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
                visit(child, weights(&self.leaves[child], x));
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
    let x = x.to_array().map(Vec4::splat);
    let half = |h: usize| {
        let inside = |axis: usize| node.lo[axis][h].cmple(x[axis]) & x[axis].cmple(node.hi[axis][h]);
        (inside(0) & inside(1) & inside(2)).bitmask()
    };
    half(0) | half(1) << 4
}

/// Lanes above 0, as bits.
#[inline(always)]
fn positive(w: &Eight) -> u32 {
    let half = |w: Vec4| w.cmpgt(Vec4::ZERO).bitmask();
    half(w[0]) | half(w[1]) << 4
}

/// 1 - q of eight ellipsoids at `x`.
#[inline(always)]
fn weights(leaf: &Leaf, x: Vec3) -> Eight {
    let x = x.to_array().map(Vec4::splat);
    std::array::from_fn(|h| {
        let d: [Vec4; 3] = std::array::from_fn(|axis| x[axis] - leaf.p[axis][h]);
        let squared = |row: &[Eight; 3]| {
            let s = row[0][h] * d[0] + row[1][h] * d[1] + row[2][h] * d[2];
            s * s
        };
        let [r, s, n] = &leaf.rows;
        Vec4::ONE - (squared(r) + squared(s) + squared(n))
    })
}
