//! The global photon map of each pass: indirect light without a cache.
//!
//! Photons leave the lights in proportion to flux; those that were scattered diffusely before count. With their kernels the light of diffuse
//! surfaces is read from the map where the eye sees them. Source: Jensen 1996. Bias: the width of the kernels, less from pass to pass.

use super::settings::PhotonSettings;
use crate::emission::{EmissionDensity, Sequence, Uniform};
use crate::transport::World;
use crate::transport::photon::Photon;
use crate::transport::photon_map::{Filter, GlobalMap, PhotonSettings as MapSettings};
use crate::transport::photon_walk::{Goal, trace};

/// Photons of a pass, if nothing is said.
const AUTOMATIC: usize = 100_000;

/// Emission and kernels of the photons of the global map.
pub struct Global<'a> {
    world: World<'a>,
    density: Uniform<'a>,
    map: MapSettings,
}

impl<'a> Global<'a> {
    /// `None` without lights or photons: paths find that light then.
    pub fn new(world: World<'a>, settings: &PhotonSettings) -> Option<Self> {
        let n = settings.photons.map_or(AUTOMATIC, |n| n as usize);
        (!world.scene.lights.is_empty() && n > 0).then(|| Global {
            world,
            density: Uniform::new(world.scene, n, Sequence::OwenSobol, settings.seed),
            map: settings.map(),
        })
    }

    /// Photons that leave the lights in a pass.
    pub fn count(&self) -> u64 {
        self.density.count() as u64
    }

    /// The photons that the map of a pass is made of, and nothing else of it.
    pub fn photons(&self, pass: u64) -> Vec<Photon> {
        trace(self.world, &self.density, &self.map.walk(Goal::Classes(Filter::INDIRECT.classes)), pass).photons
    }

    /// The photons of a pass.
    pub fn map(&self, pass: u64) -> GlobalMap {
        GlobalMap::build(self.world, &self.density, &self.map, pass, Filter::INDIRECT)
    }
}
