//! What the irradiance cache is told, and what it tells.

use super::cache_file::stored;
use super::gather_ray::RayCounts;
use super::surfels::Facet;
use crate::math::Vec3;
use crate::scene::SurfacePoint;

/// Settings of [`super::IrradianceCache`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CacheSettings {
    /// Mean relative error of interpolation that a record may have over its disc.
    pub error: f32,
    /// Gather rays per record.
    pub gather_rays: u32,
    /// Least radius of a record, in pixels at its place.
    pub min_radius_pixels: f32,
    /// Greatest radius of a record, as a share of the scene's diameter.
    pub max_radius: f32,
    /// Edge of the largest surfel cells over the median length of gather rays: the bias of the light at hits goes to zero
    /// with it.
    pub surfel_cell: f32,
    /// Gather rays per surfel.
    pub surfel_rays: u32,
    /// Light samples per surfel.
    pub light_samples: u32,
    /// Most times that light goes on from surface to surface before a gather ray meets it; `None`: no limit. 0: hits are lit by lamps alone.
    pub bounces: Option<u32>,
    /// Whether records send further rays to small bright patches.
    pub guided: bool,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for CacheSettings {
    fn default() -> Self {
        CacheSettings {
            error: 0.015,
            gather_rays: 256,
            min_radius_pixels: 2.0,
            max_radius: 0.1,
            surfel_cell: 0.06,
            surfel_rays: 16,
            light_samples: 4,
            bounces: None,
            guided: true,
            seed: 0,
        }
    }
}

stored!(CacheSettings {
    error,
    gather_rays,
    min_radius_pixels,
    max_radius,
    surfel_cell,
    surfel_rays,
    light_samples,
    bounces,
    guided,
    seed
});

/// A place where irradiance will be asked for.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The side of the surface that is seen.
    pub facet: Facet,
    /// Width of a pixel there, world units; 0 without a camera.
    pub pixel: f32,
}

impl Place {
    /// The side of the surface point that the unit vector `wo` sees; `pixel` is the width of a pixel there.
    pub fn new(at: &SurfacePoint, wo: Vec3, pixel: f32) -> Self {
        Place { facet: Facet::seen_from(at, wo), pixel }
    }
}

/// What has been done so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CacheStatistics {
    /// Records.
    pub records: usize,
    /// Surfels.
    pub surfels: usize,
    /// Rays and shadow rays of the records.
    pub record_rays: RayCounts,
    /// Rays and shadow rays of the surfels.
    pub surfel_rays: RayCounts,
    /// Records with the least radius.
    pub smallest: usize,
    /// Small bright patches that records send rays to.
    pub patches: usize,
    /// Places left without a record because the number of new ones was spent.
    pub left: usize,
    /// Shapes that are too finely structured: they get no more records.
    pub hopeless: usize,
}
