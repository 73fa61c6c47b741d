//! The irradiance cache of a progressive picture: made anew, and finer, as samples go on.
//!
//! Renewal     after N passes of cost S and n caches of cost C the picture has the squared error V / N + e / n, V that of a pass, e that of a cache, which
//!             is least for its cost where
//!
//! ```text
//! N S = n C sqrt(V S / (e C))                                                        (1)
//! ```
//!
//! e is what two caches differ by where both cover what is seen, a quarter of it: the one before is coarser. Before there are two, samples may
//!             cost as much as the cache
//! Finer       the k-th cache has the bound 1 / k of the error where both cost the same and caches cost in proportion to 1 / bound: all so far
//!             is then k (k - 1) times the cost of the first, and k is taken from the cost. Errors of interpolation fall faster than noise: they
//!             have a sign near shadows, and averages over caches keep it. Measured against the root of k: relMSE after 16 to 24 passes lower
//!             by 10 to 16 %, that of 8 x 8 blocks by 10 to 35 %
//! Loaded      a cache that came from elsewhere stays: it is filled where the eye sees uncovered places, and not renewed, so that
//!             pictures of one camera path do not differ by their caches
//! Given up    shapes on which the first cache was of no use are left out of the next ones, which judge none themselves. Where no shape
//!             remains, the next cache finds that out again: it is for its surfels, on which paths end
//! Source      Knaus & Zwicker 2011 (passes whose bias shrinks), for records in place of photons; Neyman 1934 (1)
//! Verified by `tests`, tests/photon.rs, tests/cache_reuse.rs

use super::looks::Found;
use super::places;
use super::settings::PhotonSettings;
use crate::math::sampler::hash;
use crate::math::{Rgb, Vec3};
use crate::transport::cache_file::FromFile;
use crate::transport::gather_ray::RayCounts;
use crate::transport::{CacheSettings, CacheStatistics, CausticMap, HitLight, IrradianceCache, World};

/// Pixels for each record that a pass may add.
const PIXELS_PER_RECORD: usize = 24;
/// Records that the first pass may add however few pixels there are.
const LEAST_RECORDS: usize = 1000;
/// Least and most of what samples cost over the cache before it is renewed.
const SHARE: (f64, f64) = (0.2, 2.0);
/// What a cache has of the squared difference to the one before, which was coarser.
const OWN: f64 = 0.25;
/// Records made before time is looked at again.
const PORTION: usize = 512;

/// The present cache, and what is known of those before it.
pub(super) struct RenewedCache<'a> {
    world: World<'a>,
    window: [u32; 4],
    /// Settings of the first cache.
    usual: CacheSettings,
    seed: u64,
    /// Segments of a light path up to the end of a gather ray, at most.
    most_segments: u32,
    /// The camera does not see lamps.
    hide_emitters: bool,
    cache: IrradianceCache<'a>,
    /// Caches made so far.
    made: u32,
    /// Rays of all caches before this one.
    rays_before: RayCounts,
    /// What the cache was when it came from elsewhere; `None` if it is the integrator's own.
    loaded: Option<Loaded>,
    /// Samples taken since this one was made.
    samples_since: f64,
    /// All samples.
    samples: f64,
    /// Rays of the first cache.
    first_rays: f64,
    /// V S / e of equation 1, in rays; once it is known.
    worth: Option<f64>,
    /// What a camera sample costs, once there have been some.
    rays_per_sample: f64,
}

/// What samples may cost before a cache that has cost `rays` is renewed, in rays: equation 1, `worth` is V S / e.
fn due_after(rays: f64, worth: Option<f64>) -> f64 {
    let share = worth.map_or(1.0, |worth| (worth / rays).sqrt());
    rays * share.clamp(SHARE.0, SHARE.1)
}

/// k of a cache before which all has cost so many times the first one.
fn fineness(all: f64) -> f32 {
    (0.5 + (0.25 + all.max(0.0)).sqrt()) as f32
}

/// A cache from elsewhere.
struct Loaded {
    /// As it came.
    as_it_was: CacheStatistics,
    /// Whether it has the light of this scene.
    same_light: bool,
}

