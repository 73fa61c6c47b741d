//! Shapes and their intersection with rays, generic over the number type.
//!
//! Shapes are plain data (`f32` or `f64`), rays carry the derivatives. Each shape answers two questions:
//!
//! * `hit(ray, t_min, t_max)`: does the ray meet the shape, and where? Decisions look at real parts only.
//! * `t(ray, ..)`: the root on the **known** primitive, chosen by the caller's own hit; no inside test, so a caller
//!   that traced in f32 and differentiates in f64 cannot get a contradiction on a knife edge.
//!
//! Normals are geometric, of unit length unless said otherwise, and are not turned towards the ray.

mod cylinder;
mod disk;
mod plane;
mod rectangle;
mod sphere;
mod triangle;

pub use cylinder::Cylinder;
pub use disk::Disk;
pub use plane::Plane;
pub use rectangle::Rectangle;
pub use sphere::Sphere;
pub use triangle::Triangle;

/// Which of the two intersections with a quadric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Root {
    /// The one with smaller t.
    Near,
    /// The one with larger t.
    Far,
}

/// Relative size, in epsilons, below which a discriminant counts as zero: its square root would differentiate to noise.
pub(crate) const GRAZING_EPS: f64 = 4.0;

#[cfg(test)]
mod tests;
