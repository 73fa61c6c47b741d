//! Light transport algorithms: each turns a camera ray into radiance.

mod branching;
pub mod many_light;
pub mod path;
pub mod photon;
#[cfg(test)]
mod tests;

use crate::emission::DensityMap;
use crate::image::film::{Features, Film};
use crate::math::{Rgb, Sampler};
use crate::scene::camera::CameraRay;
use crate::transport::IrradianceCache;
use crate::transport::cache_file::CacheFileError;
use crate::transport::direct::DirectCounts;
use crate::transport::photon::Photon;
use crate::transport::strategies::ManyLightCounts;
use std::path::Path;

/// What was counted while rendering. Sums over samples, the same for any number of threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Camera samples.
    pub samples: u64,
    /// Closest-hit rays.
    pub rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Shadow rays of the first pass that were examined for what blocks them.
    pub probed_shadow_rays: u64,
    /// Those of them that end on smooth glass, water or another surface that only specular paths cross.
    pub blocked_by_specular: u64,
    /// Direct light of the photon and the many-light integrator.
    pub direct: DirectCounts,
    /// Sums over virtual lights of the many-light integrator.
    pub many_light: ManyLightCounts,
    /// Look-ups in the irradiance cache.
    pub cache_lookups: u64,
    /// Those of them that found no record near enough.
    pub cache_misses: u64,
    /// Samples that were not finite and left out.
    pub invalid: u64,
    /// Photons emitted.
    pub photons: u64,
}

impl Counts {
    /// Shadow rays of all kinds.
    pub fn all_shadow_rays(&self) -> u64 {
        self.shadow_rays + self.direct.shadow_rays + self.many_light.shadow_rays
    }
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, o: Counts) {
        self.samples += o.samples;
        self.rays += o.rays;
        self.shadow_rays += o.shadow_rays;
        self.probed_shadow_rays += o.probed_shadow_rays;
        self.blocked_by_specular += o.blocked_by_specular;
        self.direct += o.direct;
        self.many_light += o.many_light;
        self.cache_lookups += o.cache_lookups;
        self.cache_misses += o.cache_misses;
        self.invalid += o.invalid;
        self.photons += o.photons;
    }
}

/// What samples of an integrator say about themselves, beside the features of the first surface ([`Makeup`](crate::image::film::Makeup)).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// Direct, caustic and indirect light, paths, look-ups in the cache.
    Parts,
    /// Roulette of virtual lights.
    VirtualLights,
}

/// A light transport algorithm, ready to take samples.
pub trait Integrator: Sync {
    /// Name on the command line.
    fn name(&self) -> &'static str;

    /// What has to be there before the samples of pass `pass` are taken: photons, caches. A pure function of the scene, the
    /// settings, `pass` and the calls before. `over` says that time is up: work for a later pass than the first may then
    /// be left, since no further sample will be asked for.
    fn prepare(&mut self, pass: u64, over: &(dyn Fn() -> bool + Sync)) {
        let _ = (pass, over);
    }

    /// What preparing has counted so far, all passes together: photons emitted, rays traced for maps and caches.
    fn prepared(&self) -> Counts {
        Counts::default()
    }

    /// Samples that pass `pass` takes in the pixel at column `x` and row `y` of the full image; at least one in pass 0.
    fn samples(&self, x: u32, y: u32, pass: u64) -> u32 {
        let _ = (x, y, pass);
        1
    }

    /// Whether [`Self::learn`] wants to see the picture.
    fn learns(&self) -> bool {
        false
    }

    /// The picture after 1, 2, 4, 8, ... passes: what it says may decide where later samples go.
    fn learn(&mut self, film: &Film) {
        let _ = film;
    }

    /// Radiance along a camera ray and the features of the first surface. A pure function of the ray, the pass and
    /// the sampler's numbers.
    fn sample(&self, ray: &CameraRay, pass: u64, sampler: &mut Sampler, counts: &mut Counts) -> (Rgb, Features);

    /// What samples say about themselves.
    fn tells(&self) -> Option<Told> {
        None
    }

    /// The photons of pass 0, traced for this call.
    fn photons(&self) -> Vec<Photon> {
        Vec::new()
    }

    /// Pictures of where photons go, for the first `most` lights with a density of their own; faces of `size` x `size` pixels.
    fn emission_densities(&self, size: usize, most: usize) -> Vec<DensityMap> {
        let _ = (size, most);
        Vec::new()
    }

    /// Starts from the irradiance cache in a file instead of an empty one; to be called before anything is prepared.
    ///
    /// # Errors
    /// If the file is no cache of this scene, or the integrator would not use one.
    fn load_cache(&mut self, path: &Path) -> Result<(), CacheFileError> {
        let _ = path;
        Err(CacheFileError::NotUsed)
    }

    /// The irradiance cache as it is, if one is used.
    fn cache(&self) -> Option<&IrradianceCache<'_>> {
        None
    }

    /// What was prepared, by name: sizes of maps and caches, rays traced for them.
    fn figures(&self) -> Vec<(&'static str, u64)> {
        Vec::new()
    }

    /// Points that the last pass was made of, as a PLY file, if there are any to show.
    fn points_ply(&self) -> Option<Vec<u8>> {
        None
    }

    /// Whether [`Self::cache_points_ply`] will have any.
    fn has_cache_points(&self) -> bool {
        false
    }

    /// What sees the points of [`Self::points_ply`]: cache points of visibility in the last pass, as a PLY file.
    fn cache_points_ply(&self) -> Option<Vec<u8>> {
        None
    }

    /// What the user should know after the run: what this algorithm could not do in this scene.
    fn remarks(&self, counts: &Counts) -> Vec<String>;
}
