//! Small bright patches: surfaces that few gather rays find, and that matter when they do.
//!
//! A lamp close to a wall, or within a shade, makes a spot that sends on as much light as the rest of the room, from a few cells of
//! a record's hemisphere. Whether none, one or two of n gather rays end there is chance: neighbouring records disagree, and the picture has
//! blotches. What the records have found tells where such spots are; cones around them then get rays of their own (`guided_rays.rs`).
//!
//! ```text
//!   r = rho E_hit / E                  what a hit brings over the mean one, bright if r > BRIGHT; E: irradiance of the record, but of
//!                                      what bright hits bring the mean over all records: it is chance who has found them. Light that comes to the place directly
//!                                      outshines noise, so E is no less than that of the surfel there
//!   V = mean over records of sum over bright hits (r / n)^2            relative variance of a record by a patch (Poisson's)
//!   n_c = k (V_c / TARGET^2 - 1)       rays that bring it to TARGET, k gather rays in the cone of the patch
//! ```
//!
//! where V_c, that of a patch at a record, is the mean one times (k g^2) / mean of (k g^2), g the cosine at the patch.
//! Patches     bright surfels, halved along the longest axis of their box until patches are as small as their cells or there are
//!             [`MOST_PATCHES`]; each has the sphere around it
//! Source      Jensen 1995, "Importance Driven Path Tracing using the Photon Map" (what was found before tells where to look)
//! Bias        none as long as the records that tell send no rays to what they have told of: a patch that they found by chance would come out darker by
//!             the chance that they had not. Patches that they missed are left to gather rays; later rounds and caches have more of these
//! Not handled patches seen in mirrors only; whether something hides a patch from a record (its rays are then in vain)
//! Verified by `guided_rays::tests`

use super::cache_file::stored;
use super::gather_cache::GatherHit;
use super::sightings::Teller;
use super::surfels::{Facet, Surfels};
use crate::math::{Rgb, Vec3};
use arrayvec::ArrayVec;
use std::collections::BTreeMap;

/// A hit is bright if it brings so many times what a mean one brings.
const BRIGHT: f32 = 12.0;
/// Aim for the relative standard deviation of a record by a patch.
const TARGET: f32 = 0.02;
/// Mean relative standard deviation by all patches below which they are left alone: the strata of gather rays do better than chance for all
/// but the smallest.
const LEAST: f32 = 0.15;
/// Share of the variance that the surfels of patches account for, the brightest first.
const MAIN: f32 = 0.998;
/// Most patches.
pub const MOST_PATCHES: usize = 16;
/// Patches are no longer halved if they are as small as this, in edges of the largest cells.
const SMALL: f32 = 1.0;
/// Patches of fewer surfels are not halved: they say little about what lies between them.
const FEW: usize = 8;
/// Most rays of a cone, and of all cones of a record, over its gather rays.
const MOST_RAYS: (f32, f32) = (0.25, 0.5);
/// Least distance of a record from a patch, in its radii.
const LEAST_DISTANCE: f32 = 1.2;

/// A patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Centre of the sphere around it.
    pub center: Vec3,
    /// Radius of that sphere.
    pub radius: f32,
    /// Mean of its normals, shorter than 1 if they differ.
    pub normal: Vec3,
    /// Relative variance that it makes, mean over the records.
    pub variance: f32,
    /// k g^2, mean over the records.
    pub typical: f32,
}

stored!(Patch { center, radius, normal, variance, typical });

/// Directions to a patch as a record sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Axis, world, unit.
    pub axis: Vec3,
    /// 1 - cos of the half angle.
    pub one_minus_cos: f32,
    /// Rays.
    pub rays: u32,
}

impl Cone {
    /// Whether the unit vector `d` lies in the cone.
    pub fn contains(&self, d: Vec3) -> bool {
        0.5 * (d - self.axis).length_squared() <= self.one_minus_cos
    }
}

/// Cones of one record.
pub type Cones = ArrayVec<Cone, MOST_PATCHES>;

/// What a bright surfel has done.
#[derive(Clone, Copy, Debug)]
struct Bright {
    p: Vec3,
    n: Vec3,
    variance: f32,
    reach: f32,
}

impl Patch {
    /// The patch as seen from a place, k with `n` gather rays, and g; `None` where it cannot shine or is too close.
    fn cone(&self, place: &Facet, n: u32) -> Option<(Cone, f32, f32)> {
        let to = self.center - place.p;
        let distance2 = to.length_squared();
        if distance2 < (LEAST_DISTANCE * self.radius).powi(2) {
            return None;
        }
        let axis = to / distance2.sqrt();
        let sin2 = self.radius * self.radius / distance2;
        let one_minus_cos = sin2 / (1.0 + (1.0 - sin2).sqrt());
        let facing = (1.0 - self.normal.length() - self.normal.dot(axis)).min(1.0);
        let cos = axis.dot(place.n_shade);
        if facing <= 0.0 || cos <= -sin2.sqrt() {
            return None;
        }
        // Solid angle 2 pi (1 - cos) times cos / pi; of a cone on the horizon some part is above it.
        let k = n as f32 * 2.0 * one_minus_cos * cos.max(0.25 * sin2.sqrt());
        Some((Cone { axis, one_minus_cos, rays: 0 }, k, facing))
    }
}

