//! Many lights: indirect light from virtual point lights.
//!
//! Estimates   the same integral as [`super::path`], split by what is known where (`eye` has the table): direct light by light sampling,
//!             caustics and other light that mirrors, glass and gloss send to diffuse surfaces from photons, light that a diffuse surface
//!             sends to another from virtual lights, summed by one of the [`strategies`](crate::transport::strategies)
//! Passes      each pass has virtual lights and cache points of its own, so that no error of one pass, banding above all, outlives it; the
//!             price of variance, lambda, and the calibration of the cache come from the passes before
//! Source      Keller 1997 (instant radiosity), progressive over passes; Nabata et al.; Tokuyoshi & Harada; METHODS 6.3, 6.4
//! Bias        kernels of photons; with `compensate` off, corners are darker (see `transport::vpl`)
//! Not handled participating media
//! Verified by tests/many_light.rs (agreement with `path`, furnace, determinism), `transport::strategies::tests`

mod eye;
mod lights;
mod meter;
mod reflected;
mod settings;

pub use settings::ManyLightSettings;

use self::eye::Eye;
use self::lights::{PassLights, Sources, class};
use self::meter::{Meter, Seen};
use self::reflected::Reflected;
use super::photon::caustics::Caustics;
use super::photon::places::places;
use super::photon::{Emission, PhotonSettings};
use super::{Counts, Integrator, Told};
use crate::image::film::{Features, Film, PixelSums};
use crate::math::sampler::{hash, unit_f32};
use crate::math::{Price, Rgb, Sampler, Vec2};
use crate::scene::camera::CameraRay;
use crate::scene::material::has_sharp_lobe;
use crate::transport::direct::Direct;
use crate::transport::emitter_vpls::EmitterVpls;
use crate::transport::light_tree::LightTree;
use crate::transport::photon_map::GlobalMap;
use crate::transport::strategies::{LOOK, ManyLights};
use crate::transport::visibility::posterior::Posterior;
use crate::transport::visibility::{self, ShadingClusters};
use crate::transport::vpl::write_ply;
use crate::transport::{CausticMap, World};
use rayon::prelude::*;
use std::borrow::Cow;
use std::f32::consts::FRAC_1_PI;

/// Pixels per virtual light of a pass if nothing is said, and the bounds of their number.
const PIXELS_PER_LIGHT: usize = 64;
const FEWEST: usize = 1024;
const MOST_LIGHTS: usize = 16_384;
/// Caustic photons of a pass where only what short paths meet is lit by them.
const FEW_CAUSTIC_PHOTONS: u64 = 1 << 13;
/// Shading points that clusters are made of, at most.
const SHADING_POINTS: usize = 1 << 16;
/// Camera samples of a trial for the first lambda, and trials.
const TRIAL: u64 = 256;
const TRIALS: u32 = 7;
/// One camera sample in so many is metered.
const METERED: u64 = 8;
/// Separates random numbers of trials and culling from those of samples.
const STREAM: u64 = 0x6d61_6e79; // "many"

/// The many-light integrator.
pub struct ManyLight<'a> {
    world: World<'a>,
    settings: ManyLightSettings,
    window: [u32; 4],
    direct: Direct<'a>,
    caustics: Option<Caustics<'a>>,
    map: Option<CausticMap>,
    reflected: Option<Reflected<'a>>,
    reflected_map: Option<GlobalMap>,
    sources: Sources<'a>,
    /// Direct light of diffuse parts by light sampling, where virtual lights bring a part of it.
    rest_of_lights: Option<Direct<'a>>,
    clusters: ShadingClusters,
    /// By class of film positions; empty without any.
    lights: Vec<PassLights>,
    posterior: Posterior,
    meter: Meter,
    price: Price,
    /// A / pi for short paths.
    radius2: f32,
    has_rest: bool,
    /// Variance of a sample, mean over the picture, once it is known.
    variance: Option<f64>,
    prepared: Counts,
    cache_rays: u64,
}

