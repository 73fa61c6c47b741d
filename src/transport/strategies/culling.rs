//! Stochastic light culling: each light has a random range, the same for all points.
//!
//! ```text
//! p_i(l) = min(1, 1 / (l^2 alpha_i)),   alpha_i = 2 pi eps_max / (E I_i)      I_i: largest radiant intensity, E: exposure (1 here)
//! r_i^2  = 1 / (alpha_i xi_i),          alive iff l < r_i, weight 1 / p_i(l)
//! ```
//!
//! One xi_i in (0, 1] per light and pass, so that the lights in range are found in the hierarchy by distance alone. Beyond the inner radius a living
//! light returns 2 eps_max cos at most: eps_max bounds the standard deviation per light. If it is not given, 2 eps_max = sqrt(lambda (c_s + c_v)): the
//! probability is then the best one for a light that is visible and faces the point (METHODS 2.B).
//! Bias        none; errors of one pass are the same everywhere in the picture (shared xi) and change from pass to pass
//! Source      Tokuyoshi & Harada 2016. Verified by `tests`: integral over xi between breakpoints; bound of the deviation

use super::{ManyLights, Receiver, Tally};
use crate::math::sampler::hash;
use crate::math::{Price, ResidualRoulette, Rgb};
use crate::transport::vpl::{Vpl, Vpls};
use std::f32::consts::PI;

/// Separates the lights' numbers from others.
const STREAM: u64 = 0x6375_6c6c; // "cull"

/// 2 eps_max.
pub fn two_epsilon(given: Option<f32>, price: &Price) -> f32 {
    given.map_or_else(|| (price.lambda * (price.look + price.check)).sqrt(), |e| 2.0 * e)
}

/// 1 / alpha of a light of largest intensity `strength`.
#[inline]
pub fn inverse_alpha(strength: f32, two_epsilon: f32) -> f32 {
    strength / (PI * two_epsilon).max(f32::MIN_POSITIVE)
}

/// Probability that a light lives at the squared distance `d2`.
#[inline]
pub fn survival(light: &Vpl, d2: f32, two_epsilon: f32) -> f32 {
    (inverse_alpha(light.strength, two_epsilon) / d2).min(1.0)
}

/// Squared ranges of all lights in a pass; `key` says which.
pub fn ranges(vpls: &Vpls, two_epsilon: f32, key: u64) -> Vec<f32> {
    let xi = |i: usize| ((hash(key ^ STREAM, i as u64) >> 40) + 1) as f32 / (1u64 << 24) as f32;
    vpls.lights.iter().enumerate().map(|(i, l)| inverse_alpha(l.strength, two_epsilon) / xi(i)).collect()
}

impl ManyLights<'_> {
    /// Sum over the lights in range.
    pub(super) fn culled(&self, r: &Receiver, tally: &mut Tally) -> Rgb {
        let mut sum = Rgb::ZERO;
        let two_epsilon = two_epsilon(self.settings.epsilon, &self.price);
        let mut waiting = vec![0u32];
        while let Some(index) = waiting.pop() {
            let node = &self.tree.nodes()[index as usize];
            tally.nodes += 1;
            if !node.in_range(r.at.p) {
                continue;
            }
            if !node.is_leaf() {
                waiting.extend(self.tree.children(index));
                continue;
            }
            for i in node.first as usize..(node.first + node.count) as usize {
                let light = &self.vpls.lights[i];
                let d2 = (light.p - r.at.p).length_squared();
                if d2 >= self.ranges[i] {
                    continue;
                }
                tally.looks += 1;
                let t = r.tentative(self.vpls, light);
                if t != Rgb::ZERO {
                    let rule = ResidualRoulette { pi: survival(light, d2, two_epsilon), q: 0.0, u: 1.0 };
                    sum += self.term(r, i, t, &rule, true, None, tally);
                }
            }
        }
        sum
    }
}
