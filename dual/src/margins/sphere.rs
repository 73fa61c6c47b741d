//! Sphere silhouette: `D = R^2 d.d - |m x d|^2`, m = c - o; equal to `(d.m)^2 - d.d (m.m - R^2)`.
//!
//! Degree 2 in d: exact at order 2 for a fixed origin outside. Guard: `d.m > 0`. From inside there is no silhouette.

use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::shapes::{Disk, Sphere};
use crate::vec3::Vec3;

/// The discriminant: positive inside the silhouette. Units: length^2 |d|^2.
#[inline(always)]
pub fn sphere<T: Real>(ray: &Ray<T>, s: &Sphere<T::Primitive>) -> T {
    s.discriminant(ray)
}

/// Positive where the sphere is in front of the origin (degree 1).
#[inline(always)]
pub fn sphere_guard<T: Real>(ray: &Ray<T>, s: &Sphere<T::Primitive>) -> T {
    (Vec3::lift(s.centre) - ray.o).dot(ray.d)
}

/// `D / (2 R d.d)`: to first order the distance by which the ray's line passes inside (positive) or outside the silhouette.
/// Smooth everywhere, also for a ray through the centre, where R - |impact| has a kink. Not polynomial.
#[inline(always)]
pub fn sphere_distance<T: Real>(ray: &Ray<T>, s: &Sphere<T::Primitive>) -> T {
    sphere(ray, s) * (ray.d.norm2() * (s.radius + s.radius)).recip()
}

/// The circle at which rays from `o` touch the sphere, as a disk with normal m = c - o: in the polar plane
/// `(x - c).(o - c) = R^2`, radius `R sqrt(1 - R^2 / m.m)`. Its [`super::rim`] has the same zero set as [`sphere`], and the sphere
/// hides whatever the disk hides. `None` from inside.
pub fn sphere_silhouette<F: Scalar>(o: Vec3<F>, s: &Sphere<F>) -> Option<Disk<F>> {
    let m = s.centre - o;
    let q = s.radius * s.radius * m.norm2().recip();
    if !(q < F::one()) {
        return None;
    }
    Some(Disk::new(s.centre - m.scale(q), m, s.radius * (F::one() - q).sqrt()))
}
