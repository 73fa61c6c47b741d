//! Coins: decisions with given probabilities, independent or systematic.
//!
//! Systematic coins share one uniform number: the probabilities are laid one after the other on a line, and a coin is heads if one of the points
//! offset, offset + 1, offset + 2, ... lies in its piece. Each is heads with its probability, so that means stay; the number of heads among any
//! neighbours varies by less than one, so that where neighbours are alike (lights in the order of their tree) variance falls (by 1.66 in METHODS 1.B).
//! Bias: none. Verified by the tests of [`super`]: integrated between breakpoints.

use crate::math::sampler::{hash, unit_f32};

/// How coins of one sum depend on each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coins {
    /// Not at all.
    Independent,
    /// One number for all of them.
    #[default]
    Systematic,
}

/// Decides with given probabilities.
pub trait Coin {
    /// Heads with probability `p`.
    fn toss(&mut self, p: f32) -> bool;

    /// Heads among `n` coins of probability `p` < 1 each: calls `heads` with their indices, in order.
    fn toss_many(&mut self, n: u32, p: f32, heads: &mut impl FnMut(u32));
}

/// Coins that do not depend on each other.
#[derive(Clone, Debug)]
pub struct Independent {
    key: u64,
    count: u64,
}

impl Independent {
    /// Coins keyed by `key`.
    pub fn new(key: u64) -> Self {
        Independent { key, count: 0 }
    }

    fn next(&mut self) -> f32 {
        self.count += 1;
        unit_f32(hash(self.key, self.count))
    }
}

impl Coin for Independent {
    #[inline]
    fn toss(&mut self, p: f32) -> bool {
        p >= 1.0 || self.next() < p
    }

    fn toss_many(&mut self, n: u32, p: f32, heads: &mut impl FnMut(u32)) {
        // Tails before the next heads are geometrically distributed. A number of 24 bits has its middle taken: never 0.
        let scale = 1.0 / f64::ln_1p(-f64::from(p));
        let mut at = -1.0;
        loop {
            let u = f64::from(self.next()) + 0.5 / f64::from(1 << 24);
            at += 1.0 + (u.ln() * scale).floor();
            if at >= f64::from(n) {
                return;
            }
            heads(at as u32);
        }
    }
}

/// Coins along a line.
#[derive(Clone, Debug)]
pub struct Systematic {
    sum: f64,
    next: f64,
}

impl Systematic {
    /// Coins with the offset `u` in [0, 1).
    pub fn new(u: f64) -> Self {
        Systematic { sum: 0.0, next: 1.0 - u }
    }
}

impl Coin for Systematic {
    #[inline]
    fn toss(&mut self, p: f32) -> bool {
        if p >= 1.0 {
            return true;
        }
        self.sum += f64::from(p);
        let heads = self.sum >= self.next;
        if heads {
            self.next += 1.0;
        }
        heads
    }

    fn toss_many(&mut self, n: u32, p: f32, heads: &mut impl FnMut(u32)) {
        let p = f64::from(p);
        let end = self.sum + f64::from(n) * p;
        if self.next <= end {
            let inverse = 1.0 / p;
            while self.next <= end {
                heads((((self.next - self.sum) * inverse) as u32).min(n - 1));
                self.next += 1.0;
            }
        }
        self.sum = end;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_coins_are_heads_with_their_probability_each() {
        let runs = 40_000u64;
        for p in [0.003f32, 0.2, 0.7] {
            for systematic in [false, true] {
                let mut counts = [0u32; 13];
                for i in 0..runs {
                    let mut note = |k: u32| counts[k as usize] += 1;
                    let u = unit_f32(hash(9, i));
                    match systematic {
                        true => Systematic::new(f64::from(u)).toss_many(13, p, &mut note),
                        false => Independent::new(i).toss_many(13, p, &mut note),
                    }
                }
                // Each count is binomial: five standard deviations.
                let limit = 5.0 * (runs as f64 * f64::from(p) * f64::from(1.0 - p)).sqrt();
                for (k, &n) in counts.iter().enumerate() {
                    let off = f64::from(n) - runs as f64 * f64::from(p);
                    assert!(off.abs() < limit, "{p}, systematic {systematic}, coin {k}: {off}");
                }
            }
        }
    }

    #[test]
    fn many_systematic_coins_are_those_tossed_one_by_one() {
        for i in 0..2000u64 {
            let u = f64::from(unit_f32(hash(3, i)));
            let (mut one, mut many) = (Systematic::new(u), Systematic::new(u));
            for (n, p) in [(5, 0.3f32), (17, 0.01), (1, 0.9), (8, 0.125)] {
                let single: Vec<u32> = (0..n).filter(|_| one.toss(p)).collect();
                let mut heads = Vec::new();
                many.toss_many(n, p, &mut |k| heads.push(k));
                // Where a point falls on a border to the last bit, either side may have it.
                assert!(single == heads || single.len().abs_diff(heads.len()) <= 1, "{u} {n} {p}");
            }
            assert_eq!(one.next, many.next, "{u}");
        }
    }
}
