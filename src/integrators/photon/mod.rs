//! Photon mapping steered by derivatives: the default integrator.
//!
//! Estimates   the same integral as [`super::path`], split by what is known where (`eye` has the table): direct light with the
//!             detector's verdicts, caustics from photons with kernels of their own footprints, diffuse interreflection from a
//!             cache of gather rays
//! Passes      each pass has photons of its own and smaller kernels; the cache is made anew now and then (`renewed_cache`)
//! Source      Namae & Makino (photons, light samples, pixels where derivatives predict edges); Jensen 2001 (the split into
//!             direct, caustic and indirect light); Yue, Onoue & Nishita (stored gather rays); Knaus & Zwicker 2011 (passes)
//! Bias        kernels and interpolated irradiance: both shrink with the passes
//! Depth       the cache holds the bounces that are left behind the first surface. Behind mirrors and glass fewer are: where that
//!             shows (few are left) paths take its place. Mirrors that gather rays meet take segments too
//! Not handled participating media
//! Verified by tests/photon.rs (agreement with `path`, furnace, determinism), tests/references.rs

mod allocate;
mod caustic_count;
pub(super) mod caustics;
mod eye;
mod global;
mod learned_emission;
mod learned_lights;
mod looks;
mod pilot;
pub mod places;
mod renewed_cache;
mod settings;

pub use settings::{Antialiasing, Emission, Indirect, Parts, PhotonSettings};

use self::caustics::Caustics;
use self::eye::Eye;
use self::global::Global;
use self::looks::Found;
use self::pilot::Pilot;
use self::renewed_cache::RenewedCache;
use super::{Counts, Integrator, Told};
use crate::emission::DensityMap;
use crate::image::film::{Features, Film};
use crate::math::sampler::hash;
use crate::math::{Rgb, Sampler};
use crate::scene::camera::CameraRay;
use crate::transport::antialias::{AntialiasSettings, samples_per_pixel};
use crate::transport::cache_file::{CacheFileError, FromFile};
use crate::transport::direct::{Direct, DirectSettings, LightSampling};
use crate::transport::gather_sky;
use crate::transport::photon::Photon as StoredPhoton;
use crate::transport::photon_map::GlobalMap;
use crate::transport::{CausticMap, IrradianceCache, World};
use std::path::Path;

/// Samples of a pixel in each pass where nothing is adaptive: as many as Namae and Makino took.
const FULL_SAMPLES: f32 = 16.0;

/// The photon integrator.
pub struct Photon<'a> {
    world: World<'a>,
    settings: PhotonSettings,
    window: [u32; 4],
    direct: Direct<'a>,
    caustics: Option<Caustics<'a>>,
    /// Caustic photons of this pass.
    map: Option<CausticMap>,
    /// Photons emitted for global maps so far.
    emitted: u64,
    global: Option<Global<'a>>,
    /// Photons of this pass in place of the cache.
    global_map: Option<GlobalMap>,
    cache: Option<RenewedCache<'a>>,
    /// Whether the cache holds the light of the environment too.
    sky: bool,
    /// Samples per pass of each pixel of the window; none: one.
    samples: Vec<f32>,
    /// Whether the detector finds an edge in a pixel of the window; empty before it is asked.
    crossed: Vec<bool>,
}

impl<'a> Photon<'a> {
    /// An integrator for the pixels of `window` (x, y, width, height).
    pub fn new(world: World<'a>, settings: PhotonSettings, window: [u32; 4]) -> Self {
        let bounces = settings.path.max_depth.is_none_or(|d| d > 2);
        let by_records = matches!(settings.indirect, Indirect::Cache | Indirect::Residual);
        let cached = by_records && settings.parts.indirect && bounces;
        let cache = cached.then(|| RenewedCache::new(world, &settings, window));
        let sky = cached && gather_sky::is_gathered(&world);
        let by_photons = settings.indirect == Indirect::Photons && settings.parts.indirect && bounces;
        let global = by_photons.then(|| Global::new(world, &settings)).flatten();
        let direct = Direct::new(world, DirectSettings { diffuse_environment: !sky, ..settings.direct });
        let caustics = Caustics::weighed(world, &settings, window[2] as usize * window[3] as usize);
        let (map, global_map) = (None, None);
        Photon {
            world,
            settings,
            window,
            direct,
            caustics,
            map,
            emitted: 0,
            global,
            global_map,
            cache,
            sky,
            samples: Vec::new(),
            crossed: Vec::new(),
        }
    }

