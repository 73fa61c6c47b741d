//! A hierarchy over virtual lights: what a whole group of them can contribute to a point, at most.
//!
//! ```text
//! bound(x) = reach max_i I_i cos_x cos_y / (d^2 + A/pi)      reach: largest f of the surface, mean of the channels
//!            d: distance to the box of the group; cos_x, cos_y: largest cosines at the surface and at lights of the cone of normals that lie
//!            anywhere in the sphere around the box
//! ```
//!
//! Beside the bound there is an estimate, the same at the middle of the group: what a light of it typically contributes. Probabilities in proportion
//! to bounds alone would waste looks on distant groups, whose boxes make every cosine possible.
//!
//! Binary, cut through the middle of the longest side of the box of positions and normals (as the clusters of shading points are), with up to
//! [`LEAF`] lights in a leaf. Lights are put into the order of the tree, so that groups are ranges and neighbours in space lie side by side.
//! Measure     the bound is a radiance
//! Bias        none: bounds serve as probabilities; even one that is too low only costs variance
//! Source      cones and clamped cosines after Conty Estevez & Kulla 2018; METHODS 2.B (thinning)
//! Verified by tests of `strategies`: no light above the bound of any of its groups

use super::visibility::VisibilityCache;
use super::visibility::clusters::{Point6, longest_side, point6, scale};
use super::vpl::{Vpl, Vpls};
use crate::math::Vec3;

/// Most lights in a leaf.
pub const LEAF: usize = 8;

/// Least share of visible lights that is believed of a group.
const LEAST_SHARE: f32 = 0.03;
/// Bound over estimate, at most.
const NARROWEST: f32 = 8.0;

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

    /// What one of its lights contributes at most at `p` to a surface of the given reach, and what [`Self::typical`] asks for; `n`: nothing
    /// comes from below its plane.
    #[inline]
    pub fn bound(&self, p: Vec3, n: Option<Vec3>, reach: f32) -> (f32, Aspect) {
        let d = self.centre - p;
        let centre2 = d.length_squared();
        let distance2 = (d.abs() - self.half).max(Vec3::ZERO).length_squared();
        // Nothing is divided by the distance to a box that is touched.
        let inverse = 1.0 / distance2.max(f32::MIN_POSITIVE).sqrt();
        let height = n.map_or(0.0, |n| d.dot(n));
        let facing = -d.dot(self.axis);
        let flux = reach * self.strength;
        let aspect = Aspect { flux, centre2, height, facing, one_sided: n.is_some() };
        let slack = self.sphere * 1.0001 + 1e-6 * d.abs().max_element();
        let cos_x = match n {
            Some(_) if height + slack <= 0.0 => return (0.0, aspect),
            Some(_) => ((height + slack) * inverse).min(1.0),
            None => 1.0,
        };
        // cos (a - b) <= cos a + sin b for angles a to the axis and b of the cone, both below a right angle; nothing if a - b is beyond one.
        let cos_y = if self.cos <= 0.0 {
            1.0
        } else if facing + slack > 0.0 {
            ((facing + slack) * inverse + self.sin).min(1.0)
        } else if facing + slack < -self.sin * (centre2.sqrt() + slack) {
            return (0.0, aspect);
        } else {
            self.sin
        };
        (flux * cos_x * cos_y / (distance2 + self.radius2).max(f32::MIN_POSITIVE), aspect)
    }

    /// What one of its lights typically contributes where [`Self::bound`] has given these: never less than an eighth of the bound.
    #[inline]
    pub fn typical(&self, bound: f32, at: &Aspect) -> f32 {
        // Lights of a box lie a third of its sphere's squared radius from its middle, on average.
        let d2 = at.centre2 + self.sphere * self.sphere * (1.0 / 3.0);
        let facing = at.facing.max(0.0);
        let cosines = if at.one_sided { at.height.max(0.0) * facing } else { facing * d2.sqrt() };
        let typical = at.flux * cosines / (d2 * (d2 + self.radius2));
        if typical < bound { typical.max(bound * (1.0 / NARROWEST)) } else { bound }
    }
}

/// How a group lies to a point.
#[derive(Clone, Copy, Debug)]
pub struct Aspect {
    /// Reach times strength.
    flux: f32,
    /// Squared distance of the middle.
    centre2: f32,
    /// Of the middle above the surface's plane.
    height: f32,
    /// Of the point along the axis of the group.
    facing: f32,
    one_sided: bool,
}

/// The hierarchy; node 0 is the root, if there is any light.
#[derive(Clone, Debug, Default)]
pub struct VplTree {
    nodes: Vec<Node>,
    /// Root of the share of lights that a cache point sees, by cache point and node: neighbouring points ask one row.
    seen: Vec<f32>,
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

    /// Counts for every node what the cache points see of its lights.
    pub fn count_visible(&mut self, cache: &VisibilityCache) {
        let points = cache.points().len();
        self.seen = vec![1.0; self.nodes.len() * points];
        for point in 0..points {
            let mut sums = vec![[0u32; 2]];
            for (visible, telling) in cache.bits(point) {
                let [v, t] = sums[sums.len() - 1];
                sums.push([v + u32::from(visible), t + u32::from(telling)]);
            }
            for (i, node) in self.nodes.iter().enumerate() {
                let (a, b) = (sums[node.first as usize], sums[(node.first + node.count) as usize]);
                // As if one half of one more light had been seen.
                let share = ((b[0] - a[0]) as f32 + 0.5) / ((b[1] - a[1]) as f32 + 1.0);
                self.seen[point * self.nodes.len() + i] = share.max(LEAST_SHARE).sqrt();
            }
        }
    }

    /// Root of the share of each node's lights that a cache point sees; empty where none was asked.
    #[inline]
    pub fn seen(&self, cache_point: Option<u32>) -> &[f32] {
        let row = |c: u32| c as usize * self.nodes.len()..(c as usize + 1) * self.nodes.len();
        cache_point.and_then(|c| self.seen.get(row(c))).unwrap_or(&[])
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
