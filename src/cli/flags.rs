//! Flags of the integrators, as `render` and each configuration of `compare` take them.

use super::options;
use crate::emission::Cut;
use crate::integrators::photon::{Antialiasing, Emission, Indirect};
use crate::transport::direct::LightSampling;
use crate::transport::light_cull::{CullingSettings, MOST_KEPT, Reservoir};
use crate::transport::light_selection::{LightStrategy, SelectionSettings};
use crate::transport::photon_map::Kernel;
use crate::transport::strategies::Strategy;
use crate::transport::strategies::coins::Coins;
use std::path::PathBuf;

/// Flags of the integrator `photon`.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Photon integrator")]
pub struct PhotonArgs {
    /// How photons leave the lights [default: adaptive].
    #[arg(long, value_enum)]
    pub emission: Option<Emission>,
    /// Where adaptive emission cuts its cells: in the middle, or where an edge is predicted [default: middle].
    #[arg(long, value_enum)]
    pub emission_cut: Option<Cut>,
    /// Refine cells whose rays land off where derivatives predict by more than this part of what the cell spans [default: 1].
    #[arg(long, value_name = "PART", value_parser = options::factor)]
    pub emission_linearity: Option<f64>,
    /// Where the indirect light of diffuse surfaces comes from [default: cache].
    #[arg(long, value_enum)]
    pub indirect: Option<Indirect>,
    /// How lights are sampled [default: adaptive].
    #[arg(long, value_enum)]
    pub light_sampling: Option<LightSampling>,
    /// Samples of a light where there are several [default: 16, fewer if most points need them].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub light_samples: Option<u32>,
    /// How radiance is estimated from photons: by each photon's own footprint (ad[:FACTOR], a factor on its width), the K nearest
    /// photons (knn[:K], 50), one radius (fixed[:R], in units of the scene) or one that shrinks from pass to pass (progressive[:R]) [default: ad].
    #[arg(long, value_parser = options::kernel)]
    pub kernel: Option<Kernel>,
    /// Samples per pixel in a pass: more on edges, 16 everywhere, or one [default: adaptive].
    #[arg(long, value_enum)]
    pub aa: Option<Antialiasing>,
    /// Photons per pass for the global map; K and M suffixes are understood; 0: paths find that light [default: 100K]. many-light: photons of the light that
    /// diffuse surfaces get from mirrors, glass and gloss [default: one for four pixels, within 8K and 262K].
    #[arg(long, value_parser = options::count)]
    pub photons: Option<u64>,
    /// Photons per pass for caustics [default: what the picture is worth, at most as many as pixels, within 33K and 262K].
    #[arg(long, value_parser = options::positive)]
    pub caustic_photons: Option<u64>,
    /// Start from the irradiance cache in this file, made by --save-cache for the same shapes and materials: records are added where
    /// there are none. After a change of lights the stored hits are evaluated anew.
    #[arg(long, value_name = "FILE")]
    pub load_cache: Option<PathBuf>,
    /// Write the irradiance cache to this file in the end.
    #[arg(long, value_name = "FILE")]
    pub save_cache: Option<PathBuf>,
    /// Write the photons of the first pass to this PLY file: positions, flux, footprints.
    #[arg(long, value_name = "FILE")]
    pub photons_ply: Option<PathBuf>,
    /// Write the records of the irradiance cache to this PLY file in the end: positions, radii, irradiance (many-light: the last pass's cache
    /// points of visibility).
    #[arg(long, value_name = "FILE")]
    pub cache_ply: Option<PathBuf>,
    /// Write a picture (.exr or .png) of where photons leave the lights: photons per solid angle over those of uniform emission, the faces of a
    /// light's cube side by side, lights one below the other.
    #[arg(long, value_name = "FILE")]
    pub emission_density: Option<PathBuf>,
    /// Show only the light that diffuse surfaces receive in these ways.
    #[arg(long, value_enum, value_delimiter = ',')]
    pub only: Vec<Part>,
}