impl<'a> ManyLight<'a> {
    /// An integrator for the pixels of `window` (x, y, width, height).
    pub fn new(world: World<'a>, settings: ManyLightSettings, window: [u32; 4]) -> Self {
        let pixels = window[2] as usize * window[3] as usize;
        // Where caustics are not shown, only short paths ask them, and those that find reflected light.
        let seldom = !settings.parts.caustic && settings.photons != Some(0);
        let photon = PhotonSettings {
            path: settings.path,
            caustic_photons: settings.caustic_photons.or(seldom.then_some(FEW_CAUSTIC_PHOTONS)),
            emission: if seldom { Emission::Uniform } else { Emission::Adaptive },
            parts: settings.parts,
            seed: settings.seed,
            ..PhotonSettings::default()
        };
        let scene = world.scene;
        let wanted = settings.vpls.unwrap_or((pixels / PIXELS_PER_LIGHT).clamp(FEWEST, MOST_LIGHTS));
        let sources = Sources::new(world, wanted.div_ceil(settings.classes()), &settings);
        let radius2 = sources.mean_area() * settings.area * FRAC_1_PI;
        let rest_of_lights = sources.emitters.is_some().then(|| {
            let tree = LightTree::of(scene, |e| !EmitterVpls::takes(scene, e));
            Direct::with_tree(world, Cow::Owned(tree), settings.direct)
        });
        let has_rest = scene.shapes.iter().any(|s| has_sharp_lobe(&scene.materials, s.material, f32::INFINITY));
        ManyLight {
            world,
            settings,
            window,
            direct: Direct::new(world, settings.direct),
            caustics: Caustics::new(world, &photon, pixels),
            map: None,
            reflected: Reflected::new(world, &settings, pixels).filter(|_| has_rest),
            reflected_map: None,
            sources,
            rest_of_lights,
            clusters: ShadingClusters::default(),
            lights: Vec::new(),
            posterior: Posterior::default(),
            meter: Meter::default(),
            price: Price { look: LOOK, check: 1.0, lambda: 0.0 },
            radius2: if settings.compensate { radius2 } else { 0.0 },
            has_rest,
            variance: None,
            prepared: Counts::default(),
            cache_rays: 0,
        }
    }

    /// Cost of a pass's preparations, shadow rays per pixel.
    fn shared_cost(&self) -> f64 {
        let rays: u64 = self.lights.iter().map(|l| l.vpls.rays + l.cache.as_ref().map_or(0, |c| c.rays)).sum();
        rays as f64 / (f64::from(self.window[2]) * f64::from(self.window[3])).max(1.0)
    }

    fn make_lights(&mut self, pass: u64) {
        if self.sources.is_empty() {
            return;
        }
        let classes = self.settings.classes() as u64;
        let one = |k| PassLights::new(self.world, &self.sources, &self.clusters, &self.settings, pass * classes + k);
        self.lights = (0..classes).map(one).collect();
        for l in &self.lights {
            self.prepared.photons += l.vpls.photons;
            self.prepared.rays += l.vpls.rays;
            self.cache_rays += l.cache.as_ref().map_or(0, |c| c.rays);
        }
    }

    /// Random ranges for this pass, with the present lambda.
    fn set_ranges(&mut self, pass: u64) {
        for (k, lights) in self.lights.iter_mut().enumerate() {
            let key = hash(hash(hash(self.settings.seed, STREAM), pass), k as u64);
            lights.set_ranges(&self.settings, &self.price, key);
        }
    }

