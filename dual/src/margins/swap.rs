//! Surfaces that exchange their depth order (interpenetration), and one plane hiding another.
//!
//! Two planes, normals turned away from the origin (tau = n.(c - o) > 0, so rays meet them where n.d > 0):
//! `t_A - t_B` times the positive denominators is `m = tau_A (n_B.d) - tau_B (n_A.d)`, degree 1, exact at order 1 for a fixed
//! origin. Plane and sphere swap on the circle they share, two spheres on the circle in their radical plane: [`super::rim`].

use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::shapes::{Disk, Plane, Sphere};
use crate::vec3::Vec3;

/// Negative where plane A is nearer, positive where B is, among rays that meet both. Units: length |n_A| |n_B| |d|.
///
/// Zero on the whole line the planes share; for finite polygons clip [`shared_segment`] instead.
#[inline(always)]
pub fn swap<T: Real>(ray: &Ray<T>, a: &Plane<T::Primitive>, b: &Plane<T::Primitive>) -> T {
    let o = ray.o.re();
    let (a, b) = (a.facing_away(o), b.facing_away(o));
    a.tau(ray.o) * Vec3::lift(b.normal).dot(ray.d) - b.tau(ray.o) * Vec3::lift(a.normal).dot(ray.d)
}

/// `1 / t` of a plane: `n.d / tau`. Affine in p for a fixed origin, so that "plane A is nearer than B in all of a convex
/// region" needs only the region's corners. Negative behind; not finite if the origin lies in the plane.
#[inline(always)]
pub fn inverse_depth<T: Real>(ray: &Ray<T>, plane: &Plane<T::Primitive>) -> T {
    Vec3::lift(plane.normal).dot(ray.d) * plane.tau(ray.o).recip()
}

/// The segment two convex polygons (corners in order) have in common, if they cross.
pub fn shared_segment<F: Scalar>(a: &[Vec3<F>], b: &[Vec3<F>]) -> Option<[Vec3<F>; 2]> {
    let normal = |p: &[Vec3<F>]| (p[1] - p[0]).cross(p[2] - p[0]);
    if a.len() < 3 || b.len() < 3 {
        return None;
    }
    let (na, nb) = (normal(a), normal(b));
    let dir = na.cross(nb);
    let inv = dir.norm2().recip();
    // A point of both planes: x = (ka nb x dir + kb dir x na) / |dir|^2 with n.x = k.
    let base = (nb.cross(dir).scale(na.dot(a[0])) + dir.cross(na).scale(nb.dot(b[0]))).scale(inv);
    let (mut s0, mut s1) = (F::neg_infinity(), F::infinity());
    for (corners, n) in [(a, na), (b, nb)] {
        for k in 0..corners.len() {
            // Inside of the edge: inward.(x - corner) >= 0 along x = base + s dir.
            let (p, q) = (corners[k], corners[(k + 1) % corners.len()]);
            let inward = n.cross(q - p);
            let (f, df) = (inward.dot(base - p), inward.dot(dir));
            let s = -f * df.recip();
            if df > F::zero() {
                s0 = s0.max(s);
            } else if df < F::zero() {
                s1 = s1.min(s);
            } else if f < F::zero() {
                return None;
            }
        }
    }
    (s0 < s1 && s0.is_finite() && s1.is_finite()).then(|| [base + dir * s0, base + dir * s1])
}

/// The circle a plane cuts out of a sphere, if it does.
pub fn plane_sphere_circle<F: Scalar>(plane: &Plane<F>, s: &Sphere<F>) -> Option<Disk<F>> {
    let n = plane.normal.normalized();
    let h = n.dot(plane.point - s.centre);
    let r2 = s.radius * s.radius - h * h;
    (r2 > F::zero()).then(|| Disk::new(s.centre + n * h, n, r2.sqrt()))
}

/// The circle two spheres share, in their radical plane, if they cross.
pub fn sphere_sphere_circle<F: Scalar>(a: &Sphere<F>, b: &Sphere<F>) -> Option<Disk<F>> {
    let v = b.centre - a.centre;
    let v2 = v.norm2();
    // Fraction of v at which the radical plane stands.
    let f = F::HALF * (F::one() + (a.radius * a.radius - b.radius * b.radius) * v2.recip());
    let r2 = a.radius * a.radius - f * f * v2;
    (r2 > F::zero() && f.is_finite()).then(|| Disk::new(a.centre + v.scale(f), v, r2.sqrt()))
}
