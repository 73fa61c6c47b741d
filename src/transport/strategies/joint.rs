//! Joint selection and visibility roulette over the hierarchy of lights (ours).
//!
//! ```text
//! group of n lights, bound b(x) of each, share f of them seen by the nearest cache points:
//!     pi = closed form of ResidualRoulette::joint for t = b, E v^2 = f, R = that of the posterior
//! descend while n pi > 1;  else each of its lights is looked at with probability pi, weight 1 / pi
//! light looked at: t exact, q and R of its own case, u = min(1, t/pi sqrt(R / (lambda c_v)))
//! ```
//!
//! Lights are selected in proportion to what they may visibly contribute; a ray is spent only where the cache is unsure. In leaves that are large
//! contributors every light is looked at (pi = 1). With systematic coins the groups of the cut lie one after the other on a line, so one number
//! chooses all lights of a point, spread evenly over space, at no cost for the groups that are passed over.
//! What has been looked at is not thrown away again: its cost is spent, so the second coin decides on the ray alone.
//! Bias: none. Source: METHODS 1.B (joint optimum), 2.B (thinning through node bounds). Verified by `tests`.

use super::coins::Coin;
use super::{ManyLights, Receiver, Tally};
use crate::math::{Prediction, ResidualRoulette, Rgb};
use crate::transport::visibility::Neighbours;

/// Expected number of lights looked at, above which a group is opened.
const OPEN: f32 = 1.0;
/// Least share of visible lights that is believed of a group.
const LEAST_SHARE: f32 = 0.03;
/// Residual of a group's lights over the share that is visible: before single ones are looked at.
const UNSURE: f32 = 0.15;

impl ManyLights<'_> {
    /// Sum over lights selected by `select`, their visibility checked as `check` says.
    pub(super) fn joint<C: Coin>(
        &self,
        r: &Receiver,
        near: &Neighbours,
        select: &mut C,
        check: &mut C,
        tally: &mut Tally,
    ) -> Rgb {
        let mut sum = Rgb::ZERO;
        let known = self.posterior.predictions(near.surrounding);
        let mut waiting: Vec<u32> = Vec::with_capacity(64);
        waiting.push(0);
        while let Some(index) = waiting.pop() {
            let node = &self.tree.nodes()[index as usize];
            tally.nodes += 1;
            let bound = node.bound(r.at.p, r.horizon, r.reach);
            if bound <= 0.0 {
                continue;
            }
            let [visible, telling] = self.tree.seen(index, &near.points);
            // As if one half of one more light had been seen.
            let share = ((visible as f32 + 0.5) / (telling as f32 + 1.0)).max(LEAST_SHARE);
            let group = Prediction { q: share, square: share, residual: share * UNSURE };
            let pi = ResidualRoulette::joint(bound, &group, &self.price).pi;
            let mut look = |i: usize, pi: f32, check: &mut C, tally: &mut Tally| {
                tally.looks += 1;
                let t = r.tentative(self.vpls, &self.vpls.lights[i]);
                if t == Rgb::ZERO {
                    return;
                }
                let case = self.agreement(near, i);
                let rule = ResidualRoulette::residual(super::mean(t), pi, &known[case], &self.price);
                let checked = check.toss(rule.u);
                sum += self.term(r, i, t, &rule, checked, Some(case), tally);
            };
            if node.count as f32 * pi <= OPEN {
                select.toss_many(node.count, pi, &mut |k| look((node.first + k) as usize, pi, check, tally));
            } else if node.is_leaf() {
                (node.first..node.first + node.count).for_each(|i| look(i as usize, 1.0, check, tally));
            } else {
                let [a, b] = self.tree.children(index);
                waiting.extend([b, a]);
            }
        }
        sum
    }
}
