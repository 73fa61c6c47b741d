//! From a binary tree with one primitive per leaf to nodes of eight children and packs of four triangles.
//!
//! What becomes a node or a pack is decided by `plan`. Nodes are laid out depth first. Should the binary tree be deeper than a stack allows for, the
//! subtree in question is rebuilt by halving its primitives.

use super::build::{Prim, quadric, triangle};
use super::layout::{Child, Node8, Tree, Tri4};
use super::pages::Pages;
use super::plan::Plan;
use super::quadric::Quadric;
use super::traverse::LONG_STACK;
use crate::scene::{Geometry, Shape};
use arrayvec::ArrayVec;
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

/// Nodes on a path from the root before balance is enforced. Balanced subtrees have a depth of at most 11 more (8^11 leaves).
pub(super) const BALANCED_DEPTH: usize = LONG_STACK / 7 - 13;

/// Makes the tree. There must be at least one primitive.
pub(super) fn collapse(shapes: &[Shape], prims: &[Prim], bvh: &Bvh2, balanced_depth: usize) -> Tree {
    let mut c = Collapse {
        shapes,
        prims,
        bvh,
        plan: Plan::new(bvh, |list| can_pack(shapes, prims, list)),
        balanced_depth,
        nodes: Vec::new(),
        tris: Vec::new(),
        quadrics: Vec::new(),
    };
    let (_, stack_need) = c.node(Part::Subtree(0), 0);
    Tree { nodes: Pages::new(c.nodes), tris: Pages::new(c.tris), quadrics: c.quadrics, stack_need }
}

/// Primitives that become a child: a subtree of the binary tree, or a list of primitives.
enum Part {
    Subtree(u32),
    List(Vec<u32>),
}

struct Collapse<'a> {
    shapes: &'a [Shape],
    prims: &'a [Prim],
    bvh: &'a Bvh2,
    plan: Plan<'a>,
    balanced_depth: usize,
    nodes: Vec<Node8>,
    tris: Vec<Tri4>,
    quadrics: Vec<Quadric>,
}

impl Collapse<'_> {
    /// Appends the node for a part, with all below it. Returns its index and how many stack entries a walk of it needs.
    fn node(&mut self, part: Part, depth: usize) -> (usize, usize) {
        let parts = match part {
            Part::Subtree(root) if depth < self.balanced_depth => {
                self.plan.open(root).into_iter().map(Part::Subtree).collect()
            }
            Part::Subtree(root) => eighths(&self.primitives_below(root)),
            Part::List(list) => eighths(&list),
        };
        let index = self.nodes.len();
        self.nodes.push(Node8::EMPTY);
        let mut node = Node8::EMPTY;
        let mut need = 0;
        for (slot, part) in parts.iter().enumerate() {
            let aabb = self.bounds(part);
            for axis in 0..3 {
                node.bounds[2 * axis][slot] = aabb.min[axis];
                node.bounds[2 * axis + 1][slot] = aabb.max[axis];
            }
        }
        let siblings = parts.len() - 1;
        // Leaves first: those of one node lie side by side.
        let mut inner = ArrayVec::<(usize, Part), 8>::new();
        for (slot, part) in parts.into_iter().enumerate() {
            match self.leaf(&part) {
                Some(leaf) => node.children[slot] = leaf,
                None => inner.push((slot, part)),
            }
        }
        for (slot, part) in inner {
            let (child, child_need) = self.node(part, depth + 1);
            node.children[slot] = Child::node(child);
            need = need.max(child_need);
        }
        self.nodes[index] = node;
        (index, need + siblings)
    }

    /// Appends the leaf for a part, if it fits into one.
    fn leaf(&mut self, part: &Part) -> Option<Child> {
        let below;
        let list = match part {
            Part::Subtree(root) if self.plan.is_leaf(*root) => {
                below = self.plan.primitives_below(*root);
                below.as_slice()
            }
            Part::Subtree(_) => return None,
            Part::List(list) => list,
        };
        if let Some(pack) = pack(self.shapes, self.prims, list) {
            self.tris.push(pack);
            return Some(Child::triangles(self.tris.len() - 1));
        }
        let [single] = list else { return None };
        self.quadrics.extend(quadric(self.shapes, &self.prims[*single as usize]));
        Some(Child::quadric(self.quadrics.len() - 1))
    }

    fn bounds(&self, part: &Part) -> Aabb {
        match part {
            Part::Subtree(root) => *self.bvh.nodes[*root as usize].aabb(),
            Part::List(list) => {
                list.iter().map(|&i| self.prims[i as usize].aabb()).fold(Aabb::empty(), |a, b| a.union(&b))
            }
        }
    }

    fn primitives_below(&self, root: u32) -> Vec<u32> {
        let (mut found, mut todo) = (Vec::new(), vec![root]);
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
}

/// Whether primitives fit into one pack.
fn can_pack(shapes: &[Shape], prims: &[Prim], list: &[u32]) -> bool {
    if 3 * list.len() > Tri4::POINTS {
        return pack(shapes, prims, list).is_some();
    }
    // So few triangles cannot have too many vertices, which then need not be looked at.
    let shape = |i: &u32| prims[*i as usize].shape;
    let is_flat = |i| matches!(shapes[shape(i) as usize].geometry, Geometry::Mesh(_) | Geometry::Rectangle(_));
    list.iter().all(|i| is_flat(i) && shape(i) == shape(&list[0]))
}

/// Packs primitives, if they fit into one pack.
fn pack(shapes: &[Shape], prims: &[Prim], list: &[u32]) -> Option<Tri4> {
    let shape = prims[*list.first()? as usize].shape;
    let is_mesh = matches!(shapes[shape as usize].geometry, Geometry::Mesh(_));
    let mut triangles = ArrayVec::<_, { Tri4::LANES }>::new();
    for &i in list {
        let prim = &prims[i as usize];
        let number = if is_mesh { prim.part } else { 0 };
        if prim.shape != shape {
            return None;
        }
        triangles.try_push((number, triangle(shapes, prim)?)).ok()?;
    }
    Tri4::new(shape, &triangles)
}

/// Up to eight parts of nearly equal length.
fn eighths(list: &[u32]) -> ArrayVec<Part, 8> {
    let length = list.len().div_ceil(8).max(1);
    list.chunks(length).map(|c| Part::List(c.to_vec())).collect()
}
