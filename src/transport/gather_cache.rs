//! The cache of gather rays: what the rays of each record have hit, kept for as long as the geometry stands.
//!
//! A hit knows its direction, distance and normal, which surfel lies there and with what factor (throughput of specular
//! surfaces times albedo) it sends on that surfel's irradiance. From these the irradiance of a record and its derivatives
//! follow for any light: [`GatherCache::evaluate`] traces nothing.
//! Source      Yue, Onoue and Nishita, "Extended irradiance caching" (stored hits); METHODS.md section 4
//! Rays        directions of `gather_strata.rs`, jittered and turned at random per record, keyed by its number
//! Bias        none of its own: that of the surfels' irradiance
//! Verified by tests/irradiance_cache.rs: against brute force, relighting without a ray

use super::World;
use super::cache_file::Stored;
use super::coat::Coat;
pub use super::gather_hit::GatherHit;
use super::gather_hit::pack_normal;
use super::gather_ray::{GlossyLight, RayCounts, light_glossy};
use super::gather_sky;
use super::gather_strata::{Estimate, Strata};
use super::guided_rays::{GuidedRays, Guides};
use super::reached::Reached;
use super::riser::{Riser, SECTORS, sector};
use super::sightings::{Seen, Sightings};
use super::surfel_light::SurfelLight;
use super::surfels::{Facet, Surfels};
use crate::math::sampler::{hash, unit_f32};
use crate::math::{Frame, Rgb, Sampler, Vec2, Vec3, luminance};
use crate::scene::SurfacePoint;
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, TAU};

/// Sine of the least slope, against the record's plane, of what rises from it.
const STEEP: f32 = 0.5;
/// Records that one task gathers for.
const CHUNK: usize = 4;
/// Streams of random numbers.
const TURN: u64 = 0x6a1;
const JITTER: u64 = 0x6a2;
const CHAIN: u64 = 0x6a3;
const GLOSSY: u64 = 0x6a4;
const SKY: u64 = 0x6a5;

/// The hits of all records.
#[derive(Clone, Debug)]
pub struct GatherCache {
    /// Directions and their tables.
    pub strata: Strata,
    /// Rays traced.
    pub counts: RayCounts,
    /// Longest chains that bring light; `None`: no limit.
    pub most_segments: Option<u32>,
    rays: u32,
    seed: u64,
    places: Vec<Facet>,
    hits: Vec<GatherHit>,
    /// 1 / depth of the border to the column before and to the row beyond, for each hit.
    depths: Vec<[f32; 2]>,
    /// Radiance of the sky for each hit's cell; empty where the sky is not gathered.
    sky: Vec<Rgb>,
    /// Light by glossy surfaces, by index of the hit.
    glossy: Vec<(u32, GlossyLight)>,
    /// What it amounts to.
    scattered: Vec<Rgb>,
    pub(super) guided: GuidedRays,
}

/// A hit whose surfel may not be known yet.
pub(super) struct Traced {
    hit: GatherHit,
    /// What is there, the reach of its cell, and the segments of the chain.
    unknown: Option<(Facet, f32, u32)>,
}

impl Traced {
    /// The hit with its surfel, a new one if need be.
    pub(super) fn known(self, world: &World, surfels: &mut Surfels) -> GatherHit {
        let Traced { mut hit, unknown } = self;
        if let Some((facet, distance, segments)) = unknown {
            hit.reached = Reached::new(surfels.find_or_insert(world, &facet, distance), segments);
        }
        hit
    }
}

/// What a few records have gathered.
struct Gathered {
    hits: Vec<Traced>,
    glossy: Vec<(u32, GlossyLight)>,
    sky: Vec<Rgb>,
    counts: RayCounts,
}

impl GatherCache {
    /// No records yet; about `rays` directions for each.
    pub fn new(rays: u32, seed: u64) -> Self {
        GatherCache {
            strata: Strata::new(rays),
            counts: RayCounts::default(),
            most_segments: None,
            rays,
            seed,
            places: Vec::new(),
            hits: Vec::new(),
            depths: Vec::new(),
            sky: Vec::new(),
            glossy: Vec::new(),
            scattered: Vec::new(),
            guided: GuidedRays::default(),
        }
    }

