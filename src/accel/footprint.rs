//! The walk with a beam: all primitives that a whole family of rays may meet.
//!
//! A [`Beam`] holds rays o + t d with o and d in boxes; at distance t it fills the box [o0 + t d0, o1 + t d1], so that a node
//! is met if that box meets the node's for some t in [tmin, tmax]: the slab test of a ray, with the smallest speed at far planes
//! and the largest at near ones, and without a far plane along axes in which directions differ in sign. Families whose
//! rays fill a pyramid, a prism or something with a waist add its four sides, by which triangles are sorted out.
//! Conservative: everything that a ray of the beam meets is visited; what is visited need not be met.
//! Nearest nodes come first, and the visitor may shorten the beam as it learns what covers all of it.
//!
//! Source: METHODS 3.B ("cone walk"); the interval slab test is that of interval ray packets (Boulos et al. 2006).
//! Not handled: beams with a coordinate that is not finite (they meet nothing).

use super::Accel;
use super::layout::{Child, Node8, Tree, Tri4};
use super::traverse::{Near, sort_descending};
use crate::math::Vec3;
use arrayvec::ArrayVec;
use std::ops::ControlFlow;

/// Rays o + t d, o and d each in a box.
#[derive(Clone, Copy, Debug)]
pub struct Beam {
    /// Box of the origins (min, max).
    pub o: [Vec3; 2],
    /// Box of the directions (min, max).
    pub d: [Vec3; 2],
    /// Start, not negative.
    pub tmin: f32,
    /// End, may be infinite.
    pub tmax: f32,
    /// Sides of the pyramid or prism that the rays fill, if there is one.
    pub sides: Option<Sides>,
}

/// Four planes: a point x lies inside of one if n . (x - o) >= -slack. With a waist, each side consists of two planes, and it is enough
/// to lie inside of one of them: what lies outside of both is convex, so that a triangle lies there if its corners do.
#[derive(Clone, Copy, Debug)]
pub struct Sides {
    /// A point of all planes (pyramid), or of the middle (prism).
    pub o: Vec3,
    /// Inward normals.
    pub n: [Vec3; 4],
    /// Distance of each plane from `o` (0 for a pyramid) and what rounding may add, times |n|.
    pub slack: [f32; 4],
    /// The second planes.
    pub waist: Option<([Vec3; 4], [f32; 4])>,
}

/// What a walk finds. `Break` ends the walk.
pub trait Visitor {
    /// A triangle of a mesh, or half of a rectangle, that the beam may meet, with its corners.
    fn triangle(&mut self, shape: u32, prim: u32, corners: [Vec3; 3]) -> ControlFlow<()>;

    /// A sphere, disk or cylinder that the beam may meet.
    fn quadric(&mut self, shape: u32) -> ControlFlow<()>;

    /// The beam's present end: what lies beyond need not be visited.
    fn limit(&self) -> f32;
}

/// Rounding of slab distances, as for rays.
const FAR_SCALE: f32 = 1.0 + 8.0 * f32::EPSILON;
/// The same for near faces.
const NEAR_SCALE: f32 = 1.0 - 8.0 * f32::EPSILON;

/// Entries of the stack; the builder limits the depth of trees so that it suffices.
const STACK: usize = super::traverse::LONG_STACK + 8;

/// The arithmetic of a node and of a pack. Implementations agree bit for bit, as those of rays do.
pub(super) trait BeamKernel {
    /// Slots whose box the beam meets before `limit`, as bits, and where it enters.
    fn boxes(slabs: &Slabs, node: &Node8, limit: f32) -> (u32, Near);

    /// Slots whose box may meet the inside of all sides, as bits.
    fn within(sides: &Sides, node: &Node8) -> u32;

    /// Lanes of a pack that hold a triangle which does not lie outside one of the sides, as bits.
    fn lanes(sides: &Sides, pack: &Tri4) -> u32;
}

