//! Nearest hit and occlusion, written once over a [`Kernel`] that does the arithmetic of a node or a leaf.
//!
//! Boxes: slab test with far distances scaled by 1 + 4 eps, twice what rounding can do (Ize 2013, "Robust BVH Ray
//! Traversal"). Triangles: Woop, Benthin, Wald 2013, "Watertight Ray/Triangle Intersection", on rays sheared to an axis:
//! an edge function is a difference of two products of rounded vertex positions, and rounding is monotone, so its sign is
//! right or it is zero. Zero counts as inside, hence no gap at an edge or vertex that triangles share (they may
//! both be hit). The distance comes from the triangle's plane, so that on an axis-aligned wall its sign is exact.

use super::layout::{Child, Node8, Tree, Tri4, View};
use super::{Hit, Ray};

/// Twice the rounding error of a slab distance is 6 half ulps; 8 are allowed.
const FAR_SCALE: f32 = 1.0 + 4.0 * f32::EPSILON;

/// A ray, prepared for queries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Query {
    pub o: [f32; 3],
    pub d: [f32; 3],
    /// 1 / d; infinite where d is zero.
    pub inv: [f32; 3],
    /// The same, enlarged, for far planes.
    pub inv_far: [f32; 3],
    /// Row of `Node8::bounds` with the near planes of each axis; `near ^ 1` has the far ones.
    pub near: [usize; 3],
    /// Axes of the sheared system: the longest component of d comes last.
    pub k: [usize; 3],
    /// Origin in these axes.
    pub o_k: [f32; 3],
    /// Shear: d[k[0]] / d[k[2]] and d[k[1]] / d[k[2]].
    pub shear: [f32; 2],
    pub tmin: f32,
    /// The end of the ray or the nearest hit so far; finite.
    pub tmax: f32,
}

impl Query {
    /// None if nothing can be hit: a component that is not finite, no direction, an empty interval.
    #[inline(always)]
    fn new(ray: &Ray) -> Option<Self> {
        let (o, d) = (ray.o.to_array(), ray.d.to_array());
        let [ax, ay, az] = d.map(f32::abs);
        let kz = if ax > ay && ax > az {
            0
        } else if ay > az {
            1
        } else {
            2
        };
        let k = [(kz + 1) % 3, (kz + 2) % 3, kz];
        // A negative start would need near planes scaled the other way.
        let tmin = if ray.tmin > 0.0 { ray.tmin } else { 0.0 };
        let tmax = ray.tmax.min(f32::MAX);
        let valid = ray.o.is_finite() && ray.d.is_finite() && d[kz] != 0.0 && tmin <= tmax && !ray.tmax.is_nan();
        if !valid {
            return None;
        }
        let inv = d.map(|d| 1.0 / d);
        let near = |axis: usize| 2 * axis + inv[axis].is_sign_negative() as usize;
        Some(Query {
            o,
            d,
            inv,
            inv_far: inv.map(|i| i * FAR_SCALE),
            near: [near(0), near(1), near(2)],
            k,
            o_k: k.map(|axis| o[axis]),
            shear: [d[k[0]] / d[kz], d[k[1]] / d[kz]],
            tmin,
            tmax,
        })
    }

    /// Bound for near distances: far ones and the end of the ray are enlarged alike.
    #[inline(always)]
    pub fn tmax_far(&self) -> f32 {
        self.tmax * FAR_SCALE
    }
}

/// Edge functions and distance of the four triangles of a pack.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(super) struct TriHits {
    /// Edge functions opposite to the first, second and third vertex, times one common sign.
    pub edge: [[f32; 4]; 3],
    /// Sum of the edge functions.
    pub det: [f32; 4],
    pub t: [f32; 4],
}

/// Entry distances of the eight boxes of a node.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Near(pub [f32; 8]);

/// The arithmetic. Implementations must agree bit for bit: same operations in the same order, maximum and minimum
/// taken as `if a > b { a } else { b }` and `if a < b { a } else { b }`.
pub(super) trait Kernel {
    /// Slots whose box the ray meets, as bits, and where.
    fn boxes(query: &Query, node: &Node8) -> (u32, Near);