    /// Number of records.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Where the records lie.
    pub fn places(&self) -> &[Facet] {
        &self.places
    }

    /// The hits of a record, row by row.
    pub fn hits(&self, record: usize) -> &[GatherHit] {
        &self.hits[record * self.strata.len()..][..self.strata.len()]
    }

    /// Radiance of the sky in the cells of a record, none if it is not gathered.
    pub fn sky(&self, record: usize) -> &[Rgb] {
        self.sky.get(record * self.strata.len()..(record + 1) * self.strata.len()).unwrap_or_default()
    }

    /// The frame of a record: around the shading normal, turned at random.
    pub fn frame(&self, record: usize) -> Frame {
        let n = self.places[record].n_shade;
        let f = Frame::from_normal(n);
        let (sin, cos) = (TAU * unit_f32(hash(hash(self.seed, TURN), record as u64))).sin_cos();
        Frame { s: f.s * cos + f.t * sin, t: f.t * cos - f.s * sin, n }
    }

    /// Traces the gather rays of new records. Hits where there is no surfel yet found one, which is dark until
    /// [`SurfelLight::extend`]; so call that, then [`Self::scatter`].
    pub fn gather(&mut self, world: &World, surfels: &mut Surfels, places: &[Facet], sightings: Option<&Sightings>) {
        let first = self.places.len();
        self.places.extend_from_slice(places);
        let with_sky = gather_sky::is_gathered(world);
        let this = &*self;
        let known = &*surfels;
        let records: Vec<usize> = (first..this.places.len()).collect();
        let traced: Vec<_> =
            records.par_chunks(CHUNK).map(|chunk| this.trace(world, known, chunk, (with_sky, sightings))).collect();
        for Gathered { hits, glossy, sky, counts } in traced {
            self.counts += counts;
            self.sky.extend(sky);
            self.glossy.extend(glossy);
            self.hits.extend(hits.into_iter().map(|hit| hit.known(world, surfels)));
        }
        let n = self.strata.len();
        for record in records {
            self.depths.extend(self.strata.depths(&self.hits[record * n..][..n]));
        }
    }

    fn trace(
        &self,
        world: &World,
        surfels: &Surfels,
        records: &[usize],
        (with_sky, sightings): (bool, Option<&Sightings>),
    ) -> Gathered {
        let n = self.strata.len();
        let mut sky = Vec::new();
        let mut counts = RayCounts::default();
        let mut glossy = Vec::new();
        let mut hits = Vec::with_capacity(records.len() * n);
        for &record in records {
            let place = self.places[record].surface_point();
            let frame = self.frame(record);
            let coat = Coat::new(world, &self.places[record]);
            for i in 0..n {
                let index = (record * n + i) as u64;
                let jitter = hash(hash(self.seed, JITTER), index);
                let u = Vec2::new(unit_f32(jitter), unit_f32(jitter << 24));
                let d = frame.to_world(self.strata.direction(i, u));
                let mut rng = Sampler::new(hash(self.seed, CHAIN), record as u64, i as u64);
                let found = |v| glossy.push((index as u32, v));
                hits.push(self.shoot(
                    world,
                    surfels,
                    (&place, d),
                    &mut rng,
                    &mut counts,
                    (coat.response(d), 1.0),
                    found,
                ));
            }
            if with_sky {
                let own: Vec<GatherHit> = hits[hits.len() - n..].iter().map(|t| t.hit).collect();
                let key = hash(hash(self.seed, SKY), record as u64);
                let place = (&self.places[record], &frame);
                let further = sightings.map_or(Vec::new(), |s| s.rays(Seen::Sky, place.0, &frame, &self.strata));
                let rays = (n as u32, &further[..]);
                sky.extend(gather_sky::sky(world, &self.strata, place, &own, rays, key, &mut counts));
            }
        }
        Gathered { hits, glossy, sky, counts }
    }

