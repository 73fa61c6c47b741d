//! Open cylinder: silhouette lines and rims.
//!
//! `D = R^2 |d x A|^2 - (A.(m x d))^2`, A = b - a, m = a - o: degree 2 in d, exact at order 2 for a fixed origin outside.
//! It knows nothing of the cylinder's ends; for a fixed origin its zero set are the two generator lines
//! of [`cylinder_silhouette`], segments that clip exactly. The rims are circles: [`super::rim`] of [`Cylinder::caps`].

use crate::ray::Ray;
use crate::real::{Real, Scalar};
use crate::shapes::Cylinder;
use crate::vec3::Vec3;

/// The discriminant of the infinite cylinder: positive inside its silhouette. Units: length^4 |d|^2.
#[inline(always)]
pub fn cylinder<T: Real>(ray: &Ray<T>, c: &Cylinder<T::Primitive>) -> T {
    c.discriminant(ray)
}

/// The two straight silhouettes seen from `o`, from rim a to rim b; `None` from inside the infinite cylinder.
///
/// In the plane across the axis this is the polar of o: foot at `-m_ R^2 / m_.m_`, half width `R sqrt(1 - R^2 / m_.m_)`, m_ the
/// part of m = a - o across the axis.
pub fn cylinder_silhouette<F: Scalar>(o: Vec3<F>, c: &Cylinder<F>) -> Option<[[Vec3<F>; 2]; 2]> {
    let axis = c.axis();
    let unit = axis.normalized();
    let m = c.a - o;
    let across = m - unit * unit.dot(m);
    let q = c.radius * c.radius * across.norm2().recip();
    if !(q < F::one()) {
        return None;
    }
    let foot = c.a - across.scale(q);
    let side = unit.cross(across).normalized().scale(c.radius * (F::one() - q).sqrt());
    Some([[foot + side, foot + side + axis], [foot - side, foot - side + axis]])
}
