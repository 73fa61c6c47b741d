//! What the many-light integrator is told.

use crate::integrators::path::PathSettings;
use crate::integrators::photon::Parts;
use crate::transport::direct::DirectSettings;
use crate::transport::strategies::StrategySettings;

/// Settings of [`super::ManyLight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ManyLightSettings {
    /// Depth, roulette, hidden emitters.
    pub path: PathSettings,
    /// Direct light.
    pub direct: DirectSettings,
    /// How sums over virtual lights are estimated.
    pub strategy: StrategySettings,
    /// Virtual lights per pass, about; `None`: one for 64 pixels, from 1024 to 16,384.
    pub vpls: Option<usize>,
    /// Virtual lights per pass on lamps, beside all point lights: diffuse surfaces then get their light from them; 0: light sampling.
    pub emitter_vpls: usize,
    /// Cache points.
    pub cache_points: usize,
    /// Whether short paths add what discs in place of points leave out; else corners are darker.
    pub compensate: bool,
    /// Areas of the discs, in areas of the photons' footprints; 0: points. Small ones: what discs leave out comes back as noise of short paths. In the
    /// Cornell box the error of two passes was 0.0076 at 1, 0.0041 at 0.2, 0.0031 at 0.04 and at 0.01, 0.0036 at 0.002, where points begin to show.
    pub area: f32,
    /// Photons per pass for caustics; `None`: as [`PhotonSettings::caustic_photons`](crate::integrators::photon::PhotonSettings), 8,192 where only short
    /// paths ask them.
    pub caustic_photons: Option<u64>,
    /// Photons per pass of the light that diffuse surfaces get from mirrors, glass and gloss; `None`: one for four pixels, from 8,192 to 262,144; 0:
    /// paths find it.
    pub photons: Option<u64>,
    /// Side n of the blocks of n x n pixels that share a pass's lights among them (interleaved sampling); 1: all pixels have all.
    pub interleave: u32,
    /// Virtual light whose probabilities are recorded.
    pub watched: Option<u32>,
    /// Which light is shown.
    pub parts: Parts,
    /// Seed of photons and caches.
    pub seed: u64,
}

impl ManyLightSettings {
    /// Classes of film positions with lights of their own.
    pub fn classes(&self) -> usize {
        (self.interleave * self.interleave) as usize
    }
}

impl Default for ManyLightSettings {
    fn default() -> Self {
        ManyLightSettings {
            path: PathSettings::default(),
            direct: DirectSettings::default(),
            strategy: StrategySettings::default(),
            vpls: None,
            emitter_vpls: 0,
            cache_points: 32,
            compensate: true,
            area: 0.02,
            caustic_photons: None,
            photons: None,
            interleave: 1,
            watched: None,
            parts: Parts::default(),
            seed: 0,
        }
    }
}
