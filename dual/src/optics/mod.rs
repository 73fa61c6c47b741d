//! What happens to a ray at a surface: interpolated normals, reflection, refraction.
//!
//! Derivatives flow by the chain rule; the closed forms they must agree with (Igehy 1999, METHODS 3.B) are stated per function.

mod interpolate;
mod reflect;
mod refract;

pub use interpolate::{interpolate, interpolate_normal, interpolate_vec3};
pub use reflect::reflect;
pub use refract::{Refraction, refract};

use crate::real::Real;
use crate::vec3::Vec3;

/// `n` turned against `d`, so that n.d <= 0; decided by the real part.
#[inline(always)]
pub fn face_against<T: Real>(n: Vec3<T>, d: Vec3<T>) -> Vec3<T> {
    if n.dot(d).re() > <T::Primitive as crate::Scalar>::of(0.0) { -n } else { n }
}

#[cfg(test)]
mod tests;
