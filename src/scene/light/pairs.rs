//! Parallelograms among the triangles of a lamp: quads, above all, that a file holds as two triangles.
//!
//! Two triangles belong together if they share a diagonal a-b, face the same way and their far corners c and d satisfy
//! a + b = c + d to the rounding of f32; each triangle belongs to one pair at most. As one emitter they have one density
//! (a spherical rectangle's), one closed form, one question of visibility.
//! Not handled: lamps with interpolated normals or textures, whose emission varies; polygons of more triangles.

use crate::scene::mesh::EdgeClass;
use crate::scene::shape::{Geometry, Rectangle, Shape};
use crate::scene::texture::Color;

/// For each triangle of the lamp: the other one of its parallelogram, and that. Empty for what is no plain mesh.
pub(super) fn parallelograms(shape: &Shape) -> Vec<Option<(u32, Rectangle)>> {
    let (Geometry::Mesh(mesh), Some(Color::Constant(_))) = (&shape.geometry, &shape.emission) else {
        return Vec::new();
    };
    // A mesh made by hand may have no adjacency.
    if !mesh.normals.is_empty() || mesh.neighbors.len() < mesh.triangles.len() {
        return Vec::new();
    }
    let mut pairs = vec![None; mesh.triangles.len()];
    for t in 0..mesh.triangles.len() {
        if pairs[t].is_some() {
            continue;
        }
        for k in 0..3 {
            let other = mesh.neighbors[t][k];
            let free = other != u32::MAX && pairs[other as usize].is_none() && other as usize != t;
            if !free || mesh.edges[t][k] != EdgeClass::Never {
                continue;
            }
            let corners = mesh.corners(t as u32);
            let [a, b, c] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
            let n = mesh.face_normal(t as u32);
            let Some(d) = mesh.corners(other).into_iter().find(|v| *v != a && *v != b) else { continue };
            let gap = (a.as_dvec3() + b.as_dvec3() - c.as_dvec3() - d.as_dvec3()).abs().max_element();
            let scale = a.abs().max(b.abs()).max(c.abs()).max_element();
            if gap > f64::from(4.0 * f32::EPSILON * scale) || n.dot(mesh.face_normal(other)) < 0.0 {
                continue;
            }
            let rectangle = Rectangle { center: 0.5 * (a + b), ex: 0.5 * (a - c), ey: 0.5 * (b - c), n };
            pairs[t] = Some((other, rectangle.clone()));
            pairs[other as usize] = Some((t as u32, rectangle));
            break;
        }
    }
    pairs
}
