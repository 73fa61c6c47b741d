//! Triangle.
//!
//! Hit or miss is decided by the three edge determinants `det[a - o, b - o, d]`, the very numbers that serve as margins
//! ([`crate::margins::line()`]). They change sign exactly when an edge's ends are exchanged, so neighbouring triangles agree on
//! their common edge. The hit itself is the point on the plane, `t = n.(a - o) / n.d`.

use super::Plane;
use crate::margins;
use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// A triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<F> {
    /// First vertex.
    pub a: Vec3<F>,
    /// Second vertex.
    pub b: Vec3<F>,
    /// Third vertex.
    pub c: Vec3<F>,
}

impl<F: Scalar> Triangle<F> {
    /// From its vertices.
    pub fn new(a: Vec3<F>, b: Vec3<F>, c: Vec3<F>) -> Self {
        Self { a, b, c }
    }

    /// `(b - a) x (c - a)`: the normal, twice the area long.
    #[inline(always)]
    pub fn area_normal(&self) -> Vec3<F> {
        (self.b - self.a).cross(self.c - self.a)
    }

    /// Unit normal; not finite for a triangle without area.
    #[inline(always)]
    pub fn normal(&self) -> Vec3<F> {
        self.area_normal().normalized()
    }

    /// The plane it lies in (normal not of unit length).
    #[inline(always)]
    pub fn plane(&self) -> Plane<F> {
        Plane::new(self.a, self.area_normal())
    }

    /// The three edges, in the order opposite to c, a, b: ab, bc, ca.
    #[inline(always)]
    pub fn edges(&self) -> [[Vec3<F>; 2]; 3] {
        [[self.a, self.b], [self.b, self.c], [self.c, self.a]]
    }

    /// Ray parameter on the triangle's plane, whether inside or not.
    #[inline(always)]
    pub fn t<T: Real<Primitive = F>>(&self, ray: &Ray<T>) -> T {
        self.plane().t(ray)
    }

    /// Barycentric coordinates (of a, b, c) of a point of the plane; they sum to 1.
    ///
    /// ```
    /// use dualux_dual::{Triangle, vec3};
    /// let tri = Triangle::new(vec3(0.0, 0.0, 0.0), vec3(2.0, 0.0, 0.0), vec3(0.0, 4.0, 0.0));
    /// assert_eq!(tri.barycentrics(vec3(1.0, 1.0, 0.0)), [0.25, 0.5, 0.25]);
    /// ```
    #[inline(always)]
    pub fn barycentrics<T: Real<Primitive = F>>(&self, p: Vec3<T>) -> [T; 3] {
        let (e1, e2) = (self.b - self.a, self.c - self.a);
        let n = e1.cross(e2);
        let inv = n.norm2().recip();
        let q = p - Vec3::lift(self.a);
        // (q x e2).n and (e1 x q).n as fixed linear forms of q.
        let v = q.dot(Vec3::lift(e2.cross(n).scale(inv)));
        let w = q.dot(Vec3::lift(n.cross(e1).scale(inv)));
        [-(v + w) + F::one(), v, w]
    }

    /// The `t` in (t_min, t_max), if the ray meets the triangle there, from either side.
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
