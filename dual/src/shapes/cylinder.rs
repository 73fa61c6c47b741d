//! Open circular cylinder between two points of its axis (no caps; add two [`super::Disk`]s for those).
//!
//! With A = b - a (not normalised), m = a - o: perpendicular parts enter as m x A and d x A, so
//! `t = (d_.m_ -+ |A| sqrt D) / d_.d_`, `d_ = d x A`, `m_ = m x A`, `D = R^2 |d x A|^2 - (A.(m x d))^2`.
//! sqrt(D) = 0 where the ray's line is tangent: A.(m x d) / |d x A| is its distance from the axis.

use super::{GRAZING_EPS, Root};
use crate::ray::Ray;
use crate::real::{Real, Scalar, constant};
use crate::vec3::Vec3;

/// An open cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder<F> {
    /// Centre of the first rim.
    pub a: Vec3<F>,
    /// Centre of the second rim.
    pub b: Vec3<F>,
    /// Radius, positive.
    pub radius: F,
}

impl<F: Scalar> Cylinder<F> {
    /// Between the rim centres `a` and `b`.
    pub fn new(a: Vec3<F>, b: Vec3<F>, radius: F) -> Self {
        Self { a, b, radius }
    }

    /// Axis `b - a`, as long as the cylinder.
    #[inline(always)]
    pub fn axis(&self) -> Vec3<F> {
        self.b - self.a
    }

    /// The two disks that would close it: at a and at b, normals along the axis outwards.
    #[inline(always)]
    pub fn caps(&self) -> [super::Disk<F>; 2] {
        let n = self.axis();
        [super::Disk::new(self.a, -n, self.radius), super::Disk::new(self.b, n, self.radius)]
    }

    /// Discriminant of the infinite cylinder: positive where the ray's line enters it. Scales with |d|^2 |A|^2.
    #[inline(always)]
    pub fn discriminant<T: Real<Primitive = F>>(&self, ray: &Ray<T>) -> T {
        let axis = Vec3::lift(self.axis());
        let m = Vec3::lift(self.a) - ray.o;
        let k = axis.dot(m.cross(ray.d));
        ray.d.cross(axis).norm2() * (self.radius * self.radius) - k * k
    }

    /// Ray parameter of the chosen root on the infinite cylinder; the closest approach to the axis where there is none
    /// (like [`super::Sphere::t`]); not finite for a ray along the axis.
    #[inline(always)]
    pub fn t<T: Real<Primitive = F>>(&self, ray: &Ray<T>, root: Root) -> T {
        let (mid, half, _) = self.roots(ray);
        match root {
            Root::Near => mid - half,
            Root::Far => mid + half,
        }
    }

    /// Nearest intersection in (t_min, t_max) between the rims, from outside or inside.
    #[inline(always)]
    pub fn hit<T: Real<Primitive = F>>(&self, ray: &Ray<T>, t_min: F, t_max: F) -> Option<(T, Root)> {
        let (mid, half, crossing) = self.roots(ray);
        if !crossing {
            return None;
        }
        let inside = |t: &T| {
            let h = self.height(ray.re().at(t.re()));
            t.re() > t_min && t.re() < t_max && h >= F::zero() && h <= F::one()
        };
        let near = mid - half;
        if inside(&near) {
            return Some((near, Root::Near));
        }
        let far = mid + half;
        inside(&far).then_some((far, Root::Far))
    }

    /// Position along the axis: 0 at the rim of a, 1 at the rim of b.
    #[inline(always)]
    pub fn height<T: Real<Primitive = F>>(&self, p: Vec3<T>) -> T {
        let axis = self.axis();
        (p - Vec3::lift(self.a)).dot(Vec3::lift(axis.scale(axis.norm2().recip())))
    }

    /// Outward unit normal at a point of the mantle.
    #[inline(always)]
    pub fn normal<T: Real<Primitive = F>>(&self, p: Vec3<T>) -> Vec3<T> {
        let q = p - Vec3::lift(self.a);
        (q - Vec3::lift(self.axis()) * self.height(p)).scale(self.radius.recip())
    }

    /// True if `o` lies strictly outside the infinite cylinder; from inside there are no silhouette lines.
    #[inline(always)]
    pub fn is_outside(&self, o: Vec3<F>) -> bool {
        let axis = self.axis();
        (o - self.a).cross(axis).norm2() > self.radius * self.radius * axis.norm2()
    }

    /// Middle and half distance of the two roots, and whether they are real.
    #[inline(always)]
    fn roots<T: Real<Primitive = F>>(&self, ray: &Ray<T>) -> (T, T, bool) {
        let axis = Vec3::lift(self.axis());
        let m = Vec3::lift(self.a) - ray.o;
        let (dx, mx) = (ray.d.cross(axis), m.cross(axis));
        let a = dx.norm2();
        let k = axis.dot(m.cross(ray.d));
        let scale = a * (self.radius * self.radius);
        let disc = scale - k * k;
        let eps = F::of(GRAZING_EPS) * F::epsilon();
        let crossing = disc.re() > scale.re() * (eps * eps);
        let inv = a.recip();
        let half = if crossing { (disc * self.axis().norm2()).sqrt() * inv } else { constant(F::zero()) };
        (dx.dot(mx) * inv, half, crossing)
    }
}
