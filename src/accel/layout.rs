//! Memory layout of the tree: what every walk over it reads.
//!
//! A walk starts at node 0 (if there is any), tests the eight boxes of a node and follows `children` of those it
//! accepts. Unused slots have an inverted box (min +inf, max -inf), which no conservative test accepts; a walk must
//! not follow them. Boxes of triangles are widened by a few ulps of their extent (see `build`).

use super::pages::Pages;
use super::quadric::Quadric;
use crate::math::Vec3;
use arrayvec::ArrayVec;
use bytemuck::{Pod, Zeroable};

/// Reference to what lies in a box: a node, a pack of triangles or a quadric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(pub u32);

const LEAF: u32 = 1 << 31;
const QUADRIC: u32 = 1 << 30;
const INDEX: u32 = QUADRIC - 1;

impl Child {
    /// Content of an unused slot.
    pub const NONE: Child = Child(u32::MAX);

    pub fn node(index: usize) -> Self {
        debug_assert!(index < INDEX as usize);
        Child(index as u32)
    }

    pub fn triangles(index: usize) -> Self {
        debug_assert!(index < INDEX as usize);
        Child(index as u32 | LEAF)
    }

    pub fn quadric(index: usize) -> Self {
        debug_assert!(index < INDEX as usize);
        Child(index as u32 | LEAF | QUADRIC)
    }

    #[inline(always)]
    pub fn is_node(self) -> bool {
        self.0 & LEAF == 0
    }

    /// Of a leaf: whether it is a quadric (else a pack of triangles).
    #[inline(always)]
    pub fn is_quadric(self) -> bool {
        self.0 & QUADRIC != 0
    }

    /// Index into `Tree::nodes`, `Tree::tris` or `Tree::quadrics`.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & INDEX) as usize
    }
}

/// Eight boxes and what lies in them.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node8 {
    /// Rows: min x, max x, min y, max y, min z, max z. Columns: slots.
    pub bounds: [[f32; 8]; 6],
    /// Contents of the slots.
    pub children: [Child; 8],
    /// Fills the last cache line.
    pub _unused: [u32; 8],
}

impl Node8 {
    /// A node with no slot in use.
    pub const EMPTY: Node8 = {
        let (lo, hi) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
        Node8 { bounds: [lo, hi, lo, hi, lo, hi], children: [Child::NONE; 8], _unused: [0; 8] }
    };
}

/// Up to four triangles of one shape with at most eight different vertices. Unused lanes come last, have one vertex three
/// times and are never hit.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Tri4 {
    /// The vertices. Rows: axes.
    pub points: [[f32; 8]; 3],
    /// Columns of `points`. Rows: second, third, first vertex. Columns: lanes.
    pub corners: [[u8; 4]; 3],
    /// Shape of all lanes.
    pub shape: u32,
    /// Triangle of the shape's mesh (0 for rectangles); `u32::MAX` in unused lanes.
    pub prim: [u32; 4],
}

impl Tri4 {
    /// Triangles that a pack takes.
    pub const LANES: usize = 4;
    /// Vertices that a pack takes.
    pub const POINTS: usize = 8;

    /// Packs triangles of one shape, given with their numbers. None if they are too many or have too many vertices.
    pub fn new(shape: u32, triangles: &[(u32, [Vec3; 3])]) -> Option<Self> {
        let mut pack = Tri4 { points: [[0.0; 8]; 3], corners: [[0; 4]; 3], shape, prim: [u32::MAX; 4] };
        let mut points = ArrayVec::<Vec3, { Self::POINTS }>::new();
        for (lane, (prim, vertices)) in triangles.iter().enumerate() {
            *pack.prim.get_mut(lane)? = *prim;
            for (v, vertex) in vertices.iter().enumerate() {
                pack.corners[(v + 2) % 3][lane] = index_of(&mut points, *vertex)?;
            }
        }
        for (column, point) in points.iter().enumerate() {
            for axis in 0..3 {
                pack.points[axis][column] = point[axis];
            }
        }
        Some(pack)
    }

