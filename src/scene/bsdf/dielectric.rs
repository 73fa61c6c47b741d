//! Glass: smooth boundary, thin pane, rough boundary.
//!
//! Local space, normal = +z on the exterior side; both sides scatter. Values are those for importance: the factor
//! 1 / eta^2 for radiance that crosses a boundary is applied in `mod.rs`.
//! Pdf measure of the rough boundary: solid angle of wi; the choice between reflection and refraction is made on the
//! facet, in proportion to what it reflects and transmits.
//! Source: Walter et al. 2007, eq. 20, 21, 17 (half vector Jacobian). Thin pane: the sum over all interreflections,
//! R' = R + T R T + ... = 2 R / (1 + R).

use super::conductor::reflect_facets;
use super::lobe::LobeSample;
use super::microfacet::{Microfacet, reflect};
use super::{LobeKind, fresnel};
use crate::math::{Rgb, Vec2, Vec3, luminance};

/// A dielectric boundary, tinted.
#[derive(Clone, Copy, Debug)]
pub struct Boundary {
    /// Interior over exterior index.
    pub eta: f32,
    /// Factor on reflection.
    pub reflectance: Rgb,
    /// Factor on transmission.
    pub transmittance: Rgb,
}

impl Boundary {
    /// Index of the far side over that of the side of a direction with the cosine `cos`.
    pub fn relative_eta(&self, cos: f32) -> f32 {
        if cos >= 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Probability to sample reflection where the share `f` is reflected.
    fn reflect_probability(&self, f: f32) -> f32 {
        let r = f * luminance(self.reflectance);
        let t = (1.0 - f) * luminance(self.transmittance);
        if r + t > 0.0 { r / (r + t) } else { f }
    }

    /// Directional albedo (both sides together) under the cosine `cos`, smooth.
    pub fn albedo(&self, cos: f32) -> Rgb {
        let f = fresnel::dielectric(cos.abs(), self.relative_eta(cos)).0;
        self.reflectance * f + self.transmittance * (1.0 - f)
    }

    /// Directional albedo of a thin pane.
    pub fn thin_albedo(&self, cos: f32) -> Rgb {
        let f = self.thin_reflectance(cos);
        self.reflectance * f + self.transmittance * (1.0 - f)
    }

    fn thin_reflectance(&self, cos: f32) -> f32 {
        // Seen from either side the pane's inside is the other medium.
        let f = fresnel::dielectric(cos.abs(), self.eta).0;
        2.0 * f / (1.0 + f)
    }

    /// Mirror direction or refracted direction.
    pub fn sample(&self, wo: Vec3, u: f32) -> Option<LobeSample> {
        let eta = self.relative_eta(wo.z);
        let (f, cos_t) = fresnel::dielectric(wo.z.abs(), eta);
        let p = self.reflect_probability(f);
        if u < p {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            return Some(LobeSample::dirac(wi, LobeKind::Specular, self.reflectance * f, p));
        }
        if f >= 1.0 {
            return None;
        }
        let wi = Vec3::new(-wo.x / eta, -wo.y / eta, -cos_t.copysign(wo.z));
        let s = LobeSample::dirac(wi, LobeKind::Specular, self.transmittance * (1.0 - f), 1.0 - p);
        Some(LobeSample { eta, ..s })
    }

    /// Mirror direction or straight on.
    pub fn sample_thin(&self, wo: Vec3, u: f32) -> LobeSample {
        let f = self.thin_reflectance(wo.z);
        let p = self.reflect_probability(f);
        if u < p {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            LobeSample::dirac(wi, LobeKind::Specular, self.reflectance * f, p)
        } else {
            LobeSample::dirac(-wo, LobeKind::Specular, self.transmittance * (1.0 - f), 1.0 - p)
        }
    }
}

/// A rough dielectric boundary.
#[derive(Clone, Copy, Debug)]
pub struct RoughBoundary {
    /// The boundary of a facet; its `eta` differs from 1.
    pub boundary: Boundary,
    /// The facets.
    pub micro: Microfacet,
}

impl RoughBoundary {
    /// f |cos| and pdf.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        // The distribution looks the same from below: mirror everything so that wo is above.
        let eta = self.boundary.relative_eta(wo.z);
        let (wo, wi) = if wo.z < 0.0 { (flip(wo), flip(wi)) } else { (wo, wi) };
        if wi.z > 0.0 {
            let Some((f, pdf, cos)) = reflect_facets(&self.micro, wo, wi) else {
                return (Rgb::ZERO, 0.0);
            };
            let (r, _) = fresnel::dielectric(cos, eta);
            let p = self.boundary.reflect_probability(r);
            (self.boundary.reflectance * (f * r), pdf * p)
        } else {
            self.transmit(wo, wi, eta)
        }
    }

    fn transmit(&self, wo: Vec3, wi: Vec3, eta: f32) -> (Rgb, f32) {
        let none = (Rgb::ZERO, 0.0);
        let Some(m) = (wo + wi * eta).try_normalize() else {
            return none;
        };
        let m = if m.z < 0.0 { -m } else { m };
        let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
        if wo.z <= 0.0 || wi.z >= 0.0 || cos_o <= 0.0 || cos_i >= 0.0 {
            return none;
        }
        let (r, _) = fresnel::dielectric(cos_o, eta);
        let root = cos_o + eta * cos_i;
        let d = self.micro.d(m) * eta * eta * cos_o * -cos_i / (root * root);
        let f = (1.0 - r) * d * self.micro.g1(wo, m) * self.micro.g1(wi, m) / wo.z;
        let pdf = (1.0 - self.boundary.reflect_probability(r)) * d / self.micro.projected_area(wo);
        if !(f.is_finite() && pdf.is_finite()) {
            return none;
        }
        (self.boundary.transmittance * f, pdf)
    }

    /// Reflection or refraction at a visible facet.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<LobeSample> {
        let eta = self.boundary.relative_eta(wo.z);
        let below = wo.z < 0.0;
        let v = if below { flip(wo) } else { wo };
        if v.z <= 0.0 {
            return None;
        }
        let m = self.micro.sample(v, u)?;
        let cos = v.dot(m);
        if cos <= 0.0 {
            return None;
        }
        let (r, cos_t) = fresnel::dielectric(cos, eta);
        let (wi, eta) = if u_lobe < self.boundary.reflect_probability(r) {
            (reflect(v, m), 1.0)
        } else {
            (m * (cos / eta - cos_t) - v / eta, eta)
        };
        // A facet may send light through the surface where it should not: such samples fail.
        if (wi.z > 0.0) != (eta == 1.0) || wi.z == 0.0 {
            return None;
        }
        let s = LobeSample::density(if below { flip(wi) } else { wi }, LobeKind::Glossy);
        Some(LobeSample { eta, ..s })
    }
}

fn flip(v: Vec3) -> Vec3 {
    Vec3::new(v.x, v.y, -v.z)
}