/// The patches that the hits of records tell of.
pub fn find(surfels: &Surfels, irradiance: &[Rgb], records: &[Teller]) -> Vec<Patch> {
    let brings = |hit: &GatherHit| hit.brings(irradiance);
    // Of each record what bright hits bring to it, and the number of its hits.
    let by_chance = records.iter().map(|Teller { level, hits, .. }| {
        let bright: f32 = hits.iter().map(brings).filter(|v| *v > BRIGHT * level).sum();
        (bright / hits.len() as f32, hits.len())
    });
    let by_chance: Vec<(f32, usize)> = by_chance.collect();
    let (count, n) = (by_chance.len(), by_chance.first().map_or(1, |(_, n)| *n));
    let usual = by_chance.iter().map(|(bright, _)| bright).sum::<f32>() / count.max(1) as f32;
    let mut found = BTreeMap::<u32, f32>::new();
    for (Teller { level, hits, .. }, (bright, _)) in records.iter().zip(&by_chance) {
        // Those that were lucky see no more of the patch than others.
        let level = (level - bright).max(0.0) + usual;
        for hit in *hits {
            let ratio = brings(hit) / level;
            if ratio > BRIGHT {
                *found.entry(hit.reached.surfel() as u32).or_default() += (ratio / n as f32).powi(2);
            }
        }
    }
    let total: f32 = found.values().sum::<f32>() / count.max(1) as f32;
    if !(total > LEAST * LEAST) {
        return Vec::new();
    }
    let mut found: Vec<(u32, f32)> = found.into_iter().collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let (mut sum, enough) = (0.0, MAIN * total * count as f32);
    let main = found.iter().take_while(|(_, variance)| {
        let more = sum < enough;
        sum += variance;
        more
    });
    let bright = main.map(|&(k, sum)| {
        let place = surfels.places()[k as usize];
        let reach = 0.5 * surfels.edge_of(k as usize);
        Bright { p: place.p, n: place.n_geo, variance: sum / count as f32, reach }
    });
    let mut patches: Vec<Patch> = divide(bright.collect(), SMALL * surfels.cell()).iter().map(|g| around(g)).collect();
    for patch in &mut patches {
        let typical = |place: &Facet| patch.cone(place, n as u32).map_or(0.0, |(_, k, g)| k * g * g);
        patch.typical = records.iter().map(|teller| typical(&teller.place)).sum::<f32>() / count as f32;
    }
    patches
}

/// The smallest axis-parallel box.
fn bounds(group: &[Bright]) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    group.iter().fold(start, |(low, high), b| (low.min(b.p - b.reach), high.max(b.p + b.reach)))
}

/// Groups of bright surfels: the widest with most variance is halved first.
fn divide(all: Vec<Bright>, small: f32) -> Vec<Vec<Bright>> {
    let mut groups = vec![all];
    while groups.len() < MOST_PATCHES {
        let weight = |g: &Vec<Bright>| {
            let (low, high) = bounds(g);
            let size = (high - low).max_element();
            let variance: f32 = g.iter().map(|b| b.variance).sum();
            if size > small && g.len() >= FEW { size * size * variance } else { 0.0 }
        };
        let weights: Vec<f32> = groups.iter().map(weight).collect();
        let widest = (0..groups.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b]).then(b.cmp(&a)));
        let Some(widest) = widest.filter(|&i| weights[i] > 0.0) else { break };
        let (low, high) = bounds(&groups[widest]);
        let (size, middle) = (high - low, 0.5 * (low + high));
        let axis = if size.x >= size.y && size.x >= size.z {
            Vec3::X
        } else if size.y >= size.z {
            Vec3::Y
        } else {
            Vec3::Z
        };
        let (near, far): (Vec<Bright>, Vec<Bright>) =
            groups[widest].iter().partition(|b| (b.p - middle).dot(axis) < 0.0);
        if near.is_empty() || far.is_empty() {
            break;
        }
        groups[widest] = near;
        groups.push(far);
    }
    groups
}

/// The patch of a group.
fn around(group: &[Bright]) -> Patch {
    let (low, high) = bounds(group);
    let center = 0.5 * (low + high);
    // What is spread over a patch reaches beyond the outermost of a few by about half of their spacing.
    let beyond = 0.5 * (high - low).max_element() / (group.len() as f32).sqrt();
    let radius = group.iter().map(|b| (b.p - center).length() + b.reach.max(beyond)).fold(0.0, f32::max);
    let variance: f32 = group.iter().map(|b| b.variance).sum();
    let normal = group.iter().map(|b| b.n * b.variance).sum::<Vec3>() / variance;
    Patch { center, radius, normal, variance, typical: 0.0 }
}

/// Where further rays of a record with `n` gather rays go.
pub fn cones(patches: &[Patch], place: &Facet, n: u32) -> Cones {
    let wanted = |patch: &Patch| {
        let (cone, k, g) = patch.cone(place, n)?;
        // None of the records that have found it could send rays to it.
        let typical = Some(patch.typical).filter(|t| *t > 0.0)?;
        let variance = patch.variance * k * g * g / typical;
        let rays = (k * (variance / (TARGET * TARGET) - 1.0)).min(MOST_RAYS.0 * n as f32);
        (rays >= 1.0).then_some((cone, rays))
    };
    let all: ArrayVec<(Cone, f32), MOST_PATCHES> = patches.iter().filter_map(wanted).collect();
    let sum: f32 = all.iter().map(|(_, rays)| rays).sum();
    let share = (MOST_RAYS.1 * n as f32 / sum).min(1.0);
    let scaled = all.iter().map(|(cone, rays)| Cone { rays: (rays * share).round() as u32, ..*cone });
    scaled.filter(|c| c.rays > 0).collect()
}
