//! Which nodes of a binary tree to keep, so that nodes of eight children are cheapest to walk.
//!
//! Source: Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", eq. 2-5: with
//! C(n, i) the least expected cost of the subtree n if it becomes at most i children of a node,
//!   C(n, 1) = cost of a leaf if its primitives fit into one, else area(n) c_node + D(n, 8),
//!   C(n, i) = min(C(n, i-1), D(n, i)),   D(n, i) = min over k of C(left, k) + C(right, i-k).
//! Differing from the paper, what fits into a leaf always becomes one.

use super::layout::Tri4;
use arrayvec::ArrayVec;
use obvhs::bvh2::Bvh2;

/// Cost of testing a pack of triangles, in units of a node's eight boxes with all that follows. Estimated from
/// the operations of both, not tuned.
const LEAF_COST: f32 = 0.6;

/// Primitives of a leaf.
const LEAF_SIZE: u8 = Tri4::LANES as u8;

/// What is known of a subtree.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    /// C(n, i) at i - 1.
    cost: [f32; 7],
    /// At i - 1: the k of D(n, i), or 0 where i - 1 children are better. Index 7 is D(n, 8), always a split.
    split: [u8; 8],
    /// Primitives, up to `LEAF_SIZE` + 1.
    size: u8,
    fits: bool,
}

/// The plan for a whole tree.
pub(super) struct Plan<'a> {
    bvh: &'a Bvh2,
    entries: Vec<Entry>,
}

impl<'a> Plan<'a> {
    /// Plans the tree. `fits` tells whether some primitives can share a leaf, or one be in a leaf with others.
    pub fn new(bvh: &'a Bvh2, fits: impl Fn(&[u32]) -> bool) -> Self {
        let mut plan = Plan { bvh, entries: vec![Entry::default(); bvh.nodes.len()] };
        // Parents before children; taken backwards, children first.
        let mut order = Vec::with_capacity(bvh.nodes.len());
        let mut todo = vec![0u32];
        while let Some(n) = todo.pop() {
            order.push(n);
            let node = &bvh.nodes[n as usize];
            if !node.is_leaf() {
                todo.extend([node.first_index, node.first_index + 1]);
            }
        }
        for n in order.into_iter().rev() {
            plan.entries[n as usize] = plan.entry(n, &fits);
        }
        plan
    }

    fn entry(&self, n: u32, fits: impl Fn(&[u32]) -> bool) -> Entry {
        let node = &self.bvh.nodes[n as usize];
        let area = node.aabb().half_area();
        let leaf = |size| Entry { cost: [area * LEAF_COST; 7], split: [0; 8], size, fits: true };
        if node.is_leaf() {
            let alone = !fits(&[self.bvh.primitive_indices[node.first_index as usize]]);
            return leaf(if alone { LEAF_SIZE + 1 } else { 1 });
        }
        let (left, right) = (self.children(n)[0], self.children(n)[1]);
        let size = (left.size + right.size).min(LEAF_SIZE + 1);
        let mut entry = leaf(size);
        entry.fits = size <= LEAF_SIZE && left.fits && right.fits && fits(&self.primitives_below(n));
        // D(n, i) for i = 2 to 8, at i - 1.
        let mut distributed = [f32::INFINITY; 8];
        for slots in 2..=8usize {
            for k in 1..slots {
                let cost = left.cost[k - 1] + right.cost[slots - k - 1];
                if cost < distributed[slots - 1] {
                    distributed[slots - 1] = cost;
                    entry.split[slots - 1] = k as u8;
                }
            }
        }
        if !entry.fits {
            entry.cost[0] = area + distributed[7];
            for i in 1..7 {
                if distributed[i] < entry.cost[i - 1] {
                    entry.cost[i] = distributed[i];
                } else {
                    entry.cost[i] = entry.cost[i - 1];
                    entry.split[i] = 0;
                }
            }
        } else {
            entry.split[1..7].fill(0);
        }
        entry
    }

    /// Primitives of a subtree with no more of them than a leaf takes.
    pub fn primitives_below(&self, n: u32) -> ArrayVec<u32, { LEAF_SIZE as usize }> {
        let mut found = ArrayVec::new();
        let mut todo = ArrayVec::<u32, { LEAF_SIZE as usize }>::new();
        todo.push(n);
        while let Some(n) = todo.pop() {
            let node = &self.bvh.nodes[n as usize];
            if node.is_leaf() {
                found.push(self.bvh.primitive_indices[node.first_index as usize]);
            } else {
                todo.extend([node.first_index + 1, node.first_index]);
            }
        }
        found
    }

    fn children(&self, n: u32) -> &[Entry] {
        let first = self.bvh.nodes[n as usize].first_index as usize;
        &self.entries[first..first + 2]
    }

    /// Whether a subtree becomes a leaf.
    pub fn is_leaf(&self, n: u32) -> bool {
        self.entries[n as usize].fits
    }

    /// The subtrees that become the children of the node for subtree n.
    pub fn open(&self, n: u32) -> ArrayVec<u32, 8> {
        let mut children = ArrayVec::new();
        let mut todo = ArrayVec::<(u32, u8), 8>::new();
        todo.push((n, 8));
        while let Some((n, mut slots)) = todo.pop() {
            let node = &self.bvh.nodes[n as usize];
            let entry = &self.entries[n as usize];
            while slots > 1 && entry.split[slots as usize - 1] == 0 {
                slots -= 1;
            }
            if slots == 1 || node.is_leaf() {
                children.push(n);
            } else {
                let k = entry.split[slots as usize - 1];
                todo.push((node.first_index + 1, slots - k));
                todo.push((node.first_index, k));
            }
        }
        children
    }
}