impl<'a> RenewedCache<'a> {
    /// An empty cache for the pixels of `window` (x, y, width, height).
    pub fn new(world: World<'a>, settings: &PhotonSettings, window: [u32; 4]) -> Self {
        let max_depth = settings.path.max_depth;
        // A path from the eye by way of a record has three segments at least; what is left are bounces.
        let usual = CacheSettings { bounces: max_depth.map(|max| max.saturating_sub(3)), ..CacheSettings::default() };
        RenewedCache {
            world,
            window,
            usual,
            seed: settings.seed,
            // The gather ray and the ray from the eye are segments too.
            most_segments: max_depth.map_or(u32::MAX, |max| max.saturating_sub(2)),
            hide_emitters: settings.path.hide_emitters,
            cache: IrradianceCache::new(world, usual),
            made: 0,
            rays_before: RayCounts::default(),
            loaded: None,
            samples_since: 0.0,
            samples: 0.0,
            first_rays: 0.0,
            worth: None,
            rays_per_sample: 0.0,
        }
    }

    /// Takes a cache from elsewhere in place of the present one.
    pub fn take_over(&mut self, FromFile { cache, same_light }: FromFile<'a>) {
        self.loaded = Some(Loaded { as_it_was: cache.statistics(), same_light });
        self.cache = cache;
    }

