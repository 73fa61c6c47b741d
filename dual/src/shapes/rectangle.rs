//! Rectangle, or any parallelogram: `c + u e1 + v e2`, u and v in `[-1,1]`.
//!
//! Hit or miss by the determinants of its four edges, like [`super::Triangle`].

use super::Plane;
use crate::margins;
use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// A parallelogram given by its centre and two half edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle<F> {
    /// Centre.
    pub centre: Vec3<F>,
    /// From the centre to the middle of the side u = 1.
    pub e1: Vec3<F>,
    /// From the centre to the middle of the side v = 1.
    pub e2: Vec3<F>,
}

impl<F: Scalar> Rectangle<F> {
    /// From centre and half edges.
    pub fn new(centre: Vec3<F>, e1: Vec3<F>, e2: Vec3<F>) -> Self {
        Self { centre, e1, e2 }
    }

    /// `e1 x e2`: the normal, a quarter of the area long.
    #[inline(always)]
    pub fn area_normal(&self) -> Vec3<F> {
        self.e1.cross(self.e2)
    }

    /// Unit normal.
    #[inline(always)]
    pub fn normal(&self) -> Vec3<F> {
        self.area_normal().normalized()
    }

    /// The plane it lies in (normal not of unit length).
    #[inline(always)]
    pub fn plane(&self) -> Plane<F> {
        Plane::new(self.centre, self.area_normal())
    }

    /// Corners, counter-clockwise about the normal: (-,-), (+,-), (+,+), (-,+).
    #[inline(always)]
    pub fn corners(&self) -> [Vec3<F>; 4] {
        let (c, a, b) = (self.centre, self.e1, self.e2);
        [c - a - b, c + a - b, c + a + b, c - a + b]
    }

    /// The four edges, counter-clockwise about the normal.
    #[inline(always)]
    pub fn edges(&self) -> [[Vec3<F>; 2]; 4] {
        let [a, b, c, d] = self.corners();
        [[a, b], [b, c], [c, d], [d, a]]
    }

    /// Ray parameter on the rectangle's plane, whether inside or not.
    #[inline(always)]
    pub fn t<T: Real<Primitive = F>>(&self, ray: &Ray<T>) -> T {
        self.plane().t(ray)
    }

    /// Coordinates (u, v) of a point of the plane; inside is `[-1,1]^2`.
    #[inline(always)]
    pub fn uv<T: Real<Primitive = F>>(&self, p: Vec3<T>) -> [T; 2] {
        let n = self.area_normal();
        let inv = n.norm2().recip();
        let q = p - Vec3::lift(self.centre);
        [q.dot(Vec3::lift(self.e2.cross(n).scale(inv))), q.dot(Vec3::lift(n.cross(self.e1).scale(inv)))]
    }

    /// The `t` in (t_min, t_max), if the ray meets the rectangle there, from either side.
    #[inline(always)]
    pub fn hit<T: Real<Primitive = F>>(&self, ray: &Ray<T>, t_min: F, t_max: F) -> Option<T> {
        let r = ray.re();
        let m = self.edges().map(|[a, b]| margins::line(&r, a, b));
        let zero = F::zero();
        let same = m.iter().all(|&m| m >= zero) || m.iter().all(|&m| m <= zero);
        if !same {
            return None;
        }
        self.plane().hit(ray, t_min, t_max)
    }
}
