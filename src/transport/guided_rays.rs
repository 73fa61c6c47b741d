//! Rays of records to bright patches and into cells in which light is uneven, beside their gather rays.
//!
//! ```text
//!   E = pi / n sum over all rays, gathering or guided, of m(d) L(d),     m = n p_0 / ((1 + n_i) n p_0 + sum_c n_c p_c(d))
//! ```
//!
//! Measure     solid angle: p_0 = cos / pi of the n gather rays, n p_0 that of a further ray in its cell, n_i of them in the cell of d, p_c =
//!             1 / Omega_c in cone c, 0 outside, of its n_c rays. Multiple importance sampling by the balance heuristic gives a ray of any kind the
//!             weight 1 / (n p_0 + ...), so all add m L to the mean radiance of the cell they lie in, and the derivatives of `gather_strata.rs` apply
//! Rays        evenly spread over the cone: ring i of n_c with a number at random each, turned by the golden ratio; at random in their cell
//! Source      Veach & Guibas 1995, "Optimally Combining Sampling Techniques" (several samples of each)
//! Bias        none where patches were found by other rays than those that are weighed here, as `irradiance_cache/growth.rs` sees to. Derivatives
//!             take the depth of a cell's gather ray for all of the cell
//! Verified by `tests`: the mean is that of gather rays alone, the variance falls; rays that chose their patch themselves darken it

use super::World;
use super::bright_patches::{Cone, Cones, Patch, cones};
use super::cache_file::stored;
use super::coat::Coat;
use super::gather_cache::{GatherCache, GatherHit, Traced};
use super::gather_ray::{GlossyLight, RayCounts, light_glossy};
use super::sightings::{Seen, Sightings};
use super::surfel_light::SurfelLight;
use super::surfels::Surfels;
use crate::math::sampler::{hash, unit_f32};
use crate::math::{Frame, Rgb, Sampler, Vec2, Vec3, warp};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::ops::Range;

/// Turn of each ray of a cone against the one before.
const GOLDEN: f32 = 0.618_034;
/// Records that one task works on.
const CHUNK: usize = 4;
/// Streams of random numbers.
const PLACE: u64 = 0x6d1;
const CHAIN: u64 = 0x6d2;
const CELL: u64 = 0x6d4;
const GLOSSY: u64 = 0x6d3;

/// The guided rays of all records.
#[derive(Clone, Debug, Default)]
pub struct GuidedRays {
    /// m of each gather ray, as far as records have been looked at; empty as long as there are no patches.
    shares: Vec<f32>,
    /// Hits by index of their cell's gather ray, in the order of the records; weights contain m.
    hits: Vec<(u32, GatherHit)>,
    /// Begin of each record's in `hits`, and the end.
    begins: Vec<u32>,
    /// Light by glossy surfaces, by index as above, in the order of the records.
    glossy: Vec<(u32, GlossyLight)>,
    /// What it amounts to.
    scattered: Vec<Rgb>,
}

stored!(GuidedRays { shares, hits, begins, glossy, scattered });

/// What a few records have found.
#[derive(Default)]
struct Found {
    shares: Vec<f32>,
    rays: Vec<Vec<(u32, Traced)>>,
    glossy: Vec<(u32, GlossyLight)>,
    counts: RayCounts,
}

/// What tells records where to send rays.
#[derive(Clone, Copy)]
pub struct Guides<'g> {
    /// Small bright patches, for all records.
    pub patches: &'g [Patch],
    /// What others have seen, for those nearby.
    pub sightings: Option<&'g Sightings>,
}

/// m(d) in a cell of `further` rays; `own` is the cone that the direction was drawn from, in which it lies whatever rounding says.
fn share(n: usize, cos: f32, further: u32, cones: &Cones, own: Option<usize>, d: Vec3) -> f32 {
    let gathered = n as f32 * cos * FRAC_1_PI;
    let inside = cones.iter().enumerate().filter(|(c, cone)| own == Some(*c) || cone.contains(d));
    let guided: f32 = inside.map(|(_, cone)| cone.rays as f32 * warp::pdf_cone(cone.one_minus_cos)).sum();
    gathered / (gathered * (1 + further) as f32 + guided)
}

/// Direction number `i` of a cone.
fn direction(cone: &Cone, i: u32, turn: f32, jitter: f32) -> Vec3 {
    let u = Vec2::new((i as f32 + jitter) / cone.rays as f32, (turn + GOLDEN * i as f32).fract());
    Frame::from_normal(cone.axis).to_world(warp::sample_cone(u, cone.one_minus_cos))
}

impl GuidedRays {
    /// Number of records that were looked at.
    fn records(&self) -> usize {
        self.begins.len().saturating_sub(1)
    }

