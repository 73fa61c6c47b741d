//! A hierarchy over virtual lights.
//!
//! Binary, cut through the middle of the longest side of the box of positions and normals (as the clusters of shading points are), with up to
//! [`LEAF`] lights in a leaf. Lights are put into the order of the tree, so that groups are ranges and neighbours in space lie side by side.
//! What a whole group can contribute to a point: [`groups`].
//! Bias        none: any hierarchy gives the same mean
//! Verified by tests of `strategies`

pub mod groups;

use self::groups::GroupTree;
use super::visibility::VisibilityCache;
use super::visibility::clusters::{Point6, longest_side, point6, scale};
use super::vpl::{Vpl, Vpls};
use crate::math::Vec3;

/// Most lights in a leaf.
pub const LEAF: usize = 8;

/// A group of lights.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    centre: Vec3,
    half: Vec3,
    axis: Vec3,
    cos: f32,
    sin: f32,
    /// Radius of the sphere around the box.
    sphere: f32,
    /// Largest intensity.
    strength: f32,
    /// Smallest A / pi.
    radius2: f32,
    /// Largest squared range, for stochastic culling ([`VplTree::set_ranges`]).
    range2: f32,
    /// First light.
    pub first: u32,
    /// Number of lights.
    pub count: u32,
    /// Children: the next node and this one; 0 in leaves.
    right: u32,
}

impl Node {
    /// Whether it has no children.
    pub fn is_leaf(&self) -> bool {
        self.right == 0
    }

    /// Largest intensity of its lights, mean of the channels, W/sr.
    pub fn strength(&self) -> f32 {
        self.strength
    }

    /// Squared distance from its box.
    pub fn distance2(&self, p: Vec3) -> f32 {
        ((self.centre - p).abs() - self.half).max(Vec3::ZERO).length_squared()
    }

    /// Whether some light of it can be in range of `p` in this pass.
    pub fn in_range(&self, p: Vec3) -> bool {
        self.distance2(p) <= self.range2 * 1.0001
    }
}

/// The hierarchy; node 0 is the root, if there is any light.
#[derive(Clone, Debug, Default)]
pub struct VplTree {
    nodes: Vec<Node>,
    groups: GroupTree,
}

impl VplTree {
    /// The tree over the lights, which it puts in order.
    pub fn build(vpls: &mut Vpls) -> Self {
        let scale = scale(vpls.lights.iter().map(|l| l.p));
        let points: Vec<Point6> = vpls.lights.iter().map(|l| point6(l.p, l.n, scale)).collect();
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut tree = VplTree::default();
        if !order.is_empty() {
            tree.grow(&vpls.lights, &points, &mut order, 0);
        }
        tree.groups = GroupTree::new(&tree.nodes);
        vpls.lights = order.iter().map(|&i| vpls.lights[i as usize]).collect();
        tree
    }

    fn grow(&mut self, lights: &[Vpl], points: &[Point6], list: &mut [u32], first: usize) -> usize {
        let index = self.nodes.len();
        self.nodes.push(leaf(lights, list, first));
        let (side, axis, middle) = longest_side(points, list);
        if list.len() <= LEAF {
            return index;
        }
        list.sort_by_key(|&i| points[i as usize][axis] > middle);
        let below = list.iter().take_while(|&&i| points[i as usize][axis] <= middle).count();
        let cut = if side <= 0.0 || below == 0 || below == list.len() { list.len() / 2 } else { below };
        let (a, b) = list.split_at_mut(cut);
        let left = self.grow(lights, points, a, first);
        let right = self.grow(lights, points, b, first + cut);
        let (a, b) = (self.nodes[left], self.nodes[right]);
        self.nodes[index].set_cone(&union(&a, &b));
        self.nodes[index].right = right as u32;
        index
    }

    /// The nodes.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The children of a node that is no leaf.
    pub fn children(&self, index: u32) -> [u32; 2] {
        [index + 1, self.nodes[index as usize].right]
    }

    /// Squared ranges of the lights in this pass, for [`Node::in_range`].
    pub fn set_ranges(&mut self, range2: &[f32]) {
        // Children come behind their parents.
        for i in (0..self.nodes.len()).rev() {
            let node = self.nodes[i];
            self.nodes[i].range2 = if node.is_leaf() {
                let lights = node.first as usize..(node.first + node.count) as usize;
                range2[lights].iter().copied().fold(0.0, f32::max)
            } else {
                self.nodes[i + 1].range2.max(self.nodes[node.right as usize].range2)
            };
        }
    }

    /// The same by eights, with bounds.
    pub fn groups(&self) -> &GroupTree {
        &self.groups
    }

    /// Counts for every group what the cache points see of its lights.
    pub fn count_visible(&mut self, cache: &VisibilityCache) {
        self.groups.count_visible(cache);
    }
}

impl Node {
    fn set_cone(&mut self, cone: &(Vec3, f32)) {
        self.axis = cone.0;
        // A little wider against rounding.
        self.cos = (cone.1 - 1e-5).max(-1.0);
        self.sin = (1.0 - self.cos * self.cos).max(0.0).sqrt();
    }
}

fn leaf(lights: &[Vpl], list: &[u32], first: usize) -> Node {
    let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (mut strength, mut radius2, mut sum) = (0.0f32, f32::INFINITY, Vec3::ZERO);
    for l in list.iter().map(|&i| &lights[i as usize]) {
        (lo, hi) = (lo.min(l.p), hi.max(l.p));
        strength = strength.max(l.strength);
        radius2 = radius2.min(l.radius2);
        sum += l.n;
    }
    let axis = sum.try_normalize().unwrap_or(Vec3::Z);
    let turned = |l: &Vpl| if l.is_isotropic() { -1.0 } else { l.n.dot(axis) };
    let cos = list.iter().map(|&i| turned(&lights[i as usize])).fold(1.0, f32::min);
    let half = 0.5 * (hi - lo);
    let mut node = Node {
        centre: lo + half,
        half,
        axis,
        cos: 1.0,
        sin: 0.0,
        sphere: half.length(),
        strength,
        radius2,
        range2: f32::INFINITY,
        first: first as u32,
        count: list.len() as u32,
        right: 0,
    };
    node.set_cone(&(axis, cos));
    node
}

/// A cone around those of two nodes: axis and cosine.
fn union(a: &Node, b: &Node) -> (Vec3, f32) {
    let Some(axis) = (a.axis + b.axis).try_normalize() else { return (Vec3::Z, -1.0) };
    let widest = |n: &Node| n.axis.dot(axis).clamp(-1.0, 1.0).acos() + n.cos.clamp(-1.0, 1.0).acos();
    let angle = widest(a).max(widest(b)) + 1e-4;
    (axis, if angle < std::f32::consts::PI { angle.cos() } else { -1.0 })
}
