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
//! Groups are asked and lights are looked at eight at a time ([`super::looks`]), by AVX2 where there is it: the same bits either way.
//! What has been looked at is not thrown away again: its cost is spent, so the second coin decides on the ray alone.
//! Bias: none. Source: METHODS 1.B (joint optimum), 2.B (thinning through node bounds). Verified by `tests`.

use super::coins::Coin;
use super::looks::Chosen;
use super::{ManyLights, Receiver, Tally};
use crate::math::Rgb;
use crate::math::residual_roulette::LEAST_SELECTION;
use crate::transport::eight::{Eight, WIDTH, Wide};
use crate::transport::visibility::Neighbours;
use crate::transport::vpl_tree::groups::{Groups, LEAF_GROUP, Point, Sorted};
use arrayvec::ArrayVec;

/// Expected number of lights looked at, by bounds, above which a group is opened. Bounds are several times what lights contribute; from 2 to 64 the
/// error of a box hardly changes, while fewer groups are asked and more lights looked at: error x time is flat from 32 on.
pub(super) const OPEN: f32 = 32.0;
/// r: residual of a group's lights over the share that is visible, before single ones are looked at.
const UNSURE: f32 = 0.15;
/// Largest probability of a look that leaves one to chance.
const MOST_CHANCE: f32 = 0.99;

/// What is to be done with a group of lights.
pub(super) enum Group {
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
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("popcnt") {
            // SAFETY: the processor has what the function enables.
            return unsafe { self.joint_avx2(r, near, select, check, tally) };
        }
        self.joint_by::<C, Eight>(r, near, select, check, tally)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,popcnt")]
    fn joint_avx2<C: Coin>(
        &self,
        r: &Receiver,
        near: &Neighbours,
        select: &mut C,
        check: &mut C,
        tally: &mut Tally,
    ) -> Rgb {
        self.joint_by::<C, crate::transport::eight::Avx2>(r, near, select, check, tally)
    }

    /// The same by the lanes of `W`.
    #[inline(always)]
    pub(super) fn joint_by<C: Coin, W: Wide>(
        &self,
        r: &Receiver,
        near: &Neighbours,
        select: &mut C,
        check: &mut C,
        tally: &mut Tally,
    ) -> Rgb {
        let chosen = self.choose::<C, W>(r, near, select, tally);
        self.look_at::<C, W>(r, near, &chosen, check, tally)
    }

    /// The lights that are looked at.
    #[inline(always)]
    fn choose<C: Coin, W: Wide>(&self, r: &Receiver, near: &Neighbours, select: &mut C, tally: &mut Tally) -> Chosen {
        let groups = self.tree.groups();
        let nodes = groups.nodes();
        let seen = groups.seen(near.points.first().copied());
        let (scale, open) = (W::splat(self.selection_scale()), W::splat(OPEN));
        let at = Point::<W>::new(r.at.p, r.horizon, r.reach);
        let mut chosen = Chosen::default();
        let mut waiting = ArrayVec::<u32, MOST_WAITING>::new();
        waiting.extend((!nodes.is_empty()).then_some(0));
        while let Some(index) = waiting.pop() {
            let node = &nodes[index as usize];
            tally.nodes += u64::from(node.used.count_ones());
            let sorted = node.sort(&at, &seen[index as usize], scale, open);
            let room = waiting.remaining_capacity() >= WIDTH;
            let (mut lit, mut inner) = (sorted.lit, 0u32);
            while lit != 0 {
                let lane = lit.trailing_zeros() as usize;
                lit &= lit - 1;
                match group(node, &sorted, lane, room) {
                    Group::Open => inner |= 1 << lane,
                    Group::All => (0..node.count[lane]).for_each(|k| chosen.push(node.first[lane] + k, 1.0)),
                    Group::Some(pi) => {
                        select.toss_many(node.count[lane], pi, &mut |k| chosen.push(node.first[lane] + k, pi));
                    }
                }
            }
            while inner != 0 {
                // The first one is to be taken next.
                let lane = inner.ilog2();
                inner ^= 1 << lane;
                waiting.push(node.within[lane as usize]);
            }
        }
        chosen
    }

    /// Probability of selection per contribution, where all is visible.
    pub(super) fn selection_scale(&self) -> f32 {
        ((1.0 - UNSURE) / (self.price.lambda * self.price.look)).sqrt()
    }
}

/// What becomes of a group that something may come from; `room`: whether its children may wait.
#[inline(always)]
pub(super) fn group(node: &Groups, sorted: &Sorted, lane: usize, room: bool) -> Group {
    let many = sorted.many >> lane & 1 == 1;
    if many && node.within[lane] != LEAF_GROUP && room {
        Group::Open
    } else if many && sorted.sure >> lane & 1 == 1 {
        Group::All
    } else {
        Group::Some(sorted.pi[lane / 4][lane % 4].clamp(LEAST_SELECTION, MOST_CHANCE))
    }
}
