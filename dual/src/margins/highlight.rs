//! Border of a highlight: where a glossy lobe falls to the fraction `tau` of its peak.
//!
//! * Lobe about the mirror direction s (Phong): `cos^e(s, d) = tau`, that is [`super::cone`] about s with
//!   `cos = tau^(1/e)` ([`phong_border`]): degree 2 in d, exact at order 2.
//! * Microfacet lobe about the half vector h = d/|d| + w (GGX): `cos(n, h) = c` with
//!   `c^2 = (1 - alpha^2 / sqrt tau) / (1 - alpha^2)` ([`ggx_border`]), from D = alpha^2 / (pi (c^2 (alpha^2 - 1) + 1)^2). Cleared of
//!   |d|: `m = (n.H)^2 - c^2 n.n H.H`, `H = d + |d| w`. The root makes it a prediction ([`half_vector`]).
//!
//! Only the lobe's own factor is looked at; Fresnel and shadowing-masking, smooth and slow, are not.

use crate::real::{Real, Scalar};
use crate::vec3::Vec3;

/// Cosine at which a Phong lobe cos^exponent falls to `tau` (0 < tau < 1) of its peak.
pub fn phong_border<F: Scalar>(exponent: F, tau: F) -> F {
    F::of(tau.to_f64().powf(1.0 / exponent.to_f64()))
}

/// Cosine between normal and half vector at which a GGX lobe of roughness `alpha` falls to `tau` of its peak; `None`
/// if it never does (a rough surface has no highlight border).
pub fn ggx_border<F: Scalar>(alpha: F, tau: F) -> Option<F> {
    let (alpha2, tau) = (alpha.to_f64().powi(2), tau.to_f64());
    let c2 = (1.0 - alpha2 / tau.sqrt()) / (1.0 - alpha2);
    (c2 > 0.0 && c2 < 1.0).then(|| F::of(c2.sqrt()))
}

/// Positive inside the highlight of a half-vector lobe: `d` towards the light (any length), `w` the **unit** vector towards the
/// viewer, `n` the normal, `cos` the border ([`ggx_border`]). Units: |n|^2 |d|^2.
#[inline(always)]
pub fn half_vector<T: Real>(d: Vec3<T>, w: Vec3<T>, n: Vec3<T>, cos: T::Primitive) -> T {
    let h = d + w * d.norm();
    let nh = n.dot(h);
    nh * nh - n.norm2() * h.norm2() * (cos * cos)
}
