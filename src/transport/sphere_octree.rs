//! Octree over spheres: which of them contain a point?
//!
//! A sphere lies in the nodes of that level whose edge is between one and two of its diameters (so in eight at most) that
//! its box overlaps. All spheres that contain a point are found on the way from the root to the point's leaf.
//! Source      Ward, Rubinstein, Clear 1988, section "Caching"; the level by size as in Ericson 2005, chapter 7
//! Cost        a look-up visits one node per level and the spheres in them; it allocates nothing. Spheres are added one by
//!             one; [`SphereOctree::pack`] puts what belongs together side by side
//! Not handled spheres larger than the root's edge are in the root; points outside of the root's cube see those only
//! Verified by the tests below: brute force

use crate::math::Vec3;

/// Deepest level: edges of 2^-14 of the root.
const MAX_LEVEL: u32 = 14;
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Node {
    children: [u32; 8],
    /// First entry of the list.
    entries: u32,
}

const EMPTY: Node = Node { children: [NONE; 8], entries: NONE };

#[derive(Clone, Copy, Debug)]
struct Entry {
    center: Vec3,
    radius_sq: f32,
    id: u32,
    next: u32,
}

/// The tree.
#[derive(Clone, Debug)]
pub struct SphereOctree {
    low: Vec3,
    edge: f32,
    nodes: Vec<Node>,
    entries: Vec<Entry>,
}

impl SphereOctree {
    /// An empty tree over the cube around `center` with half the edge `half`.
    pub fn new(center: Vec3, half: f32) -> Self {
        SphereOctree { low: center - half, edge: 2.0 * half, nodes: vec![EMPTY], entries: Vec::new() }
    }

    /// Takes all spheres out.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.nodes.push(EMPTY);
        self.entries.clear();
    }

    /// Adds the sphere `id`.
    pub fn insert(&mut self, id: u32, center: Vec3, radius: f32) {
        let level = (0..MAX_LEVEL).take_while(|&l| self.edge / (2u32 << l) as f32 >= 2.0 * radius).count() as u32;
        let (low, high) = (self.cell(center - radius, level), self.cell(center + radius, level));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let node = self.node([x, y, z], level);
                    let next = self.nodes[node].entries;
                    self.nodes[node].entries = self.entries.len() as u32;
                    self.entries.push(Entry { center, radius_sq: radius * radius, id, next });
                }
            }
        }
    }

    /// Integer coordinates of the cell of `level` that holds `p`, clamped to the root.
    fn cell(&self, p: Vec3, level: u32) -> [u32; 3] {
        let cells = (1u32 << level) as f32;
        let q = (p - self.low) * (cells / self.edge);
        q.to_array().map(|c| c.clamp(0.0, cells - 1.0) as u32)
    }

    /// The node of a cell, made with all above it.
    fn node(&mut self, cell: [u32; 3], level: u32) -> usize {
        let mut node = 0;
        for l in (0..level).rev() {
            let child = child_of(cell, l);
            if self.nodes[node].children[child] == NONE {
                self.nodes[node].children[child] = self.nodes.len() as u32;
                self.nodes.push(EMPTY);
            }
            node = self.nodes[node].children[child] as usize;
        }
        node
    }

    /// Puts the spheres of each node side by side, in the order in which they were added.
    pub fn pack(&mut self) {
        let mut packed: Vec<Entry> = Vec::with_capacity(self.entries.len());
        for node in &mut self.nodes {
            let first = packed.len();
            let mut at = node.entries;
            while at != NONE {
                packed.push(self.entries[at as usize]);
                at = self.entries[at as usize].next;
            }
            let end = packed.len();
            packed[first..].reverse();
            for i in first..end {
                packed[i].next = if i + 1 < end { i as u32 + 1 } else { NONE };
            }
            node.entries = if first < end { first as u32 } else { NONE };
        }
        self.entries = packed;
    }

    /// Calls `found` with every sphere that contains `p`, until it returns false. Each is met once.
    #[inline]
    pub fn containing(&self, p: Vec3, mut found: impl FnMut(u32) -> bool) {
        let cell = self.cell(p, MAX_LEVEL);
        let mut node = &self.nodes[0];
        let mut level = MAX_LEVEL;
        loop {
            let mut at = node.entries;
            while at != NONE {
                let e = &self.entries[at as usize];
                if (p - e.center).length_squared() < e.radius_sq && !found(e.id) {
                    return;
                }
                at = e.next;
            }
            if level == 0 {
                return;
            }
            level -= 1;
            let child = node.children[child_of(cell, level)];
            if child == NONE {
                return;
            }
            node = &self.nodes[child as usize];
        }
    }
}

/// Number of the child that holds the cell, `level` levels above the cell's own.
fn child_of(cell: [u32; 3], level: u32) -> usize {
    let [x, y, z] = cell.map(|c| (c >> level & 1) as usize);
    x | y << 1 | z << 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32};

    #[test]
    fn finds_what_brute_force_finds_once() {
        let r = |i: u64, k: u64| unit_f32(hash(i, k)) * 2.0 - 1.0;
        let spheres: Vec<(Vec3, f32)> = (0..2000)
            .map(|i| (Vec3::new(r(i, 0), r(i, 1), r(i, 2)) * 1.2, 2f32.powf(4.0 * r(i, 3) - 5.0)))
            .chain([(Vec3::ZERO, 5.0), (Vec3::ONE, 0.0), (Vec3::splat(0.3), 1e-9)])
            .collect();
        let mut tree = SphereOctree::new(Vec3::ZERO, 1.0);
        for (i, (c, radius)) in spheres.iter().enumerate() {
            tree.insert(i as u32, *c, *radius);
        }
        let mut packed = tree.clone();
        packed.pack();
        let mut total = 0;
        for i in 0..3000 {
            let p = Vec3::new(r(i, 5), r(i, 6), r(i, 7));
            let expected: Vec<u32> = (0..spheres.len() as u32)
                .filter(|&k| (p - spheres[k as usize].0).length_squared() < spheres[k as usize].1.powi(2))
                .collect();
            total += expected.len();
            for t in [&tree, &packed] {
                let mut found = Vec::new();
                t.containing(p, |id| {
                    found.push(id);
                    true
                });
                found.sort_unstable();
                assert_eq!(found, expected);
            }
        }
        assert!(total > 3000, "the test meets spheres");
    }
}
