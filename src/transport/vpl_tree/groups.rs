//! Groups of virtual lights, eight at a time: what each can contribute to a point, at most and typically.
//!
//! ```text
//! bound(x)   = reach max_i I_i cos_x cos_y / (d^2 + A/pi)      reach: largest f of the surface, mean of the channels
//!              d: distance to the box of the group; cos_x, cos_y: largest cosines at the surface and at lights of the cone of normals that
//!              lie anywhere in the sphere around the box:  cos_x <= (h + s) / d,  cos_y <= (g + s) / d + sin b
//!              h, g: of the middle above the surface's plane, of the point along the cone's axis; s: radius of the sphere; b: of the cone
//! typical(x) = reach max_i I_i cos_x cos_y / (d^2 + A/pi)      the same at the middle of the group, d^2 with a third of s^2 added
//! ```
//!
//! Probabilities in proportion to bounds alone would waste looks on distant groups, whose boxes make every cosine possible: hence the estimate,
//! which is never less than an eighth of the bound.
//!
//! The binary tree with up to three levels in one: of a group's children the largest are replaced by theirs, until there are eight. Their
//! bounds lie side by side (`eight`), and what does not depend on the point is computed when they are built.
//! Measure     both are radiances
//! Bias        none: they serve as probabilities; even a bound that is too low only costs variance, as long as it is above 0 wherever a light is
//! Source      cones and clamped cosines after Conty Estevez & Kulla 2018; METHODS 2.B (thinning)
//! Verified by tests of `strategies`: no light above the bound of any of its groups, every light in one leaf

use super::Node;
use crate::math::Vec3;
use crate::transport::eight::{Eight, WIDTH, Wide, all, dot, lanes, splat3};
use crate::transport::visibility::VisibilityCache;

/// Least share of visible lights that is believed of a group.
const LEAST_SHARE: f32 = 0.03;
/// Bound over estimate, at most.
const NARROWEST: f32 = 8.0;
/// In place of the index of a leaf's children.
pub const LEAF_GROUP: u32 = 0;

/// Up to eight groups of lights, one beside the other.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Groups {
    centre: [Eight; 3],
    half: [Eight; 3],
    axis: [Eight; 3],
    /// Of the cone; more than 1 for cones beyond a half space, where the cosine is 1 whatever is added.
    sin: Eight,
    /// Radius of the sphere around the box, a little more against rounding.
    slack: Eight,
    /// A third of its square: the mean squared distance of a box's lights from its middle.
    spread2: Eight,
    /// Largest intensity; 0 in lanes without a group.
    strength: Eight,
    /// Smallest A / pi.
    radius2: Eight,
    /// Number of lights.
    size: Eight,
    /// First light.
    pub first: [u32; WIDTH],
    /// Number of lights.
    pub count: [u32; WIDTH],
    /// Index of the groups within; [`LEAF_GROUP`] of leaves.
    pub within: [u32; WIDTH],
    /// Lanes with a group.
    pub used: u32,
}

/// A point as groups see it.
#[derive(Clone, Copy, Debug)]
pub struct Point<W> {
    p: [W; 3],
    /// Of the plane below which nothing comes; zero without one.
    n: [W; 3],
    one_sided: bool,
    reach: W,
}

impl<W: Wide> Point<W> {
    /// The point `p` of a surface of the given reach; `n`: nothing comes from below its plane.
    #[inline(always)]
    pub fn new(p: Vec3, n: Option<Vec3>, reach: f32) -> Self {
        Point { p: splat3(p), n: splat3(n.unwrap_or(Vec3::ZERO)), one_sided: n.is_some(), reach: W::splat(reach) }
    }
}

/// What becomes of eight groups; lanes as bits.
#[derive(Clone, Copy, Debug)]
pub struct Sorted {
    /// Something may come from them.
    pub lit: u32,
    /// More lights than so many would be looked at, by bounds.
    pub many: u32,
    /// By the bound, each light would be.
    pub sure: u32,
    /// Probability that a light is looked at, before limits.
    pub pi: Eight,
}

