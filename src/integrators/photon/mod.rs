//! Photon mapping steered by derivatives: the default integrator.
//!
//! Estimates   the same integral as [`super::path`], split by what is known where (`eye` has the table): direct light with the
//!             detector's verdicts, caustics from photons with kernels of their own footprints, diffuse interreflection from a
//!             cache of gather rays
//! Passes      each pass has photons of its own and smaller kernels; a new and finer cache is made whenever samples have cost as much as the
//!             last one. A cache that was loaded stays: it is filled where the eye sees uncovered places, and not renewed, so that
//!             pictures of one camera path do not differ by their caches
//! Source      Namae & Makino (photons, light samples, pixels where derivatives predict edges); Jensen 2001 (the split into
//!             direct, caustic and indirect light); Yue, Onoue & Nishita (stored gather rays); Knaus & Zwicker 2011 (passes)
//! Bias        kernels and interpolated irradiance: both shrink with the passes
//! Depth       the cache holds the bounces that are left behind the first surface. Behind mirrors and glass fewer are: where that
//!             shows (few are left) paths take its place. What gather rays meet in mirrors counts as if the mirror were none
//! Not handled participating media
//! Verified by tests/photon.rs (agreement with `path`, furnace, determinism), tests/references.rs

mod allocate;
pub(super) mod caustics;
mod eye;
mod global;
mod learned_lights;
pub mod places;
mod settings;

pub use settings::{Antialiasing, Emission, Indirect, Parts, PhotonSettings};

use self::caustics::Caustics;
use self::eye::Eye;
use self::global::Global;
use super::{Counts, Integrator, Told};
use crate::emission::DensityMap;
use crate::image::film::{Features, Film};
use crate::math::sampler::hash;
use crate::math::{Rgb, Sampler, Vec2, Vec3};
use crate::scene::camera::CameraRay;
use crate::transport::antialias::{AntialiasSettings, samples_per_pixel};
use crate::transport::cache_file::{CacheFileError, FromFile};
use crate::transport::direct::{Direct, DirectSettings, LightSampling};
use crate::transport::gather_ray::RayCounts;
use crate::transport::gather_sky;
use crate::transport::photon::Photon as StoredPhoton;
use crate::transport::photon_map::GlobalMap;
use crate::transport::{CacheSettings, CacheStatistics, CausticMap, HitLight, IrradianceCache, World};
use std::path::Path;

/// Pixels for each record that a pass may add.
const PIXELS_PER_RECORD: usize = 24;
/// What a camera sample costs, in rays of the cache.
const RAYS_PER_SAMPLE: f64 = 3.0;
/// Records made before time is looked at again.
const PORTION: usize = 512;
/// Camera samples that find out how many light samples are needed, and their stream of random numbers.
const PILOT: u64 = 512;
const PILOT_STREAM: u64 = 0x9107;
/// Most light samples of a camera sample, on average, and the least of one light.
const MOST_LIGHT_SAMPLES: f32 = 10.0;
const LEAST_LIGHT_SAMPLES: u32 = 4;
/// Share of verdicts that must save samples: a verdict costs about as much as four shadow rays, and saves up to sixteen.
const LEAST_USEFUL: f32 = 0.25;
/// Samples of a pixel in each pass where nothing is adaptive: as many as Namae and Makino took.
const FULL_SAMPLES: f32 = 16.0;
/// Records that the first pass may add however few pixels there are.
const LEAST_RECORDS: usize = 1000;

/// The photon integrator.
pub struct Photon<'a> {
    world: World<'a>,
    settings: PhotonSettings,
    window: [u32; 4],
    direct: Direct<'a>,
    caustics: Option<Caustics<'a>>,
    /// Caustic photons of this pass.
    map: Option<CausticMap>,
    /// Photons emitted in all passes so far.
    emitted: u64,
    global: Option<Global<'a>>,
    /// Photons of this pass in place of the cache.
    global_map: Option<GlobalMap>,
    cache: Option<IrradianceCache<'a>>,
    /// Caches made so far.
    caches: u32,
    /// Rays of all caches before this one.
    cache_rays: RayCounts,
    /// What the cache was when it came from elsewhere; `None` if it is the integrator's own.
    loaded: Option<Loaded>,
    /// Samples taken since this one was made.
    samples_since: f64,
    /// Whether the cache holds the light of the environment too.
    sky: bool,
    /// Samples per pass of each pixel of the window; none: one.
    samples: Vec<f32>,
}

/// Settings of the first cache. A path from the eye by way of a record has three segments at least; what is left are bounces.
fn cache_settings(settings: &PhotonSettings) -> CacheSettings {
    CacheSettings { bounces: settings.path.max_depth.map(|max| max.saturating_sub(3)), ..CacheSettings::default() }
}

/// A cache from elsewhere.
struct Loaded {
    /// As it came.
    as_it_was: CacheStatistics,
    /// Whether it has the light of this scene.
    same_light: bool,
}

