//! Irradiance of surfels: direct light by light samples, all further bounces by the transport operator.
//!
//! ```text
//! E_j = D_j + C_j + I_l(j),      I_l = G_l + sum_r T_lr E_s(r),      T_lr = weight_r / n,      r = the n gather rays of l
//! ```
//!
//! l(j) is the surfel of the large cell around j (j itself if its cell is large): what comes after the second bounce varies
//! so slowly that only large cells gather, from one another.
//! D = direct irradiance averaged over the cell, mean over light samples of weight cos V; C = irradiance by caustics, from a callback; G = pi / n
//! times the sum of what glossy vertices of the rays scatter from lamps; weight_r = throughput times albedo at the end of
//! ray r, s(r) the surfel there. Directions have the density cos / pi per solid angle, so the factors pi cancel.
//! Solved in `surfel_bounces.rs`.
//! Rays of surfels found the next ones, in the largest cells, some by lot if there were too many; the others and the ends of *their* rays
//! take a surfel of a wider neighbourhood, and where there is none that sees the place found one as well, and so on: light finds its way
//! through any number of rooms. When there are too many in spite of that, the rest of the row stands for the lost rays.
//! Source      METHODS: direct-to-indirect transfer over clustered hits; cf. Hasan, Pellacini, Bala 2006
//! Bias        that of the clusters (`surfels.rs`) and of the neighbours of third order; none from the number of samples
//! Verified by tests/irradiance_cache.rs: furnaces (E = pi L / (1 - rho) to 1e-3), against path tracing, relighting

use super::World;
use super::cache_file::stored;
use super::coat::Coat;
use super::gather_ray::{GlossyLight, RayCounts, light_glossy};
use super::reached::Reached;
use super::surfel_direct::{PLACES, Sampled, direct, places_of, samples_needed};
use super::surfels::{Facet, LONELY, Surfels};
use crate::math::sampler::hash;
use crate::math::{Frame, Rgb, Sampler, Vec3, warp};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Surfels that later generations may add, beside as many as the first have.
const FURTHER: usize = 4096;
/// Generations of surfels, each found by rays of the one before.
const MOST_GENERATIONS: u32 = 32;
/// Surfels that one task works on.
const CHUNK: usize = 64;
/// Streams of random numbers.
const DIRECT: u64 = 0x5d1;
const ROWS: u64 = 0x5d2;
const GLOSSY: u64 = 0x5d3;
const FOUNDS: u64 = 0x5d9;

/// Irradiance by position and normal.
pub type IrradianceAt<'a> = &'a (dyn Fn(Vec3, Vec3) -> Rgb + Sync);

/// Where the irradiance at the ends of gather rays comes from.
#[derive(Clone, Copy)]
pub enum HitLight<'a> {
    /// Direct light, the caustics that the function returns, and all further bounces by the operator.
    Operator {
        /// Irradiance that reaches the point from lamps by specular surfaces only.
        caustic: IrradianceAt<'a>,
    },
    /// Direct light and caustics only: one bounce.
    OneBounce {
        /// As above.
        caustic: IrradianceAt<'a>,
    },
    /// All of it from elsewhere, such as a global photon map.
    Map {
        /// Whole irradiance: direct, caustic and indirect.
        total: IrradianceAt<'a>,
    },
}

/// How finely surfels are evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfelSettings {
    /// Least number of light samples per surfel. The noise of the first surfels decides how many are taken.
    pub light_samples: u32,
    /// Gather rays per surfel.
    pub gather_rays: u32,
    /// Most bounces between surfels; `None`: no limit.
    pub bounces: Option<u32>,
    /// Seed of all random numbers.
    pub seed: u64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) reached: Reached,
    pub(super) weight: Rgb,
}

