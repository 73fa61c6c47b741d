//! Plane: `t = n.(c - o) / n.d`.

use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// An infinite plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane<F> {
    /// Any point of the plane.
    pub point: Vec3<F>,
    /// Normal, of any length but zero.
    pub normal: Vec3<F>,
}

impl<F: Scalar> Plane<F> {
    /// Through `point`, perpendicular to `normal`.
    pub fn new(point: Vec3<F>, normal: Vec3<F>) -> Self {
        Self { point, normal }
    }

    /// `n.(c - o)`: the origin's distance *below* the plane, times |n|; positive if the normal points away from the origin.
    #[inline(always)]
    pub fn tau<T: Real<Primitive = F>>(&self, o: Vec3<T>) -> T {
        Vec3::lift(self.normal).dot(Vec3::lift(self.point) - o)
    }

    /// Ray parameter at which the ray's line meets the plane; not finite for a parallel ray.
    #[inline(always)]
    pub fn t<T: Real<Primitive = F>>(&self, ray: &Ray<T>) -> T {
        self.tau(ray.o) * Vec3::lift(self.normal).dot(ray.d).recip()
    }

    /// The `t` in (t_min, t_max), if the ray meets the plane there.
    #[inline(always)]
    pub fn hit<T: Real<Primitive = F>>(&self, ray: &Ray<T>, t_min: F, t_max: F) -> Option<T> {
        let t = self.t(ray);
        (t.re() > t_min && t.re() < t_max).then_some(t)
    }

    /// The same plane with its normal pointing away from `o`, so that `tau(o) >= 0` and rays meet it where `n.d > 0`.
    #[inline(always)]
    pub fn facing_away(&self, o: Vec3<F>) -> Self {
        if self.tau(o) < F::zero() { Self { normal: -self.normal, ..*self } } else { *self }
    }
}