    /// A first lambda, by trials of some camera samples with the lights of the first pass.
    fn find_price(&mut self) {
        let all = self.lights.iter().flat_map(|l| &l.vpls.lights);
        let total = all.map(|l| f64::from(l.strength)).sum::<f64>() / self.lights.len().max(1) as f64;
        let area: f64 = self.world.scene.shapes.iter().map(|s| f64::from(s.area())).sum();
        // The radiance of the lights' flux if it lay evenly on all surfaces: right to an order of magnitude.
        let radiance = total * std::f64::consts::PI / area.max(f64::MIN_POSITIVE);
        self.meter = Meter::new(radiance);
        self.price.lambda = (radiance * radiance / 10.0) as f32;
        if !self.settings.strategy.strategy.needs_price() {
            return;
        }
        let [x, y, w, h] = self.window.map(|v| v as f32);
        for trial in 0..TRIALS {
            self.set_ranges(u64::from(trial) | 1 << 63);
            // Two samples of each place: what differs is noise.
            let pair = |i: u64| {
                let key = hash(hash(self.settings.seed, STREAM), i);
                let at = Vec2::new(x + w * unit_f32(key), y + h * unit_f32(hash(key, 1)));
                let (eye, camera) = (self.eye(at), self.world.scene.camera.ray(at, Vec2::splat(0.5)));
                let mut traced = 0;
                let [a, b] = [0, 1].map(|k| {
                    let mut rng = Sampler::new(self.settings.seed, key, u64::from(2 * trial + k));
                    let mut counts = Counts::default();
                    let (radiance, _, tally) = eye.sample(&camera, &mut rng, &mut counts);
                    let other = counts.rays + counts.direct.shadow_rays;
                    self.meter.add(&tally, other);
                    traced += other + tally.counts().shadow_rays;
                    radiance.as_dvec3()
                });
                (traced, (a - b).length_squared() / 6.0)
            };
            let (rays, variances): (Vec<u64>, Vec<f64>) = (0..TRIAL).into_par_iter().map(pair).unzip();
            self.prepared.rays += rays.iter().sum::<u64>();
            self.read_meter(Seen::mean(variances).map_or(Seen::Nothing, Seen::OnePass));
        }
    }

    /// Takes what the meter says into account.
    fn read_meter(&mut self, seen: Seen) {
        let shared = self.shared_cost();
        if let Some(factor) = self.meter.read(shared, seen) {
            self.price.lambda *= factor as f32;
        }
    }

    /// The eye at a film position.
    fn eye(&self, film: Vec2) -> Eye<'_> {
        let lights = self.lights.get(class(film, self.settings.interleave)).filter(|l| !l.vpls.lights.is_empty());
        Eye {
            world: self.world,
            settings: &self.settings,
            direct: &self.direct,
            rest_of_lights: self.rest_of_lights.as_ref(),
            caustics: self.map.as_ref(),
            reflected: self.reflected_map.as_ref(),
            lights: lights.map(|PassLights { vpls, tree, cache, ranges }| ManyLights {
                ranges,
                ..ManyLights::new(
                    self.world,
                    vpls,
                    tree,
                    cache.as_ref(),
                    &self.posterior,
                    self.settings.strategy,
                    self.price,
                )
            }),
            radius2: self.radius2,
            seeks_rest: self.has_rest && self.reflected.is_none(),
        }
    }
}

