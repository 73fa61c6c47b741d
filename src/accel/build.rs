//! From shapes to the tree.
//!
//! Primitives (triangles, two per rectangle, quadrics) get boxes; obvhs builds a binary tree over them (parallel
//! locally-ordered clustering, Benthin et al. 2022, and reinsertion, Meister and Bittner 2018); `collapse` turns it into
//! nodes of eight. Deterministic for any number of threads.
//! Left out: primitives with NaN, infinite or huge coordinates, triangles without area, indices out of range.

use super::collapse::{BALANCED_DEPTH, collapse};
use super::layout::Tree;
use super::quadric::Quadric;
use crate::math::sampler::{hash, unit_f32};
use crate::math::{DVec3, Vec3};
use crate::scene::shape::Rectangle;
use crate::scene::{Geometry, Mesh, Shape};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::PlocBuilder;
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;

/// Beyond this, products of three coordinates leave the range of f32.
const LARGEST_COORDINATE: f32 = 1e12;

/// A primitive on its way into the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prim {
    min: Vec3,
    max: Vec3,
    pub shape: u32,
    /// Triangle of a mesh; half of a rectangle.
    pub part: u32,
}

impl Boundable for Prim {
    fn aabb(&self) -> Aabb {
        Aabb::new(self.min.into(), self.max.into())
    }
}

impl Prim {
    /// None where coordinates are not finite or too large.
    ///
    /// The box is widened by at least 4 ulps of its largest extent, and outwards to the next floats: the triangle test moves
    /// vertices by up to 1.5 ulps of their distance from the origin of the ray, in proportion to their weight at the hit.
    /// The part due to the distance of the hit is covered by the scale of far distances, the rest by this.
    ///
    /// Some boxes are widened by up to 64 ulps, so that no two are likely to be equal: over many equal boxes the clustering of
    /// obvhs takes quadratic time (14 s for 20,000).
    fn new(shape: u32, part: u32, min: Vec3, max: Vec3) -> Option<Self> {
        let key = hash(shape as u64, part as u64);
        let pad = (max - min).max_element() * (4.0 + 60.0 * unit_f32(key)) * f32::EPSILON;
        let (min, max) = (
            (min - Vec3::splat(pad)).map(|x| x.next_down().next_down()),
            (max + Vec3::splat(pad)).map(|x| x.next_up().next_up()),
        );
        let usable = |v: Vec3| v.abs().cmple(Vec3::splat(LARGEST_COORDINATE)).all();
        (usable(min) && usable(max)).then_some(Prim { min, max, shape, part })
    }
}

/// The corners of half a rectangle.
fn half_rectangle(r: &Rectangle, half: u32) -> [Vec3; 3] {
    let corner = |x: f32, y: f32| r.center + r.ex * x + r.ey * y;
    if half == 0 {
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)]
    } else {
        [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]
    }
}

/// None if an index is out of range.
fn mesh_triangle(mesh: &Mesh, index: u32) -> Option<[Vec3; 3]> {
    let [a, b, c] = *mesh.triangles.get(index as usize)?;
    let vertex = |i: u32| mesh.positions.get(i as usize).copied();
    Some([vertex(a)?, vertex(b)?, vertex(c)?])
}

/// The vertices of a triangle, or None for a quadric.
pub(super) fn triangle(shapes: &[Shape], prim: &Prim) -> Option<[Vec3; 3]> {
    match &shapes[prim.shape as usize].geometry {
        Geometry::Mesh(mesh) => mesh_triangle(mesh, prim.part),
        Geometry::Rectangle(r) => Some(half_rectangle(r, prim.part)),
        _ => None,
    }
}

/// The surface of a primitive that is not a triangle.
pub(super) fn quadric(shapes: &[Shape], prim: &Prim) -> Option<Quadric> {
    match &shapes[prim.shape as usize].geometry {
        Geometry::Sphere(s) => Quadric::sphere(prim.shape, s),
        Geometry::Disk(d) => Quadric::disk(prim.shape, d),
        Geometry::Cylinder(c) => Quadric::cylinder(prim.shape, c),
        Geometry::Mesh(_) | Geometry::Rectangle(_) => None,
    }
}

fn triangle_prim(shape: u32, part: u32, [a, b, c]: [Vec3; 3]) -> Option<Prim> {
    let has_area = {
        let [a, b, c] = [a, b, c].map(|v| v.as_dvec3());
        (b - a).cross(c - a) != DVec3::ZERO
    };
    // Of NaN, minimum and maximum keep the other operand: it is looked for in the vertices themselves.
    let finite = a.is_finite() && b.is_finite() && c.is_finite();
    if has_area && finite { Prim::new(shape, part, a.min(b).min(c), a.max(b).max(c)) } else { None }
}

fn prims(shapes: &[Shape]) -> Vec<Prim> {
    let mut prims = Vec::new();
    for (shape, s) in (0u32..).zip(shapes) {
        match &s.geometry {
            Geometry::Mesh(mesh) => {
                let indices = (0..mesh.triangles.len() as u32).into_par_iter().with_min_len(1 << 14);
                prims.par_extend(indices.filter_map(|i| triangle_prim(shape, i, mesh_triangle(mesh, i)?)));
            }
            Geometry::Rectangle(r) => {
                prims.extend([0, 1].into_iter().filter_map(|half| triangle_prim(shape, half, half_rectangle(r, half))));
            }
            Geometry::Sphere(_) | Geometry::Disk(_) | Geometry::Cylinder(_) => {
                let probe = Prim { min: Vec3::ZERO, max: Vec3::ZERO, shape, part: 0 };
                let bounds = quadric(shapes, &probe).map(|q| q.bounds);
                // The f32 box may round inwards by half an ulp; `Prim::new` moves it out by two.
                prims.extend(bounds.and_then(|(lo, hi)| Prim::new(shape, 0, lo.as_vec3(), hi.as_vec3())));
            }
        }
    }
    prims
}

/// Builds the tree over all primitives of the shapes.
pub(super) fn build(shapes: &[Shape]) -> Tree {
    build_with(shapes, BALANCED_DEPTH)
}

/// The same, with nodes below a depth balanced by force.
pub(super) fn build_with(shapes: &[Shape], balanced_depth: usize) -> Tree {
    let prims = prims(shapes);
    if prims.is_empty() {
        return Tree::default();
    }
    collapse(shapes, &prims, &binary_tree(&prims), balanced_depth)
}

/// As the "medium" preset of obvhs, with one primitive per leaf.
fn binary_tree(prims: &[Prim]) -> Bvh2 {
    let params = BvhBuildParams::medium_build();
    let mut bvh = PlocBuilder::with_capacity(prims.len()).build(
        params.ploc_search_distance,
        prims,
        (0..prims.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut bvh, params.reinsertion_batch_ratio, None);
    bvh
}
