//! Joint selection and visibility roulette over the hierarchy of lights (ours).
//!
//! ```text
//! group of n lights, bound b(x) and typical contribution a(x) of each, share f of them seen by the nearest cache point:
//!     pi(t) = t sqrt(f (1 - r) / (lambda c_s))       closed form of ResidualRoulette::joint for E v^2 = f, R = r f, where u < 1
//! descend while n pi(b) > [`OPEN`];  else each of its lights is looked at with probability pi(a), weight 1 / pi(a)
//! light looked at: t exact, q and R of its own case, u = min(1, t/pi sqrt(R / (lambda c_v)))
//! ```
//!
//! Lights are selected in proportion to what they may visibly contribute; a ray is spent only where the cache is unsure. In leaves that are large
//! contributors (pi(b) >= 1) every light is looked at. With systematic coins the groups of the cut lie one after the other on a line, so one number
//! chooses all lights of a point, spread evenly over space, at no cost for the groups that are passed over.
//! What has been looked at is not thrown away again: its cost is spent, so the second coin decides on the ray alone.
//! Bias: none. Source: METHODS 1.B (joint optimum), 2.B (thinning through node bounds). Verified by `tests`.

use super::coins::Coin;
use super::{ManyLights, Receiver, Tally};
use crate::math::residual_roulette::LEAST_SELECTION;
use crate::math::{ResidualRoulette, Rgb};
use crate::transport::visibility::Neighbours;
use arrayvec::ArrayVec;

/// Expected number of lights looked at, by bounds, above which a group is opened. Bounds are several times what lights contribute; from 2 to 64 the
/// error of a box hardly changes, while fewer groups are asked and more lights looked at: error x time is flat from 32 on.
const OPEN: f32 = 32.0;
/// r: residual of a group's lights over the share that is visible, before single ones are looked at.
const UNSURE: f32 = 0.15;
/// What is to be done with a group of lights.
pub(super) enum Group {
    /// Nothing comes from it.
    Dark,
    /// Its children are asked.
    Open,
    /// Every light is looked at.
    All,
    /// Each light is looked at with this probability.
    Some(f32),
}

/// Groups that wait at a time: more than the tree can be deep.
const MOST_WAITING: usize = 512;

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
        let known = self.posterior.predictions(near.surrounding).each_ref().map(|k| (k.q, k.check_rate(&self.price)));
        let seen = self.tree.seen(near.points.first().copied());
        let scale = self.selection_scale();
        let mut waiting = ArrayVec::<u32, MOST_WAITING>::new();
        waiting.push(0);
        while let Some(index) = waiting.pop() {
            let node = &self.tree.nodes()[index as usize];
            tally.nodes += 1;
            let mut look = |i: usize, pi: f32, check: &mut C, tally: &mut Tally| {
                tally.looks += 1;
                let t = r.tentative(self.vpls, &self.vpls.lights[i]);
                if t == Rgb::ZERO {
                    return;
                }
                let case = self.agreement(near, i);
                let (q, rate) = known[case];
                let rule = ResidualRoulette::residual_at_rate(super::mean(t), pi, q, rate);
                let checked = check.toss(rule.u);
                sum += self.term(r, i, t, &rule, checked, Some(case), tally);
            };
            match self.group(index, r, seen, scale, waiting.remaining_capacity() >= 2) {
                Group::Dark => {}
                Group::Open => {
                    let [a, b] = self.tree.children(index);
                    waiting.push(b);
                    waiting.push(a);
                }
                Group::All => (node.first..node.first + node.count).for_each(|i| look(i as usize, 1.0, check, tally)),
                Group::Some(pi) => {
                    select.toss_many(node.count, pi, &mut |k| look((node.first + k) as usize, pi, check, tally));
                }
            }
        }
        sum
    }

    /// Probability of selection per contribution, where all is visible.
    pub(super) fn selection_scale(&self) -> f32 {
        ((1.0 - UNSURE) / (self.price.lambda * self.price.look)).sqrt()
    }

    /// What becomes of a group; `seen`: of all groups, by the nearest cache point; `room`: whether its children may wait.
    #[inline]
    pub(super) fn group(&self, index: u32, r: &Receiver, seen: &[f32], scale: f32, room: bool) -> Group {
        let node = &self.tree.nodes()[index as usize];
        let (bound, aspect) = node.bound(r.at.p, r.horizon, r.reach);
        if bound <= 0.0 {
            return Group::Dark;
        }
        let scale = scale * seen.get(index as usize).copied().unwrap_or(1.0);
        let most = bound * scale;
        let opened = node.count as f32 * most > OPEN;
        if opened && !node.is_leaf() && room {
            Group::Open
        } else if opened && most >= 1.0 {
            Group::All
        } else {
            Group::Some((node.typical(bound, &aspect) * scale).clamp(LEAST_SELECTION, 0.99))
        }
    }
}
