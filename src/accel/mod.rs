//! Ray queries over the shapes of a scene.

use crate::math::Vec3;
use crate::scene::Shape;

/// A ray segment: points o + t d with tmin <= t <= tmax. `d` need not be a unit vector; t is in units of |d|.
/// Robust origins come from `SurfacePoint::spawn_origin`, with `tmin` = `f32::MIN_POSITIVE`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin.
    pub o: Vec3,
    /// Direction.
    pub d: Vec3,
    /// Start; must be above 0 for rays that leave a surface.
    pub tmin: f32,
    /// End, may be infinite.
    pub tmax: f32,
}

/// The nearest intersection of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter.
    pub t: f32,
    /// First surface coordinate (see `ShapeHit`).
    pub u: f32,
    /// Second surface coordinate.
    pub v: f32,
    /// Shape index.
    pub shape: u32,
    /// Triangle of a mesh, else 0.
    pub prim: u32,
}

/// Acceleration structure over shapes. Rectangles lie in it as two triangles with their shape's id.
#[derive(Debug)]
pub struct Accel {
    _todo: (),
}

impl Accel {
    /// Builds the structure.
    pub fn new(shapes: &[Shape]) -> Self {
        let _ = shapes;
        todo!("helper accel")
    }

    /// Nearest intersection.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let _ = ray;
        todo!()
    }

    /// Whether anything lies on the segment.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let _ = ray;
        todo!()
    }
}