impl Groups {
    /// Bound and typical contribution of a light of each group.
    #[inline(always)]
    pub fn bounds<W: Wide>(&self, at: &Point<W>) -> [W; 2] {
        let (zero, one, tiny) = (W::splat(0.0), W::splat(1.0), W::splat(f32::MIN_POSITIVE));
        let (x, y) = (W::load(&self.centre[0]).minus(at.p[0]), W::load(&self.centre[1]).minus(at.p[1]));
        let z = W::load(&self.centre[2]).minus(at.p[2]);
        let (size_x, size_y, size_z) = (x.size(), y.size(), z.size());
        let centre2 = x.times(x).plus(y.times(y)).plus(z.times(z));
        let out_x = size_x.minus(W::load(&self.half[0])).larger(zero);
        let out_y = size_y.minus(W::load(&self.half[1])).larger(zero);
        let out_z = size_z.minus(W::load(&self.half[2])).larger(zero);
        let distance2 = out_x.times(out_x).plus(out_y.times(out_y)).plus(out_z.times(out_z));
        // Nothing is divided by the distance to a box that is touched.
        let inverse = one.over(distance2.larger(tiny).root());
        let facing = zero.minus(dot(&self.axis, &[x, y, z]));
        let flux = at.reach.times(W::load(&self.strength));
        let slack = W::load(&self.slack).plus(W::splat(1e-6).times(size_x.larger(size_y).larger(size_z)));
        // cos (a - b) <= cos a + sin b for angles a to the axis and b of the cone, both below a right angle; nothing if a - b is beyond one.
        let sin = W::load(&self.sin);
        let nearest = facing.plus(slack);
        let centre = centre2.root();
        let turned = zero.at_most(nearest.plus(sin.times(centre.plus(slack))));
        let cos_y = nearest.larger(zero).times(inverse).plus(sin).smaller(one).kept(turned);
        let near2 = distance2.plus(W::load(&self.radius2)).larger(tiny);
        let middle2 = centre2.plus(W::load(&self.spread2));
        let far2 = middle2.times(middle2.plus(W::load(&self.radius2))).larger(tiny);
        let facing = facing.larger(zero);
        let (bound, typical) = if at.one_sided {
            let height = x.times(at.n[0]).plus(y.times(at.n[1])).plus(z.times(at.n[2]));
            let cos_x = height.plus(slack).larger(zero).times(inverse).smaller(one);
            (cos_x.times(cos_y), height.larger(zero).times(facing))
        } else {
            (cos_y, facing.times(middle2.root()))
        };
        let bound = flux.times(bound).over(near2);
        let typical = flux.times(typical).over(far2);
        [bound, typical.larger(bound.times(W::splat(1.0 / NARROWEST))).smaller(bound)]
    }

    /// What becomes of the groups; `seen`: roots of the shares of their lights that are seen; `scale`: probability of a look per contribution, where
    /// all are; `open`: expected number of looks that is too many for a group.
    #[inline(always)]
    pub fn sort<W: Wide>(&self, at: &Point<W>, seen: &Eight, scale: W, open: W) -> Sorted {
        let [bound, typical] = self.bounds(at);
        let scale = scale.times(W::load(seen));
        let most = bound.times(scale);
        Sorted {
            lit: W::bits(W::splat(0.0).below(bound)),
            many: W::bits(open.below(W::load(&self.size).times(most))),
            sure: W::bits(W::splat(1.0).at_most(most)),
            pi: typical.times(scale).store(),
        }
    }
}

/// Groups, and what cache points see of them.
#[derive(Clone, Debug, Default)]
pub struct GroupTree {
    nodes: Vec<Groups>,
    /// Root of the share of lights that a cache point sees, by cache point and groups: neighbouring points ask one row.
    seen: Vec<Eight>,
    /// Of no cache point.
    unknown: Vec<Eight>,
}

