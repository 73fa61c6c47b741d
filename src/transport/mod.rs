//! Light transport: what integrators are made of.
//!
//! * [`World`]: a scene with its acceleration structure, and what every walk asks of the two
//! * [`direct`]: light that comes straight from emitters; [`light_tree`]: one of many lights
//! * [`photon`], [`photon_walk`], [`differential`]: photons, their random walk, and the footprints that they carry
//! * [`footprint_kernel`], [`border`], [`obstacle`]: the kernel of a photon's own footprint, and what becomes of it at borders and at the
//!   foot of what stands on the surface
//! * [`photon_tree`]: all photons whose reach covers a point; [`nearest`]: the nearest photons
//! * [`photon_map`]: radiance and irradiance from photons, [`photon_lanes`] eight at a time, by the arithmetic of `eight`; [`photon_ply`]: photons as a point cloud
//! * [`antialias`]: which pixels need several samples
//! * [`irradiance_cache`]: indirect diffuse light by records and interpolation; its parts are
//!   [`gather_ray`] (one ray over specular surfaces), [`surfels`] (clusters of hits) with [`surfel_light`] (their
//!   irradiance) and [`surfel_direct`] (the direct part of it), [`gather_sky`] (light of a soft sky), [`bright_patches`] and [`guided_rays`] (what few of them find), [`gather_strata`] (directions, derivatives), [`gather_cache`] (stored hits), [`glossy_guide`] (what these tell glossy lobes),
//!   [`cache_record`] (radii and weights), [`riser`] (what stands between), [`sphere_octree`] (look-up), [`cache_placement`] (places for it all over a scene),
//!   [`cache_file`], [`fingerprint`] (what a file belongs to), [`cache_inspect`] (what a look-up rests on)
//! * [`vpl`]: virtual point lights from photons; [`vpl_tree`]: groups of them; [`visibility`]: what a few points see of them;
//!   [`strategies`]: sums over them

pub mod antialias;
pub mod border;
pub mod bright_patches;
pub mod cache_file;
pub mod cache_inspect;
pub mod cache_placement;
pub mod cache_record;
mod cache_settings;
pub mod coat;
pub mod differential;
pub mod direct;
mod eight;
pub mod emitter_vpls;
pub mod fingerprint;
pub mod footprint_kernel;
pub mod gather_cache;
mod gather_hit;
pub mod gather_ray;
pub mod gather_sky;
pub mod gather_strata;
pub mod glossy_guide;
pub mod guided_rays;
pub mod irradiance_cache;
pub mod light_cull;
pub mod light_selection;
pub mod light_tree;
pub mod nearest;
pub mod obstacle;
pub mod photon;
pub mod photon_lanes;
pub mod photon_map;
pub mod photon_ply;
mod photon_settings;
pub mod photon_tree;
pub mod photon_walk;
pub mod reached;
pub mod riser;
pub mod sightings;
pub mod sphere_octree;
pub mod strategies;
mod surfel_bounces;
pub mod surfel_demand;
pub mod surfel_direct;
pub mod surfel_light;
pub mod surfels;
#[cfg(test)]
pub(crate) mod tests;
pub mod visibility;
pub mod vpl;
pub mod vpl_tree;
mod world;

use crate::scene::{Bsdf, LobeKind};
pub use cache_settings::{CacheSettings, CacheStatistics, Place};
pub use irradiance_cache::IrradianceCache;
pub use photon_map::CausticMap;
pub use surfel_light::HitLight;
pub use world::{MAX_PASSED_SURFACES, Through, World, power_heuristic};

/// Roughness (Beckmann or GGX alpha) below which glossy scattering counts as nearly specular: photons behind it make caustics, paths
/// from the eye go on through it and ask the caustic map at the next diffuse surface. Above it light sampling and multiple importance
/// sampling do better than photons.
pub const NEARLY_SPECULAR_ALPHA: f32 = 0.1;

/// Upper bound of the survival probability in Russian roulette: without it a path between white walls need not end.
pub const MAX_SURVIVAL: f32 = 0.95;

/// Whether a scattering by `lobe`, drawn from `rest`, the part of a material that is not diffuse ([`Bsdf::split`]), is (nearly) specular.
pub fn nearly_specular(rest: &Bsdf, lobe: LobeKind) -> bool {
    match lobe {
        LobeKind::Specular => true,
        LobeKind::Glossy => rest.min_glossy_alpha() < NEARLY_SPECULAR_ALPHA,
        LobeKind::Diffuse | LobeKind::Null => false,
    }
}
