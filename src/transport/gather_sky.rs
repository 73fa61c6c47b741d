//! Light of the sky in gather rays: what each cell of a record's hemisphere sees of a soft environment.
//!
//! A soft sky, one without a small bright sun, is gathered like the light of surfaces, so that what comes through a window is as smooth as
//! what the walls send on. Windows are small, so rays beyond the gather rays are sent where those have found the sky:
//!
//! ```text
//! L_i = mean of L V over n_i jittered directions of cell i,   n_i = 1 + round(n h_i / sum h) + s_i
//!       h_i = gather rays among cell i and its neighbours that left the scene
//!       s_i = further rays by what records nearby have seen (`sightings.rs`): a window behind a gap is too small for gather rays
//! ```
//!
//! The gather rays themselves are not counted: they decided where the others go, and counting them would bias the sum. Every cell has a
//! ray, so that its mean is right however small the window is that the gather rays have missed.
//! Source      adaptive stratification as in METHODS 3.B ("pilot reuse")
//! Bias        none
//! Not handled sky seen by reflection or through glass: it belongs to the caustic map
//! Verified by tests/sky.rs

use super::World;
use super::coat::Coat;
use super::gather_cache::GatherHit;
use super::gather_ray::RayCounts;
use super::gather_strata::Strata;
use super::surfels::Facet;
use crate::accel::Ray;
use crate::math::sampler::hash;
use crate::math::{Frame, Rgb, Sampler};

/// Greatest contrast of a sky that counts as soft.
const SOFT: f32 = 16.0;
/// Stream of random numbers.
const SKY: u64 = 0x6b1;

/// Whether the environment of the scene is gathered: there is one and it is soft.
pub fn is_gathered(world: &World) -> bool {
    let contrast = world.scene.lights.environment_contrast();
    contrast > 0.0 && contrast <= SOFT
}

/// Mean radiance of the sky in each cell of a record, by one ray each, about `rays` and those of `further` more. `hits` are those of its gather rays, `key` is its own.
pub fn sky(
    world: &World,
    strata: &Strata,
    (place, frame): (&Facet, &Frame),
    hits: &[GatherHit],
    (rays, further): (u32, &[u32]),
    key: u64,
    counts: &mut RayCounts,
) -> Vec<Rgb> {
    let n = strata.len();
    let near = neighbourhoods(strata, hits);
    let total: f32 = near.iter().sum();
    let at = place.surface_point();
    let coat = Coat::new(world, place);
    let scene = world.scene;
    (0..n)
        .map(|i| {
            let own = if total > 0.0 { (rays as f32 * near[i] / total).round() as u32 } else { 0 };
            let count = 1 + own + further.get(i).copied().unwrap_or(0);
            let mut sum = Rgb::ZERO;
            for k in 0..count {
                let mut rng = Sampler::new(hash(key, SKY), i as u64, u64::from(k));
                let d = frame.to_world(strata.direction(i, rng.next_2d()));
                let radiance = scene.lights.environment(scene.textures(), d);
                if radiance == Rgb::ZERO || d.dot(place.n_geo) <= 0.0 {
                    continue;
                }
                counts.shadow_rays += 1;
                let ray = Ray::leaving(&at, d);
                sum += radiance * (coat.response(d) * world.transmittance(ray, false).share);
            }
            sum / count as f32
        })
        .collect()
}

/// For each cell, gather rays that left the scene, of itself and of the eight around it.
fn neighbourhoods(strata: &Strata, hits: &[GatherHit]) -> Vec<f32> {
    let left = |cell: usize| u32::from(hits[cell].inverse_distance == 0.0);
    (0..strata.len())
        .map(|i| {
            let mut count = 0;
            strata.around(i, |cell| count += left(cell));
            count as f32
        })
        .collect()
}
