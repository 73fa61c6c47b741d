//! Mirror reflection: `r = d - 2 (d.n) n`, `r' = d' - 2 [(d.n) n' + (d'.n + d.n') n]`.

use crate::real::Real;
use crate::vec3::Vec3;

/// Mirrors `d` at a surface with **unit** normal `n` (either side). Keeps |d|.
///
/// ```
/// use dualux_dual::{reflect, vec3};
/// assert_eq!(reflect(vec3(1.0, -1.0, 0.0), vec3(0.0, 1.0, 0.0)), vec3(1.0, 1.0, 0.0));
/// ```
#[inline(always)]
pub fn reflect<T: Real>(d: Vec3<T>, n: Vec3<T>) -> Vec3<T> {
    let dn = d.dot(n);
    d - n * (dn + dn)
}