    /// Follows one ray of a record from the place along the unit vector; what it brings counts times `response` and `share`, that of a gather
    /// ray's solid angle which the ray stands for.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn shoot(
        &self,
        world: &World,
        surfels: &Surfels,
        (from, d): (&SurfacePoint, Vec3),
        rng: &mut Sampler,
        counts: &mut RayCounts,
        (response, share): (f32, f32),
        mut on_glossy: impl FnMut(GlossyLight),
    ) -> Traced {
        let g = world.gather(from.spawn_origin(d), d, rng, counts, |v| on_glossy(v.scaled(response * share)));
        // Where chains may not be that long, the first surface is all there is, and black.
        let too_long = self.most_segments.is_some_and(|most| g.segments > most);
        let (depth, normal) = if too_long { g.first } else { (g.depth, g.normal) };
        let mut hit = GatherHit {
            direction: d,
            inverse_distance: if depth > 0.0 { 1.0 / depth } else { 0.0 },
            weight: Rgb::ZERO,
            reached: Reached::NONE,
            packed_normal: pack_normal(normal),
        };
        let mut unknown = None;
        if let Some(end) = g.end.filter(|_| !too_long) {
            let facet = Facet::seen_from(&end.at, end.wo);
            hit.weight = end.weight * (response * share);
            // Cells as large as the footprint of the ray.
            let reach = g.last * share.sqrt();
            match surfels.find(world, &facet, reach) {
                Some(k) => hit.reached = Reached::new(k, g.segments),
                None => unknown = Some((facet, reach, g.segments)),
            }
        }
        Traced { hit, unknown }
    }

    /// Seed of all random numbers.
    pub(super) fn seed(&self) -> u64 {
        self.seed
    }

    /// Sends guided rays from the records that have not sent any yet. To be called as [`Self::gather`] is.
    pub fn guide(&mut self, world: &World, surfels: &mut Surfels, guides: Guides) {
        let mut guided = std::mem::take(&mut self.guided);
        self.counts += guided.trace(world, surfels, self, guides);
        self.guided = guided;
    }

    /// Leaves the records there are without rays to bright patches, if they have none.
    pub fn leave_unguided(&mut self) {
        let mut guided = std::mem::take(&mut self.guided);
        guided.skip(self);
        self.guided = guided;
    }

    /// Lights the glossy vertices of records that were gathered since the last call; of `all` for a new light.
    pub fn scatter(&mut self, world: &World, all: bool) {
        let start = if all { 0 } else { self.scattered.len() };
        let (scattered, counts) = light_glossy(world, hash(self.seed, GLOSSY), &self.glossy, start);
        self.scattered.truncate(start);
        self.scattered.extend(scattered);
        self.counts += counts;
        self.counts += self.guided.scatter(world, self.seed, all);
    }

    /// Irradiance and derivatives of records under the light of the surfels.
    pub fn evaluate(&self, records: std::ops::Range<usize>, light: &SurfelLight) -> Vec<Estimate> {
        let n = self.strata.len();
        let records: Vec<usize> = records.collect();
        let chunks: Vec<Vec<Estimate>> = records
            .par_chunks(16)
            .map(|chunk| {
                let mut radiance = vec![Rgb::ZERO; n];
                let estimate = |&record: &usize| {
                    self.radiance(record, light, &mut radiance);
                    self.strata.estimate(&radiance, &self.depths[record * n..][..n])
                };
                chunk.iter().map(estimate).collect()
            })
            .collect();
        chunks.into_iter().flatten().collect()
    }

    /// Radiance of each cell of a record under the light of the surfels, times what a coat makes of it.
    pub fn radiance(&self, record: usize, light: &SurfelLight, radiance: &mut [Rgb]) {
        let n = self.strata.len();
        for (l, hit) in radiance.iter_mut().zip(self.hits(record)) {
            *l = hit.weight * light.by(hit.reached) * FRAC_1_PI;
        }
        let range = record * n..(record + 1) * n;
        let from = self.glossy.partition_point(|(i, _)| (*i as usize) < range.start);
        let glossy = self.glossy[from..].iter().zip(&self.scattered[from.min(self.scattered.len())..]);
        for ((i, _), l) in glossy.take_while(|((i, _), _)| (*i as usize) < range.end) {
            radiance[*i as usize - range.start] += *l;
        }
        self.guided.add(record, range, light, radiance);
        radiance.iter_mut().zip(self.sky(record)).for_each(|(l, sky)| *l += *sky);
    }

    /// What a unit of the irradiance of surfels brings to a record.
    pub fn shares(&self, record: usize) -> Vec<(u32, f32)> {
        let hits = self
            .hits(record)
            .iter()
            .enumerate()
            .map(|(cell, hit)| (self.guided.share(record * self.strata.len() + cell), hit));
        let guided = self.guided.hits(record).iter().map(|(_, hit)| (1.0, hit));
        let known = hits.chain(guided).filter(|(_, hit)| hit.reached != Reached::NONE);
        known
            .map(|(share, hit)| (hit.reached.surfel() as u32, luminance(hit.weight) * share / self.strata.len() as f32))
            .collect()
    }

    /// What rises from the surface around a record, in each sector of its tangent plane counted from `frame.s`: the nearest
    /// surface that a low ray has hit.
    pub fn risers(&self, record: usize, frame: &Frame) -> [Riser; SECTORS] {
        let mut risers = [Riser::NONE; SECTORS];
        let mut nearest = [f32::INFINITY; SECTORS];
        for hit in self.hits(record) {
            let direction = frame.to_local(hit.direction);
            let (along, normal) = (direction.truncate(), frame.to_local(hit.normal()).truncate());
            let low = along.length_squared() > direction.z * direction.z;
            if hit.inverse_distance > 0.0 && low && normal.length_squared() > STEEP * STEEP {
                let at = along / hit.inverse_distance;
                let k = sector(along);
                if at.length() < nearest[k] {
                    nearest[k] = at.length();
                    let normal = normal.normalize();
                    risers[k] = Riser { normal, offset: at.dot(normal) };
                }
            }
        }
        risers
    }

    /// Harmonic mean of the distances of a record's hits, infinite if it sees nothing.
    pub fn mean_distance(&self, record: usize) -> f32 {
        let sum: f32 = self.hits(record).iter().map(|h| h.inverse_distance).sum();
        self.strata.len() as f32 / sum
    }
}

