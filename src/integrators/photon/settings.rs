//! What the photon integrator is told.

use crate::emission::{Cut, LINEARITY};
use crate::integrators::path::PathSettings;
use crate::transport::direct::DirectSettings;
use crate::transport::photon_map::{Kernel, PhotonSettings as MapSettings};
use clap::ValueEnum;

/// How photons leave the lights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Emission {
    /// Dense where derivatives predict edges, and only where specular surfaces are met.
    #[default]
    Adaptive,
    /// In proportion to flux.
    Uniform,
}

/// Where the indirect light of diffuse surfaces comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Indirect {
    /// Irradiance cache with stored gather rays; paths where it does not reach.
    #[default]
    Cache,
    /// Paths: the oracle of the cache.
    Gather,
    /// The cache as a prediction that paths correct by chance: its errors become noise.
    Residual,
    /// The global photon map alone.
    Photons,
}

/// How many samples a pixel gets in each pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Antialiasing {
    /// More where the detector finds edges.
    #[default]
    Adaptive,
    /// Sixteen, everywhere.
    Full,
    /// One.
    Off,
}

/// Settings of [`super::Photon`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Depth, roulette, hidden emitters.
    pub path: PathSettings,
    /// Emission.
    pub emission: Emission,
    /// Where adaptive emission cuts its cells.
    pub emission_cut: Cut,
    /// Error of linearisation above which it refines them; infinite: it does not ask.
    pub emission_linearity: f64,
    /// Direct light.
    pub direct: DirectSettings,
    /// Indirect light.
    pub indirect: Indirect,
    /// Antialiasing.
    pub antialiasing: Antialiasing,
    /// Photons per pass for the global map; `None`: 100,000; 0: paths find that light.
    pub photons: Option<u64>,
    /// Photons per pass for caustics; `None`: at most as many as pixels, but within 32,768 and 262,144, and as many of them as
    /// the rest of the picture is worth.
    pub caustic_photons: Option<u64>,
    /// How radiance is estimated from photons.
    pub kernel: Kernel,
    /// Whether lights get fewer samples where most of what is seen needs several.
    pub adaptive_light_samples: bool,
    /// Whether later samples go where the picture is noisy.
    pub adaptive_sampling: bool,
    /// Whether the picture is filtered in the end (`image::denoise`), so that these samples go where the filter leaves errors.
    pub filtered: bool,
    /// Which light is shown.
    pub parts: Parts,
    /// Whether samples tell what their look-ups in the cache rest on.
    pub inspect: bool,
    /// Seed of photons and caches.
    pub seed: u64,
}

impl Default for PhotonSettings {
    fn default() -> Self {
        PhotonSettings {
            path: PathSettings::default(),
            emission: Emission::default(),
            emission_cut: Cut::default(),
            emission_linearity: LINEARITY,
            direct: DirectSettings::default(),
            indirect: Indirect::default(),
            antialiasing: Antialiasing::default(),
            photons: None,
            caustic_photons: None,
            kernel: Kernel::FOOTPRINT,
            adaptive_light_samples: true,
            adaptive_sampling: true,
            filtered: false,
            parts: Parts::default(),
            inspect: false,
            seed: 0,
        }
    }
}

impl PhotonSettings {
    /// What photon maps are told of them.
    pub(super) fn map(&self) -> MapSettings {
        MapSettings {
            seed: self.seed,
            kernel: self.kernel,
            max_depth: self.path.max_depth,
            rr_depth: self.path.rr_depth,
            ..MapSettings::default()
        }
    }
}

/// Parts of the light that diffuse surfaces reflect. What is seen directly, in mirrors and through glass belongs to the part of
/// the surface at the end; what glossy surfaces reflect by themselves counts as direct light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parts {
    /// Straight from the lights.
    pub direct: bool,
    /// From the lights by way of specular surfaces.
    pub caustic: bool,
    /// All else.
    pub indirect: bool,
}

impl Default for Parts {
    fn default() -> Self {
        Parts { direct: true, caustic: true, indirect: true }
    }
}
