//! Photons as they are stored, and the ledger of what became of all of them.

use crate::math::{DVec3, Rgb, Vec3};
use std::ops::AddAssign;

/// By which way a photon came to the surface that stores it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum PhotonClass {
    /// Straight from the light.
    Direct,
    /// By way of (nearly) specular scatterings only, one at least.
    Caustic,
    /// After a diffuse or glossy scattering.
    Indirect,
}

impl PhotonClass {
    /// All classes, in order.
    pub const ALL: [PhotonClass; 3] = [PhotonClass::Direct, PhotonClass::Caustic, PhotonClass::Indirect];
}

/// Light that arrives at a surface with a diffuse part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Where.
    pub p: Vec3,
    /// Unit direction towards where it came from.
    pub wi: Vec3,
    /// Unit geometric normal, on the side it came from.
    pub n: Vec3,
    /// Power, W.
    pub flux: Rgb,
    /// Shading cosine over geometric cosine of `wi`, by which materials weigh the light that arrives; 0 below the shading horizon.
    pub shading: f32,
    /// Its footprint: two orthogonal tangent vectors, the standard deviations of the area that the photon stands for along its principal
    /// axes, the longer one first. Infinite where nothing is known of the neighbourhood.
    pub sigma: [Vec3; 2],
    /// Number of parameters over which it spreads: 2, or 4 from lamps with an area and behind diffuse scattering.
    pub parameters: u32,
    /// Shape that stores it.
    pub shape: u32,
    /// Triangle of the shape's mesh, else 0.
    pub prim: u32,
    /// Light that it came from, as in `Lights::infos`.
    pub light: u32,
    /// Stratum of the emission density.
    pub stratum: u32,
    /// Segments of its way: 1 straight from the light, one more for each scattering.
    pub segments: u32,
    /// Kind of way.
    pub class: PhotonClass,
}

/// What became of the photons of one light. Fluxes close to rounding: [`LightLedger::imbalance`]. Deposits are no part of it: a photon is
/// stored as it passes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightLedger {
    /// Photons that left the light.
    pub photons: u64,
    /// Flux that left it, W.
    pub emitted: DVec3,
    /// Flux that surfaces took: what they do not scatter, and scattering that ended in no direction.
    pub absorbed: DVec3,
    /// Flux that left the scene.
    pub escaped: DVec3,
    /// Flux of photons cut off by a limit: of depth, of surfaces passed, or by a value that was not finite.
    pub truncated: DVec3,
    /// Flux that was scattered diffusely by a walk that wanted caustics only: it belongs to other estimators.
    pub handed_on: DVec3,
    /// Flux taken by Russian roulette less the flux it gave; 0 in expectation.
    pub roulette: DVec3,
    /// Photons stored, by class.
    pub stored: [u64; 3],
    /// Flux stored, by class.
    pub stored_flux: [DVec3; 3],
    /// Closest-hit rays.
    pub rays: u64,
}

impl LightLedger {
    /// Emitted flux less the sum of its fates, relative to what was emitted: rounding only.
    pub fn imbalance(&self) -> f64 {
        let fates = self.absorbed + self.escaped + self.truncated + self.handed_on + self.roulette;
        (self.emitted - fates).abs().max_element() / self.emitted.max_element().max(f64::MIN_POSITIVE)
    }
}

impl AddAssign<&LightLedger> for LightLedger {
    fn add_assign(&mut self, o: &LightLedger) {
        self.photons += o.photons;
        self.emitted += o.emitted;
        self.absorbed += o.absorbed;
        self.escaped += o.escaped;
        self.truncated += o.truncated;
        self.handed_on += o.handed_on;
        self.roulette += o.roulette;
        self.rays += o.rays;
        for class in 0..3 {
            self.stored[class] += o.stored[class];
            self.stored_flux[class] += o.stored_flux[class];
        }
    }
}

/// The ledgers of all lights, by index into `Lights::infos`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ledger {
    /// One per light.
    pub lights: Vec<LightLedger>,
}

impl Ledger {
    /// Empty ledgers of `lights` lights.
    pub fn new(lights: usize) -> Self {
        Ledger { lights: vec![LightLedger::default(); lights] }
    }

    /// Sum over all lights.
    pub fn total(&self) -> LightLedger {
        let mut sum = LightLedger::default();
        self.lights.iter().for_each(|l| sum += l);
        sum
    }
}

impl AddAssign<&Ledger> for Ledger {
    fn add_assign(&mut self, o: &Ledger) {
        if self.lights.len() < o.lights.len() {
            self.lights.resize(o.lights.len(), LightLedger::default());
        }
        self.lights.iter_mut().zip(&o.lights).for_each(|(a, b)| *a += b);
    }
}