impl Integrator for ManyLight<'_> {
    fn name(&self) -> &'static str {
        "many-light"
    }

    fn prepare(&mut self, pass: u64, _over: &(dyn Fn() -> bool + Sync)) {
        if let Some(caustics) = &mut self.caustics {
            self.map = Some(caustics.map(pass));
        }
        if let Some(reflected) = &self.reflected {
            self.prepared.photons += reflected.count();
            self.reflected_map = Some(reflected.map(pass));
        }
        if pass == 0 && !self.sources.is_empty() && self.settings.strategy.strategy.needs_cache() {
            let pixels = self.window[2] as usize * self.window[3] as usize;
            let spacing = (pixels as f64 / SHADING_POINTS as f64).sqrt().ceil().max(1.0) as u32;
            let points = places(self.world, self.window, spacing, None, self.settings.path.hide_emitters)
                .iter()
                .map(|p| p.facet)
                .collect();
            self.clusters = ShadingClusters::new(points, self.settings.cache_points);
        }
        self.make_lights(pass);
        if pass == 0 {
            self.find_price();
        } else if pass.is_power_of_two() {
            self.read_meter(self.variance.map_or(Seen::Nothing, Seen::Passes));
        }
        self.posterior.fold();
        self.set_ranges(pass);
    }

    fn prepared(&self) -> Counts {
        let photons = self.prepared.photons + self.caustics.as_ref().map_or(0, Caustics::emitted);
        Counts { photons, shadow_rays: self.cache_rays, ..self.prepared }
    }

    fn learns(&self) -> bool {
        self.settings.strategy.strategy.needs_price()
    }

    fn learn(&mut self, film: &Film) {
        let of = |p: &PixelSums| p.variance().iter().sum::<f64>() / 3.0 * f64::from(p.count());
        self.variance = Seen::mean(film.pixels().iter().filter(|p| p.count() > 1).map(of).collect());
    }

    fn sample(&self, camera: &CameraRay, _pass: u64, rng: &mut Sampler, counts: &mut Counts) -> (Rgb, Features) {
        let before = counts.rays + counts.direct.shadow_rays;
        let (radiance, mut features, tally) = self.eye(camera.film).sample(camera, rng, counts);
        counts.many_light += tally.counts();
        tally.tell(&mut features.makeup);
        // A part of the samples, the same for any number of threads.
        if hash(u64::from(camera.d.x.to_bits()), u64::from(camera.d.y.to_bits())).is_multiple_of(METERED) {
            self.meter.add(&tally, counts.rays + counts.direct.shadow_rays - before);
        }
        (radiance, features)
    }

    fn figures(&self) -> Vec<(&'static str, u64)> {
        let sum = |of: fn(&PassLights) -> usize| self.lights.iter().map(of).sum::<usize>() as u64;
        let mut all = vec![("virtual lights", sum(|l| l.vpls.lights.len()))];
        if let Some(map) = &self.map {
            all.push(("caustic photons stored", map.stored() as u64));
        }
        if let Some(map) = &self.reflected_map {
            all.push(("reflected photons stored", map.stored() as u64));
        }
        if self.lights.iter().any(|l| l.cache.is_some()) {
            all.push(("cache points", sum(|l| l.cache.as_ref().map_or(0, |c| c.points().len()))));
            all.push(("cache bytes", sum(|l| l.cache.as_ref().map_or(0, |c| c.bytes()))));
            all.push(("cache shadow rays", self.cache_rays));
        }
        all
    }

    fn tells(&self) -> Option<Told> {
        Some(Told::VirtualLights)
    }

    fn points_ply(&self) -> Option<Vec<u8>> {
        Some(write_ply(self.lights.iter().map(|l| &l.vpls)))
    }

    fn has_cache_points(&self) -> bool {
        !self.sources.is_empty() && self.settings.strategy.strategy.needs_cache()
    }

    fn cache_points_ply(&self) -> Option<Vec<u8>> {
        let caches: Vec<_> = self.lights.iter().filter_map(|l| l.cache.as_ref()).collect();
        (!caches.is_empty()).then(|| visibility::write_ply(&caches))
    }

    fn remarks(&self, _counts: &Counts) -> Vec<String> {
        let mut out = Vec::new();
        let fewest = self.lights.iter().map(|l| l.vpls.lights.len()).min().unwrap_or(0);
        if let Some(light) = self.settings.watched.filter(|&l| l as usize >= fewest) {
            out.push(format!("the last pass has {fewest} virtual lights; one with the index {light} is none of them"));
        }
        if self.sources.photons.is_none() && self.settings.parts.indirect && !self.world.scene.lights.is_empty() {
            out.push("no light reaches a diffuse surface within the limit of depth: no virtual light".into());
        }
        out
    }
}
