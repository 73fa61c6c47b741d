//! Barycentric interpolation of vertex attributes, and the shading normal made of it.
//!
//! `N = sum b_i N_i`, `n = N / |N|`; derivative `n' = (N' - n (n.N')) / |N|`, `N' = sum b_i' N_i`.

use crate::real::{Prim, Real};
use crate::vec3::Vec3;

/// Interpolates one number per vertex (a texture coordinate, say).
#[inline(always)]
pub fn interpolate<T: Real>(b: [T; 3], at: [Prim<T>; 3]) -> T {
    b[0] * at[0] + b[1] * at[1] + b[2] * at[2]
}

/// Interpolates one vector per vertex, not normalised.
#[inline(always)]
pub fn interpolate_vec3<T: Real>(b: [T; 3], at: [Vec3<Prim<T>>; 3]) -> Vec3<T> {
    Vec3 { x: interpolate(b, at.map(|v| v.x)), y: interpolate(b, at.map(|v| v.y)), z: interpolate(b, at.map(|v| v.z)) }
}

/// Unit shading normal from vertex normals; not finite if they cancel at this point.
#[inline(always)]
pub fn interpolate_normal<T: Real>(b: [T; 3], normals: [Vec3<Prim<T>>; 3]) -> Vec3<T> {
    interpolate_vec3(b, normals).normalized()
}
