//! Metals: smooth and rough.
//!
//! Local space, normal = +z, black below. Pdf measure of the rough metal: solid angle of wi.
//! Source: Walter et al. 2007, eq. 20; visible normals after Heitz & d'Eon 2014: pdf = D(m) / (4 A(wo)) with the
//! projected area A.

use super::lobe::LobeSample;
use super::microfacet::{Microfacet, reflect};
use super::{LobeKind, fresnel};
use crate::math::{Rgb, Vec2, Vec3};

/// Fresnel reflectance of a metal, tinted.
#[derive(Clone, Copy, Debug)]
pub struct Metal {
    /// Real part of the index.
    pub eta: Rgb,
    /// Imaginary part of the index.
    pub k: Rgb,
    /// Factor on the reflectance.
    pub tint: Rgb,
}

impl Metal {
    /// Reflectance under the cosine `cos`.
    pub fn reflectance(&self, cos: f32) -> Rgb {
        fresnel::conductor(cos, self.eta, self.k) * self.tint
    }

    /// Mirror direction.
    pub fn sample(&self, wo: Vec3) -> Option<LobeSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let wi = Vec3::new(-wo.x, -wo.y, wo.z);
        Some(LobeSample::dirac(wi, LobeKind::Specular, self.reflectance(wo.z), 1.0))
    }
}

/// f cos / F and pdf of reflection at facets, and the cosine on the facet; `None` where nothing is reflected.
pub fn reflect_facets(micro: &Microfacet, wo: Vec3, wi: Vec3) -> Option<(f32, f32, f32)> {
    if wo.z <= 0.0 || wi.z <= 0.0 {
        return None;
    }
    let m = (wo + wi).try_normalize()?;
    let cos = wo.dot(m);
    if cos <= 0.0 {
        return None;
    }
    let d = micro.d(m);
    let f = 0.25 * d * micro.g1(wo, m) * micro.g1(wi, m) / wo.z;
    let pdf = 0.25 * d / micro.projected_area(wo);
    // The two quotients overflow together where the sharpest peaks meet the horizon.
    (f.is_finite() && pdf.is_finite()).then_some((f, pdf, cos))
}

/// A rough metal.
#[derive(Clone, Copy, Debug)]
pub struct RoughMetal {
    /// Reflectance of a facet.
    pub metal: Metal,
    /// The facets.
    pub micro: Microfacet,
}

impl RoughMetal {
    /// f cos and pdf.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        match reflect_facets(&self.micro, wo, wi) {
            Some((f, pdf, cos)) => (f * self.metal.reflectance(cos), pdf),
            None => (Rgb::ZERO, 0.0),
        }
    }

    /// Reflection at a visible facet.
    pub fn sample(&self, wo: Vec3, u: Vec2) -> Option<LobeSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let wi = reflect(wo, self.micro.sample(wo, u)?);
        (wi.z > 0.0).then(|| LobeSample::density(wi, LobeKind::Glossy))
    }
}