impl Stored for GatherCache {
    fn put(&self, out: &mut Vec<u8>) {
        self.rays.put(out);
        self.counts.put(out);
        self.seed.put(out);
        self.places.put(out);
        self.hits.put(out);
        self.glossy.put(out);
        self.scattered.put(out);
        self.sky.put(out);
        self.guided.put(out);
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        let rays = u32::take(from)?;
        let counts = RayCounts::take(from)?;
        let mut cache = GatherCache { counts, ..GatherCache::new(rays, u64::take(from)?) };
        (cache.places, cache.hits) = (Vec::take(from)?, Vec::take(from)?);
        (cache.glossy, cache.scattered) = (Vec::take(from)?, Vec::take(from)?);
        (cache.sky, cache.guided) = (Vec::take(from)?, GuidedRays::take(from)?);
        let n = cache.strata.len();
        let sky = cache.sky.is_empty() || cache.sky.len() == cache.hits.len();
        let guided = cache.guided.is_sound(cache.places.len(), n);
        if cache.hits.len() != n * cache.places.len() || cache.glossy.len() != cache.scattered.len() || !sky || !guided
        {
            return None;
        }
        let depths: Vec<[f32; 2]> = cache.hits.chunks(n).flat_map(|hits| cache.strata.depths(hits)).collect();
        cache.depths = depths;
        Some(cache)
    }
}