    /// Uses the records of `cache` as they are, whatever light they hold. `None` where no cache would be asked.
    pub fn with_cache(mut self, cache: IrradianceCache<'a>) -> Option<Self> {
        self.take_over(FromFile { cache, same_light: true }).then_some(self)
    }

    fn take_over(&mut self, file: FromFile<'a>) -> bool {
        self.cache.as_mut().map(|cache| cache.take_over(file)).is_some()
    }

    /// Takes as many light samples as suit the rest of the picture, and verdicts where they are of use.
    fn ration_light_samples(&mut self) {
        let pilot = Pilot::new(&self.eye(), self.window, self.direct.samples(), self.settings.seed);
        let samples = pilot.light_samples();
        if !pilot.verdicts_pay(samples) {
            self.direct.give_up_verdicts();
        }
        self.direct.set_samples(samples);
    }

    /// Finds out how many caustic photons the picture is worth, from the map before and the present one.
    fn weigh_caustics(&mut self, before: Option<CausticMap>) {
        if !self.caustics.as_ref().is_some_and(Caustics::is_weighed) {
            return;
        }
        let present = self.eye();
        let before = Eye { caustics: before.as_ref(), ..self.eye() };
        let found = Found::new([&before, &present], self.window, self.settings.seed);
        if let Some(caustics) = &mut self.caustics {
            caustics.learn_counts(found);
        }
    }

    /// Finds out how often caches are worth to be renewed, from the cache before and the present one.
    fn compare_caches(&mut self, before: &IrradianceCache<'a>, pass: u64) {
        let present = self.eye();
        let before = Eye { cache: Some(before), ..self.eye() };
        let found = Found::new([&before, &present], self.window, hash(self.settings.seed, pass));
        if let Some(cache) = &mut self.cache {
            cache.learn(found);
        }
    }

    fn eye(&self) -> Eye<'_> {
        Eye {
            world: self.world,
            settings: &self.settings,
            direct: &self.direct,
            caustics: self.map.as_ref(),
            global: self.global_map.as_ref(),
            cache: self.cache.as_ref().map(RenewedCache::cache),
            guides: self.cache.as_ref().map(RenewedCache::cache),
            sky: self.sky,
        }
    }

    /// Samples that a pixel which wants `wanted` gets in pass `pass`, on average: at first one everywhere, then what edges want beyond it. A
    /// picture without gaps comes first.
    fn share(&self, wanted: f32, pass: u64) -> f32 {
        match (self.settings.antialiasing, pass) {
            (Antialiasing::Adaptive, 0) => 1.0,
            (Antialiasing::Adaptive, 1) => (wanted - 1.0).max(0.0),
            _ => wanted,
        }
    }
}

