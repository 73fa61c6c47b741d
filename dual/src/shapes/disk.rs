//! Disk: the points of a plane within a radius of its centre.
//!
//! Hit or miss by the rim's margin ([`crate::margins::rim`]), the hit condition multiplied out by (n.d)^2.

use super::Plane;
use crate::margins;
use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// A flat disk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk<F> {
    /// Centre.
    pub centre: Vec3<F>,
    /// Normal, of any length but zero.
    pub normal: Vec3<F>,
    /// Radius, positive.
    pub radius: F,
}

impl<F: Scalar> Disk<F> {
    /// From centre, normal and radius.
    pub fn new(centre: Vec3<F>, normal: Vec3<F>, radius: F) -> Self {
        Self { centre, normal, radius }
    }

    /// The plane it lies in.
    #[inline(always)]
    pub fn plane(&self) -> Plane<F> {
        Plane::new(self.centre, self.normal)
    }

    /// Ray parameter on the disk's plane, whether inside or not.
    #[inline(always)]
    pub fn t<T: Real<Primitive = F>>(&self, ray: &Ray<T>) -> T {
        self.plane().t(ray)
    }

    /// The `t` in (t_min, t_max), if the ray meets the disk there, from either side.
    #[inline(always)]
    pub fn hit<T: Real<Primitive = F>>(&self, ray: &Ray<T>, t_min: F, t_max: F) -> Option<T> {
        if !(margins::rim(&ray.re(), self) >= F::zero()) {
            return None;
        }
        self.plane().hit(ray, t_min, t_max)
    }
}
