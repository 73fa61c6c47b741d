//! One scattering lobe: the closed family of models, in local space (normal = +z).
//!
//! A lobe is plain parameters without textures. Values are f |cos(wi)| for importance, pdfs per solid angle of wi, both
//! without the Dirac part of the lobe. What depends on the kind of transport is applied in `mod.rs`.

use super::LobeKind;
use super::conductor::{Metal, RoughMetal};
use super::dielectric::{Boundary, RoughBoundary};
use super::diffuse::{Lambert, OrenNayar, sample_cosine};
use super::plastic::{Plastic, RoughPlastic};
use crate::math::{Rgb, Vec2, Vec3};

/// A scattering model with its parameters at one point.
#[derive(Clone, Debug)]
pub enum Lobe {
    Lambert(Lambert),
    OrenNayar(OrenNayar),
    Metal(Metal),
    RoughMetal(RoughMetal),
    Glass(Boundary),
    Pane(Boundary),
    RoughGlass(RoughBoundary),
    Plastic(Plastic),
    RoughPlastic(RoughPlastic),
    Null,
}

/// A direction drawn from a lobe.
#[derive(Clone, Copy, Debug)]
pub struct LobeSample {
    /// Direction, local.
    pub wi: Vec3,
    /// Kind of scattering.
    pub kind: LobeKind,
    /// Relative index crossed (transmitted over incident side).
    pub eta: f32,
    /// Of Dirac lobes: what they scatter, and the probability of having chosen them.
    pub dirac: Option<(Rgb, f32)>,
}

impl LobeSample {
    /// A sample of a lobe with a density.
    pub fn density(wi: Vec3, kind: LobeKind) -> Self {
        LobeSample { wi, kind, eta: 1.0, dirac: None }
    }

    /// A sample of a Dirac lobe.
    pub fn dirac(wi: Vec3, kind: LobeKind, value: Rgb, pmf: f32) -> Self {
        LobeSample { wi, kind, eta: 1.0, dirac: Some((value, pmf)) }
    }
}

impl Lobe {
    /// f |cos| and pdf of the part that has a density.
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        match self {
            Lobe::Lambert(l) => l.eval(wo, wi),
            Lobe::OrenNayar(l) => l.eval(wo, wi),
            Lobe::RoughMetal(l) => l.eval(wo, wi),
            Lobe::RoughGlass(l) => l.eval(wo, wi),
            Lobe::Plastic(l) => l.eval(wo, wi),
            Lobe::RoughPlastic(l) => l.eval(wo, wi),
            Lobe::Metal(_) | Lobe::Glass(_) | Lobe::Pane(_) | Lobe::Null => (Rgb::ZERO, 0.0),
        }
    }

    /// Draws a direction.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<LobeSample> {
        match self {
            Lobe::Lambert(_) | Lobe::OrenNayar(_) => (wo.z > 0.0).then(|| sample_cosine(u)),
            Lobe::Metal(l) => l.sample(wo),
            Lobe::RoughMetal(l) => l.sample(wo, u),
            Lobe::Glass(l) => l.sample(wo, u_lobe),
            Lobe::Pane(l) => Some(l.sample_thin(wo, u_lobe)),
            Lobe::RoughGlass(l) => l.sample(wo, u_lobe, u),
            Lobe::Plastic(l) => l.sample(wo, u_lobe, u),
            Lobe::RoughPlastic(l) => l.sample(wo, u_lobe, u),
            Lobe::Null => Some(LobeSample::dirac(-wo, LobeKind::Null, Rgb::ONE, 1.0)),
        }
    }

    /// Share of light scattered, roughly: exact for Lambert and for Dirac lobes, without shadowing between facets for
    /// the others. Positive wherever the lobe scatters anything.
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        let cos = wo.z;
        let two_sided = matches!(self, Lobe::Glass(_) | Lobe::Pane(_) | Lobe::RoughGlass(_) | Lobe::Null);
        if cos <= 0.0 && !two_sided {
            return Rgb::ZERO;
        }
        match self {
            Lobe::Lambert(l) => l.reflectance,
            Lobe::OrenNayar(l) => l.reflectance,
            Lobe::Metal(l) => l.reflectance(cos),
            Lobe::RoughMetal(l) => l.metal.reflectance(cos),
            Lobe::Glass(l) => l.albedo(cos),
            Lobe::Pane(l) => l.thin_albedo(cos),
            Lobe::RoughGlass(l) => l.boundary.albedo(cos),
            Lobe::Plastic(l) => l.albedo(cos),
            Lobe::RoughPlastic(l) => l.albedo(cos),
            Lobe::Null => Rgb::ONE,
        }
    }

    /// Relative index between the side of a direction with the cosine `cos` and the other side.
    pub fn relative_eta(&self, cos: f32) -> f32 {
        match self {
            Lobe::RoughGlass(l) => l.boundary.relative_eta(cos),
            Lobe::Glass(l) => l.relative_eta(cos),
            _ => 1.0,
        }
    }

    /// True if nothing of the lobe has a density.
    pub fn is_dirac(&self) -> bool {
        match self {
            Lobe::Metal(_) | Lobe::Glass(_) | Lobe::Pane(_) | Lobe::Null => true,
            Lobe::Plastic(l) => !l.has_base(),
            _ => false,
        }
    }

    /// True if a part of the lobe is diffuse.
    pub fn has_diffuse(&self) -> bool {
        match self {
            Lobe::Lambert(_) | Lobe::OrenNayar(_) => true,
            Lobe::Plastic(l) => l.has_base(),
            Lobe::RoughPlastic(l) => l.has_base(),
            _ => false,
        }
    }

    /// The diffuse part and the rest; their values add up to this lobe's.
    pub fn split(self) -> [Option<Self>; 2] {
        match self {
            Lobe::Lambert(_) | Lobe::OrenNayar(_) => [Some(self), None],
            Lobe::Plastic(l) => l.split().map(|part| Some(Lobe::Plastic(part))),
            Lobe::RoughPlastic(l) => l.split().map(|part| Some(Lobe::RoughPlastic(part))),
            _ => [None, Some(self)],
        }
    }

    /// Roughness of the sharpest part: 0 for Dirac lobes, 1 for diffuse and null ones.
    pub fn min_alpha(&self) -> f32 {
        match self {
            Lobe::Lambert(_) | Lobe::OrenNayar(_) | Lobe::Null => 1.0,
            Lobe::Plastic(l) if !l.has_coat() => 1.0,
            Lobe::RoughPlastic(l) if !l.has_coat() => 1.0,
            Lobe::Metal(_) | Lobe::Glass(_) | Lobe::Pane(_) | Lobe::Plastic(_) => 0.0,
            Lobe::RoughMetal(l) => l.micro.min_alpha().min(1.0),
            Lobe::RoughGlass(l) => l.micro.min_alpha().min(1.0),
            Lobe::RoughPlastic(l) => l.micro.min_alpha().min(1.0),
        }
    }
}
