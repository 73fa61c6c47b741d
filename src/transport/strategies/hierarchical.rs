//! Hierarchical Russian roulette: stochastic culling with numbers of its own for every point.
//!
//! ```text
//! m = 1 - (1 - U)^(1/n)                               the least of n independent uniform numbers
//! children of a, b lights: with probability a/n the left has m, the right 1 - (1 - m) (1 - U)^(1/b); else the other way round
//! descend while m <= largest p_i of the node at x;  in a leaf every light has its xi: keep iff xi_i <= p_i, weight 1 / p_i
//! ```
//!
//! p_i is that of [`super::culling`]. The numbers of all lights are independent and uniform although most of them are never made; errors of
//! neighbouring pixels do not depend on each other, so that they look like noise.
//! Bias: none. Source: Tokuyoshi & Harada 2019; METHODS 2.B. Verified by `tests` (z-test).

use super::culling::{inverse_alpha, survival, two_epsilon};
use super::{ManyLights, Receiver, Tally};
use crate::math::sampler::{hash, unit_f32};
use crate::math::{ResidualRoulette, Rgb};
use crate::transport::vpl_tree::LEAF;

/// Numbers one after the other.
struct Numbers {
    key: u64,
    count: u64,
}

impl Numbers {
    fn next(&mut self) -> f32 {
        self.count += 1;
        unit_f32(hash(self.key, self.count))
    }

    /// The least of `n` uniform numbers above `from`.
    fn least(&mut self, n: u32, from: f32) -> f32 {
        1.0 - (1.0 - from) * (1.0 - self.next()).powf(1.0 / n as f32)
    }
}

impl ManyLights<'_> {
    /// Sum over the lights that survive at this point; `key` decides.
    pub(super) fn hierarchical(&self, r: &Receiver, key: u64, tally: &mut Tally) -> Rgb {
        let two_epsilon = two_epsilon(self.settings.epsilon, &self.price);
        let mut numbers = Numbers { key, count: 0 };
        let mut sum = Rgb::ZERO;
        let Some(root) = self.tree.nodes().first() else { return sum };
        let mut waiting = vec![(0u32, numbers.least(root.count, 0.0))];
        while let Some((index, m)) = waiting.pop() {
            let node = &self.tree.nodes()[index as usize];
            tally.nodes += 1;
            let most = inverse_alpha(node.strength(), two_epsilon) / node.distance2(r.at.p);
            // A little above the lights' own: rounding must not cut.
            if m > most * 1.0001 {
                continue;
            }
            if node.is_leaf() {
                let heir = ((numbers.next() * node.count as f32) as u32).min(node.count - 1);
                let mut xi = [0.0; LEAF];
                for k in 0..node.count {
                    xi[k as usize] = if k == heir { m } else { numbers.least(1, m) };
                }
                for (k, i) in (node.first as usize..(node.first + node.count) as usize).enumerate() {
                    let light = &self.vpls.lights[i];
                    let p = survival(light, (light.p - r.at.p).length_squared(), two_epsilon);
                    if xi[k] > p {
                        continue;
                    }
                    tally.looks += 1;
                    let t = r.tentative(self.vpls, light);
                    if t != Rgb::ZERO {
                        sum += self.term(r, i, t, &ResidualRoulette { pi: p, q: 0.0, u: 1.0 }, true, None, tally);
                    }
                }
                continue;
            }
            let [a, b] = self.tree.children(index);
            let counts = [a, b].map(|c| self.tree.nodes()[c as usize].count);
            let left_inherits = numbers.next() * (node.count as f32) < counts[0] as f32;
            let (heir, other, n) = if left_inherits { (a, b, counts[1]) } else { (b, a, counts[0]) };
            waiting.push((heir, m));
            let rest = numbers.least(n, m);
            waiting.push((other, rest));
        }
        sum
    }
}
