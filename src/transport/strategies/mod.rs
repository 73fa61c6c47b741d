//! Sums over virtual lights: interchangeable strategies, all of them a [`ResidualRoulette`] (pi, q, u) per light.
//!
//! | strategy | pi | q | u |
//! | --- | --- | --- | --- |
//! | [`exact`] | 1 | 0 | 1 |
//! | [`veach`] | 1 | 0 | min(1, t / delta) |
//! | [`nabata`] | 1 | share of 3 cache points | equations 10 to 13 |
//! | [`residual`] | 1 | posterior | min(1, t sqrt(R / (c_v lambda))) |
//! | [`culling`] | min(1, 1 / (alpha l^2)), shared xi | 0 | 1 |
//! | `hierarchical` | the same, own xi | 0 | 1 |
//! | `joint` | t q / sqrt(lambda c_s) by node bounds | posterior | min(1, t/pi sqrt(R / (c_v lambda))) |
//!
//! Given the lights of a pass all have the mean of `exact`; what differs is variance and cost. t is the mean of the channels of the tentative
//! contribution, the path's throughput included, so that one lambda = S / C holds for the whole picture. Estimates may be negative: they are
//! never clamped one by one.
//! Bias: none beyond that of the lights. Verified by `tests`.

pub mod coins;
pub mod culling;
pub mod exact;
mod hierarchical;
mod joint;
mod looks;
pub mod nabata;
pub mod receiver;
pub mod residual;
mod tally;
#[cfg(test)]
mod tests;
pub mod veach;
mod watch;

use self::coins::{Coin, Independent, Systematic};
pub use self::receiver::Receiver;
pub use self::tally::{ManyLightCounts, Tally};
use super::World;
use super::visibility::posterior::{Posterior, agreement};
use super::visibility::{Neighbours, VisibilityCache};
use super::vpl::{Vpls, mean};
use super::vpl_tree::VplTree;
use crate::math::residual_roulette::LEAST_CHECK;
use crate::math::sampler::{hash, refine};
use crate::math::{Price, ResidualRoulette, Rgb, Sampler, Vec2};
use coins::Coins;

/// What it costs to look at a light (tentative contribution, bits of the cache), in shadow rays: 30 ns, where a ray takes from 0.1 us (in a plain
/// box) to some us (in hair). Too low a price costs a box more than too high a one costs hair, whose rays are few and dear either way.
pub const LOOK: f32 = 0.2;

/// Strategies by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Every light with its shadow ray.
    Exact,
    /// Veach's roulette by contribution.
    Veach,
    /// Nabata et al.: visibility of three cache points, their probabilities and clamps.
    Nabata,
    /// Roulette of the residual of a calibrated prediction, one price for the picture.
    Residual,
    /// Tokuyoshi & Harada: random ranges, shared by all points.
    Culling,
    /// The same with numbers of its own for every point.
    Hierarchical,
    /// Selection and visibility roulette together.
    #[default]
    Joint,
}

impl Strategy {
    /// Whether it reads the visibility cache.
    pub fn needs_cache(self) -> bool {
        matches!(self, Strategy::Veach | Strategy::Nabata | Strategy::Residual | Strategy::Joint)
    }

    /// Whether it depends on lambda.
    pub fn needs_price(self) -> bool {
        !matches!(self, Strategy::Exact | Strategy::Veach | Strategy::Nabata)
    }
}

/// Settings of the sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StrategySettings {
    /// The strategy.
    pub strategy: Strategy,
    /// Dependence of coins.
    pub coins: Coins,
    /// Standard deviation per light of `culling` and `hierarchical`; `None`: the best for the picture.
    pub epsilon: Option<f32>,
}

/// The virtual lights of a pass and all that is known of them.
#[derive(Clone, Copy, Debug)]
pub struct ManyLights<'a> {
    /// The scene.
    pub world: World<'a>,
    /// The lights, in the order of the tree.
    pub vpls: &'a Vpls,
    /// Their hierarchy.
    pub tree: &'a VplTree,
    /// What cache points see, for strategies that ask.
    pub cache: Option<&'a VisibilityCache>,
    /// How far that can be believed.
    pub posterior: &'a Posterior,
    /// Squared ranges of the lights, for `culling`.
    pub ranges: &'a [f32],
    /// Settings.
    pub settings: StrategySettings,
    /// What rays cost and variance is worth.
    pub price: Price,
}

impl<'a> ManyLights<'a> {
    /// Lights without ranges; see the fields.
    pub fn new(
        world: World<'a>,
        vpls: &'a Vpls,
        tree: &'a VplTree,
        cache: Option<&'a VisibilityCache>,
        posterior: &'a Posterior,
        settings: StrategySettings,
        price: Price,
    ) -> Self {
        ManyLights { world, vpls, tree, cache, posterior, ranges: &[], settings, price }
    }

