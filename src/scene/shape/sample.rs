//! Points on shapes, uniform by area.
//!
//! Measure: density per world area, the same constant on the whole primitive: 1 / its area. Each map from the unit
//! square is the area-preserving warp of [`crate::math::warp`], so stratified numbers stay stratified.
//! Not handled here: sampling by solid angle (lights do that) and choosing a triangle of a mesh.

use super::super::surface::SurfacePoint;
use super::point::mesh_point;
use super::{Geometry, Shape};
use crate::math::{DVec3, Vec2, warp};
use std::f64::consts::TAU;

impl Shape {
    /// A point on primitive `prim`, uniform by area, and the density per area of that (1 / area of the primitive).
    pub fn sample_area(&self, shape: u32, prim: u32, u: Vec2) -> (SurfacePoint, f32) {
        let point = match &self.geometry {
            Geometry::Mesh(mesh) => {
                let b = warp::sample_triangle(u);
                mesh_point(mesh, prim, b.x, b.y)
            }
            Geometry::Sphere(s) => {
                let d = warp::sample_sphere(u).as_dvec3();
                let [ax, ay, az] = s.axes.map(|a| a.as_dvec3());
                s.point(ax * d.x + ay * d.y + az * d.z)
            }
            Geometry::Rectangle(r) => r.point(2.0 * u.x - 1.0, 2.0 * u.y - 1.0),
            Geometry::Disk(d) => {
                let q = warp::sample_disk(u);
                d.point(q.x, q.y)
            }
            Geometry::Cylinder(c) => {
                let (sin, cos) = (TAU * u.x as f64).sin_cos();
                let across: DVec3 = c.reference.as_dvec3() * cos + c.binormal.as_dvec3() * sin;
                c.point(u.y, across)
            }
        };
        (SurfacePoint { shape, prim, ..point }, 1.0 / self.primitive_area(prim))
    }
}
