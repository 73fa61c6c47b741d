//! What sums over virtual lights count: for reports, and for the price of variance.
//!
//! Horvitz-Thompson estimates from the rays that were traced, each with its probability pi u:
//!
//! ```text
//! roulette variance   sum over rays of t^2 Var X(v) / (pi u)
//! variance of the set sum over rays of t^2 v^2 / (pi u) - L^2 / N        as if the N lights had been drawn independently
//! ```

use crate::image::film::Makeup;
use crate::math::ResidualRoulette;
use crate::transport::visibility::posterior::{AGREEMENTS, Posterior};
use std::ops::AddAssign;

/// Counts of sums over virtual lights, for reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ManyLightCounts {
    /// Points at which light was summed.
    pub points: u64,
    /// Lights there were, over all points.
    pub lights: u64,
    /// Groups of lights whose bounds were asked.
    pub nodes: u64,
    /// Lights whose tentative contribution was computed.
    pub looks: u64,
    /// Those of them with a contribution above 0.
    pub pairs: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Pairs whose ray was certain.
    pub certain: u64,
    /// Pairs at the lower limit of the probability of a ray.
    pub floored: u64,
}

impl AddAssign for ManyLightCounts {
    fn add_assign(&mut self, o: ManyLightCounts) {
        self.points += o.points;
        self.lights += o.lights;
        self.nodes += o.nodes;
        self.looks += o.looks;
        self.pairs += o.pairs;
        self.shadow_rays += o.shadow_rays;
        self.certain += o.certain;
        self.floored += o.floored;
    }
}

/// Counts and variances of the sums of one camera sample.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    pub(super) nodes: u64,
    pub(super) looks: u64,
    pub(super) pairs: u64,
    pub(super) certain: u64,
    pub(super) floored: u64,
    points: u64,
    lights: u64,
    rays: u64,
    /// Variance by roulette, of all sums together.
    pub roulette: f64,
    /// Variance by the choice of lights.
    pub set: f64,
    /// Of the present point.
    squares: f64,
    here: u64,
    seen: [[u16; 2]; AGREEMENTS],
    watched: Option<ResidualRoulette>,
}

impl Tally {
    /// A sum over `lights` lights begins.
    pub(super) fn begin(&mut self, lights: usize) {
        self.points += 1;
        self.here = lights as u64;
        self.lights += lights as u64;
        self.squares = 0.0;
        self.seen = Default::default();
    }

    /// It has come to `total`, mean of the channels.
    pub(super) fn end(&mut self, total: f32) {
        let total = f64::from(total);
        self.set += (self.squares - total * total / self.here.max(1) as f64).max(0.0);
    }

    /// A shadow ray found `v` for a contribution of size `t`.
    pub(super) fn ray(&mut self, t: f32, rule: &ResidualRoulette, v: f32, case: Option<usize>) {
        self.rays += 1;
        let weight = f64::from(t) * f64::from(t) / (f64::from(rule.pi) * f64::from(rule.u));
        self.roulette += weight * rule.variance(v);
        self.squares += weight * f64::from(v * v);
        if let Some(case) = case {
            let seen = &mut self.seen[case];
            seen[0] = seen[0].saturating_add(u16::from(v > 0.5));
            seen[1] = seen[1].saturating_add(1);
        }
    }

    /// Tells the posterior what the rays of the present point have found.
    pub(super) fn note(&self, posterior: &Posterior, surrounding: usize) {
        for (case, &[visible, traced]) in self.seen.iter().enumerate() {
            if traced > 0 {
                posterior.note(surrounding, case, u64::from(visible), u64::from(traced));
            }
        }
    }

    /// Counts `n` lights as looked at.
    #[cfg(test)]
    pub(crate) fn looked(&mut self, n: u64) {
        self.looks += n;
    }

    /// Notes how a light that is watched is treated at the present point, the first time.
    pub fn watch(&mut self, rule: ResidualRoulette) {
        self.watched.get_or_insert(rule);
    }

    /// Adds what debug layers show to `makeup`.
    pub fn tell(&self, makeup: &mut Makeup) {
        [makeup.pairs, makeup.certain, makeup.floored] = [self.pairs, self.certain, self.floored].map(|n| n as f32);
        if let Some(rule) = self.watched {
            (makeup.watched, makeup.selection, makeup.prediction, makeup.check) = (1.0, rule.pi, rule.q, rule.u);
        }
    }

    /// The counts.
    pub fn counts(&self) -> ManyLightCounts {
        ManyLightCounts {
            points: self.points,
            lights: self.lights,
            nodes: self.nodes,
            looks: self.looks,
            pairs: self.pairs,
            shadow_rays: self.rays,
            certain: self.certain,
            floored: self.floored,
        }
    }
}
