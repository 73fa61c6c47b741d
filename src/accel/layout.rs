//! Memory layout of the tree: what every walk over it reads.
//!
//! A walk starts at node 0 (if there is any), tests the eight boxes of a node and follows `children` of those it
//! accepts. Unused slots have an inverted box (min +inf, max -inf), which no conservative test accepts; a walk must
//! not follow them. Boxes of triangles are widened by a few ulps of their extent (see `build`).

use super::pages::Pages;
use super::quadric::Quadric;
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

/// Up to four triangles. Unused lanes come last, have all vertices at zero and are never hit.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Tri4 {
    /// Rows: 3 * vertex + axis. Columns: lanes.
    pub v: [[f32; 4]; 9],
    /// Shape of each lane; `u32::MAX` in unused ones.
    pub shape: [u32; 4],
    /// Triangle of the shape's mesh (0 for rectangles).
    pub prim: [u32; 4],
    /// Fills the last cache line.
    pub _unused: [u32; 4],
}

impl Tri4 {
    /// A pack with no lane in use.
    pub const EMPTY: Tri4 = Tri4 { v: [[0.0; 4]; 9], shape: [u32::MAX; 4], prim: [u32::MAX; 4], _unused: [0; 4] };
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
    #[inline(always)]
    pub fn view(&self) -> View<'_> {
        View { nodes: &self.nodes, tris: &self.tris, quadrics: &self.quadrics }
    }
}