impl Integrator for Photon<'_> {
    fn name(&self) -> &'static str {
        "photon"
    }

    fn prepare(&mut self, pass: u64, over: &(dyn Fn() -> bool + Sync)) {
        let pixels = self.window[2] as usize * self.window[3] as usize;
        match (self.settings.antialiasing, pass) {
            (Antialiasing::Full, 0) => self.samples = vec![FULL_SAMPLES; pixels],
            // What edges want is found out after the first pass.
            (Antialiasing::Off | Antialiasing::Adaptive, 0) => self.samples = vec![1.0; pixels],
            (Antialiasing::Adaptive, 1) if !over() => {
                let hide_emitters = self.settings.path.hide_emitters;
                let settings = AntialiasSettings { hide_emitters, ..AntialiasSettings::default() };
                let samples = samples_per_pixel(self.world, self.window, settings);
                self.crossed = samples.iter().map(|&n| n > 1).collect();
                self.samples = samples.into_iter().map(f32::from).collect();
            }
            _ => {}
        }
        let before = self.map.take();
        if let Some(caustics) = &mut self.caustics {
            caustics.begin(pass);
            self.map = Some(caustics.map(pass));
        }
        self.global_map = self.global.as_ref().map(|g| g.map(pass));
        self.emitted += self.global.as_ref().map_or(0, Global::count);
        if let Some(cache) = &mut self.cache {
            let before = cache.renew(pass, self.map.as_ref(), over);
            if let Some(before) = before.filter(|_| !over()) {
                self.compare_caches(&before, pass);
            }
        }
        if pass == 1 && !over() {
            self.weigh_caustics(before);
        }
        let adaptive = self.settings.direct.sampling == LightSampling::Adaptive;
        if pass == 0 && adaptive && self.settings.adaptive_light_samples {
            self.ration_light_samples();
        }
        if pass == 0 && !over() && self.cache.as_ref().is_some_and(RenewedCache::is_renewed) {
            let rays = looks::rays_per_sample(&self.eye(), self.window, self.settings.seed);
            self.cache.iter_mut().for_each(|cache| cache.learn_cost(rays));
        }
        let samples = self.samples.iter().map(|&wanted| f64::from(self.share(wanted, pass))).sum();
        if let Some(cache) = &mut self.cache {
            cache.count_samples(samples);
        }
    }

    fn prepared(&self) -> Counts {
        let cache = self.cache.as_ref().map(RenewedCache::rays).unwrap_or_default();
        let photons = self.emitted + self.caustics.as_ref().map_or(0, Caustics::emitted);
        Counts { photons, rays: cache.rays, shadow_rays: cache.shadow_rays, ..Counts::default() }
    }

    fn samples(&self, x: u32, y: u32, pass: u64) -> u32 {
        let [x0, y0, width, _] = self.window;
        let i = (y - y0) as usize * width as usize + (x - x0) as usize;
        let wanted = self.samples.get(i).copied().unwrap_or(1.0);
        allocate::rounded(self.share(wanted, pass), i as u64, pass, self.settings.seed)
    }

    fn learns(&self) -> bool {
        // Few samples say nothing of residuals that are traced by chance: to follow them would bring a bias back.
        let unbiased = self.settings.indirect == Indirect::Residual;
        self.settings.adaptive_sampling && !unbiased && self.settings.antialiasing == Antialiasing::Adaptive
    }

    fn learn(&mut self, film: &Film) {
        // After the first pass pixels have one sample each, which says nothing of noise.
        if film.pixels().iter().any(|p| p.count() > 1) {
            self.samples = allocate::samples_per_pass(film, &self.crossed, self.settings.filtered);
        }
    }

    fn sample(&self, camera: &CameraRay, _pass: u64, rng: &mut Sampler, counts: &mut Counts) -> (Rgb, Features) {
        self.eye().sample(camera, rng, counts)
    }

    fn figures(&self) -> Vec<(&'static str, u64)> {
        let mut all = Vec::new();
        if let Some(map) = &self.map {
            all.push(("caustic photons stored", map.stored() as u64));
        }
        if let Some(map) = &self.global_map {
            all.push(("indirect photons stored", map.stored() as u64));
        }
        all.push(("samples of a light", u64::from(self.direct.samples())));
        all.extend(self.cache.iter().flat_map(RenewedCache::figures));
        all
    }

    fn tells(&self) -> Option<Told> {
        Some(Told::Parts)
    }

    fn photons(&self) -> Vec<StoredPhoton> {
        let caustic = self.caustics.as_ref().map(|c| c.photons(0)).unwrap_or_default();
        let global = self.global.as_ref().map(|g| g.photons(0)).unwrap_or_default();
        [caustic, global].concat()
    }

    fn emission_densities(&self, size: usize, most: usize) -> Vec<DensityMap> {
        self.caustics.as_ref().map(|c| c.densities(size, most)).unwrap_or_default()
    }

    fn load_cache(&mut self, path: &Path) -> Result<(), CacheFileError> {
        let file = IrradianceCache::load(self.world, path)?;
        if self.take_over(file) { Ok(()) } else { Err(CacheFileError::NotUsed) }
    }

    fn cache(&self) -> Option<&IrradianceCache<'_>> {
        self.cache.as_ref().map(RenewedCache::cache)
    }

    fn remarks(&self, _counts: &Counts) -> Vec<String> {
        self.cache.iter().filter_map(RenewedCache::remark).map(String::from).collect()
    }
}
