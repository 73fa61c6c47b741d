//! Photons of light that diffuse surfaces get from mirrors, glass and gloss: what virtual lights cannot bring.
//!
//! A virtual light is a diffuse vertex. What a lamp or a diffuse surface sends by way of the rest r of a material (Dirac and glossy lobes,
//! coats) to a diffuse part d is found by a ray from d that happens to meet r: seldom, and then with the light of all of its ways at once. A
//! mirror that covers the share s of what a surface sees adds noise of about s in squares of its light, which no strategy for virtual lights
//! can lower. Photons bring the same light in small portions, and the ray from d need not be traced:
//!
//!   L (D | S)* r d      the last scattering before d is one by r: all but L S+ d, the caustics, which have photons of their own
//!
//! Source      Jensen 1996 (caustic photons of light that has been indirect before); METHODS 6.3 (partition by path class)
//! Bias        the width of kernels, less from pass to pass; [`ManyLightSettings::photons`] of 0 leaves this light to paths, without that bias
//! Verified by tests/many_light.rs: agreement with paths on every material, with and without these photons; `transport::tests` (the classes
//!             of photons are a partition)

use super::ManyLightSettings;
use crate::emission::{EmissionDensity, Sequence, Uniform};
use crate::math::sampler::hash;
use crate::transport::World;
use crate::transport::photon_map::{GlobalMap, PhotonSettings as MapSettings};
use crate::transport::photon_walk::{Goal, trace};

/// Photons of a pass, if nothing is said: so many for each pixel, within bounds. In cornell-spheres (192 x 288) the errors with 8,000, 27,000 and
/// 100,000 were 0.0039, 0.0036 and 0.0036 (with paths 0.032), times 1.41, 1.49 and 1.79 s.
const PER_PIXEL: f32 = 0.25;
const FEWEST: usize = 1 << 13;
const MOST: usize = 1 << 18;
/// Separates their random numbers from those of virtual lights and caustic photons.
const STREAM: u64 = 0x7265_666c; // "refl"

/// Emission and kernels of these photons.
pub struct Reflected<'a> {
    world: World<'a>,
    density: Uniform<'a>,
    map: MapSettings,
}

impl<'a> Reflected<'a> {
    /// `None` where paths are to find this light, where there is none, or none is shown.
    pub fn new(world: World<'a>, settings: &ManyLightSettings, pixels: usize) -> Option<Self> {
        let automatic = || ((pixels as f32 * PER_PIXEL) as usize).clamp(FEWEST, MOST);
        let count = settings.photons.map_or_else(automatic, |n| n as usize);
        let deep_enough = settings.path.max_depth.is_none_or(|d| d > 2);
        if count == 0 || !deep_enough || !settings.parts.indirect || world.scene.lights.is_empty() {
            return None;
        }
        let seed = hash(settings.seed, STREAM);
        let map = MapSettings {
            seed,
            max_depth: settings.path.max_depth,
            rr_depth: settings.path.rr_depth,
            ..MapSettings::default()
        };
        Some(Reflected { world, density: Uniform::new(world.scene, count, Sequence::OwenSobol, seed), map })
    }

    /// Photons that leave the lights in a pass.
    pub fn count(&self) -> u64 {
        self.density.count() as u64
    }

    /// The photons of a pass.
    pub fn map(&self, pass: u64) -> GlobalMap {
        let traced = trace(self.world, &self.density, &self.map.walk(Goal::Reflected), pass);
        GlobalMap::from_photons(self.world, traced, &self.map, pass)
    }
}
