//! Caustic photons of each pass: where they start, how many there are.

use super::settings::{Emission, PhotonSettings};
use crate::emission::{self, DensityMap, EdgeAdaptive, EmissionDensity, Sequence, Uniform};
use crate::scene::material::has_sharp_lobe;
use crate::transport::photon::Photon;
use crate::transport::photon_map::PhotonSettings as MapSettings;
use crate::transport::photon_walk::{Goal, trace};
use crate::transport::{CausticMap, NEARLY_SPECULAR_ALPHA, World};

/// Photons of a pass, if nothing is said: as many as pixels, within these bounds.
const AUTOMATIC: [usize; 2] = [1 << 15, 1 << 18];

/// Emission and kernels of caustic photons.
pub struct Caustics<'a> {
    world: World<'a>,
    density: Box<dyn EmissionDensity + 'a>,
    map: MapSettings,
}

impl<'a> Caustics<'a> {
    /// `None` where there can be no caustic, or none is to be shown: without lights or nearly specular surfaces.
    pub fn new(world: World<'a>, settings: &PhotonSettings, pixels: usize) -> Option<Self> {
        let scene = world.scene;
        let sharp = |id: u32| has_sharp_lobe(&scene.materials, id, NEARLY_SPECULAR_ALPHA);
        let deep_enough = settings.path.max_depth.is_none_or(|d| d > 2);
        if scene.lights.is_empty() || !deep_enough || !scene.shapes.iter().any(|s| sharp(s.material)) {
            return None;
        }
        let n = settings.caustic_photons.map_or(pixels.clamp(AUTOMATIC[0], AUTOMATIC[1]), |n| n as usize);
        let density: Box<dyn EmissionDensity> = match settings.emission {
            Emission::Uniform => Box::new(Uniform::new(scene, n, Sequence::Random, settings.seed)),
            Emission::Adaptive => {
                let wanted = |shape: u32| sharp(scene.shapes[shape as usize].material);
                let adaptive = emission::Settings { interest: Some(&wanted), ..Default::default() };
                Box::new(EdgeAdaptive::new(scene, world.accel, n, &adaptive, settings.seed))
            }
        };
        Some(Caustics { world, density, map: settings.map() })
    }

    /// Photons emitted in each pass.
    pub fn emitted(&self) -> u64 {
        self.density.count() as u64
    }

    /// The photons that the map of a pass is made of, and nothing else of it.
    pub fn photons(&self, pass: u64) -> Vec<Photon> {
        trace(self.world, self.density.as_ref(), &self.map.walk(Goal::Caustics), pass).photons
    }

    /// Pictures of the emission of the first `most` lights that have a density of their own.
    pub fn densities(&self, size: usize, most: usize) -> Vec<DensityMap> {
        let lights = 0..self.world.scene.lights.infos.len() as u32;
        lights.filter_map(|light| self.density.density_map(light, size)).take(most).collect()
    }

    /// The photons of a pass.
    pub fn map(&self, pass: u64) -> CausticMap {
        CausticMap::build(self.world, self.density.as_ref(), &self.map, pass)
    }
}
