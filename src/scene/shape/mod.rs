//! Shapes in world space: spheres, disks, cylinders and rectangles stay analytic, the rest are meshes.
//!
//! * `build`: world-space geometry from a description
//! * `cube`: the cube's mesh
//! * `point`: surface points with error bounds, from ray hits and from parameters
//! * `sample`: points uniform by area
//!
//! Parametrisations, normal sides and their behaviour under mirroring transforms are Mitsuba 3.9's, measured; the file
//! that computes each says which.

mod build;
mod cube;
mod point;
mod sample;
#[cfg(test)]
mod tests;

use super::description::MaterialId;
use super::mesh::Mesh;
use super::texture::Color;
use crate::math::Vec3;

/// A shape of the scene.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Name for messages.
    pub name: String,
    /// World-space geometry.
    pub geometry: Geometry,
    /// Material.
    pub material: MaterialId,
    /// Emitted radiance on the normal side, if it is a lamp.
    pub emission: Option<Color>,
}

/// World-space geometry. A cube becomes a mesh of 12 triangles.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Triangles.
    Mesh(Mesh),
    /// Sphere.
    Sphere(Sphere),
    /// Rectangle (or parallelogram, under a shear).
    Rectangle(Rectangle),
    /// Disk (or ellipse).
    Disk(Disk),
    /// Open cylinder.
    Cylinder(Cylinder),
}

/// A sphere.
#[derive(Clone, Debug)]
pub struct Sphere {
    /// Centre.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
    /// Normals point inwards.
    pub flip: bool,
    /// Columns: object x, y, z axes in the world (for uv).
    pub axes: [Vec3; 3],
}

/// The parallelogram center + x ex + y ey, x and y in `[-1,1]`.
#[derive(Clone, Debug)]
pub struct Rectangle {
    /// Centre.
    pub center: Vec3,
    /// Half edge along u.
    pub ex: Vec3,
    /// Half edge along v.
    pub ey: Vec3,
    /// Unit normal (flips applied).
    pub n: Vec3,
}

/// The ellipse center + r (cos a ex + sin a ey), r in `[0,1]`.
#[derive(Clone, Debug)]
pub struct Disk {
    /// Centre.
    pub center: Vec3,
    /// Radius vector at angle 0.
    pub ex: Vec3,
    /// Radius vector at angle pi/2.
    pub ey: Vec3,
    /// Unit normal (flips applied).
    pub n: Vec3,
}

/// An open cylinder of circular section.
#[derive(Clone, Debug)]
pub struct Cylinder {
    /// Centre of the first rim.
    pub p0: Vec3,
    /// From the first rim's centre to the second's.
    pub axis: Vec3,
    /// Radius.
    pub radius: f32,
    /// Normals point inwards.
    pub flip: bool,
    /// Unit vector across the axis at angle 0, where u = 0.
    pub reference: Vec3,
    /// Unit vector across the axis at angle pi/2, where u = 1/4 (left-handed under mirroring transforms).
    pub binormal: Vec3,
}

/// A ray's intersection with an analytic shape or triangle: distance in units of |d| and two surface coordinates
/// (triangles: barycentrics of the second and third vertex; others: not used, the point is recomputed from t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter.
    pub t: f32,
    /// First surface coordinate.
    pub u: f32,
    /// Second surface coordinate.
    pub v: f32,
}

impl Shape {
    /// Box that encloses the shape (min, max), conservative in f32.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        // Half extents of a centred shape, widened by more than the roundings of any point computed on it.
        let centered = |c: Vec3, half: Vec3| {
            let half = half + (c.abs() + half) * (8.0 * f32::EPSILON);
            (c - half, c + half)
        };
        match &self.geometry {
            Geometry::Mesh(mesh) => mesh.bounds(),
            Geometry::Sphere(s) => centered(s.center, Vec3::splat(s.radius)),
            Geometry::Rectangle(r) => centered(r.center, r.ex.abs() + r.ey.abs()),
            // max over a of cos a x + sin a y is the length of (x, y).
            Geometry::Disk(d) => {
                let half = d.ex.as_dvec3() * d.ex.as_dvec3() + d.ey.as_dvec3() * d.ey.as_dvec3();
                centered(d.center, half.map(f64::sqrt).as_vec3())
            }
            Geometry::Cylinder(c) => {
                let across =
                    c.reference.as_dvec3() * c.reference.as_dvec3() + c.binormal.as_dvec3() * c.binormal.as_dvec3();
                let rim = across.map(f64::sqrt).as_vec3() * c.radius;
                let (lo0, hi0) = centered(c.p0, rim);
                let (lo1, hi1) = centered(c.p0 + c.axis, rim + (c.p0.abs() + c.axis.abs()) * f32::EPSILON);
                (lo0.min(lo1), hi0.max(hi1))
            }
        }
    }

    /// Surface area, world units squared.
    pub fn area(&self) -> f32 {
        match &self.geometry {
            Geometry::Mesh(mesh) => mesh.area(),
            Geometry::Sphere(s) => s.area(),
            Geometry::Rectangle(r) => r.area(),
            Geometry::Disk(d) => d.area(),
            Geometry::Cylinder(c) => c.area(),
        }
    }

    /// Number of primitives that can be addressed: triangles of a mesh, else 1.
    pub fn primitive_count(&self) -> usize {
        match &self.geometry {
            Geometry::Mesh(mesh) => mesh.triangles.len(),
            _ => 1,
        }
    }

    /// Area of primitive `prim`, world units squared: of one triangle of a mesh, else of the whole shape.
    pub fn primitive_area(&self, prim: u32) -> f32 {
        match &self.geometry {
            Geometry::Mesh(mesh) => mesh.triangle_area(prim),
            _ => self.area(),
        }
    }
}

impl Sphere {
    /// Surface area.
    pub fn area(&self) -> f32 {
        4.0 * std::f32::consts::PI * self.radius * self.radius
    }
}

impl Rectangle {
    /// Surface area.
    pub fn area(&self) -> f32 {
        4.0 * self.ex.as_dvec3().cross(self.ey.as_dvec3()).length() as f32
    }
}

impl Disk {
    /// Surface area.
    pub fn area(&self) -> f32 {
        std::f32::consts::PI * self.ex.as_dvec3().cross(self.ey.as_dvec3()).length() as f32
    }
}

impl Cylinder {
    /// Surface area, without caps (there are none).
    pub fn area(&self) -> f32 {
        2.0 * std::f32::consts::PI * self.radius * self.axis.as_dvec3().length() as f32
    }
}
