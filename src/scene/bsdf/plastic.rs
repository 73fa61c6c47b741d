//! Plastic: a diffuse base under a dielectric coat, smooth or rough.
//!
//!   f_base = T(wo) T(wi) / (pi eta^2) * rho / (1 - c R_int),   c = rho if `nonlinear`, else 1
//!
//! with the transmittance T of the coat from outside and the diffuse reflectance R_int of the coat from inside: light
//! that comes back from the base is reflected down again with R_int, and the series over all bounces is summed.
//! The base's albedo is T(wo) base times the mean of T(wi). That mean is integrated on its own: facets of the model lose light that is
//! scattered more than once, so that (1 - R_int) eta^2, which a coat without losses would give, is too much (by 30 % at a roughness of 0.4).
//! Local space, normal = +z, black below. Pdf measure: solid angle of wi; one-sample mixture of coat and base.
//! Source: the model of Mitsuba's `plastic` and `roughplastic` (its "nonlinear" flag: whether the base tints each
//! internal bounce); Walter et al. 2007 for the rough coat; T of it from [`super::rough_transmittance`].
//! Not handled: anisotropy of T (the geometric mean of the two roughnesses counts).

use super::conductor::reflect_facets;
use super::diffuse::sample_cosine;
use super::lobe::LobeSample;
use super::microfacet::{Microfacet, reflect};
use super::rough_transmittance::Transmittance;
use super::{LobeKind, fresnel};
use crate::math::{Rgb, Vec2, Vec3, luminance};
use std::f32::consts::FRAC_1_PI;

/// What smooth and rough plastic share.
#[derive(Clone, Copy, Debug)]
struct Layers {
    /// rho / (1 - c R_int) / eta^2.
    base: Rgb,
    /// Factor on the coat's reflection.
    coat: Rgb,
    /// Share of the coat in the sum of the two reflectances.
    coat_share: f32,
    /// Mean transmittance of the coat from outside, over directions in proportion to their cosine.
    entering: f32,
}

impl Layers {
    fn new(eta: f32, rho: Rgb, coat: Rgb, nonlinear: bool, internal: f32, entering: f32) -> Self {
        let c = if nonlinear { rho } else { Rgb::ONE };
        // Reflectances above 1 could make the series diverge.
        let series = c.map(|c| 1.0 / (1.0 - c * internal).max(1e-3));
        let (d, s) = (luminance(rho), luminance(coat));
        Layers {
            base: rho * series / (eta * eta),
            coat,
            coat_share: if d + s > 0.0 { s / (d + s) } else { 0.5 },
            entering,
        }
    }

    /// The base alone.
    fn of_base(self) -> Self {
        Layers { coat: Rgb::ZERO, coat_share: 0.0, ..self }
    }

    /// The coat alone.
    fn of_coat(self) -> Self {
        Layers { base: Rgb::ZERO, coat_share: 1.0, ..self }
    }

    /// Probability to sample the coat where it reflects the share `f`.
    fn coat_probability(&self, f: f32) -> f32 {
        let s = f * self.coat_share;
        let d = (1.0 - f) * (1.0 - self.coat_share);
        if s + d > 0.0 { s / (s + d) } else { 0.5 }
    }

    fn albedo(&self, f: f32) -> Rgb {
        self.coat * f + self.base * ((1.0 - f) * self.entering)
    }
}

/// Methods that smooth and rough plastic have alike.
macro_rules! parts {
    ($plastic:ty) => {
        impl $plastic {
            /// Base and coat as materials of their own, whose values add up to this one's.
            pub fn split(self) -> [Self; 2] {
                [self.layers.of_base(), self.layers.of_coat()].map(|layers| Self { layers, ..self })
            }

            /// Whether the base reflects anything.
            pub fn has_base(&self) -> bool {
                self.layers.base != Rgb::ZERO
            }

            /// Whether the coat reflects anything.
            pub fn has_coat(&self) -> bool {
                self.layers.coat != Rgb::ZERO
            }
        }
    };
}
parts!(Plastic);
parts!(RoughPlastic);

