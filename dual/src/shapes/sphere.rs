//! Sphere.
//!
//! With m = c - o: `t = (d.m -+ sqrt D) / d.d`, and the discriminant in the cross-product form
//! `D = R^2 d.d - |m x d|^2` (equal to `(d.m)^2 - d.d (m.m - R^2)` by Lagrange's identity). In f32, for a unit sphere at
//! distance 1000, the error of D / (2 R d.d), a distance, is 1e-4 in this form and 0.2 in the textbook form.

use super::{GRAZING_EPS, Root};
use crate::ray::Ray;
use crate::real::{Real, Scalar, constant};
use crate::vec3::Vec3;

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere<F> {
    /// Centre.
    pub centre: Vec3<F>,
    /// Radius, positive.
    pub radius: F,
}

impl<F: Scalar> Sphere<F> {
    /// From centre and radius.
    pub fn new(centre: Vec3<F>, radius: F) -> Self {
        Self { centre, radius }
    }

    /// Discriminant: positive where the ray's line pierces the sphere, zero on the silhouette. Scales with |d|^2.
    #[inline(always)]
    pub fn discriminant<T: Real<Primitive = F>>(&self, ray: &Ray<T>) -> T {
        let m = Vec3::lift(self.centre) - ray.o;
        ray.d.norm2() * (self.radius * self.radius) - m.cross(ray.d).norm2()
    }

    /// Ray parameter of the chosen root.
    ///
    /// Where the ray misses, or grazes so closely that D is rounding noise, this is the point of closest approach and its
    /// derivative; so the result is finite for every ray.
    #[inline(always)]
    pub fn t<T: Real<Primitive = F>>(&self, ray: &Ray<T>, root: Root) -> T {
        let m = Vec3::lift(self.centre) - ray.o;
        let a = ray.d.norm2();
        let b = ray.d.dot(m);
        let r2d2 = a * (self.radius * self.radius);
        let disc = r2d2 - m.cross(ray.d).norm2();
        let s = if self.is_crossing(disc.re(), r2d2.re()) { disc.sqrt() } else { constant(F::zero()) };
        match root {
            Root::Near => (b - s) * a.recip(),
            Root::Far => (b + s) * a.recip(),
        }
    }

    /// Nearest intersection in (t_min, t_max). A ray that only touches does not hit.
    #[inline(always)]
    pub fn hit<T: Real<Primitive = F>>(&self, ray: &Ray<T>, t_min: F, t_max: F) -> Option<(T, Root)> {
        let m = Vec3::lift(self.centre) - ray.o;
        let a = ray.d.norm2();
        let r2d2 = a * (self.radius * self.radius);
        let disc = r2d2 - m.cross(ray.d).norm2();
        if !self.is_crossing(disc.re(), r2d2.re()) {
            return None;
        }
        let (b, s, inv) = (ray.d.dot(m), disc.sqrt(), a.recip());
        let inside = |t: &T| t.re() > t_min && t.re() < t_max;
        let near = (b - s) * inv;
        if inside(&near) {
            return Some((near, Root::Near));
        }
        let far = (b + s) * inv;
        inside(&far).then_some((far, Root::Far))
    }

    /// Outward unit normal at a point of the sphere: n' = P' / R.
    #[inline(always)]
    pub fn normal<T: Real<Primitive = F>>(&self, p: Vec3<T>) -> Vec3<T> {
        (p - Vec3::lift(self.centre)).scale(self.radius.recip())
    }

    /// True if `o` lies strictly outside; from inside there is no silhouette.
    #[inline(always)]
    pub fn is_outside(&self, o: Vec3<F>) -> bool {
        (o - self.centre).norm2() > self.radius * self.radius
    }

    /// D large enough for its root to be differentiable in practice.
    #[inline(always)]
    fn is_crossing(&self, disc: F, scale: F) -> bool {
        let eps = F::of(GRAZING_EPS) * F::epsilon();
        disc > scale * (eps * eps)
    }
}