/// The beam as the slab test wants it: per axis offsets and reciprocals for both faces of a box.
pub(super) struct Slabs {
    /// Largest and smallest origin.
    pub o: [[f32; 2]; 3],
    /// Factor of (min face - largest origin) and of (max face - smallest origin) for entry; 0 where there is none.
    pub enter: [[f32; 2]; 3],
    /// Row (0: min face, 1: max face) and factor for exit; NaN where directions differ in sign, which constrains nothing.
    pub leave: [(usize, f32); 3],
    /// Start.
    pub tmin: f32,
}

impl Slabs {
    #[inline(always)]
    fn new(beam: &Beam) -> Option<Self> {
        let finite = beam.o.iter().chain(&beam.d).all(|v| v.is_finite());
        if !(finite && beam.tmin <= beam.tmax) {
            return None;
        }
        let [o, far_o, slow, fast] = [beam.o[0], beam.o[1], beam.d[0], beam.d[1]].map(|v| v.to_array());
        let [by_slow, by_fast] = [slow, fast].map(|d| d.map(|d| 1.0 / d));
        let mut s =
            Slabs { o: [[0.0; 2]; 3], enter: [[0.0; 2]; 3], leave: [(0, f32::NAN); 3], tmin: beam.tmin.max(0.0) };
        for axis in 0..3 {
            let (up, down) = (fast[axis] > 0.0, slow[axis] < 0.0);
            s.o[axis] = [far_o[axis], o[axis]];
            s.enter[axis] = [
                if up { NEAR_SCALE * by_fast[axis] } else { 0.0 },
                if down { NEAR_SCALE * by_slow[axis] } else { 0.0 },
            ];
            s.leave[axis] = match (slow[axis] > 0.0, fast[axis] < 0.0) {
                (true, _) => (1, FAR_SCALE * by_slow[axis]),
                (_, true) => (0, FAR_SCALE * by_fast[axis]),
                _ => (0, f32::NAN),
            };
        }
        Some(s)
    }
}

/// The kernel for any processor.
pub(super) struct Portable;

impl BeamKernel for Portable {
    #[inline(always)]
    fn boxes(slabs: &Slabs, node: &Node8, limit: f32) -> (u32, Near) {
        let mut near = [slabs.tmin; 8];
        let mut far = [limit; 8];
        for axis in 0..3 {
            let (lo, hi) = (&node.bounds[2 * axis], &node.bounds[2 * axis + 1]);
            let [o_max, o_min] = slabs.o[axis];
            let [e0, e1] = slabs.enter[axis];
            let (row, leave) = slabs.leave[axis];
            let face = &node.bounds[2 * axis + row];
            let from = if row == 0 { o_max } else { o_min };
            for i in 0..8 {
                // Unused slots have infinite faces: 0 * inf is NaN, which constrains nothing, but another axis does.
                near[i] = larger((lo[i] - o_max) * e0, near[i]);
                near[i] = larger((hi[i] - o_min) * e1, near[i]);
                far[i] = smaller((face[i] - from) * leave, far[i]);
            }
        }
        let mask = (0..8).fold(0, |mask, i| mask | u32::from(near[i] <= far[i]) << i);
        (mask, Near(near))
    }

    #[inline(always)]
    fn within(sides: &Sides, node: &Node8) -> u32 {
        // Of each box the corner that is farthest along n.
        let reach = |n: Vec3, i: usize| {
            let along = |axis: usize, n: f32, o: f32| n * (node.bounds[2 * axis + usize::from(n > 0.0)][i] - o);
            along(0, n.x, sides.o.x) + along(1, n.y, sides.o.y) + along(2, n.z, sides.o.z)
        };
        // Unused slots may be anything, also not a number: they are not followed.
        let slots = |n: Vec3, slack: f32| (0..8).fold(0, |m, i| m | u32::from(reach(n, i) >= -slack) << i);
        (0..4).fold(0xff, |kept, k| {
            let waist = sides.waist.as_ref().map_or(0, |(n, slack)| slots(n[k], slack[k]));
            kept & (slots(sides.n[k], sides.slack[k]) | waist)
        })
    }