/// Flags of the integrator `many-light`; it heeds --light-sampling, --light-samples, --photons, --caustic-photons and --only
/// as well.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Many-light integrator")]
pub struct ManyLightArgs {
    /// How sums over virtual lights are estimated [default: joint].
    #[arg(long, value_enum)]
    pub strategy: Option<Strategy>,
    /// How chance decisions of one sum depend on each other [default: systematic].
    #[arg(long, value_enum)]
    pub coins: Option<Coins>,
    /// Virtual lights per pass, about; K and M suffixes are understood [default: one for 64 pixels, 1024 to 16384].
    #[arg(long, value_name = "N", value_parser = options::positive)]
    pub vpls: Option<u64>,
    /// Put virtual lights on lamps as well, about so many in a pass, and on point lights: diffuse surfaces get direct light from them in place
    /// of light sampling; for thousands of lamps [default: 0].
    #[arg(long, value_name = "N", value_parser = options::count)]
    pub emitter_vpls: Option<u64>,
    /// Cache points of visibility [default: 32].
    #[arg(long, value_name = "N", value_parser = options::positive)]
    pub cache_points: Option<u64>,
    /// Standard deviation per light of the strategies culling and hierarchical, radiance [default: the best for the picture].
    #[arg(long, value_name = "RADIANCE", value_parser = options::not_negative)]
    pub epsilon: Option<f64>,
    /// Area of virtual lights, in areas of their photons' footprints; 0: points [default: 0.02].
    #[arg(long, value_name = "FACTOR", value_parser = options::not_negative)]
    pub vpl_area: Option<f64>,
    /// Share each pass's virtual lights out among N x N pixels that lie side by side: N^2 times fewer for each, a quicker preview with a pattern
    /// that fades as passes go on [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub interleave: Option<u32>,
    /// Show how this virtual light is treated in the layer `watched`: its index in the file of --points.
    #[arg(long, value_name = "INDEX")]
    pub watch_light: Option<u32>,
    /// Leave out what the area of virtual lights takes away near them: corners come out darker, a little faster.
    #[arg(long)]
    pub no_compensation: bool,
}

/// Flags of the integrator `path`.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Path integrator")]
pub struct PathArgs {
    /// Which light a path vertex samples [default: tree].
    #[arg(long, value_enum)]
    pub light_selection: Option<LightStrategy>,
    /// Light culling: bound of the standard deviation of one light, in units of radiance [default: by --culling-lights].
    #[arg(long, value_name = "RADIANCE", value_parser = options::radiance)]
    pub culling_error: Option<f64>,
    /// Light culling: number of lights that survive on average [default: 16].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub culling_lights: Option<u32>,
    /// Light culling: lights that are kept and get a shadow ray [default: 1].
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=MOST_KEPT as i64))]
    pub culling_kept: Option<u32>,
    /// Light culling: how they are kept [default: weighted].
    #[arg(long, value_enum)]
    pub culling_reservoir: Option<Reservoir>,
}

impl PathArgs {
    /// The choice of lights that the flags ask for.
    pub fn selection(&self, seed: u64) -> SelectionSettings {
        let default = CullingSettings::default();
        SelectionSettings {
            strategy: self.light_selection.unwrap_or_default(),
            culling: CullingSettings {
                error: self.culling_error.map(|e| e as f32),
                lights: self.culling_lights.map_or(default.lights, |n| n as f32),
                kept: self.culling_kept.unwrap_or(default.kept),
                reservoir: self.culling_reservoir.unwrap_or(default.reservoir),
            },
            seed,
        }
    }
}

/// Whether something is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Switch {
    /// It is.
    On,
    /// It is not.
    Off,
}

/// Ways of light to a diffuse surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Straight from the lights.
    Direct,
    /// From the lights by way of specular surfaces.
    Caustic,
    /// All else.
    Indirect,
}

/// Integrators by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum IntegratorChoice {
    /// Photon mapping steered by derivatives.
    Photon,
    /// Virtual point lights from photons, summed by one of several strategies.
    ManyLight,
    /// Unidirectional path tracing with light sampling: unbiased, the reference for all others.
    Path,
}

impl IntegratorChoice {
    /// The integrator that runs where the command line names none: one of ours that the file names, under its own name or one that files of
    /// Mitsuba 0.6 have for it; else photon mapping. All others give their depth, roulette and hidden emitters only.
    pub fn of_file(name: &str) -> Self {
        match name {
            "many-light" => IntegratorChoice::ManyLight,
            _ => IntegratorChoice::Photon,
        }
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            IntegratorChoice::Photon => "photon",
            IntegratorChoice::ManyLight => "many-light",
            IntegratorChoice::Path => "path",
        }
    }
}
