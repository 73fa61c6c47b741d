//! Rim of a disk: the hit condition `|o + t d - c|^2 <= R^2`, `t = tau / (n.d)`, multiplied out by (n.d)^2:
//! `m = R^2 (n.d)^2 - |tau d - (n.d) (c - o)|^2`, tau = n.(c - o), and the vector is `n x (d x (c - o))`.
//!
//! Degree 2 in d: exact at order 2 for a fixed origin. Guard: `tau (n.d) > 0`, the disk's plane in front.

use crate::ray::Ray;
use crate::real::Real;
use crate::shapes::Disk;
use crate::vec3::Vec3;

/// Positive where the ray's line passes through the disk. Units: length^2 |n|^2 |d|^2.
#[inline(always)]
pub fn rim<T: Real>(ray: &Ray<T>, disk: &Disk<T::Primitive>) -> T {
    let n = Vec3::lift(disk.normal);
    let m = Vec3::lift(disk.centre) - ray.o;
    let nd = n.dot(ray.d);
    // tau d - (n.d) m, written so that large terms do not cancel far away.
    let v = n.cross(ray.d.cross(m));
    nd * nd * (disk.radius * disk.radius) - v.norm2()
}

/// Positive where the disk's plane is in front of the origin: `n.d` with n turned away from the origin (degree 1). For a fixed
/// origin: rays that start elsewhere may start on the plane's other side.
#[inline(always)]
pub fn rim_guard<T: Real>(ray: &Ray<T>, disk: &Disk<T::Primitive>) -> T {
    let n = disk.plane().facing_away(ray.o.re()).normal;
    Vec3::lift(n).dot(ray.d)
}