    #[inline(always)]
    fn lanes(sides: &Sides, pack: &Tri4) -> u32 {
        let o = sides.o;
        let [xs, ys, zs] = &pack.points;
        // Per lane the columns of its vertices, as bits.
        let vertices: [u8; 4] = std::array::from_fn(|lane| (0..3).fold(0, |m, v| m | 1 << (pack.corners[v][lane] & 7)));
        let along = |n: Vec3, i: usize| n.x * (xs[i] - o.x) + n.y * (ys[i] - o.y) + n.z * (zs[i] - o.z);
        let columns = |inside: &dyn Fn(usize) -> bool| (0..8).fold(0u8, |m, i| m | u8::from(inside(i)) << i);
        let mut kept = used_lanes(pack);
        let mut keep = |inside: u8| {
            for (lane, of_lane) in vertices.iter().enumerate() {
                kept &= !(u32::from(of_lane & inside == 0) << lane);
            }
        };
        for k in 0..4 {
            let mut inside = columns(&|i| along(sides.n[k], i) >= -sides.slack[k]);
            if let Some((n, slack)) = &sides.waist {
                inside |= columns(&|i| along(n[k], i) >= -slack[k]);
            }
            keep(inside);
        }
        kept
    }
}

/// The second operand if the first is NaN or both are equal.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The second operand if the first is NaN or both are equal.
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Lanes of a pack that hold a triangle, as bits.
#[inline(always)]
pub(super) fn used_lanes(pack: &Tri4) -> u32 {
    (0..4).fold(0, |m, i| m | u32::from(pack.prim[i] != u32::MAX) << i)
}

impl Accel {
    /// Visits all primitives that a ray of the beam may meet before the visitor's limit, roughly from near to far.
    /// A rectangle may come twice.
    #[inline]
    pub fn walk(&self, beam: &Beam, visitor: &mut impl Visitor) {
        match self.avx2 {
            Some(avx2) => avx2.walk(&self.tree, beam, visitor),
            None => walk::<Portable>(&self.tree, beam, visitor),
        }
    }
}

/// The walk itself.
#[inline(always)]
pub(super) fn walk<K: BeamKernel>(tree: &Tree, beam: &Beam, visitor: &mut impl Visitor) {
    let (Some(slabs), tree) = (Slabs::new(beam), tree.view()) else { return };
    let Some(mut node) = tree.nodes.first() else { return };
    let mut stack = ArrayVec::<u64, STACK>::new();
    loop {
        let limit = visitor.limit().min(f32::MAX) * FAR_SCALE;
        let (mut mask, near) = K::boxes(&slabs, node, limit);
        // Pyramids and prisms fill their boxes well enough.
        if let Some(sides) = beam.sides.as_ref().filter(|sides| sides.waist.is_some()) {
            mask &= K::within(sides, node);
        }
        let base = stack.len();
        while mask != 0 {
            let slot = mask.trailing_zeros() as usize & 7;
            mask &= mask - 1;
            if node.children[slot] != Child::NONE {
                stack.push(u64::from(near.0[slot].to_bits()) << 32 | u64::from(node.children[slot].0));
            }
        }
        sort_descending(&mut stack[base..]);
        // Leaves, until the next node comes up.
        loop {
            let Some(entry) = stack.pop() else { return };
            if f32::from_bits((entry >> 32) as u32) > visitor.limit() * FAR_SCALE {
                continue;
            }
            let child = Child(entry as u32);
            if child.is_node() {
                node = &tree.nodes[child.index()];
                break;
            }
            if child.is_quadric() {
                if visitor.quadric(tree.quadrics[child.index()].shape).is_break() {
                    return;
                }
                continue;
            }
            let pack = &tree.tris[child.index()];
            let mut lanes = match &beam.sides {
                Some(sides) => K::lanes(sides, pack),
                None => used_lanes(pack),
            };
            while lanes != 0 {
                let i = lanes.trailing_zeros() as usize & 3;
                lanes &= lanes - 1;
                let corner = |v: usize| Vec3::new(pack.vertex(i, v, 0), pack.vertex(i, v, 1), pack.vertex(i, v, 2));
                if visitor.triangle(pack.shape, pack.prim[i], [corner(0), corner(1), corner(2)]).is_break() {
                    return;
                }
            }
        }
    }
}
