//! Circular cones about an axis: the border of a spot light, of an emission cone, of a highlight about the mirror direction.
//!
//! `m = sign(cos) [(a.d)^2 - cos^2 a.a d.d]`: degree 2 in d, exact at order 2 wherever d is affine in p.
//! Guard: `sign(cos) a.d > 0` (a cone wider than a half space has its border behind the apex). For cos = 0 use
//! [`super::facing`].

use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// Positive, near the border, for directions inside the cone with half angle acos(`cos`). Units: |axis|^2 |d|^2.
#[inline(always)]
pub fn cone<T: Real>(d: Vec3<T>, axis: Vec3<T::Primitive>, cos: T::Primitive) -> T {
    let ad = Vec3::lift(axis).dot(d);
    let m = ad * ad - d.norm2() * (cos * cos * axis.norm2());
    if cos < T::Primitive::of(0.0) { -m } else { m }
}

/// Positive on the side of the apex where the cone's border is (degree 1).
#[inline(always)]
pub fn cone_guard<T: Real>(d: Vec3<T>, axis: Vec3<T::Primitive>, cos: T::Primitive) -> T {
    let ad = Vec3::lift(axis).dot(d);
    if cos < T::Primitive::of(0.0) { -ad } else { ad }
}
