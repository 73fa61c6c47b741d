//! Lights that have been selected, looked at eight at a time.
//!
//! ```text
//! t: tentative contribution, q and R: of its case,   u = min(1, t/pi sqrt(R / (lambda c_v)))
//! X = [q + (v - q) B/u] / pi                         what the light adds is t X
//! ```
//!
//! The rule is that of [`ResidualRoulette::residual`]. Lights are gathered from their places, eight lines of memory at once; contributions and
//! probabilities are computed side by side, coins are tossed one after the other, in the order of the selection.
//! Bias: none. Verified by `tests`: as [`super::joint`]; lanes against single lights.

use super::coins::Coin;
use super::{ManyLights, Receiver, Tally};
use crate::math::residual_roulette::LEAST_CHECK;
use crate::math::{ResidualRoulette, Rgb};
use crate::transport::eight::{WIDTH, Wide, lanes, total};
use crate::transport::visibility::Neighbours;

/// Lights looked at by one point, typically: what is allocated beforehand.
const TYPICAL: usize = 512;

/// Selected lights.
#[derive(Debug)]
pub(super) struct Chosen {
    lights: Vec<u32>,
    /// Probability of selection of each.
    pi: Vec<f32>,
}

impl Default for Chosen {
    fn default() -> Self {
        Chosen { lights: Vec::with_capacity(TYPICAL), pi: Vec::with_capacity(TYPICAL) }
    }
}

impl Chosen {
    #[inline(always)]
    pub(super) fn push(&mut self, light: u32, pi: f32) {
        self.lights.push(light);
        self.pi.push(pi);
    }
}

impl ManyLights<'_> {
    /// Sum over selected lights, their visibility checked as `check` says.
    #[inline(always)]
    pub(super) fn look_at<C: Coin, W: Wide>(
        &self,
        r: &Receiver,
        near: &Neighbours,
        chosen: &Chosen,
        check: &mut C,
        tally: &mut Tally,
    ) -> Rgb {
        tally.looks += chosen.lights.len() as u64;
        let known = self.posterior.predictions(near.surrounding);
        let (predicted, rates) = (known.map(|k| k.q), known.map(|k| k.check_rate(&self.price)));
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        let mut sum = [zero; 3];
        for (lights, pis) in chosen.lights.chunks(WIDTH).zip(chosen.pi.chunks(WIDTH)) {
            // Lanes too many repeat the first light and are not asked.
            let (mut indices, mut pi) = ([lights[0]; WIDTH], [1.0; WIDTH]);
            indices[..lights.len()].copy_from_slice(lights);
            pi[..lights.len()].copy_from_slice(pis);
            let t = r.tentative_eight::<W>(self.vpls, &indices);
            let [red, green, blue] = [W::load(&t[0]), W::load(&t[1]), W::load(&t[2])];
            let size = red.plus(green).plus(blue).times(W::splat(1.0 / 3.0));
            let mut lit = W::bits(zero.below(size)) & ((1u32 << lights.len()) - 1);
            if lit == 0 {
                continue;
            }
            let (mut case, mut q, mut rate) = ([0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
            for k in 0..WIDTH {
                case[k] = self.agreement(near, indices[k] as usize);
                (q[k], rate[k]) = (predicted[case[k]], rates[case[k]]);
            }
            let over_pi = W::load(&lanes(&pi));
            let u = size.over(over_pi).times(W::load(&lanes(&rate))).smaller(one).larger(W::splat(LEAST_CHECK));
            tally.pairs += u64::from(lit.count_ones());
            tally.certain += u64::from((W::bits(one.at_most(u)) & lit).count_ones());
            tally.floored += u64::from((W::bits(u.at_most(W::splat(LEAST_CHECK))) & lit).count_ones());
            let (u, size, unchecked) = (u.store(), size.store(), W::load(&lanes(&q)).over(over_pi).store());
            let mut x = [0.0; WIDTH];
            while lit != 0 {
                let k = lit.trailing_zeros() as usize;
                lit &= lit - 1;
                let rule = ResidualRoulette { pi: pi[k], q: q[k], u: u[k / 4][k % 4] };
                x[k] = if check.toss(rule.u) {
                    let (light, size) = (indices[k] as usize, size[k / 4][k % 4]);
                    rule.estimate(true, true, || self.visible(r, light, size, &rule, Some(case[k]), tally))
                } else {
                    unchecked[k / 4][k % 4]
                };
            }
            let x = W::load(&lanes(&x));
            sum = [sum[0].plus(red.times(x)), sum[1].plus(green.times(x)), sum[2].plus(blue.times(x))];
        }
        Rgb::new(total(sum[0].store()), total(sum[1].store()), total(sum[2].store()))
    }
}