/// Surfels with their light.
#[derive(Clone, Debug)]
pub struct SurfelLight {
    /// The places.
    pub surfels: Surfels,
    /// Rays traced.
    pub counts: RayCounts,
    pub(super) settings: SurfelSettings,
    /// Surfels that gather rays of records have found.
    by_records: usize,
    /// Light samples per surfel, once it is known how many are needed.
    light_samples: Option<u32>,
    /// D + C (or everything, from a map).
    pub(super) own: Vec<Rgb>,
    /// C.
    pub(super) caustic: Vec<Rgb>,
    /// Variance of one light sample (luminance) and the number of them.
    pub(super) variance: Vec<f32>,
    pub(super) samples: Vec<u32>,
    /// I of large surfels.
    pub(super) indirect: Vec<Rgb>,
    /// G of large surfels.
    pub(super) scattered: Vec<Rgb>,
    pub(super) total: Vec<Rgb>,
    /// Light of 0, 1, ... bounces, as long as there is a limit that shows ([`MOST_LEVELS`]); further ones are like `total`.
    pub(super) levels: Vec<Vec<Rgb>>,
    /// l: the surfel that gathers for each.
    pub(super) gatherer: Vec<u32>,
    /// End of the surfel's row in `entries`.
    pub(super) row_ends: Vec<u32>,
    pub(super) entries: Vec<Entry>,
    /// Light by glossy surfaces with the index of their surfel.
    glossy: Vec<(u32, GlossyLight)>,
}

stored!(SurfelSettings { light_samples, gather_rays, bounces, seed });
stored!(Entry { reached, weight });
stored!(SurfelLight {
    surfels,
    counts,
    settings,
    by_records,
    light_samples,
    own,
    caustic,
    variance,
    samples,
    indirect,
    scattered,
    total,
    levels,
    gatherer,
    row_ends,
    entries,
    glossy,
});

/// What a gather ray of a surfel ended on.
struct Found {
    at: Facet,
    weight: Rgb,
    /// The surfel there, if known.
    surfel: Option<u32>,
    segments: u32,
}

impl SurfelLight {
    /// No surfels yet; `cell` is the edge of the largest cells.
    pub fn new(cell: f32, settings: SurfelSettings) -> Self {
        SurfelLight {
            surfels: Surfels::new(cell),
            counts: RayCounts::default(),
            settings,
            by_records: 0,
            light_samples: None,
            own: Vec::new(),
            caustic: Vec::new(),
            variance: Vec::new(),
            samples: Vec::new(),
            indirect: Vec::new(),
            scattered: Vec::new(),
            total: Vec::new(),
            levels: Vec::new(),
            gatherer: Vec::new(),
            row_ends: Vec::new(),
            entries: Vec::new(),
            glossy: Vec::new(),
        }
    }

    /// Another limit of bounces, as of the next [`Self::solve`].
    pub fn limit_bounces(&mut self, bounces: Option<u32>) {
        self.settings.bounces = bounces;
    }

    /// Irradiance of each surfel.
    pub fn irradiance(&self) -> &[Rgb] {
        &self.total
    }