impl GroupTree {
    /// The groups of a binary tree.
    pub(super) fn new(tree: &[Node]) -> Self {
        let mut out = GroupTree::default();
        if !tree.is_empty() {
            out.grow(tree, 0);
        }
        out.unknown = vec![all(1.0); out.nodes.len()];
        out
    }

    fn grow(&mut self, tree: &[Node], root: usize) -> u32 {
        let index = self.nodes.len();
        let mut members = vec![root];
        while members.len() < WIDTH {
            let open = (0..members.len()).filter(|&k| !tree[members[k]].is_leaf());
            // The first of the largest.
            let Some(k) = open.rev().max_by_key(|&k| tree[members[k]].count) else { break };
            let at = members[k];
            members.splice(k..=k, [at + 1, tree[at].right as usize]);
        }
        self.nodes.push(Groups::of(tree, &members));
        for (lane, &member) in members.iter().enumerate() {
            if !tree[member].is_leaf() {
                self.nodes[index].within[lane] = self.grow(tree, member);
            }
        }
        index as u32
    }

    /// The groups, eight by eight: first those of the whole, then those within.
    pub fn nodes(&self) -> &[Groups] {
        &self.nodes
    }

    /// Counts for every group what the cache points see of its lights.
    pub(super) fn count_visible(&mut self, cache: &VisibilityCache) {
        self.seen.clear();
        let mut sums = Vec::new();
        for point in 0..cache.points().len() {
            sums.clear();
            let (mut v, mut t) = (0u32, 0u32);
            sums.push([v, t]);
            for (visible, telling) in cache.bits(point) {
                (v, t) = (v + u32::from(visible), t + u32::from(telling));
                sums.push([v, t]);
            }
            for node in &self.nodes {
                let share = |lane: usize| {
                    let first = node.first[lane] as usize;
                    let (a, b) = (sums[first], sums[first + node.count[lane] as usize]);
                    // As if one half of one more light had been seen.
                    (((b[0] - a[0]) as f32 + 0.5) / ((b[1] - a[1]) as f32 + 1.0)).max(LEAST_SHARE).sqrt()
                };
                self.seen.push(lanes(&std::array::from_fn(share)));
            }
        }
    }

    /// Root of the share of each group's lights that a cache point sees; 1 where none was asked.
    #[inline]
    pub fn seen(&self, cache_point: Option<u32>) -> &[Eight] {
        let row = |c: u32| c as usize * self.nodes.len()..(c as usize + 1) * self.nodes.len();
        cache_point.and_then(|c| self.seen.get(row(c))).unwrap_or(&self.unknown)
    }
}

impl Groups {
    fn of(tree: &[Node], members: &[usize]) -> Self {
        let of = |f: &dyn Fn(&Node) -> f32| {
            lanes(&std::array::from_fn(|lane| members.get(lane).map_or(0.0, |&m| f(&tree[m]))))
        };
        let of3 = |f: &dyn Fn(&Node) -> Vec3| [0, 1, 2].map(|axis| of(&|node| f(node)[axis]));
        let whole =
            |f: &dyn Fn(&Node) -> u32| std::array::from_fn(|lane| members.get(lane).map_or(0, |&m| f(&tree[m])));
        Groups {
            centre: of3(&|n| n.centre),
            half: of3(&|n| n.half),
            axis: of3(&|n| n.axis),
            sin: of(&|n| if n.cos <= 0.0 { 2.0 } else { n.sin }),
            slack: of(&|n| n.sphere * 1.0001),
            spread2: of(&|n| n.sphere * n.sphere * (1.0 / 3.0)),
            strength: of(&|n| n.strength),
            radius2: of(&|n| n.radius2),
            size: of(&|n| n.count as f32),
            first: whole(&|n| n.first),
            count: whole(&|n| n.count),
            within: [LEAF_GROUP; WIDTH],
            used: (1 << members.len()) - 1,
        }
    }
}