    /// Lanes of the pack that the ray hits in [tmin, tmax], as bits; `hits` is written only if there is one.
    fn triangles(query: &Query, pack: &Tri4, hits: &mut TriHits) -> u32;

    /// Hint that a child will soon be read.
    fn prefetch(tree: View, child: Child);
}

/// Stack of children still to visit. An entry is the entry distance (bits of a float that is not negative: they
/// sort as integers do) above the child.
struct Stack<const N: usize> {
    entries: [u64; N],
    len: usize,
}

impl<const N: usize> Stack<N> {
    #[inline(always)]
    fn new() -> Self {
        Stack { entries: [0; N], len: 0 }
    }

    /// Fails unless the children of a node (all but one) can be pushed.
    #[inline(always)]
    fn reserve(&self) -> Result<(), Overflow> {
        if self.len + 7 <= N { Ok(()) } else { Err(Overflow) }
    }

    #[inline(always)]
    fn push(&mut self, entry: u64) {
        self.entries[self.len] = entry;
        self.len += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<u64> {
        self.len = self.len.checked_sub(1)?;
        Some(self.entries[self.len])
    }
}

#[inline(always)]
fn entry(near: &Near, node: &Node8, slot: usize) -> u64 {
    (near.0[slot & 7].to_bits() as u64) << 32 | node.children[slot & 7].0 as u64
}

#[inline(always)]
fn child_of(entry: u64) -> Child {
    Child(entry as u32)
}

#[inline(always)]
fn next_slot(mask: &mut u32) -> usize {
    let slot = mask.trailing_zeros();
    *mask &= *mask - 1;
    slot as usize
}

/// Entries of the first stack tried. Few rays need more, and a short one is cheaper to set up.
const SHORT_STACK: usize = 32;

/// Entries of the stack for the others. The builder limits the depth of trees so that it suffices.
pub(super) const LONG_STACK: usize = 320;

/// The stack was too short for this ray.
struct Overflow;

/// Nearest hit.
#[inline(always)]
pub(super) fn closest<K: Kernel>(tree: &Tree, ray: &Ray) -> Option<Hit> {
    let mut query = Query::new(ray)?;
    let tree = tree.view();
    closest_with::<K, SHORT_STACK>(tree, ray, &mut query)
        .or_else(|Overflow| closest_with::<K, LONG_STACK>(tree, ray, &mut Query::new(ray).ok_or(Overflow)?))
        .unwrap_or(None)
}

/// Whether there is a hit.
#[inline(always)]
pub(super) fn occluded<K: Kernel>(tree: &Tree, ray: &Ray) -> bool {
    let Some(query) = Query::new(ray) else { return false };
    let tree = tree.view();
    occluded_with::<K, SHORT_STACK>(tree, ray, &query)
        .or_else(|Overflow| occluded_with::<K, LONG_STACK>(tree, ray, &query))
        .unwrap_or(false)
}

#[inline(always)]
fn closest_with<K: Kernel, const N: usize>(tree: View, ray: &Ray, query: &mut Query) -> Result<Option<Hit>, Overflow> {
    let mut best: Option<Hit> = None;
    let mut current;
    let Some(mut node) = tree.nodes.first() else {
        return Ok(None);
    };
    let mut stack = Stack::<N>::new();
    loop {
        // Down to a leaf, nearest child first.
        loop {
            let (mut mask, near) = K::boxes(query, node);
            if mask == 0 {
                current = Child::NONE;
                break;
            }
            let slot = next_slot(&mut mask);
            current = node.children[slot & 7];
            if mask != 0 {
                let mut first = entry(&near, node, slot);
                stack.reserve()?;
                let base = stack.len;
                while mask != 0 {
                    let other = entry(&near, node, next_slot(&mut mask));
                    K::prefetch(tree, child_of(first.max(other)));
                    stack.push(first.max(other));
                    first = first.min(other);
                }
                sort_descending(&mut stack.entries[base..stack.len]);
                current = child_of(first);
            }
            if !current.is_node() {
                break;
            }
            node = &tree.nodes[current.index()];
        }
        // Leaves, until the next node comes up.
        loop {
            if current != Child::NONE {
                leaf::<K>(tree, current, ray, query, &mut best);
            }
            let limit = query.tmax_far();
            current = loop {
                let Some(entry) = stack.pop() else { return Ok(best) };
                if f32::from_bits((entry >> 32) as u32) <= limit {
                    break child_of(entry);
                }
            };
            if current.is_node() {
                node = &tree.nodes[current.index()];
                break;
            }
        }
    }
}

/// Sorts a few entries so that the nearest is popped first.
#[inline(always)]
pub(super) fn sort_descending(entries: &mut [u64]) {
    for i in 1..entries.len() {
        let moved = entries[i];
        let mut j = i;
        while j > 0 && entries[j - 1] < moved {
            entries[j] = entries[j - 1];
            j -= 1;
        }
        entries[j] = moved;
    }
}

/// Takes the hits of a leaf into `best`. Of hits at equal t the lowest (shape, prim) wins.
#[inline(always)]
fn leaf<K: Kernel>(tree: View, child: Child, ray: &Ray, query: &mut Query, best: &mut Option<Hit>) {
    let mut consider = |query: &mut Query, hit: Hit| {
        let wins = match best {
            Some(b) => hit.t < b.t || (hit.t == b.t && (hit.shape, hit.prim) < (b.shape, b.prim)),
            None => true,
        };
        if wins {
            query.tmax = hit.t;
            *best = Some(hit);
        }
    };
    if child.is_quadric() {
        let quadric = &tree.quadrics[child.index()];
        if let Some(t) = quadric.intersect(ray.o, ray.d, query.tmin, query.tmax) {
            let (u, v, shape, prim) = (0.0, 0.0, quadric.shape, 0);
            consider(query, Hit { t, u, v, shape, prim });
        }
        return;
    }
    let pack = &tree.tris[child.index()];
    let mut hits = NO_HITS;
    let mut mask = K::triangles(query, pack, &mut hits);
    while mask != 0 {
        let lane = next_slot(&mut mask) & 3;
        let hit = Hit {
            t: hits.t[lane],
            u: hits.edge[1][lane] / hits.det[lane],
            v: hits.edge[2][lane] / hits.det[lane],
            shape: pack.shape,
            prim: pack.prim[lane],
        };
        consider(query, hit);
    }
}

const NO_HITS: TriHits = TriHits { edge: [[0.0; 4]; 3], det: [0.0; 4], t: [0.0; 4] };

#[inline(always)]
fn occluded_with<K: Kernel, const N: usize>(tree: View, ray: &Ray, query: &Query) -> Result<bool, Overflow> {
    if tree.nodes.is_empty() {
        return Ok(false);
    }
    let mut stack = Stack::<N>::new();
    let mut current = Child::node(0);
    loop {
        if current.is_node() {
            let node = &tree.nodes[current.index()];
            let (mut mask, near) = K::boxes(query, node);
            if mask != 0 {
                let slot = next_slot(&mut mask);
                current = node.children[slot & 7];
                if mask != 0 {
                    let mut first = entry(&near, node, slot);
                    stack.reserve()?;
                    while mask != 0 {
                        // The nearest box goes first, the others as they come.
                        let other = entry(&near, node, next_slot(&mut mask));
                        K::prefetch(tree, child_of(first.max(other)));
                        stack.push(first.max(other));
                        first = first.min(other);
                    }
                    current = child_of(first);
                }
                continue;
            }
        } else if current.is_quadric() {
            let quadric = &tree.quadrics[current.index()];
            if quadric.intersect(ray.o, ray.d, query.tmin, query.tmax).is_some() {
                return Ok(true);
            }
        } else if K::triangles(query, &tree.tris[current.index()], &mut { NO_HITS }) != 0 {
            return Ok(true);
        }
        match stack.pop() {
            Some(entry) => current = child_of(entry),
            None => return Ok(false),
        }
    }
}
