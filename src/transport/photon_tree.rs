//! All photons whose kernels cover a point: a stabbing query.
//!
//! Photons are put in classes by the power of two of their reach (a large kernel would blow up the box of every group that it is in),
//! within each sorted along a Z-order curve (Morton 1966) and grouped by eights, and these by eights again: the tree is implied by the
//! order, complete but for its last nodes, and needs no pointers. A node holds the boxes of its eight children; a leaf eight ellipsoids, one
//! array per coefficient, so that vector units test all or half of them at a time. Building is a sort, O(n log n) whatever the photons' arrangement:
//! duplicates and axis-aligned walls are nothing special. A query visits in the order of the tree: sums have the same bits for any
//! number of threads.
//! Source: for the order Lauterbach et al. 2009, "Fast BVH Construction on GPUs"; classes by reach: METHODS 3.B.
//! Verified against brute force by `tests/tree.rs`.

use super::eight::{Eight, WIDTH, Wide, all, dot, splat3};
use super::footprint_kernel::Ellipsoid;
use crate::math::Vec3;
use crate::math::morton::morton;
use rayon::prelude::*;

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

/// What becomes of the leaves around a point.
pub trait LeafVisitor<T, W> {
    /// A leaf: its number as in [`PhotonTree::map_leaves`], 1 - q of its ellipsoids (not positive: outside, may be NaN), and their items, fewer
    /// than lanes in the last one.
    fn leaf(&mut self, leaf: usize, w: W, items: &[T]);
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
        let key = |e: &Ellipsoid| (u64::from(size_class(e.radii[0])) << (3 * BITS)) | morton((e.p - lo) * scale);
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
            let mut leaves = class.leaves_at::<Eight>(x);
            while let Some(leaf) = leaves.next() {
                let w = weights(&class.leaves[leaf], &leaves.x);
                let mut mask = positive(w);
                while mask != 0 {
                    let k = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    visit(&self.items[class.first + leaf * WIDTH + k], w[k / 4][k % 4]);
                }
            }
        }
    }

    /// Lets `visitor` see each leaf that has an ellipsoid which covers `x`, always in the same order. Inlined with all that it calls: a
    /// caller that enables vector instructions has them here.
    #[inline(always)]
    pub fn visit_leaves<W: Wide>(&self, x: Vec3, visitor: &mut impl LeafVisitor<T, W>) {
        for class in &self.classes {
            let mut leaves = class.leaves_at::<W>(x);
            while let Some(leaf) = leaves.next() {
                let w = weights(&class.leaves[leaf], &leaves.x);
                if positive(w) != 0 {
                    let first = class.first + leaf * WIDTH;
                    let end = (first + WIDTH).min(class.first + class.count);
                    visitor.leaf(class.first_leaf + leaf, w, &self.items[first..end]);
                }
            }
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

    /// The leaves whose boxes hold `x`.
    #[inline(always)]
    fn leaves_at<W: Wide>(&self, x: Vec3) -> Leaves<'_, W> {
        let (x, top) = (splat3(x), self.levels.len() - 1);
        let mut leaves = Leaves { class: self, x, level: top, masks: [0; MOST_LEVELS], nodes: [0; MOST_LEVELS] };
        leaves.masks[top] = covered(&self.levels[top][0], &leaves.x);
        leaves
    }
}

/// A walk down to the leaves around a point.
struct Leaves<'a, W> {
    class: &'a Class,
    x: [W; 3],
    level: usize,
    /// Children still to be visited, and the node they belong to, per level.
    masks: [u32; MOST_LEVELS],
    nodes: [usize; MOST_LEVELS],
}

impl<W: Wide> Leaves<'_, W> {
    /// The next one, as an index.
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        loop {
            let mask = self.masks[self.level];
            if mask == 0 {
                self.level += 1;
                if self.level == self.class.levels.len() {
                    self.level -= 1;
                    return None;
                }
                continue;
            }
            let child = self.nodes[self.level] * WIDTH + mask.trailing_zeros() as usize;
            self.masks[self.level] = mask & (mask - 1);
            if self.level == 0 {
                return Some(child);
            }
            self.level -= 1;
            self.nodes[self.level] = child;
            self.masks[self.level] = covered(&self.class.levels[self.level][child], &self.x);
        }
    }
}

/// Children whose boxes hold `x`, as bits.
#[inline(always)]
fn covered<W: Wide>(node: &Node, x: &[W; 3]) -> u32 {
    let along_x = W::both(W::load(&node.lo[0]).at_most(x[0]), x[0].at_most(W::load(&node.hi[0])));
    let along_y = W::both(W::load(&node.lo[1]).at_most(x[1]), x[1].at_most(W::load(&node.hi[1])));
    let along_z = W::both(W::load(&node.lo[2]).at_most(x[2]), x[2].at_most(W::load(&node.hi[2])));
    W::bits(W::both(W::both(along_x, along_y), along_z))
}

/// Lanes above 0, as bits.
#[inline(always)]
fn positive<W: Wide>(w: W) -> u32 {
    W::bits(W::splat(0.0).below(w))
}

/// 1 - q of eight ellipsoids at `x`.
#[inline(always)]
fn weights<W: Wide>(leaf: &Leaf, x: &[W; 3]) -> W {
    let p = &leaf.p;
    let d = [x[0].minus(W::load(&p[0])), x[1].minus(W::load(&p[1])), x[2].minus(W::load(&p[2]))];
    let [r, s, n] = &leaf.rows;
    let (r, s, n) = (dot(r, &d), dot(s, &d), dot(n, &d));
    W::splat(1.0).minus(r.times(r).plus(s.times(s)).plus(n.times(n)))
}
