//! Shapes in world space: spheres, disks, cylinders and rectangles stay analytic, the rest are meshes.

use super::description::{GeometryDesc, MaterialId, ShapeDesc};
use super::mesh::Mesh;
use super::surface::SurfacePoint;
use super::texture::Color;
use crate::math::{Vec2, Vec3};

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

/// The parallelogram center + x ex + y ey, x and y in [-1,1].
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

/// The ellipse center + r (cos a ex + sin a ey), r in [0,1].
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
    /// Unit vector across the axis at which v... the angle is zero.
    pub reference: Vec3,
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
    /// World-space shape from its description. The error is a text without location.
    pub fn new(desc: ShapeDesc) -> Result<Self, String> {
        let _ = (desc, GeometryDesc::Cube);
        todo!("helper geometry")
    }

    /// Box that encloses the shape (min, max), conservative in f32.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        todo!()
    }

    /// Surface area.
    pub fn area(&self) -> f32 {
        todo!()
    }

    /// Number of primitives that can be addressed: triangles of a mesh, else 1.
    pub fn primitive_count(&self) -> usize {
        todo!()
    }

    /// The surface point that the ray (o, d) has found at `hit` on primitive `prim` of this shape, whose index is `shape`.
    /// The point comes from the surface's own parameters, not from o + t d, and carries its error bound.
    pub fn surface_point(&self, shape: u32, prim: u32, o: Vec3, d: Vec3, hit: ShapeHit) -> SurfacePoint {
        let _ = (shape, prim, o, d, hit);
        todo!()
    }

    /// A point on primitive `prim`, uniform by area, and the density per area of that (1 / area of the primitive).
    pub fn sample_area(&self, shape: u32, prim: u32, u: Vec2) -> (SurfacePoint, f32) {
        let _ = (shape, prim, u);
        todo!()
    }
}
