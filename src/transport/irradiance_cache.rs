//! The irradiance cache: indirect diffuse light on a few thousand places instead of at every pixel.
//!
//! Estimates   E(x, n) = sum_i w_i E_i(x, n) / sum_i w_i          over the records near x (`cache_record.rs`)
//! Meaning     E = integral of L_ind(w) cos dw, where L_ind leaves out what emitters and the environment send to x directly
//!             or by specular surfaces only: add direct light and the caustic map. The value of a diffuse surface is rho / pi E
//! Source      Ward, Rubinstein, Clear 1988, "A Ray Tracing Solution for Diffuse Interreflection"; Yue, Onoue and Nishita
//! Bias        of interpolation (falls with [`CacheSettings::error`]) and of the surfels (`surfels.rs`); shading normals are
//!             those of the geometry, bump maps do not turn them
//! Not handled glossy receivers; shapes so finely structured that a record covers next to nothing ([`CacheStatistics::hopeless`])
//! Determinism a function of the settings and of the calls, for any number of threads
//! Verified by tests/irradiance_cache.rs
//!
//! # Use by an integrator
//!
//! ```text
//! let mut cache = IrradianceCache::new(world, CacheSettings::default());
//! let light = HitLight::Operator { caustic: &|p, n| map.irradiance(p, n) };       // or &|_, _| Rgb::ZERO
//! for stride in [16, 8, 4, 2] {                                                   // pixels, coarse to fine
//!     let places: Vec<Place> = ...first diffuse hit (beyond mirrors and glass) of every stride-th pixel;
//!     cache.fill(&places, &light, max_new);
//! }
//! cache.finish();                            // all bounces of all surfels, once before the samples are taken
//! ...
//! let place = Place::new(&at, wo, 0.0);
//! match cache.lookup(place.facet.p, place.facet.n_shade, place.facet.n_geo) {
//!     Some(e) => radiance += albedo_of_the_diffuse_part * e / PI,
//!     None => path tracing,
//! }
//! ...
//! cache.refine(0.5 * error);                        // a later pass: smaller radii; fill again, then finish
//! ```

mod glossy;
mod growth;

use super::World;
use super::bright_patches::{self, Patch};
use super::cache_file::Stored;
use super::cache_record::{BORDER, Record};
use super::cache_settings::{CacheSettings, CacheStatistics, Place};
use super::gather_cache::GatherCache;
use super::gather_ray::RayCounts;
use super::glossy_guide::GlossyGuides;
use super::sightings::Sightings;
use super::sphere_octree::SphereOctree;
use super::surfel_light::{HitLight, SurfelLight, SurfelSettings};
use super::surfels::Facet;
use crate::math::sampler::hash;
use crate::math::{Frame, Rgb, Sampler, Vec3, luminance, warp};
use growth::is_smallest;
use rayon::prelude::*;
use std::sync::Arc;

/// New records of one round: bounds, and their share of the records there are.
const ROUND: (usize, usize) = (64, 1024);
/// Places that are examined for the length of gather rays, and rays at each.
const PILOT: (usize, u32) = (256, 8);
/// Share of the mean irradiance to which errors are relative in darker places.
const DARK: f32 = 0.1;
/// Number of records at which bright patches are looked for, at first and times the number before.
const LOOK: (usize, usize) = (64, 4);
/// Stream of random numbers.
const PILOT_STREAM: u64 = 0x1ca;

/// The cache.
#[derive(Clone, Debug)]
pub struct IrradianceCache<'a> {
    world: World<'a>,
    settings: CacheSettings,
    gather: GatherCache,
    /// Set up by the first places, which tell the scale of the scene.
    light: Option<SurfelLight>,
    records: Vec<Record>,
    /// Least radius of each record.
    min_radii: Vec<f32>,
    tree: SphereOctree,
    left: usize,
    /// Shapes that are given up, in order.
    hopeless: Vec<u32>,
    /// Whether more of them may be.
    judges: bool,
    /// Bright patches that few gather rays find.
    patches: Vec<Patch>,
    /// Number of records at which they are looked for again.
    look_at: usize,
    /// What records have seen, for those nearby.
    sightings: Option<Arc<Sightings>>,
    /// Number of records beyond which they tell more than those that did.
    sights_at: usize,
    /// Number of records when surfels last took further light samples.
    sharpened: usize,
    /// Whether records came from a file: these stay.
    loaded: bool,
    /// What records tell glossy lobes.
    guides: GlossyGuides,
}