    /// The cache.
    pub fn cache(&self) -> &IrradianceCache<'a> {
        &self.cache
    }

    /// Tells of camera samples that are about to be taken.
    pub fn count_samples(&mut self, samples: f64) {
        self.samples_since += samples;
        self.samples += samples;
    }

    /// Whether there will be others: not so of one that came from elsewhere.
    pub fn is_renewed(&self) -> bool {
        self.loaded.is_none()
    }

    /// Learns what a camera sample costs, in rays: at least the one from the camera.
    pub fn learn_cost(&mut self, rays_per_sample: f64) {
        self.rays_per_sample = rays_per_sample.max(1.0);
    }

    /// Learns what the pixels of the picture have of the noise of samples and of that of caches: `found` of the last two caches.
    pub fn learn(&mut self, found: Found) {
        let pixels = f64::from(self.window[2]) * f64::from(self.window[3]);
        self.learn_cost(found.rays);
        let worth = found.sample * pixels * found.rays / (OWN * found.difference);
        // Nothing to be seen of either says nothing.
        self.worth = Some(worth).filter(|w| !w.is_nan());
    }

    /// Makes a cache if it is time for a new one, and returns the one before. `map` has the caustics on what gather rays hit.
    pub fn renew(
        &mut self,
        pass: u64,
        map: Option<&CausticMap>,
        over: &(dyn Fn() -> bool + Sync),
    ) -> Option<IrradianceCache<'a>> {
        let most = self.most_segments;
        let caustic = |p: Vec3, n: Vec3| map.map_or(Rgb::ZERO, |map| map.irradiance_within(p, n, most));
        let light = HitLight::Operator { caustic: &caustic };
        if let Some(&Loaded { same_light, .. }) = self.loaded.as_ref() {
            if pass == 0 {
                self.complete(same_light, &light, over);
            }
            return None;
        }
        let known = self.cache.statistics();
        let cost = (known.record_rays + known.surfel_rays).total();
        // There are no places for records, and passes see the same places.
        let idle = cost == 0;
        if pass > 0 && (idle || self.samples_since * self.rays_per_sample < due_after(cost as f64, self.worth)) {
            return None;
        }
        let cache = self.finer(&light, over);
        // Without the time to finish it there will be no further samples.
        if pass > 0 && over() {
            return None;
        }
        self.rays_before += known.record_rays + known.surfel_rays;
        let before = std::mem::replace(&mut self.cache, cache);
        if self.made == 0 {
            self.first_rays = self.rays().total() as f64;
        }
        self.made += 1;
        self.samples_since = 0.0;
        (self.made > 1).then_some(before)
    }

    /// The next cache.
    fn finer(&self, light: &HitLight, over: &(dyn Fn() -> bool + Sync)) -> IrradianceCache<'a> {
        let all = self.rays().total() as f64 + self.samples * self.rays_per_sample;
        let finer = if self.made == 0 { 1.0 } else { fineness(all / self.first_rays) };
        let settings = CacheSettings {
            error: self.usual.error / finer,
            surfel_cell: self.usual.surfel_cell / finer.sqrt(),
            seed: hash(self.seed, u64::from(self.made)),
            ..self.usual
        };
        let mut cache = IrradianceCache::new(self.world, settings);
        cache.start_as(&self.cache);
        self.fill(&mut cache, finer, light, over);
        if cache.records().is_empty() {
            cache = IrradianceCache::new(self.world, settings);
            self.fill(&mut cache, finer, light, over);
        }
        cache
    }

    /// Makes a loaded cache fit: the present light, records for places that have none.
    fn complete(&mut self, same_light: bool, light: &HitLight, over: &(dyn Fn() -> bool + Sync)) {
        let empty = IrradianceCache::new(self.world, self.usual);
        let mut cache = std::mem::replace(&mut self.cache, empty);
        if !same_light {
            cache.relight(self.world, light);
        }
        cache.limit_bounces(self.usual.bounces);
        self.fill(&mut cache, 1.0, light, over);
        self.cache = cache;
    }

    /// Records for what the eye sees, coarse to fine; the bound of the error is that of the first cache over `finer`.
    fn fill(&self, cache: &mut IrradianceCache, finer: f32, light: &HitLight, over: &(dyn Fn() -> bool + Sync)) {
        let pixels = self.window[2] as usize * self.window[3] as usize;
        let known_records = cache.records().len();
        let most = known_records + ((pixels / PIXELS_PER_RECORD).max(LEAST_RECORDS) as f32 * finer) as usize;
        let finest = if self.made == 0 { 4 } else { 2 };
        let mut known = None;
        for spacing in [32, 16, 8, 4, 2].into_iter().filter(|&s| s >= finest) {
            if over() || cache.records().len() >= most {
                break;
            }
            let places = places::places(self.world, self.window, spacing, known, self.hide_emitters);
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
        cache.finish();
    }

    /// Rays that this run has traced for the present cache: of records, of surfels.
    fn own_rays(&self) -> [RayCounts; 2] {
        let (now, before) = (self.cache.statistics(), self.loaded.as_ref().map(|l| l.as_it_was).unwrap_or_default());
        [now.record_rays - before.record_rays, now.surfel_rays - before.surfel_rays]
    }

    /// Rays that this run has traced for all caches.
    pub fn rays(&self) -> RayCounts {
        let [records, surfels] = self.own_rays();
        self.rays_before + records + surfels
    }

    /// What is worth telling, in numbers.
    pub fn figures(&self) -> Vec<(&'static str, u64)> {
        let s = self.cache.statistics();
        let [records, surfels] = self.own_rays();
        let loaded = self.loaded.as_ref().map(|l| ("cache records loaded", l.as_it_was.records as u64));
        let present = [
            ("caches", u64::from(self.made)),
            ("cache records", s.records as u64),
            ("cache surfels", s.surfels as u64),
            ("cache records of least radius", s.smallest as u64),
            ("cache rays of records", records.rays),
            ("cache rays of surfels", surfels.rays),
            ("cache shadow rays", records.shadow_rays + surfels.shadow_rays),
            ("cache bright patches", s.patches as u64),
            ("cache places left", s.left as u64),
            ("cache shapes given up", s.hopeless as u64),
        ];
        loaded.into_iter().chain(present).collect()
    }

    /// What the user should know of a loaded cache.
    pub fn remark(&self) -> Option<&'static str> {
        let other_light = self.loaded.as_ref().is_some_and(|l| !l.same_light);
        other_light
            .then_some("the cache was made under other light; its stored hits were evaluated under that of the scene")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_and_caches_share_the_time_so_that_error_times_cost_is_least() {
        let (variance, cost) = (0.02, 2e5);
        for (error, rays) in [(4e-3, 3e5), (1e-2, 1e6), (2e-3, 8e5)] {
            // Passes for each cache.
            let badness = |passes: f64| (variance / passes + error) * (passes * cost + rays);
            let passes = due_after(rays, Some(variance * cost / error)) / cost;
            assert!(SHARE.0 * rays < passes * cost && passes * cost < SHARE.1 * rays, "{passes} is a bound");
            assert!(badness(passes) < badness(0.9 * passes) && badness(passes) < badness(1.1 * passes), "{passes}");
        }
        // Before anything is known, where caches are all alike, and where samples have no noise.
        let bounds = [None, Some(1e30), Some(0.0)].map(|worth| due_after(10.0, worth));
        assert_eq!(bounds, [10.0, 10.0 * SHARE.1, 10.0 * SHARE.0]);
    }

    #[test]
    fn the_kth_cache_is_k_times_as_fine_where_samples_cost_as_much() {
        // Caches of cost 1, 2, 3 ..., and samples for as much after each.
        let mut all = 0.0;
        for k in 1..9 {
            assert!((fineness(all) - k as f32).abs() < 1e-5, "{all}");
            all += 2.0 * f64::from(k);
        }
    }
}
