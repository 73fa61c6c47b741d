//! Light transport: what integrators are made of.
//!
//! * [`World`]: a scene with its acceleration structure, and what every walk asks of the two
//! * [`direct`]: light that comes straight from emitters; [`light_tree`]: one of many lights
//! * [`irradiance_cache`]: indirect diffuse light by records and interpolation; its parts are
//!   [`gather_ray`] (one ray over specular surfaces), [`surfels`] (clusters of hits) with [`surfel_light`] (their
//!   irradiance), [`gather_strata`] (directions, derivatives), [`gather_cache`] (stored hits), [`cache_record`] (radii and
//!   weights) and [`sphere_octree`] (look-up)

pub mod cache_record;
pub mod direct;
pub mod gather_cache;
pub mod gather_ray;
pub mod gather_strata;
pub mod irradiance_cache;
pub mod light_tree;
pub mod sphere_octree;
pub mod surfel_light;
pub mod surfels;
mod world;

pub use gather_ray::NEARLY_SPECULAR_ALPHA;
pub use irradiance_cache::{CacheSettings, CacheStatistics, IrradianceCache, Place};
pub use surfel_light::HitLight;
pub use world::{MAX_PASSED_SURFACES, Through, World, power_heuristic};
