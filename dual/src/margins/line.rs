//! Straight edges: `m = det[a - o, b - o, d] = ((a - o) x (b - o)) . d`, the Pluecker product of ray and edge.
//!
//! Degree 1 in d; origin fixed: exact at order 1. Zero on the whole line through a and b: for `bounds` use
//! [`super::Projector::clip`], which knows the segment.

use std::cmp::Ordering;

use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// On which side of the line a-b the ray passes. Exchanging a and b flips the sign exactly.
///
/// Units: length^2 times |d|; divide by |b - a| |d| sin(angle) for a distance ([`line_distance`]).
///
/// ```
/// use dualux_dual::{Ray, margins, vec3};
/// let down = Ray::new(vec3(0.25, 0.0, 1.0), vec3(0.0, 0.0, -1.0));
/// let (a, b) = (vec3(0.0, -1.0, 0.0), vec3(0.0, 1.0, 0.0));
/// assert_eq!(margins::line(&down, a, b), 0.5);
/// assert_eq!(margins::line_distance(&down, a, b), 0.25);
/// ```
#[inline(always)]
pub fn line<T: Real>(ray: &Ray<T>, a: Vec3<T::Primitive>, b: Vec3<T::Primitive>) -> T {
    (Vec3::lift(a) - ray.o).cross(Vec3::lift(b) - ray.o).dot(ray.d)
}

/// Signed distance between the ray's line and the line a-b (same sign as [`line()`]). Not finite if they are parallel.
#[inline(always)]
pub fn line_distance<T: Real>(ray: &Ray<T>, a: Vec3<T::Primitive>, b: Vec3<T::Primitive>) -> T {
    line(ray, a, b) * Vec3::lift(b - a).cross(ray.d).norm().recip()
}

/// Margins of a convex polygon's edges, positive inside, whichever side the origin is on: the ray hits the polygon, in
/// front of its origin, iff all are positive. `None` if the origin lies in the polygon's plane, or with less than three corners.
///
/// `corners` in order round the polygon. Degree 1, exact at order 1 for a fixed origin.
pub fn polygon<'a, T: Real>(
    ray: &'a Ray<T>,
    corners: &'a [Vec3<T::Primitive>],
) -> Option<impl Iterator<Item = T> + 'a> {
    let &[a, b, c, ..] = corners else { return None };
    let side = (b - a).cross(c - a).dot(a - ray.o.re());
    let sign = T::Primitive::of(match side.partial_cmp(&T::Primitive::of(0.0))? {
        Ordering::Greater => 1.0,
        Ordering::Less => -1.0,
        Ordering::Equal => return None,
    });
    let next = corners.iter().cycle().skip(1);
    Some(corners.iter().zip(next).map(move |(a, b)| line(ray, *a, *b) * sign))
}