/// Diffuse base under a smooth coat.
#[derive(Clone, Copy, Debug)]
pub struct Plastic {
    layers: Layers,
    eta: f32,
}

impl Plastic {
    /// `rho` is the albedo of the base, `coat` the factor on the coat's reflection.
    pub fn new(eta: f32, rho: Rgb, coat: Rgb, nonlinear: bool) -> Self {
        let internal = fresnel::diffuse_reflectance(1.0 / eta);
        let entering = 1.0 - fresnel::diffuse_reflectance(eta);
        Plastic { layers: Layers::new(eta, rho, coat, nonlinear, internal, entering), eta }
    }

    fn reflectance(&self, cos: f32) -> f32 {
        fresnel::dielectric(cos, self.eta).0
    }

    /// f cos and pdf of the base.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let (f_o, f_i) = (self.reflectance(wo.z), self.reflectance(wi.z));
        let lambert = wi.z * FRAC_1_PI;
        let f = self.layers.base * (lambert * (1.0 - f_o) * (1.0 - f_i));
        (f, lambert * (1.0 - self.layers.coat_probability(f_o)))
    }

    /// Mirror direction or a direction off the base.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<LobeSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let f = self.reflectance(wo.z);
        let p = self.layers.coat_probability(f);
        if u_lobe < p {
            let wi = Vec3::new(-wo.x, -wo.y, wo.z);
            Some(LobeSample::dirac(wi, LobeKind::Specular, self.layers.coat * f, p))
        } else {
            Some(sample_cosine(u))
        }
    }

    /// Directional albedo.
    pub fn albedo(&self, cos: f32) -> Rgb {
        self.layers.albedo(self.reflectance(cos))
    }
}

/// Diffuse base under a rough coat.
#[derive(Clone, Copy, Debug)]
pub struct RoughPlastic {
    layers: Layers,
    eta: f32,
    /// The facets of the coat.
    pub micro: Microfacet,
    transmittance: Transmittance,
}

impl RoughPlastic {
    /// `rho` is the albedo of the base, `coat` the factor on the coat's reflection.
    pub fn new(eta: f32, rho: Rgb, coat: Rgb, nonlinear: bool, micro: Microfacet) -> Self {
        let transmittance = Transmittance::new(&micro, eta);
        let (internal, entering) = (transmittance.internal_reflectance(), transmittance.mean());
        RoughPlastic { layers: Layers::new(eta, rho, coat, nonlinear, internal, entering), eta, micro, transmittance }
    }

    /// f cos and pdf.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return (Rgb::ZERO, 0.0);
        }
        let t_o = self.transmittance.at(wo.z);
        let p = self.layers.coat_probability(1.0 - t_o);
        let lambert = wi.z * FRAC_1_PI;
        let f = self.layers.base * (lambert * t_o * self.transmittance.at(wi.z));
        let pdf = (1.0 - p) * lambert;
        match reflect_facets(&self.micro, wo, wi) {
            Some((f_coat, pdf_coat, cos)) => {
                let r = fresnel::dielectric(cos, self.eta).0;
                (f + self.layers.coat * (f_coat * r), pdf + p * pdf_coat)
            }
            None => (f, pdf),
        }
    }

    /// Reflection at a visible facet of the coat or a direction off the base.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<LobeSample> {
        if wo.z <= 0.0 {
            return None;
        }
        let p = self.layers.coat_probability(1.0 - self.transmittance.at(wo.z));
        if u_lobe < p {
            let wi = reflect(wo, self.micro.sample(wo, u)?);
            (wi.z > 0.0).then(|| LobeSample::density(wi, LobeKind::Glossy))
        } else {
            Some(sample_cosine(u))
        }
    }

    /// Directional albedo.
    pub fn albedo(&self, cos: f32) -> Rgb {
        self.layers.albedo(1.0 - self.transmittance.at(cos))
    }
}
