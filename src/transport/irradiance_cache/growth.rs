//! How the irradiance cache grows: new records, what bounds their radii, shapes that are given up, bright patches.

use super::super::bright_patches;
use super::super::cache_record::{BORDER, RadiusLimits, Record};
use super::super::cache_settings::Place;
use super::super::gather_cache::GatherCache;
use super::super::gather_strata::Estimate;
use super::super::guided_rays::Guides;
use super::super::sightings::{Sightings, Teller};
use super::super::surfel_demand::Demand;
use super::super::surfel_light::HitLight;
use super::super::surfels::Facet;
use super::{DARK, IrradianceCache, LOOK};
use crate::math::sampler::hash;
use crate::math::{Rgb, luminance};
use rayon::prelude::*;
use std::sync::Arc;

/// A shape is given up if of so many records on it, or more, this share has the least radius: hair, leaves.
const HOPELESS: (usize, f32) = (256, 0.45);
/// Records whose normals' cosine is less do not bound each other's radii.
const SAME_SURFACE: f32 = 0.7;
/// Difference between what a record predicts for another one that it covers and what that one has gathered, over the greater of the two or
/// [`DARK`] of the mean, from which on it ends before it: most noise of records is less.
const DISAGREE: f32 = 0.3;
/// Most records that are gathered anew once they have told of bright patches, and the stream of random numbers of their new rays.
const AGAIN: usize = 512;
const AGAIN_STREAM: u64 = 0x1cb;
/// Relative standard deviation of records by bright hits from which on they are gathered anew for these, too.
const UNEVEN: f32 = 0.15;
/// Number of records at which they tell anew what they have seen, over the number before: a quotient.
const SIGHT: (usize, usize) = (5, 4);

/// Whether a record has the least radius.
pub(super) fn is_smallest(record: &Record, least: f32) -> bool {
    record.radii.max_element() <= least * 1.001
}

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
        self.gather.gather(&self.world, &mut light.surfels, facets, self.sightings.as_deref());
        let guides = Guides { patches: &self.patches, sightings: self.sightings.as_deref() };
        self.gather.guide(&self.world, &mut light.surfels, guides);
        light.extend(&self.world, hit_light, self.gather.len() * self.gather.strata.len());
        self.gather.scatter(&self.world, false);
    }

    /// Looks at what records have seen, and for bright patches, each if it is time to. Records to come send rays there, and none of those that have
    /// told: rays that have found something by chance must not be weighed by that. The first few records are gathered anew.
    pub(super) fn look_for_light(&mut self, hit_light: &HitLight) {
        let count = self.records.len();
        let (sights, looks) = (count > self.sights_at, count >= self.look_at);
        let Some(light) = self.light.as_ref().filter(|_| self.settings.guided && (sights || looks)) else { return };
        let told = self.told();
        let sightings = sights.then(|| Sightings::of(light.irradiance(), &told));
        let patches = looks.then(|| bright_patches::find(&light.surfels, light.irradiance(), &told));
        let mut uneven = false;
        if let Some(sightings) = sightings {
            uneven = self.sightings.is_none() && sightings.as_ref().is_some_and(|s| s.deviation() > UNEVEN);
            self.sightings = sightings.map(Arc::new);
            self.sights_at = count * SIGHT.0 / SIGHT.1;
        }
        if looks {
            self.look_at = LOOK.1 * count;
        }
        if let Some(patches) = patches.filter(|p| !p.is_empty()) {
            uneven |= self.patches.is_empty();
            self.patches = patches;
        }
        if uneven && count <= AGAIN && !self.loaded {
            self.start_again(hit_light);
        }
        if self.sightings.is_some() || !self.patches.is_empty() {
            self.gather.leave_unguided();
        }
    }

    /// Irradiance (luminance) to which errors are relative in darker places.
    fn dark(&self) -> f32 {
        DARK * (self.records.iter().map(|r| luminance(r.irradiance)).sum::<f32>() / self.records.len() as f32)
    }

    /// Place, irradiance and hits of each record. Light that comes to the place directly outshines noise, so irradiance is no less than that of
    /// the surfel there.
    fn told(&self) -> Vec<Teller<'_>> {
        let dark = self.dark();
        let tell = |i: usize| {
            let (record, place) = (&self.records[i], &self.gather.places()[i]);
            let outshone = self.at_hit(place, f32::INFINITY).map_or(0.0, luminance);
            let level = luminance(record.irradiance).max(dark).max(outshone);
            Teller { place: *place, level, hits: self.gather.hits(i), sky: self.gather.sky(i) }
        };
        (0..self.records.len()).into_par_iter().with_min_len(64).map(tell).collect()
    }

    /// Further light samples where the records want them; whether any.
    pub(super) fn sharpen(&mut self) -> bool {
        let demand = self.demand();
        let Some(light) = &mut self.light else { return false };
        let sharper = light.sharpen(&self.world, &demand);
        self.sharpened = self.records.len();
        if sharper {
            light.solve();
        }
        sharper
    }

    /// What the records want of the surfels.
    fn demand(&self) -> Demand {
        let mut demand = Demand::default();
        for (i, Teller { level, .. }) in self.told().into_iter().enumerate() {
            let shares = self.gather.shares(i);
            demand.add(shares.into_iter().map(|(surfel, w)| (surfel, w / level)).collect());
        }
        demand
    }

    /// What the records have seen.
    pub(super) fn sight(&self) -> Option<Arc<Sightings>> {
        let light = self.light.as_ref()?;
        Sightings::of(light.irradiance(), &self.told()).map(Arc::new)
    }

    /// Gathers anew for the records there are, by other rays.
    fn start_again(&mut self, hit_light: &HitLight) {
        let other = GatherCache::new(self.settings.gather_rays, hash(self.gather.seed(), AGAIN_STREAM));
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
    /// as a corner, the others learn; and d_i(x_j) >= b if what i predicts at x_j is not what j has gathered (their adaptive caching): an edge of
    /// light that lies between them is in the derivatives of neither, if their rays have seen one side each. Never below the least radius.
    pub(super) fn bound_by_neighbours(&mut self) {
        let dark = self.dark();
        let limits: Vec<Vec<(u32, f32)>> = (0..self.records.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|j| {
                let near = &self.records[j];
                let mut wide = Vec::new();
                self.tree.containing(near.p, |i| {
                    let far = &self.records[i as usize];
                    let bound = (near.mean_radius() + (near.p - far.p).length()).min(end_before(far, near, dark));
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

/// Mean radius with which `far` is of no more use at the place of `near`, if it covers that and predicts something else there than what `near` has
/// gathered; infinite if not. Errors of what is darker than `dark` are relative to that.
fn end_before(far: &Record, near: &Record, dark: f32) -> f32 {
    let n = near.frame.n;
    match far.distance(near.p, n, n) {
        Some(d) if d < 1.0 && far.p != near.p => {
            let (predicted, there) = (luminance(far.predict(near.p, n)), luminance(near.irradiance));
            let disagree = (predicted - there).abs() > DISAGREE * predicted.max(there).max(dark);
            if disagree { far.mean_radius() * d / BORDER } else { f32::INFINITY }
        }
        _ => f32::INFINITY,
    }
}
