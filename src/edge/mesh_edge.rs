//! Whether a side of a triangle is an edge for rays from a range of origins.
//!
//! Borders and creases are edges from everywhere; others are if one of the two facets turns to an origin and the other from one
//! ([`margins::may_be_silhouette`], which errs towards "edge").

use super::Facet;
use super::kinds::Kinds;
use super::view::to_dual;
use crate::math::DVec3;
use crate::scene::mesh::EdgeClass;
use crate::scene::{Geometry, Scene};
use dualux_dual::margins;

/// What side k of a triangle of a mesh (shape, triangle) is, seen from origins o + sum p_k o_k, which lie on the facet `from`.
pub(super) fn mesh_edge<const N: usize>(
    scene: &Scene,
    [shape, prim]: [u32; 2],
    k: usize,
    from: Facet,
    o: DVec3,
    o_p: &[DVec3; N],
) -> Option<Kinds> {
    let Geometry::Mesh(mesh) = &scene.shapes[shape as usize].geometry else { return None };
    let (class, other) = (mesh.edges[prim as usize][k], mesh.neighbors[prim as usize][k]);
    if class == EdgeClass::Never || from == (Facet { shape, prim: other }) {
        return None;
    }
    if other == u32::MAX {
        return Some(Kinds::BOUNDARY);
    }
    let corners = |prim: u32| mesh.corners(prim).map(|c| c.as_dvec3());
    let normal = |c: &[DVec3; 3]| to_dual((c[1] - c[0]).cross(c[2] - c[0]));
    let points = corners(prim);
    let (n1, n2) = (normal(&points), normal(&corners(other)));
    match margins::may_be_silhouette(to_dual(o), &o_p.map(to_dual), to_dual(points[k]), n1, n2) {
        true => Some(Kinds::SILHOUETTE),
        false => (class == EdgeClass::Always).then_some(Kinds::CREASE),
    }
}
