//! Diffuse reflection: Lambert and Oren-Nayar.
//!
//! Local space, normal = +z, black below. Pdf measure: solid angle, cosine-weighted: pdf = cos / pi.
//! Source: Oren & Nayar 1994, "Generalization of Lambert's Reflectance Model", eq. 30 (qualitative model).
//! Bias: none in the sampling; the qualitative model leaves out interreflections between facets.

use super::clamp_or_low;
use super::lobe::LobeSample;
use crate::math::{Rgb, Vec2, Vec3, warp};
use crate::scene::LobeKind;
use std::f32::consts::{FRAC_1_PI, SQRT_2};

/// Lambertian reflection.
#[derive(Clone, Copy, Debug)]
pub struct Lambert {
    /// Albedo.
    pub reflectance: Rgb,
}

impl Lambert {
    /// f cos and pdf.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let pdf = wi.z * FRAC_1_PI;
        (self.reflectance * pdf, pdf)
    }
}

/// Rough diffuse reflection.
#[derive(Clone, Copy, Debug)]
pub struct OrenNayar {
    /// Albedo of a facet.
    pub reflectance: Rgb,
    a: f32,
    b: f32,
}

impl OrenNayar {
    /// `alpha` is the roughness of a Beckmann surface with the same slopes: sqrt(2) times the standard deviation of the
    /// facets' angle (the convention of Mitsuba 0.6's `roughdiffuse`).
    pub fn new(reflectance: Rgb, alpha: f32) -> Self {
        let sigma = clamp_or_low(alpha, 0.0, 1e3) / SQRT_2;
        let sigma2 = sigma * sigma;
        OrenNayar { reflectance, a: 1.0 - 0.5 * sigma2 / (sigma2 + 0.33), b: 0.45 * sigma2 / (sigma2 + 0.09) }
    }

    /// f cos and pdf.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let pdf = wi.z * FRAC_1_PI;
        // sin_i sin_o cos(phi) is the dot product in the plane; sin(alpha) tan(beta) = sin_i sin_o / max(cos_i, cos_o).
        let planar = wo.x * wi.x + wo.y * wi.y;
        let slope = planar.max(0.0) / wo.z.max(wi.z);
        (self.reflectance * (pdf * (self.a + self.b * slope)), pdf)
    }
}

/// A cosine-distributed direction above the horizon.
pub fn sample_cosine(u: Vec2) -> LobeSample {
    LobeSample::density(warp::sample_cosine_hemisphere(u), LobeKind::Diffuse)
}
