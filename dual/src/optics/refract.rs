//! Refraction by Snell's law, with the margin of total internal reflection.
//!
//! For a direction of any length, unit normal n against it, eta = n_incident / n_transmitted, c = -d.n:
//! `k = d.d - eta^2 (d.d - c^2)`, and for k > 0: `d_t = eta d + (eta c - sqrt k) n`, of the same length as d.
//! k is the margin: polynomial of degree 2 in d (for a plane and a fixed origin hence exact at order 2), zero at the
//! critical angle. With |d| = 1 it is cos^2 of the transmitted angle, and the derivative is the one of METHODS 3.B.

use crate::real::Real;
use crate::vec3::Vec3;

/// Outcome of [`refract`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refraction<T> {
    /// Transmitted direction, as long as the incident one; `None` under total internal reflection.
    pub direction: Option<Vec3<T>>,
    /// `k`: positive where light is transmitted, zero at the critical angle, negative under total internal reflection.
    pub margin: T,
}

/// Refracts `d` at a surface with **unit** normal `n` against it (d.n < 0, see [`super::face_against`]);
/// `eta` is the index of refraction on the side the ray comes from, divided by that on the other side.
///
/// ```
/// use dualux_dual::{refract, vec3};
/// let into_glass = refract(vec3(0.6f64, -0.8, 0.0), vec3(0.0, 1.0, 0.0), 1.0 / 1.5);
/// assert!((into_glass.direction.unwrap().x - 0.4).abs() < 1e-15); // Snell: 0.6 / 1.5
/// let out_of_glass = refract(vec3(0.6f64, -0.8, 0.0), vec3(0.0, 1.0, 0.0), 2.0);
/// assert!(out_of_glass.direction.is_none() && out_of_glass.margin < 0.0);
/// ```
#[inline(always)]
pub fn refract<T: Real>(d: Vec3<T>, n: Vec3<T>, eta: T::Primitive) -> Refraction<T> {
    let c = -d.dot(n);
    let d2 = d.norm2();
    let k = d2 - (d2 - c * c) * (eta * eta);
    let zero = <T::Primitive as crate::Scalar>::of(0.0);
    // At k = 0 the root has no derivative; the critical ray counts as reflected.
    let direction = (k.re() > zero).then(|| d.scale(eta) + n * (c * eta - k.sqrt()));
    Refraction { direction, margin: k }
}