impl<'a> IrradianceCache<'a> {
    /// An empty cache.
    pub fn new(world: World<'a>, settings: CacheSettings) -> Self {
        let (center, radius) = world.scene.bounds;
        let mut cache = IrradianceCache {
            world,
            settings,
            gather: GatherCache::new(settings.gather_rays, settings.seed),
            light: None,
            records: Vec::new(),
            min_radii: Vec::new(),
            tree: SphereOctree::new(center, radius),
            left: 0,
            hopeless: Vec::new(),
            judges: true,
            patches: Vec::new(),
            look_at: LOOK.0,
            sightings: None,
            sights_at: 0,
            sharpened: 0,
            loaded: false,
            guides: GlossyGuides::default(),
        };
        cache.limit_bounces(settings.bounces);
        cache
    }

    /// The scene.
    pub fn world(&self) -> &World<'a> {
        &self.world
    }

    /// The settings.
    pub fn settings(&self) -> &CacheSettings {
        &self.settings
    }

    /// The records.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The hits of the records.
    pub fn gather_rays(&self) -> &GatherCache {
        &self.gather
    }

    /// The surfels, once there are any.
    pub fn surfels(&self) -> Option<&SurfelLight> {
        self.light.as_ref()
    }

    /// What has been done so far.
    pub fn statistics(&self) -> CacheStatistics {
        CacheStatistics {
            records: self.records.len(),
            surfels: self.light.as_ref().map_or(0, |l| l.surfels.len()),
            record_rays: self.gather.counts,
            surfel_rays: self.light.as_ref().map_or(RayCounts::default(), |l| l.counts),
            smallest: self.smallest(),
            patches: self.patches.len(),
            left: self.left,
            hopeless: self.hopeless.len(),
        }
    }

    fn smallest(&self) -> usize {
        self.records.iter().zip(&self.min_radii).filter(|(r, m)| is_smallest(r, **m)).count()
    }

    /// Indirect irradiance at a point, `None` where no record may be used. Normals are unit and point to the side that is
    /// seen.
    pub fn lookup(&self, p: Vec3, n_shade: Vec3, n_geo: Vec3) -> Option<Rgb> {
        let (mut sum, mut weights) = (Rgb::ZERO, 0.0);
        self.tree.containing(p, |id| {
            let record = &self.records[id as usize];
            if let Some(d) = record.distance(p, n_shade, n_geo) {
                let w = 1.0 - d / BORDER;
                sum += record.predict(p, n_shade) * w;
                weights += w;
            }
            true
        });
        (weights > 0.0).then(|| sum / weights)
    }

    /// Whole irradiance (direct, caustic and indirect) as gather rays read it, at the end of a ray whose last part, after mirrors and glass, is of
    /// length `distance`; `None` where no surfel stands for the place. For rays that come from all of a hemisphere or a wide lobe.
    pub fn at_hit(&self, at: &Facet, distance: f32) -> Option<Rgb> {
        let light = self.light.as_ref()?;
        let k = light.surfels.find(&self.world, at, distance)?;
        light.irradiance().get(k as usize).copied()
    }

    /// Shows the records that a look-up at the point uses, with their distances d.
    pub(super) fn visit(&self, p: Vec3, n_shade: Vec3, n_geo: Vec3, mut visitor: impl FnMut(&Record, f32)) {
        self.tree.containing(p, |id| {
            let record = &self.records[id as usize];
            if let Some(d) = record.distance(p, n_shade, n_geo) {
                visitor(record, d);
            }
            true
        });
    }

    /// Whether the cache has no records on a shape because they would cover next to nothing.
    pub fn gives_up(&self, shape: u32) -> bool {
        self.hopeless.binary_search(&shape).is_ok()
    }

    /// Whether the cache is good for the place as it is.
    pub fn covers(&self, at: &Facet) -> bool {
        let mut covered = false;
        self.tree.containing(at.p, |id| {
            covered = self.records[id as usize].distance(at.p, at.n_shade, at.n_geo).is_some_and(|d| d < 1.0);
            !covered
        });
        covered
    }

    /// Adds records until all places are covered, at most `max_new`. Places should come in levels from coarse to fine. Call
    /// [`Self::finish`] after the last level.
    pub fn fill(&mut self, places: &[Place], light: &HitLight, max_new: usize) {
        let mut open: Vec<u32> = self.uncovered(places, (0..places.len() as u32).collect());
        if open.is_empty() {
            return;
        }
        if self.light.is_none() {
            self.light = Some(SurfelLight::new(self.surfel_cell(places), self.surfel_settings()));
        }
        // Any order will do that spreads the first ones over all.
        open.sort_by_key(|&i| (hash(self.settings.seed, u64::from(i)), i));
        let mut budget = max_new;
        while !open.is_empty() && budget > 0 {
            let size = (self.records.len() / 2).clamp(ROUND.0, ROUND.1).min(budget).min(open.len());
            let rest = open.split_off(size);
            let round: Vec<Place> = open.iter().map(|&i| places[i as usize]).collect();
            self.add(&round, light);
            self.look_for_light(light);
            budget -= size;
            open = self.uncovered(places, rest);
            if open.is_empty() {
                // Radii shrink by what neighbours learn: some places have lost their record.
                open = self.uncovered(places, (0..places.len() as u32).collect());
            }
            let before = self.hopeless.len();
            self.give_up();
            if self.hopeless.len() > before {
                open = self.uncovered(places, open);
            }
        }
        self.left += open.len();
    }

    /// Leaves out what another cache has given up, and nothing else: with smaller errors more records have the least radius, which says nothing of
    /// their shapes. Sends rays to the bright patches which that one has found. A cache without records has judged nothing.
    pub fn start_as(&mut self, other: &IrradianceCache) {
        if other.records.is_empty() {
            return;
        }
        self.hopeless.clone_from(&other.hopeless);
        self.judges = false;
        self.patches.clone_from(&other.patches);
        // Fewer records know less of patches.
        self.look_at = other.records.len().max(LOOK.0);
        self.sightings = other.sight().filter(|_| self.settings.guided);
        self.sights_at = other.records.len();
    }

    /// Solves for all bounces between the surfels found so far and evaluates all records with them; if there are new ones, surfels on which much
    /// depends take further light samples first. Radii stay.
    pub fn finish(&mut self) {
        let Some(light) = &mut self.light else { return };
        light.solve();
        self.update();
        if self.records.len() > self.sharpened && self.sharpen() {
            self.update();
        }
        self.index();
        self.learn_guides();
    }

    /// Evaluates all records under the light of the surfels as it is.
    fn update(&mut self) {
        let Some(light) = &self.light else { return };
        let estimates = self.gather.evaluate(0..self.records.len(), light);
        for (i, (record, e)) in self.records.iter_mut().zip(&estimates).enumerate() {
            record.update(&self.gather.frame(i), e);
        }
    }

    /// Another limit of bounces, as of the next [`Self::finish`].
    pub fn limit_bounces(&mut self, bounces: Option<u32>) {
        self.settings.bounces = bounces;
        self.gather.most_segments = bounces.map(|n| n + 1);
        if let Some(light) = &mut self.light {
            light.limit_bounces(bounces);
        }
    }

    /// Lowers the bound of the error: records stay, their radii shrink, so that [`Self::fill`] finds places for more.
    pub fn refine(&mut self, error: f32) {
        self.settings.error = error;
        self.resize();
    }

    /// Evaluates all records under another light on the same geometry, without a gather ray; radii follow. What records
    /// see of glossy surfaces is lit anew as well. `world` has the new light.
    pub fn relight(&mut self, world: World<'a>, light: &HitLight) {
        self.world = world;
        if let Some(surfels) = &mut self.light {
            surfels.relight(&world, light);
            self.gather.scatter(&world, true);
            // What records want of surfels is a matter of their own light.
            self.resize();
            if self.sharpen() {
                self.resize();
            }
        }
    }

    /// Makes all records anew from the stored hits.
    fn resize(&mut self) {
        let Some(light) = &self.light else { return };
        let estimates = self.gather.evaluate(0..self.records.len(), light);
        let mean: f32 = estimates.iter().map(|e| luminance(e.irradiance)).sum::<f32>() / estimates.len().max(1) as f32;
        for (i, e) in estimates.iter().enumerate() {
            self.records[i] = self.record(i, e, DARK * mean);
        }
        self.index();
        self.bound_by_neighbours();
        self.index();
    }

    fn surfel_settings(&self) -> SurfelSettings {
        let CacheSettings { light_samples, surfel_rays, bounces, seed, .. } = self.settings;
        SurfelSettings { light_samples, gather_rays: surfel_rays, bounces, seed }
    }

    /// Edge of the largest surfel cells: by the median length of gather rays from the places.
    fn surfel_cell(&self, places: &[Place]) -> f32 {
        let step = places.len().div_ceil(PILOT.0);
        let key = hash(self.settings.seed, PILOT_STREAM);
        let mut counts = RayCounts::default();
        let mut lengths = Vec::new();
        for (i, place) in places.iter().step_by(step).enumerate() {
            let (at, frame) = (place.facet.surface_point(), Frame::from_normal(place.facet.n_shade));
            for k in 0..PILOT.1 {
                let mut rng = Sampler::new(key, i as u64, u64::from(k));
                let d = frame.to_world(warp::sample_cosine_hemisphere(rng.next_2d()));
                let g = self.world.gather(at.spawn_origin(d), d, &mut rng, &mut counts, |_| {});
                lengths.extend(g.end.map(|_| g.distance));
            }
        }
        lengths.sort_by(f32::total_cmp);
        let radius = self.world.scene.bounds.1;
        let median = lengths.get(lengths.len() / 2).copied().unwrap_or(radius);
        self.settings.surfel_cell * median.clamp(1e-4 * radius, radius)
    }

    fn uncovered(&self, places: &[Place], candidates: Vec<u32>) -> Vec<u32> {
        let open = |at: &Facet| self.hopeless.binary_search(&at.shape).is_err() && !self.covers(at);
        candidates.into_par_iter().with_min_len(256).filter(|&i| open(&places[i as usize].facet)).collect()
    }

    /// Builds the tree over the records as they are.
    fn index(&mut self) {
        self.tree.clear();
        for (i, record) in self.records.iter().enumerate() {
            self.tree.insert(i as u32, record.p, record.extent());
        }
        self.tree.pack();
    }

    /// Appends what a file keeps.
    pub(super) fn put_fields(&self, out: &mut Vec<u8>) {
        self.settings.put(out);
        self.gather.put(out);
        self.light.put(out);
        self.min_radii.put(out);
        self.left.put(out);
        self.hopeless.put(out);
        self.records.put(out);
        self.patches.put(out);
        self.look_at.put(out);
        self.sharpened.put(out);
    }

    /// The cache whose fields [`Self::put_fields`] wrote.
    pub(super) fn take_fields(world: World<'a>, from: &mut &[u8]) -> Option<Self> {
        let mut cache = IrradianceCache::new(world, CacheSettings::take(from)?);
        (cache.gather, cache.light) = (GatherCache::take(from)?, Stored::take(from)?);
        (cache.min_radii, cache.left) = (Vec::take(from)?, usize::take(from)?);
        (cache.hopeless, cache.records) = (Vec::take(from)?, Vec::take(from)?);
        (cache.patches, cache.look_at) = (Vec::take(from)?, usize::take(from)?);
        (cache.sharpened, cache.loaded) = (usize::take(from)?, true);
        let n = cache.gather.len();
        if cache.min_radii.len() != n || cache.records.len() != n || cache.patches.len() > bright_patches::MOST_PATCHES
        {
            return None;
        }
        cache.limit_bounces(cache.settings.bounces);
        cache.sightings = cache.sight().filter(|_| cache.settings.guided);
        cache.sights_at = n;
        cache.index();
        Some(cache)
    }
}
