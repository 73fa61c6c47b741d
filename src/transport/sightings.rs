//! What records nearby have seen of bright surfaces: where a new record sends further rays.
//!
//! Light that comes through a door that is ajar, or from a few lit walls behind a gap, reaches a record by two or three of its gather rays. Its
//! neighbours have seen the same light from a little aside:
//!
//! ```text
//!   r = rho E_hit / E, pi L_sky / E                    what a hit brings over the mean one, bright if r > BRIGHT; E: irradiance of its record
//!   v_i = sum r^2 / N - (sum r / N)^2                  over the bright hits of the K nearest records which lie, as seen from here, in cell i or
//!                                                      one of those around it; N = 9 K: the number of all their hits there (6 K at the horizon)
//!   n_i = s sqrt(v_i) - 1,  s = sum sqrt(v) / (n TARGET)^2      further rays of cell i (Neyman), as many as bring the record to TARGET
//! ```
//!
//! A cell's radiance is the mean over its gather ray and its further ones (`guided_rays.rs`); rays to the sky are a matter of their own
//! (`gather_sky.rs`), which has no place: it is looked for in the directions in which others have seen it.
//! Source      Jensen 1995, "Importance Driven Path Tracing using the Photon Map" (what was found before tells where to look); Neyman 1934 (shares)
//! Bias        none: the number of rays depends on other records' rays alone
//! Not handled light that none of the neighbours has found; what stands before a bright surface here and not there (rays in vain)
//! Verified by `guided_rays::tests`

use super::gather_cache::GatherHit;
use super::gather_strata::Strata;
use super::nearest::turned;
use super::surfels::Facet;
use crate::math::{Frame, Rgb, Vec3, luminance};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::f32::consts::PI;
use std::num::NonZero;

/// A hit is bright if it brings so many times what a mean one brings.
const BRIGHT: f32 = 4.0;
/// Records that are asked, of twice as many nearest ones.
const ASKED: usize = 6;
/// Least cosine between the normals of a record and of those it asks.
const ALIKE: f32 = 0.5;
/// Aim for the relative standard deviation of a record.
const TARGET: f32 = 0.03;
/// Relative standard deviation below which nothing is done.
const LEAST: f32 = 0.1;
/// Most further rays over gather rays.
const MOST_RAYS: f32 = 1.0;

/// What rays may see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Seen {
    /// Surfaces, by the light that they scatter.
    Surface,
    /// The environment.
    Sky,
}

/// A bright hit: r, and where.
#[derive(Clone, Copy, Debug)]
struct Bright {
    ratio: f32,
    seen: Seen,
    /// The place, of the sky the direction.
    p: Vec3,
}

/// A record that tells.
#[derive(Clone, Copy, Debug)]
pub struct Teller<'h> {
    /// Its place.
    pub place: Facet,
    /// Irradiance (luminance, positive).
    pub level: f32,
    /// Its gather rays.
    pub hits: &'h [GatherHit],
    /// Radiance of the sky in their cells, none if it is not gathered.
    pub sky: &'h [Rgb],
}

/// Bright hits of records, to be asked for from places nearby.
#[derive(Debug)]
pub struct Sightings {
    tree: ImmutableKdTree<f32, 3>,
    normals: Vec<Vec3>,
    /// End of each record's in `bright`.
    ends: Vec<u32>,
    bright: Vec<Bright>,
    /// Relative variance of a record by its bright hits (Poisson's), mean over records.
    variance: f32,
}

impl Sightings {
    /// Of records; `None` if they have seen nothing bright. `irradiance`: of surfels.
    pub fn of(irradiance: &[Rgb], records: &[Teller]) -> Option<Self> {
        let (mut points, mut normals, mut ends, mut bright) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut variance = 0.0;
        for Teller { place, level, hits, sky } in records {
            let mut add = |p: Vec3, brings: f32, seen: Seen| {
                let ratio = brings / level;
                if ratio > BRIGHT {
                    variance += (ratio / hits.len() as f32).powi(2);
                    bright.push(Bright { ratio, seen, p });
                }
            };
            for hit in hits.iter().filter(|hit| hit.inverse_distance > 0.0) {
                add(place.p + hit.direction / hit.inverse_distance, hit.brings(irradiance), Seen::Surface);
            }
            for (hit, sky) in hits.iter().zip(*sky) {
                add(hit.direction, PI * luminance(*sky), Seen::Sky);
            }
            points.push(turned(place.p));
            normals.push(place.n_shade);
            ends.push(bright.len() as u32);
        }
        if bright.is_empty() {
            return None;
        }
        let tree = ImmutableKdTree::new_from_slice(&points).ok()?;
        variance /= points.len() as f32;
        Some(Sightings { tree, normals, ends, bright, variance })
    }

    /// Relative standard deviation of a record by bright hits, were these chance; root mean square over records.
    pub fn deviation(&self) -> f32 {
        self.variance.sqrt()
    }

    /// Further rays to what is to be seen for each cell of a record, none at all where it can do without.
    pub fn rays(&self, seen: Seen, place: &Facet, frame: &Frame, strata: &Strata) -> Vec<u32> {
        let query = turned(place.p);
        let most = NonZero::<usize>::MIN.saturating_add(2 * ASKED - 1);
        let found = self.tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(most).execute();
        let alike = found.iter().map(|f| f.item as usize).filter(|&k| self.normals[k].dot(place.n_shade) > ALIKE);
        let n = strata.len();
        let (mut sums, mut asked) = (Vec::new(), 0);
        for k in alike.take(ASKED) {
            asked += 1;
            let begin = if k == 0 { 0 } else { self.ends[k - 1] };
            let bright = &self.bright[begin as usize..self.ends[k] as usize];
            for bright in bright.iter().filter(|b| b.seen == seen) {
                let d = if seen == Seen::Sky { bright.p } else { bright.p - place.p };
                let d = frame.to_local(d).normalize_or_zero();
                if d.z > 0.0 {
                    sums.resize(n, [0.0f32; 2]);
                    let r = bright.ratio;
                    strata.around(strata.cell(d), |cell| {
                        sums[cell][0] += r;
                        sums[cell][1] += r * r;
                    });
                }
            }
        }
        if sums.is_empty() {
            return Vec::new();
        }
        let root = |(cell, [sum, square]): (usize, &[f32; 2])| {
            let mut count = 0.0;
            strata.around(cell, |_| count += asked as f32);
            (square / count - (sum / count).powi(2)).max(0.0).sqrt()
        };
        let roots: Vec<f32> = sums.iter().enumerate().map(root).collect();
        let per_ray = 1.0 / (n as f32 * n as f32);
        let variance: f32 = roots.iter().map(|s| s * s).sum::<f32>() * per_ray;
        if variance < LEAST * LEAST {
            return Vec::new();
        }
        let scale = roots.iter().sum::<f32>() * per_ray / (TARGET * TARGET);
        let wanted = |s: f32| roots.iter().map(|root| (s * root - 1.0).max(0.0)).sum::<f32>();
        // No more than there may be.
        let most = MOST_RAYS * n as f32;
        let scale = scale * (most / wanted(scale).max(most));
        roots.iter().map(|root| (scale * root - 0.5).max(0.0) as u32).collect()
    }
}