    /// A coordinate of a vertex (0 to 2) of a lane.
    #[inline(always)]
    pub fn vertex(&self, lane: usize, v: usize, axis: usize) -> f32 {
        self.points[axis][(self.corners[(v + 2) % 3][lane] & 7) as usize]
    }
}

/// Where in the list a point is, after it has been added if need be. None if the list is full.
fn index_of(points: &mut ArrayVec<Vec3, { Tri4::POINTS }>, point: Vec3) -> Option<u8> {
    // Bits, for the sign of zero.
    let bits = |p: &Vec3| p.to_array().map(f32::to_bits);
    let index = points.iter().position(|p| bits(p) == bits(&point)).unwrap_or(points.len());
    if index == points.len() {
        points.try_push(point).ok()?;
    }
    Some(index as u8)
}

/// The whole tree. Nodes come before their descendants.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    /// Inner nodes; the first is the root. Empty if there is no primitive.
    pub nodes: Pages<Node8>,
    /// Packs of triangles.
    pub tris: Pages<Tri4>,
    /// Quadrics.
    pub quadrics: Vec<Quadric>,
    /// Entries that a stack needs at most, if a walk pushes all children of a node but one.
    #[allow(dead_code)] // walks here have a stack of their own bound; tests hold it against this
    pub stack_need: usize,
}

/// The arrays of a tree, as a walk keeps them at hand.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub nodes: &'a [Node8],
    pub tris: &'a [Tri4],
    pub quadrics: &'a [Quadric],
}

impl Tree {
    /// The arrays.
    #[inline(always)]
    pub fn view(&self) -> View<'_> {
        View { nodes: &self.nodes, tris: &self.tris, quadrics: &self.quadrics }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of triangles: each shares two vertices with the one before.
    fn strip(count: usize) -> Vec<(u32, [Vec3; 3])> {
        let point = |i: usize| Vec3::new(i as f32, (i * i) as f32, -0.0);
        (0..count).map(|i| (7 + i as u32, [point(i), point(i + 1), point(i + 2)])).collect()
    }

    #[test]
    fn packs_keep_vertices_and_their_order() {
        for count in 1..=4 {
            let triangles = strip(count);
            let pack = Tri4::new(3, &triangles).unwrap();
            for (lane, (prim, vertices)) in triangles.iter().enumerate() {
                assert_eq!((pack.shape, pack.prim[lane]), (3, *prim));
                for (v, vertex) in vertices.iter().enumerate() {
                    for axis in 0..3 {
                        assert_eq!(pack.vertex(lane, v, axis).to_bits(), vertex[axis].to_bits());
                    }
                }
            }
            for lane in count..4 {
                assert_eq!(pack.prim[lane], u32::MAX);
                assert!((0..3).all(|axis| (1..3).all(|v| pack.vertex(lane, v, axis) == pack.vertex(lane, 0, axis))));
            }
        }
    }

    #[test]
    fn packs_refuse_what_they_cannot_hold() {
        assert!(Tri4::new(0, &strip(5)).is_none());
        // Far apart: three vertices each.
        let apart = |n: usize| strip(7).into_iter().step_by(3).take(n).collect::<Vec<_>>();
        assert!(Tri4::new(0, &apart(2)).is_some());
        assert!(Tri4::new(0, &apart(3)).is_none());
    }

    #[test]
    fn zeros_of_different_sign_are_different_vertices() {
        let [a, b] = [Vec3::X, Vec3::Y];
        let pack = Tri4::new(0, &[(0, [a, b, Vec3::ZERO]), (1, [a, b, -Vec3::ZERO])]).unwrap();
        assert!(pack.vertex(0, 2, 0).is_sign_positive() && pack.vertex(1, 2, 0).is_sign_negative());
    }
}
