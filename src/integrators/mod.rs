//! Light transport algorithms: each turns a camera ray into radiance.

pub mod path;

use crate::image::film::Features;
use crate::math::{Rgb, Sampler};
use crate::scene::camera::CameraRay;

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
    /// Samples that were not finite and left out.
    pub invalid: u64,
    /// Photons emitted.
    pub photons: u64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, o: Counts) {
        self.samples += o.samples;
        self.rays += o.rays;
        self.shadow_rays += o.shadow_rays;
        self.probed_shadow_rays += o.probed_shadow_rays;
        self.blocked_by_specular += o.blocked_by_specular;
        self.invalid += o.invalid;
        self.photons += o.photons;
    }
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

    /// Samples that a pass takes in the pixel at column `x` and row `y` of the full image; the same for every pass.
    fn samples_per_pass(&self, x: u32, y: u32) -> u32 {
        let _ = (x, y);
        1
    }

    /// Radiance along a camera ray and the features of the first surface. A pure function of the ray, the pass and
    /// the sampler's numbers.
    fn sample(&self, ray: &CameraRay, pass: u64, sampler: &mut Sampler, counts: &mut Counts) -> (Rgb, Features);

    /// What the user should know after the run: what this algorithm could not do in this scene.
    fn remarks(&self, counts: &Counts) -> Vec<String>;
}
