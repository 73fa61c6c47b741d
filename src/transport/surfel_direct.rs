//! Direct light of surfels, by light samples averaged over the cell.
//!
//! Estimates   D = mean over the samples of weight cos r V (r: `coat.rs`) at places spread over the cell, lights by [`World::sample_light`]
//! Number      two estimates at each of the first surfels tell the variance of one sample; enough are taken for `DIRECT_VARIANCE`, a record
//!             averages hundreds of surfels. One number for all surfels, a function of the first ones
//! Bias        none
//! Verified by tests/irradiance_cache.rs (with the rest of the cache)

use super::World;
use super::coat::Coat;
use super::gather_ray::RayCounts;
use super::light_tree::LitPoint;
use super::surfel_light::SurfelSettings;
use super::surfels::{Facet, Surfels};
use crate::math::sampler::hash;
use crate::math::{Rgb, Sampler, Vec2, luminance};
use crate::scene::LightSample;
use arrayvec::ArrayVec;
use rayon::prelude::*;

/// Aim for the relative variance of a surfel's direct light.
const DIRECT_VARIANCE: f32 = 0.05;
/// Most light samples over the least number.
const MAX_MORE_SAMPLES: f32 = 4.0;
/// Places within its cell at which a surfel's direct light is sampled, in turn; of surfels on which much depends.
pub(super) const PLACES: u32 = 4;
pub(super) const MANY_PLACES: u32 = 16;
/// Surfels from which the number of samples is found out.
const PILOT: usize = 2048;
/// Surfels that one task works on.
const CHUNK: usize = 64;
/// Streams of random numbers.
const PILOT_A: u64 = 0x5d4;
const PILOT_B: u64 = 0x5d5;
const WITHIN: u64 = 0x5d6;

/// Places within a cell.
type Spread = ArrayVec<Facet, { MANY_PLACES as usize }>;

/// Light samples per surfel that bring the variance of direct light to `DIRECT_VARIANCE` times its squared mean, by the
/// difference of two estimates at each of the first ones.
pub(super) fn samples_needed(world: &World, surfels: &Surfels, settings: SurfelSettings) -> u32 {
    let least = settings.light_samples.max(1);
    let estimates: Vec<[f32; 2]> = (0..surfels.len().min(PILOT))
        .into_par_iter()
        .with_min_len(CHUNK)
        .map(|i| {
            let mut counts = RayCounts::default();
            [PILOT_A, PILOT_B].map(|stream| {
                let key = hash(settings.seed, stream);
                let places = places_of(world, surfels, i, (least, PLACES), key, i as u64, &mut counts);
                luminance(direct(world, &places, least, key, i as u64, &mut counts).mean)
            })
        })
        .collect();
    let (mut variance, mut mean) = (0.0, 0.0);
    for [a, b] in &estimates {
        variance += 0.5 * (a - b) * (a - b);
        mean += 0.5 * (a + b);
    }
    let relative = variance * estimates.len() as f32 / (mean * mean);
    // No light at all gives NaN: the least number.
    let wanted = relative / DIRECT_VARIANCE;
    let more = if wanted > 1.0 { wanted.min(MAX_MORE_SAMPLES) } else { 1.0 };
    (least as f32 * more).round() as u32
}

/// Places in the cell of surfel `k`, one for each of `samples` but no more than `most`, at least one.
pub(super) fn places_of(
    world: &World,
    surfels: &Surfels,
    k: usize,
    (samples, most): (u32, u32),
    seed: u64,
    stream: u64,
    counts: &mut RayCounts,
) -> Spread {
    let place = |i: u32| {
        counts.shadow_rays += 1;
        let mut rng = Sampler::new(hash(seed, WITHIN), stream, u64::from(i));
        surfels.spread(world, k, rng.next_2d())
    };
    (0..samples.clamp(1, most)).map(place).collect()
}

/// Direct irradiance by several light samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sampled {
    /// Irradiance.
    pub mean: Rgb,
    /// Variance of one sample's luminance.
    pub variance: f32,
}

/// Irradiance directly from all lights, the mean over `places`.
pub(super) fn direct(
    world: &World,
    places: &Spread,
    samples: u32,
    seed: u64,
    stream: u64,
    counts: &mut RayCounts,
) -> Sampled {
    let coats: ArrayVec<Coat, { MANY_PLACES as usize }> = places.iter().map(|p| Coat::new(world, p)).collect();
    let sample = |s: u32| {
        let k = s as usize % places.len();
        direct_sample(world, &places[k], &coats[k], Sampler::new(seed, stream, u64::from(s)).next_4d(), counts)
    };
    let (mut sum, mut squares) = (Rgb::ZERO, 0.0);
    for value in (0..samples).map(sample) {
        sum += value;
        squares += luminance(value).powi(2);
    }
    let n = samples.max(1) as f32;
    let (mean, unbiased) = (sum / n, n / (n - 1.0).max(1.0));
    Sampled { mean, variance: ((squares / n - luminance(mean).powi(2)) * unbiased).max(0.0) }
}

/// Irradiance directly from all lights, by `samples` light samples.
pub fn direct_irradiance(
    world: &World,
    place: &Facet,
    samples: u32,
    seed: u64,
    stream: u64,
    counts: &mut RayCounts,
) -> Rgb {
    let coat = Coat::new(world, place);
    let sample =
        |s: u32| direct_sample(world, place, &coat, Sampler::new(seed, stream, u64::from(s)).next_4d(), counts);
    (0..samples).map(sample).sum::<Rgb>() / samples.max(1) as f32
}

fn direct_sample(
    world: &World,
    place: &Facet,
    coat: &Coat,
    [ux, uy, u_light, _]: [f32; 4],
    counts: &mut RayCounts,
) -> Rgb {
    let at = LitPoint { p: place.p, n: Some(place.n_shade), matte: true };
    let sample = world.sample_light(&at, u_light, Vec2::new(ux, uy));
    let Some(LightSample { wi, distance, weight, .. }) = sample else { return Rgb::ZERO };
    let cos = wi.dot(place.n_shade);
    if cos <= 0.0 {
        return Rgb::ZERO;
    }
    counts.shadow_rays += 1;
    weight
        * (cos
            * coat.response(wi)
            * world.transmittance(world.shadow_ray(&place.surface_point(), wi, distance), false).share)
}