    /// Lights the surfels that were founded since the last call, and those that their rays found. `rays`: gather rays of records so far.
    pub fn extend(&mut self, world: &World, light: &HitLight, rays: usize) {
        self.surfels.coarsen(rays);
        let first = self.total.len();
        let with_rows = matches!(light, HitLight::Operator { .. });
        for k in first..self.surfels.len() {
            let large = self.surfels.is_large(k) || !with_rows;
            let at = self.surfels.places()[k];
            let gatherer = if large { k as u32 } else { self.surfels.find_or_insert(world, &at, f32::INFINITY) };
            self.gatherer.push(gatherer);
        }
        self.by_records += self.surfels.len() - first;
        // In hair and foliage every ray would find a new one: no more than half as many again as rays of records have found. Where rays share surfels,
        // up to three for each.
        let lonely = self.by_records as f32 > LONELY * rays as f32;
        let mut later = None;
        for generation in 0..MOST_GENERATIONS {
            self.surfels.coarsen(rays);
            let start = self.row_ends.len();
            if start == self.surfels.len() {
                break;
            }
            self.gatherer.extend(self.gatherer.len() as u32..self.surfels.len() as u32);
            // From the second generation on: wider neighbourhoods, and not much more than there is.
            let most = match generation {
                _ if lonely => self.by_records * 3 / 2 + FURTHER,
                0 => 2 * rays + FURTHER,
                _ => *later.get_or_insert(self.surfels.len() * 3 / 2 + FURTHER),
            };
            self.gather(world, start, with_rows, generation > 0, most);
        }
        self.row_ends.resize(self.surfels.len(), self.entries.len() as u32);
        self.gatherer.extend(self.gatherer.len() as u32..self.surfels.len() as u32);
        let zeros = vec![Rgb::ZERO; self.surfels.len() - first];
        self.levels.clear();
        for values in [&mut self.own, &mut self.caustic, &mut self.indirect, &mut self.scattered, &mut self.total] {
            values.extend_from_slice(&zeros);
        }
        self.variance.resize(self.surfels.len(), 0.0);
        self.samples.resize(self.surfels.len(), 0);
        self.light(world, light, first);
        self.sweeps(first, self.settings.bounces.unwrap_or(u32::MAX).min(8));
    }

    /// Evaluates all light anew, without a gather ray.
    pub fn relight(&mut self, world: &World, light: &HitLight) {
        self.light(world, light, 0);
        self.solve();
    }