impl<'a> Photon<'a> {
    /// An integrator for the pixels of `window` (x, y, width, height).
    pub fn new(world: World<'a>, settings: PhotonSettings, window: [u32; 4]) -> Self {
        let bounces = settings.path.max_depth.is_none_or(|d| d > 2);
        let by_records = matches!(settings.indirect, Indirect::Cache | Indirect::Residual);
        let cached = by_records && settings.parts.indirect && bounces;
        let cache = cached.then(|| IrradianceCache::new(world, cache_settings(&settings)));
        let sky = cached && gather_sky::is_gathered(&world);
        let by_photons = settings.indirect == Indirect::Photons && settings.parts.indirect && bounces;
        let global = by_photons.then(|| Global::new(world, &settings)).flatten();
        let direct = Direct::new(world, DirectSettings { diffuse_environment: !sky, ..settings.direct });
        let caustics = Caustics::new(world, &settings, window[2] as usize * window[3] as usize);
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
            caches: 0,
            cache_rays: RayCounts::default(),
            loaded: None,
            samples_since: 0.0,
            sky,
            samples: Vec::new(),
        }
    }

    /// Uses the records of `cache` as they are, whatever light they hold. `None` where no cache would be asked.
    pub fn with_cache(mut self, cache: IrradianceCache<'a>) -> Option<Self> {
        self.take_over(FromFile { cache, same_light: true }).then_some(self)
    }

    fn take_over(&mut self, FromFile { cache, same_light }: FromFile<'a>) -> bool {
        let used = self.cache.is_some();
        if used {
            self.loaded = Some(Loaded { as_it_was: cache.statistics(), same_light });
            self.cache = Some(cache);
        }
        used
    }

    /// Makes a loaded cache fit: the present light, records for places that have none.
    fn complete(
        &self,
        mut cache: IrradianceCache<'a>,
        same_light: bool,
        over: &(dyn Fn() -> bool + Sync),
    ) -> IrradianceCache<'a> {
        if !same_light {
            self.with_light(|light| cache.relight(self.world, light));
        }
        cache.limit_bounces(cache_settings(&self.settings).bounces);
        self.fill(&mut cache, over);
        cache
    }

    /// Rays that this run has traced for the present cache.
    fn own_cache_rays(&self) -> [RayCounts; 2] {
        let Some(cache) = &self.cache else { return [RayCounts::default(); 2] };
        let (now, before) = (cache.statistics(), self.loaded.as_ref().map(|l| l.as_it_was).unwrap_or_default());
        [now.record_rays - before.record_rays, now.surfel_rays - before.surfel_rays]
    }

    /// Makes a cache, if it is time for a new one: when as many samples have been taken as the last one cost rays. Then the noise of
    /// caches falls with the passes like that of samples, and so does their bias, since each is finer than the one before.
    fn renew_cache(&mut self, pass: u64, over: &(dyn Fn() -> bool + Sync)) {
        if let Some(&Loaded { same_light, .. }) = self.loaded.as_ref() {
            if pass == 0 {
                self.cache = self.cache.take().map(|cache| self.complete(cache, same_light, over));
            }
            return;
        }
        let Some(cache) = &self.cache else { return };
        let known = cache.statistics();
        let cost = (known.record_rays + known.surfel_rays).total();
        if pass > 0 && self.samples_since * RAYS_PER_SAMPLE < cost as f64 {
            return;
        }
        let finer = 1.0 + self.caches as f32;
        let usual = cache_settings(&self.settings);
        let settings = CacheSettings {
            error: usual.error / finer.sqrt(),
            surfel_cell: usual.surfel_cell / finer.sqrt(),
            seed: hash(self.settings.seed, u64::from(self.caches)),
            ..usual
        };
        let given_up = cache;
        let mut cache = IrradianceCache::new(self.world, settings);
        cache.give_up_as(given_up);
        self.fill(&mut cache, over);
        // Without the time to finish it there will be no further samples.
        if pass == 0 || !over() {
            self.cache_rays += known.record_rays + known.surfel_rays;
            self.cache = Some(cache);
            self.caches += 1;
            self.samples_since = 0.0;
        }
    }

    /// Records for what the eye sees: coarse to fine.
    fn fill(&self, cache: &mut IrradianceCache, over: &(dyn Fn() -> bool + Sync)) {
        self.with_light(|light| self.fill_with(cache, light, over));
        cache.finish();
    }

    /// Hands on what lights the hits of the cache.
    fn with_light(&self, mut user: impl FnMut(&HitLight)) {
        let map = self.map.as_ref();
        // The gather ray and the ray from the eye are segments too.
        let most = self.settings.path.max_depth.map_or(u32::MAX, |max| max.saturating_sub(2));
        let caustic = |p: Vec3, n: Vec3| map.map_or(Rgb::ZERO, |map| map.irradiance_within(p, n, most));
        user(&HitLight::Operator { caustic: &caustic });
    }

    fn fill_with(&self, cache: &mut IrradianceCache, light: &HitLight, over: &(dyn Fn() -> bool + Sync)) {
        let pixels = self.window[2] as usize * self.window[3] as usize;
        let known_records = cache.records().len();
        let most = known_records + (pixels / PIXELS_PER_RECORD).max(LEAST_RECORDS) * (1 + self.caches as usize);
        let finest = if self.caches == 0 { 4 } else { 2 };
        let mut known = None;
        for spacing in [32, 16, 8, 4, 2].into_iter().filter(|&s| s >= finest) {
            if over() || cache.records().len() >= most {
                break;
            }
            let places = places::places(self.world, self.window, spacing, known);
            // In portions, between which time may be up.
            loop {
                let before = cache.records().len();
                cache.fill(&places, light, PORTION.min(most.saturating_sub(before)));
                if over() || cache.records().len() < before + PORTION {
                    break;
                }
            }
            known = Some(spacing);
        }
    }

    /// Lowers the number of light samples where points that need several are the rule: then they would cost most of the time, and what
    /// one pass lacks the next ones give. Verdicts that are hardly ever of use are done without.
    fn ration_light_samples(&mut self) {
        let [x0, y0, width, height] = self.window.map(|v| v as f32);
        let eye = self.eye();
        let mut counts = Counts::default();
        for k in 0..PILOT {
            let mut rng = Sampler::new(self.settings.seed, PILOT_STREAM, k);
            let (at, lens) = (rng.next_2d(), rng.next_2d());
            let ray = self.world.scene.camera.ray(Vec2::new(x0, y0) + at * Vec2::new(width, height), lens);
            eye.sample(&ray, &mut rng, &mut counts);
        }
        let taken = counts.direct.light_samples as f32 / PILOT as f32;
        let d = counts.direct;
        let (of_use, of_none) = (d.visible + d.blocked, d.partial + d.unknown);
        if (of_use as f32) < LEAST_USEFUL * (of_use + of_none) as f32 {
            self.direct.give_up_verdicts();
        }
        let usual = self.direct.samples();
        if taken > MOST_LIGHT_SAMPLES {
            let rationed = (usual as f32 * MOST_LIGHT_SAMPLES / taken).round() as u32;
            self.direct.set_samples(rationed.max(LEAST_LIGHT_SAMPLES.min(usual)));
        }
    }

    fn eye(&self) -> Eye<'_> {
        Eye {
            world: self.world,
            settings: &self.settings,
            direct: &self.direct,
            caustics: self.map.as_ref(),
            global: self.global_map.as_ref(),
            cache: self.cache.as_ref(),
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
                let samples = samples_per_pixel(self.world, self.window, AntialiasSettings::default());
                self.samples = samples.into_iter().map(f32::from).collect();
            }
            _ => {}
        }
        self.emitted += self.caustics.as_ref().map_or(0, Caustics::emitted);
        self.map = self.caustics.as_mut().map(|c| c.map(pass));
        self.global_map = self.global.as_ref().map(|g| g.map(pass));
        self.emitted += self.global.as_ref().map_or(0, Global::count);
        self.renew_cache(pass, over);
        let adaptive = self.settings.direct.sampling == LightSampling::Adaptive;
        if pass == 0 && adaptive && self.settings.adaptive_light_samples {
            self.ration_light_samples();
        }
        self.samples_since += self.samples.iter().map(|&wanted| f64::from(self.share(wanted, pass))).sum::<f64>();
    }

    fn prepared(&self) -> Counts {
        let mut counts = Counts { photons: self.emitted, ..Counts::default() };
        let [records, surfels] = self.own_cache_rays();
        let all = self.cache_rays + records + surfels;
        (counts.rays, counts.shadow_rays) = (all.rays, all.shadow_rays);
        counts
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
            self.samples = allocate::samples_per_pass(film);
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
        if let Some(cache) = &self.cache {
            let s = cache.statistics();
            let [records, surfels] = self.own_cache_rays();
            if let Some(loaded) = &self.loaded {
                all.push(("cache records loaded", loaded.as_it_was.records as u64));
            }
            all.extend([
                ("caches", u64::from(self.caches)),
                ("cache records", s.records as u64),
                ("cache surfels", s.surfels as u64),
                ("cache records of least radius", s.smallest as u64),
                ("cache rays of records", records.rays),
                ("cache rays of surfels", surfels.rays),
                ("cache shadow rays", records.shadow_rays + surfels.shadow_rays),
                ("cache places left", s.left as u64),
                ("cache shapes given up", s.hopeless as u64),
            ]);
        }
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
        self.cache.as_ref()
    }

    fn remarks(&self, _counts: &Counts) -> Vec<String> {
        match &self.loaded {
            Some(l) if !l.same_light => {
                vec![
                    "the cache was made under other light; its stored hits were evaluated under that of the scene"
                        .into(),
                ]
            }
            _ => Vec::new(),
        }
    }
}
