//! Total internal reflection: `k = n.n d.d - eta^2 (n.n d.d - (n.d)^2)`, eta = n_incident / n_transmitted.
//!
//! At a plane n is constant and k has degree 2 in d: exact at order 2 wherever d is affine in p. At a curved surface n is a dual
//! and k a prediction. For unit n it equals the margin [`crate::refract`] returns.

use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// Positive where light is transmitted, zero at the critical angle, negative under total reflection. Units: |n|^2 |d|^2.
///
/// For eta <= 1 it is positive for every direction.
#[inline(always)]
pub fn total_reflection<T: Real>(d: Vec3<T>, n: Vec3<T>, eta: T::Primitive) -> T {
    let nd = n.dot(d);
    let nn_dd = n.norm2() * d.norm2();
    let eta2 = eta * eta;
    nd * nd * eta2 + nn_dd * (T::Primitive::of(1.0) - eta2)
}
