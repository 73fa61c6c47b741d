//! Bidirectional scattering: a material at one point, as sample / pdf / eval trios.

use super::material::Material;
use super::surface::SurfacePoint;
use super::texture::Textures;
use crate::math::{Rgb, Vec2, Vec3};

/// What a path carries. Radiance scales with the squared index when it crosses a boundary, photon power does not;
/// and with shading normals the adjoint needs Veach's factor (1997, section 5.3). Both are applied here only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Path from the eye; `wo` points to where radiance flows.
    Radiance,
    /// Path from a light; `wo` points back to where the photon came from.
    Importance,
}

/// Kind of a scattering lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeKind {
    /// Diffuse: stores photons.
    Diffuse,
    /// Rough reflection or refraction.
    Glossy,
    /// Perfectly specular reflection or refraction (a Dirac lobe).
    Specular,
    /// Straight through, as if there were no surface.
    Null,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Direction away from the surface, world, unit.
    pub wi: Vec3,
    /// f |cos| / pdf over all lobes (for Dirac lobes: their weight over the probability of choosing them).
    pub weight: Rgb,
    /// Density per solid angle over all non-Dirac lobes; 0 for Dirac lobes (`lobe` tells).
    pub pdf_dir: f32,
    /// The lobe that was sampled.
    pub lobe: LobeKind,
    /// Relative index crossed (transmitted over incident side), 1 without refraction.
    pub eta: f32,
}

/// A material at a point: textures evaluated, nesting resolved into weighted lobes.
/// `wo` and `wi` are world unit vectors that point away from the surface.
#[derive(Clone, Debug)]
pub struct Bsdf {
    _todo: (),
}

impl Bsdf {
    /// The material `id` at `at`, seen from `wo`.
    pub fn new(materials: &[Material], id: u32, textures: Textures, at: &SurfacePoint, wo: Vec3) -> Self {
        let _ = (materials, id, textures, at, wo);
        todo!("helper bsdf")
    }

    /// f(wo, wi) |cos(n_shade, wi)|, Dirac lobes excluded.
    pub fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport) -> Rgb {
        let _ = (wo, wi, transport);
        todo!()
    }

    /// Density per solid angle with which [`Self::sample`] draws `wi`, Dirac lobes excluded.
    pub fn pdf_dir(&self, wo: Vec3, wi: Vec3) -> f32 {
        let _ = (wo, wi);
        todo!()
    }

    /// Draws a direction. `u_lobe` chooses the lobe, `u` the direction within.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2, transport: Transport) -> Option<BsdfSample> {
        let _ = (wo, u_lobe, u, transport);
        todo!()
    }

    /// [`Self::eval`] and [`Self::pdf_dir`] at once.
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3, transport: Transport) -> (Rgb, f32) {
        (self.eval(wo, wi, transport), self.pdf_dir(wo, wi))
    }

    /// Share of light that passes straight through (weight of the null lobes).
    pub fn straight_through(&self) -> f32 {
        todo!()
    }

    /// True if every lobe is a Dirac or null lobe: light sampling is of no use.
    pub fn is_delta(&self) -> bool {
        todo!()
    }

    /// Hemispherical albedo, approximate (for the albedo layer and photon storage).
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        let _ = wo;
        todo!()
    }
}