    /// Traces the guided rays of the records of `cache` that have none yet; returns the number of rays. Surfels as in [`GatherCache::gather`].
    pub fn trace(&mut self, world: &World, surfels: &mut Surfels, cache: &GatherCache, guides: Guides) -> RayCounts {
        let mut counts = RayCounts::default();
        if guides.patches.is_empty() && guides.sightings.is_none() {
            return counts;
        }
        if self.begins.is_empty() {
            self.begins.push(0);
        }
        let records: Vec<usize> = (self.records()..cache.len()).collect();
        let known = &*surfels;
        let found: Vec<Found> = records
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut found = Found::default();
                chunk.iter().for_each(|&record| found.trace(world, known, cache, guides, record));
                found
            })
            .collect();
        for Found { shares, rays, glossy, counts: more } in found {
            counts += more;
            self.shares.extend(shares);
            self.glossy.extend(glossy);
            for rays in rays {
                self.hits.extend(rays.into_iter().map(|(cell, ray)| (cell, ray.known(world, surfels))));
                self.begins.push(self.hits.len() as u32);
            }
        }
        counts
    }

    /// Counts the records of `cache` that have sent no rays yet as done.
    pub fn skip(&mut self, cache: &GatherCache) {
        if self.begins.is_empty() {
            self.begins.push(0);
        }
        let (end, records) = (self.hits.len() as u32, cache.len());
        self.begins.resize(records + 1, end);
        self.shares.resize(records * cache.strata.len(), 1.0);
    }

    /// Whether the fields fit to each other and to `records` of `n` gather rays.
    pub fn is_sound(&self, records: usize, n: usize) -> bool {
        let begins = self.begins.is_sorted() && self.begins.first().is_none_or(|b| *b == 0);
        let hits = self.begins.last().map_or(0, |end| *end as usize) == self.hits.len();
        let done = self.records();
        let lit = |all: &[Rgb]| all.len() == self.glossy.len();
        let cells =
            self.hits.iter().map(|h| h.0).chain(self.glossy.iter().map(|g| g.0)).all(|i| (i as usize) < done * n);
        begins && hits && cells && done <= records && self.shares.len() == done * n && lit(&self.scattered)
    }

    /// Lights the glossy vertices that are new since the last call, or `all`; as [`GatherCache::scatter`].
    pub fn scatter(&mut self, world: &World, seed: u64, all: bool) -> RayCounts {
        let start = if all { 0 } else { self.scattered.len() };
        let (scattered, counts) = light_glossy(world, hash(seed, GLOSSY), &self.glossy, start);
        self.scattered.truncate(start);
        self.scattered.extend(scattered);
        counts
    }

    /// m of gather ray number `index`.
    pub fn share(&self, index: usize) -> f32 {
        self.shares.get(index).copied().unwrap_or(1.0)
    }

    /// The guided rays of a record, with the index of the gather ray in whose cell they lie.
    pub fn hits(&self, record: usize) -> &[(u32, GatherHit)] {
        match self.begins.get(record..record + 2) {
            Some(&[begin, end]) => &self.hits[begin as usize..end as usize],
            _ => &[],
        }
    }

    /// Turns the radiance of the gather rays of `record`, those of index `range`, into that of its cells.
    pub fn add(&self, record: usize, range: Range<usize>, light: &SurfelLight, radiance: &mut [Rgb]) {
        if record >= self.records() {
            return;
        }
        radiance.iter_mut().zip(&self.shares[range.clone()]).for_each(|(l, share)| *l *= *share);
        for (i, hit) in self.hits(record) {
            radiance[*i as usize - range.start] += hit.weight * light.by(hit.reached) * FRAC_1_PI;
        }
        let [from, to] = [range.start, range.end].map(|end| self.glossy.partition_point(|(i, _)| (*i as usize) < end));
        for ((i, _), l) in self.glossy[from..to].iter().zip(&self.scattered[from.min(self.scattered.len())..]) {
            radiance[*i as usize - range.start] += *l;
        }
    }
}

impl Found {
    fn trace(&mut self, world: &World, surfels: &Surfels, cache: &GatherCache, guides: Guides, record: usize) {
        let place = &cache.places()[record];
        let (frame, n) = (cache.frame(record), cache.strata.len());
        let cones = cones(guides.patches, place, n as u32);
        let further = guides.sightings.map_or(Vec::new(), |s| s.rays(Seen::Surface, place, &frame, &cache.strata));
        let further_in = |cell: usize| further.get(cell).copied().unwrap_or(0);
        self.shares.extend(
            cache
                .hits(record)
                .iter()
                .enumerate()
                .map(|(cell, hit)| share(n, hit.direction.dot(frame.n), further_in(cell), &cones, None, hit.direction)),
        );
        let (at, coat) = (place.surface_point(), Coat::new(world, place));
        let first = self.glossy.len();
        let mut rays = Vec::new();
        let mut shoot = |d: Vec3, cell: usize, share: f32, rng: &mut Sampler| {
            let (index, glossy) = ((record * n + cell) as u32, &mut self.glossy);
            let weights = (coat.response(d), share);
            let counts = &mut self.counts;
            let traced = cache.shoot(world, surfels, (&at, d), rng, counts, weights, |v| glossy.push((index, v)));
            rays.push((index, traced));
        };
        for (c, cone) in cones.iter().enumerate() {
            let key = hash(hash(cache.seed(), PLACE), (record * cones.capacity() + c) as u64);
            for i in 0..cone.rays {
                let d = direction(cone, i, unit_f32(key), unit_f32(hash(key, u64::from(i))));
                let local = frame.to_local(d);
                if local.z <= 0.0 {
                    continue;
                }
                let cell = cache.strata.cell(local);
                let mut rng = Sampler::new(hash(cache.seed(), CHAIN), record as u64, (c as u64) << 32 | u64::from(i));
                shoot(d, cell, share(n, local.z, further_in(cell), &cones, Some(c), d), &mut rng);
            }
        }
        for (cell, count) in further.iter().enumerate() {
            for i in 0..*count {
                let mut rng = Sampler::new(hash(cache.seed(), CELL), (record * n + cell) as u64, u64::from(i));
                let local = cache.strata.direction(cell, rng.next_2d());
                let d = frame.to_world(local);
                shoot(d, cell, share(n, local.z, *count, &cones, None, d), &mut rng);
            }
        }
        self.glossy[first..].sort_by_key(|(cell, _)| *cell);
        self.rays.push(rays);
    }
}

#[cfg(test)]
mod tests;