    /// Traces the rows of the surfels from `start` on.
    fn gather(&mut self, world: &World, start: usize, with_rows: bool, coarse: bool, most: usize) {
        let n = if with_rows { self.settings.gather_rays } else { 0 };
        let indices: Vec<usize> = (start..self.surfels.len()).collect();
        let (surfels, seed, most_segments) = (&self.surfels, self.settings.seed, self.settings.bounces);
        let traced: Vec<_> = indices
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut counts = RayCounts::default();
                let mut found = Vec::with_capacity(chunk.len() * n as usize);
                let mut glossy = Vec::new();
                for &k in chunk.iter().filter(|&&k| surfels.is_large(k)) {
                    let place = surfels.places()[k];
                    let (at, frame) = (place.surface_point(), Frame::from_normal(place.n_shade));
                    let coat = Coat::new(world, &place);
                    for i in 0..n {
                        let mut rng = Sampler::new(hash(seed, ROWS), k as u64, u64::from(i));
                        let d = frame.to_world(warp::sample_cosine_hemisphere(rng.next_2d()));
                        let response = coat.response(d);
                        let g = world.gather(at.spawn_origin(d), d, &mut rng, &mut counts, |v| {
                            glossy.push((k as u32, v.scaled(response)));
                        });
                        let counted = g.end.filter(|_| most_segments.is_none_or(|most| g.segments <= most));
                        found.push(counted.map(|end| {
                            let facet = Facet::seen_from(&end.at, end.wo);
                            let surfel = surfels.find(world, &facet, f32::INFINITY);
                            Found { at: facet, weight: end.weight * response, surfel, segments: g.segments }
                        }));
                    }
                }
                (found, glossy, counts)
            })
            .collect();
        let ends = traced.iter().flat_map(|(found, ..)| found.iter().flatten());
        let mut unknown: Vec<Facet> = ends.filter(|f| f.surfel.is_none() && !coarse).map(|f| f.at).collect();
        // Too many, perhaps: lots are drawn, so that not always the last ones are left out. What they have seen may be nobody else's, such as
        // another room.
        if self.surfels.len() + unknown.len() > most {
            let lot = |i: usize| hash(hash(seed, FOUNDS), hash(start as u64, i as u64));
            let mut drawn: Vec<(u64, Facet)> = unknown.into_iter().enumerate().map(|(i, at)| (lot(i), at)).collect();
            drawn.sort_unstable_by_key(|(lot, _)| *lot);
            unknown = drawn.into_iter().map(|(_, at)| at).collect();
        }
        for at in &unknown {
            if self.surfels.len() >= most {
                break;
            }
            self.surfels.find_or_insert(world, at, f32::INFINITY);
        }
        let mut next = start;
        for (found, glossy, counts) in traced {
            self.counts += counts;
            self.glossy.extend(glossy);
            for row in found.chunks(n.max(1) as usize) {
                while !self.surfels.is_large(next) {
                    self.row_ends.push(self.entries.len() as u32);
                    next += 1;
                }
                next += 1;
                let (begin, mut lost) = (self.entries.len(), 0);
                for f in row.iter().flatten() {
                    // Founded by now, perhaps.
                    let found = || if coarse { None } else { self.surfels.find(world, &f.at, f32::INFINITY) };
                    let known = f.surfel.or_else(found);
                    let surfel = known.or_else(|| self.surfels.find_or_insert_coarse(world, &f.at, most + most / 2));
                    match surfel {
                        Some(surfel) => {
                            let reached = Reached::new(surfel, f.segments);
                            self.entries.push(Entry { reached, weight: f.weight / n as f32 });
                        }
                        None => lost += 1,
                    }
                }
                // The rays that are left stand for those without a surfel.
                let scale = n as f32 / (n - lost).max(1) as f32;
                self.entries[begin..].iter_mut().for_each(|e| e.weight *= scale);
                self.row_ends.push(self.entries.len() as u32);
            }
        }
        self.row_ends.resize(indices.len() + start, self.entries.len() as u32);
    }

    /// Light that does not come from other surfels, for those from `start` on.
    fn light(&mut self, world: &World, light: &HitLight, start: usize) {
        let places = &self.surfels.places()[start..];
        let samples = *self.light_samples.get_or_insert_with(|| match light {
            HitLight::Map { .. } => self.settings.light_samples,
            _ => samples_needed(world, &self.surfels, self.settings),
        });
        let (settings, glossy) = (self.settings, &self.glossy);
        let lit: Vec<([Rgb; 2], f32, RayCounts)> = places
            .par_iter()
            .enumerate()
            .with_min_len(CHUNK)
            .map(|(i, place)| {
                let mut counts = RayCounts::default();
                let ([own, caustic], variance) = match light {
                    HitLight::Map { total } => ([total(place.p, place.n_shade), Rgb::ZERO], 0.0),
                    HitLight::Operator { caustic } | HitLight::OneBounce { caustic } => {
                        let stream = (start + i) as u64;
                        let key = hash(settings.seed, DIRECT);
                        let wanted = (samples, PLACES);
                        let places = places_of(world, &self.surfels, start + i, wanted, key, stream, &mut counts);
                        // Of caustics one place must do: asking for them costs as much as many shadow rays.
                        let somewhere = &places[0];
                        let caustic = caustic(somewhere.p, somewhere.n_shade);
                        let Sampled { mean, variance } = direct(world, &places, samples, key, stream, &mut counts);
                        ([caustic + mean, caustic], variance)
                    }
                };
                if own.is_finite() { ([own, caustic], variance, counts) } else { ([Rgb::ZERO; 2], 0.0, counts) }
            })
            .collect();
        for (k, (value, variance, counts)) in (start..).zip(lit) {
            [self.own[k], self.caustic[k]] = value;
            (self.variance[k], self.samples[k]) = (variance, samples);
            self.counts += counts;
        }
        self.scattered[start..].fill(Rgb::ZERO);
        if matches!(light, HitLight::Operator { .. }) {
            // Vertices lie in the order of their surfels.
            let from = glossy.partition_point(|(k, _)| (*k as usize) < start);
            let (scattered, counts) = light_glossy(world, hash(settings.seed, GLOSSY), glossy, from);
            self.counts += counts;
            for ((k, _), value) in glossy[from..].iter().zip(scattered) {
                self.scattered[*k as usize] += value * (PI / settings.gather_rays as f32);
            }
        }
    }
}