    /// Light that the receiver reflects of all virtual lights, times its weight.
    pub fn sum(&self, r: &Receiver, rng: &mut Sampler, tally: &mut Tally) -> Rgb {
        let [a, b, c, d] = rng.next_4d();
        let (select, check) = (refine(a, Vec2::new(c, d)), refine(b, Vec2::new(d, c)));
        if self.vpls.lights.is_empty() || r.reach <= 0.0 {
            return Rgb::ZERO;
        }
        let key = hash(select.to_bits(), check.to_bits());
        tally.begin(self.vpls.lights.len());
        let near = self.cache.map(|cache| cache.neighbours(r.at.p, r.normal()));
        let sum = match self.settings.coins {
            Coins::Systematic => {
                self.sum_with(r, near.as_ref(), [Systematic::new(select), Systematic::new(check)], key, tally)
            }
            Coins::Independent => {
                self.sum_with(r, near.as_ref(), [Independent::new(key), Independent::new(!key)], key, tally)
            }
        };
        tally.end(mean(sum));
        if let Some(near) = &near {
            tally.note(self.posterior, near.surrounding);
        }
        sum
    }

    /// The sum with given coins: of selection and of visibility.
    fn sum_with<C: Coin>(
        &self,
        r: &Receiver,
        near: Option<&Neighbours>,
        [mut select, mut check]: [C; 2],
        key: u64,
        tally: &mut Tally,
    ) -> Rgb {
        let nothing = Neighbours::default();
        let near = near.unwrap_or(&nothing);
        match self.settings.strategy {
            Strategy::Culling => self.culled(r, tally),
            Strategy::Hierarchical => self.hierarchical(r, key, tally),
            Strategy::Joint => self.joint(r, near, &mut select, &mut check, tally),
            _ => self.flat(r, near, &mut check, tally),
        }
    }

    /// Sum over all lights one by one.
    fn flat<C: Coin>(&self, r: &Receiver, near: &Neighbours, check: &mut C, tally: &mut Tally) -> Rgb {
        let mut sum = Rgb::ZERO;
        for (i, light) in self.vpls.lights.iter().enumerate() {
            tally.looks += 1;
            let t = r.tentative(self.vpls, light);
            if t == Rgb::ZERO {
                continue;
            }
            let (rule, case) = self.flat_rule(r, near, i, mean(t));
            let checked = check.toss(rule.u);
            sum += self.term(r, i, t, &rule, checked, case, tally);
        }
        sum
    }

    /// Roulette of a light of tentative contribution `size`, and the agreement of the cache points that were asked.
    #[inline]
    fn flat_rule(&self, r: &Receiver, near: &Neighbours, i: usize, size: f32) -> (ResidualRoulette, Option<usize>) {
        // The cache points' mean is that of a white surface, whose f is 1 / pi.
        let local = near.mean * r.reach * std::f32::consts::PI;
        let sigma2 = near.kappa * local * local;
        let n0 = 1.0 + r.eye_rays as f32 / self.vpls.lights.len() as f32;
        match self.settings.strategy {
            Strategy::Veach => (veach::roulette(size, sigma2, n0), None),
            Strategy::Nabata => {
                let (visible, telling) = self.votes(near, i);
                (nabata::roulette(size, visible, telling, sigma2, n0), Some(agreement(visible, telling)))
            }
            Strategy::Residual => {
                let of = self.agreement(near, i);
                let known = self.posterior.predictions(near.surrounding);
                (residual::roulette(size, &known[of], &self.price), Some(of))
            }
            _ => (exact::roulette(), None),
        }
    }

    fn votes(&self, near: &Neighbours, light: usize) -> (u32, u32) {
        self.cache.map_or((0, 0), |cache| cache.votes(near, light))
    }

    fn agreement(&self, near: &Neighbours, light: usize) -> usize {
        self.cache.map_or(0, |cache| cache.agreement(near, light))
    }

    /// The estimate of a selected light's contribution `t`; `case`: its agreement, where cache points were asked.
    #[expect(clippy::too_many_arguments)]
    #[inline]
    fn term(
        &self,
        r: &Receiver,
        light: usize,
        t: Rgb,
        rule: &ResidualRoulette,
        checked: bool,
        case: Option<usize>,
        tally: &mut Tally,
    ) -> Rgb {
        tally.pairs += 1;
        tally.certain += u64::from(rule.u >= 1.0);
        let floor = if self.settings.strategy == Strategy::Nabata { nabata::EPSILON_2 } else { LEAST_CHECK };
        tally.floored += u64::from(rule.u <= floor);
        t * rule.estimate(true, checked, || self.visible(r, light, mean(t), rule, case, tally))
    }

    /// What a shadow ray finds; the light's tentative contribution is of the size `t`.
    fn visible(
        &self,
        r: &Receiver,
        light: usize,
        t: f32,
        rule: &ResidualRoulette,
        case: Option<usize>,
        tally: &mut Tally,
    ) -> f32 {
        let d = self.vpls.lights[light].p - r.at.p;
        let distance = d.length();
        let ray = self.world.shadow_ray(r.at, d / distance, distance);
        let v = self.world.transmittance(ray, false).share;
        tally.ray(t, rule, v, case);
        v
    }
}
