//! How the irradiance cache grows: new records, what bounds their radii, shapes that are given up, bright patches.

use super::super::bright_patches;
use super::super::cache_record::{RadiusLimits, Record};
use super::super::cache_settings::Place;
use super::super::gather_cache::GatherCache;
use super::super::gather_strata::Estimate;
use super::super::surfel_light::HitLight;
use super::super::surfels::Facet;
use super::{DARK, IrradianceCache, LOOK, is_smallest};
use crate::math::sampler::hash;
use crate::math::{Rgb, luminance};
use rayon::prelude::*;

/// A shape is given up if of so many records on it, or more, this share has the least radius: hair, leaves.
const HOPELESS: (usize, f32) = (256, 0.45);
/// Records whose normals' cosine is less do not bound each other's radii.
const SAME_SURFACE: f32 = 0.7;
/// Most records that are gathered anew once they have told of bright patches, and the stream of random numbers of their new rays.
const AGAIN: usize = 512;
const AGAIN_STREAM: u64 = 0x1cb;

impl IrradianceCache<'_> {
    /// Gives up shapes on which records cover next to nothing.
    pub(super) fn give_up(&mut self) {
        if !self.judges {
            return;
        }
        // Records and those of least radius, by shape.
        let mut counts = std::collections::BTreeMap::<u32, [usize; 2]>::new();
        for (place, (record, least)) in self.gather.places().iter().zip(self.records.iter().zip(&self.min_radii)) {
            let count = counts.entry(place.shape).or_default();
            count[0] += 1;
            count[1] += usize::from(is_smallest(record, *least));
        }
        let fine = counts.iter().filter(|(_, [n, least])| *n >= HOPELESS.0 && *least as f32 > HOPELESS.1 * *n as f32);
        self.hopeless.extend(fine.map(|(shape, _)| *shape));
        self.hopeless.sort_unstable();
        self.hopeless.dedup();
    }

    /// Adds a record at each place.
    pub(super) fn add(&mut self, round: &[Place], hit_light: &HitLight) {
        let first = self.records.len();
        let facets: Vec<Facet> = round.iter().map(|p| p.facet).collect();
        self.gather_at(&facets, hit_light);
        let Some(light) = &self.light else { return };
        let estimates = self.gather.evaluate(first..self.gather.len(), light);
        let bright = |sum: f32, e: Rgb| sum + luminance(e);
        let sum =
            self.records.iter().map(|r| r.irradiance).chain(estimates.iter().map(|e| e.irradiance)).fold(0.0, bright);
        let mean = sum / self.gather.len() as f32;
        for (i, (place, e)) in round.iter().zip(&estimates).enumerate() {
            self.min_radii.push(self.settings.min_radius_pixels * place.pixel);
            let record = self.record(first + i, e, DARK * mean);
            self.tree.insert((first + i) as u32, record.p, record.extent());
            self.records.push(record);
        }
        self.bound_by_neighbours();
    }

    /// Gathers at places: gather rays, those to bright patches, and the light of what they hit.
    fn gather_at(&mut self, facets: &[Facet], hit_light: &HitLight) {
        let Some(light) = &mut self.light else { return };
        self.gather.gather(&self.world, &mut light.surfels, facets);
        self.gather.guide(&self.world, &mut light.surfels, &self.patches);
        light.extend(&self.world, hit_light, self.gather.len() * self.gather.strata.len());
        self.gather.scatter(&self.world, false);
    }

    /// Looks for bright patches if it is time to. Records to come send rays to them, and none of those that have told where they are: rays that
    /// have found a patch by chance must not be weighed by that. The first few records are gathered anew.
    pub(super) fn look_for_patches(&mut self, hit_light: &HitLight) {
        let Some(light) = self.light.as_ref().filter(|_| self.settings.guided && self.records.len() >= self.look_at)
        else {
            return;
        };
        self.look_at = LOOK.1 * self.records.len();
        let mean = self.records.iter().map(|r| luminance(r.irradiance)).sum::<f32>() / self.records.len() as f32;
        let levels: Vec<f32> = self
            .records
            .iter()
            .zip(self.gather.places())
            .map(|(record, place)| {
                let outshone = self.at_hit(place, f32::INFINITY).map_or(0.0, luminance);
                luminance(record.irradiance).max(DARK * mean).max(outshone)
            })
            .collect();
        let records =
            levels.iter().enumerate().map(|(i, level)| (self.gather.places()[i], *level, self.gather.hits(i)));
        let patches = bright_patches::find(&light.surfels, light.irradiance(), records);
        if !patches.is_empty() {
            let first = self.patches.is_empty();
            self.patches = patches;
            if first && self.records.len() <= AGAIN {
                self.start_again(hit_light);
            }
        }
        self.gather.leave_unguided();
    }

    /// Gathers anew for the records there are.
    fn start_again(&mut self, hit_light: &HitLight) {
        let other = GatherCache::new(self.settings.gather_rays, hash(self.settings.seed, AGAIN_STREAM));
        let before = std::mem::replace(&mut self.gather, other);
        (self.gather.most_segments, self.gather.counts) = (before.most_segments, before.counts);
        self.gather_at(before.places(), hit_light);
        self.resize();
    }

    pub(super) fn record(&self, i: usize, e: &Estimate, floor: f32) -> Record {
        let max = self.settings.max_radius * 2.0 * self.world.scene.bounds.1;
        let min = self.min_radii[i].max(1e-5 * max).min(max);
        let limits = RadiusLimits { error: self.settings.error, floor, min, max };
        let place = &self.gather.places()[i];
        Record::new(place.p, &self.gather.frame(i), e, &limits, |frame| self.gather.risers(i, frame))
    }

    /// R_i <= R_j + |x_i - x_j| for records of one surface (Krivanek et al. 2006, section 4): what one has seen nearby, such
    /// as a corner, the others learn. Never below the least radius.
    pub(super) fn bound_by_neighbours(&mut self) {
        let limits: Vec<Vec<(u32, f32)>> = (0..self.records.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|j| {
                let near = &self.records[j];
                let mut wide = Vec::new();
                self.tree.containing(near.p, |i| {
                    let far = &self.records[i as usize];
                    let bound = near.mean_radius() + (near.p - far.p).length();
                    if far.mean_radius() > bound && far.frame.n.dot(near.frame.n) > SAME_SURFACE {
                        wide.push((i, bound));
                    }
                    true
                });
                wide
            })
            .collect();
        for (i, bound) in limits.into_iter().flatten() {
            let record = &mut self.records[i as usize];
            let shrink = bound / record.mean_radius();
            if shrink < 1.0 {
                record.radii = (record.radii * shrink).max(crate::math::Vec2::splat(self.min_radii[i as usize]));
            }
        }
    }
}
