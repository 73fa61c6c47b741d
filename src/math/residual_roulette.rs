//! Residual roulette: predict, then check the prediction by chance.
//!
//! ```text
//! X = K/pi [ q + (v - q) B/u ]       K ~ Bernoulli(pi), B ~ Bernoulli(u), K and B independent of v, B of K
//! E X   = v                                                     for any prediction q, any pi, u in (0, 1]
//! E X^2 = [ v^2 + (v - q)^2 (1/u - 1) ] / pi
//! cost  = pi (c_s + u c_v)           c_s: to look at the term and predict, c_v: to find out v
//! ```
//!
//! v may be any number: 0 or 1 for visibility, what masks let through, radiance. A wrong prediction costs variance, never bias, as long
//! as pi > 0 and u > 0. With q = 0 and pi = 1 it is Veach's roulette (1997, section 10.4), with pi = 1 that of Nabata et al. (eq. 6, u = 1 - p),
//! with q = 0 and u = 1 stochastic light culling (Tokuyoshi & Harada 2016).
//!
//! Best values: the terms t_i v_i of a sum whose variance S and cost C, all else included, are to have the least product S C obey one number,
//! lambda = S / C. With m = E v^2 and R = E (v - q)^2 at best knowledge before v is found out:
//!
//! ```text
//! pi given:  u = min(1, t/pi sqrt(R / (lambda c_v)))                                               (METHODS 1.B for pi = 1)
//! both free: u = min(1, sqrt(c_s/c_v R / (m - R))),  pi = t sqrt((m - R) / (lambda c_s))           if u < 1
//!                                                    pi = t sqrt(m / (lambda (c_s + c_v)))         if u = 1
//!            where that gives pi >= 1: pi = 1 and u as above
//! ```
//!
//! Measure     probabilities
//! Bias        none; a prediction of exactly nothing (m = 0) keeps the floors [`LEAST_SELECTION`] and [`LEAST_CHECK`]
//! Not handled dependence between the coins of several terms: it changes the variance of their sum, not its mean
//! Verified by tests in this file: enumeration of both coins, formulas against grid search

/// Lowest probability of a check that the rules below give; the traced value then stays within 50 of the prediction.
pub const LEAST_CHECK: f32 = 0.02;
/// Lowest probability of selection that [`ResidualRoulette::joint`] gives.
pub const LEAST_SELECTION: f32 = 1e-4;

/// The probabilities and the prediction for one term. `pi` and `u` lie in (0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualRoulette {
    /// Probability that the term is looked at.
    pub pi: f32,
    /// Prediction of its value.
    pub q: f32,
    /// Probability that its value is found out, once it is looked at.
    pub u: f32,
}

/// What is known of a value before it is found out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction {
    /// The prediction q.
    pub q: f32,
    /// E v^2.
    pub square: f32,
    /// E (v - q)^2.
    pub residual: f32,
}

impl Prediction {
    /// Of a value that is 0 or 1, the latter with probability `q`: then E v^2 = q, and the residual is q (1 - q).
    pub fn of_probability(q: f32) -> Self {
        Prediction { q, square: q, residual: q * (1.0 - q) }
    }

    /// The best u of a term over its size t / pi.
    pub fn check_rate(&self, price: &Price) -> f32 {
        (self.residual / (price.lambda * price.check)).sqrt()
    }
}

/// What things cost, in any one unit, and what variance is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Price {
    /// Of looking at a term, c_s.
    pub look: f32,
    /// Of finding out its value, c_v.
    pub check: f32,
    /// Variance over cost of the whole estimate, lambda.
    pub lambda: f32,
}

impl ResidualRoulette {
    /// No chance at all: the value is always found out.
    pub const EXACT: ResidualRoulette = ResidualRoulette { pi: 1.0, q: 0.0, u: 1.0 };

    /// The value as it is, found out with probability `u`: no prediction.
    pub fn plain(u: f32) -> Self {
        ResidualRoulette { pi: 1.0, q: 0.0, u }
    }

    /// The check that is best for a term of size `t` >= 0, looked at with probability `pi`.
    pub fn residual(t: f32, pi: f32, known: &Prediction, price: &Price) -> Self {
        Self::residual_at_rate(t, pi, known.q, known.check_rate(price))
    }

    /// The same for the prediction `q`, whose [`Prediction::check_rate`] is `rate`: for many terms of few cases.
    #[inline]
    pub fn residual_at_rate(t: f32, pi: f32, q: f32, rate: f32) -> Self {
        ResidualRoulette { pi, q, u: bounded(t / pi * rate, LEAST_CHECK) }
    }

    /// The selection and the check that are best together for a term of size `t` >= 0.
    pub fn joint(t: f32, known: &Prediction, price: &Price) -> Self {
        let Prediction { square, residual, .. } = *known;
        let Price { look, check, lambda } = *price;
        let sure = (square - residual).max(0.0);
        let u = bounded((look / check * residual / sure).sqrt(), LEAST_CHECK);
        let pi =
            if u < 1.0 { t * (sure / (lambda * look)).sqrt() } else { t * (square / (lambda * (look + check))).sqrt() };
        if pi >= 1.0 {
            return Self::residual(t, 1.0, known, price);
        }
        ResidualRoulette { pi: bounded(pi, LEAST_SELECTION), q: known.q, u }
    }

    /// The estimate X of the value, for given coins: `selected` is K, `checked` is B. `truth` is asked only if both are heads.
    pub fn estimate(&self, selected: bool, checked: bool, truth: impl FnOnce() -> f32) -> f32 {
        match (selected, checked) {
            (false, _) => 0.0,
            (true, false) => self.q / self.pi,
            (true, true) => (self.q + (truth() - self.q) / self.u) / self.pi,
        }
    }

    /// E X^2 for the value `v`.
    pub fn second_moment(&self, v: f32) -> f64 {
        let [pi, q, u, v] = [self.pi, self.q, self.u, v].map(f64::from);
        (v * v + (v - q) * (v - q) * (1.0 / u - 1.0)) / pi
    }

    /// Variance of X for the value `v`; 0 without chance.
    pub fn variance(&self, v: f32) -> f64 {
        (self.second_moment(v) - f64::from(v) * f64::from(v)).max(0.0)
    }

    /// Expected cost.
    pub fn cost(&self, price: &Price) -> f64 {
        f64::from(self.pi) * (f64::from(price.look) + f64::from(self.u) * f64::from(price.check))
    }
}

/// `p` within `[least, 1]`; 1 for NaN (0 / 0: nothing is known, nothing is saved).
fn bounded(p: f32, least: f32) -> f32 {
    if p >= 1.0 || p.is_nan() { 1.0 } else { p.max(least) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32};

    /// Mean and mean square of X over the four outcomes of both coins.
    fn enumerated(r: &ResidualRoulette, v: f32) -> (f64, f64) {
        let mut sums = (0.0, 0.0);
        for (k, b) in [(false, false), (false, true), (true, false), (true, true)] {
            let p = |heads: bool, p: f32| if heads { f64::from(p) } else { 1.0 - f64::from(p) };
            let x = f64::from(r.estimate(k, b, || v));
            sums.0 += p(k, r.pi) * p(b, r.u) * x;
            sums.1 += p(k, r.pi) * p(b, r.u) * x * x;
        }
        sums
    }

    fn random(i: u64) -> impl FnMut() -> f32 {
        let mut k = 0;
        move || {
            k += 1;
            unit_f32(hash(i, k))
        }
    }

    #[test]
    fn any_prediction_and_any_probabilities_keep_the_mean() {
        for i in 0..2000 {
            let mut u = random(i);
            let r = ResidualRoulette { pi: 0.02 + 0.98 * u(), q: 3.0 * u() - 1.0, u: 0.02 + 0.98 * u() };
            let v = if i % 2 == 0 { f32::from(u() < 0.5) } else { 2.0 * u() };
            let (mean, square) = enumerated(&r, v);
            assert!((mean - f64::from(v)).abs() < 1e-4, "{r:?} {v}: {mean}");
            assert!((square / r.second_moment(v) - 1.0).abs() < 1e-4 || square < 1e-9, "{r:?} {v}: {square}");
            assert!((r.variance(v) - (square - mean * mean)).abs() < 1e-3 * (1.0 + square), "{r:?} {v}");
        }
    }

    #[test]
    fn a_wrong_weight_would_be_seen() {
        // The prediction is not corrected for the share of checks: what "always trust the cache" amounts to.
        let r = ResidualRoulette { pi: 1.0, q: 0.7, u: 0.1 };
        let wrong: f64 = [(0.9, 0.7), (0.1, 1.0)].iter().map(|(p, x)| p * x).sum();
        assert!((wrong - enumerated(&r, 1.0).0).abs() > 0.1);
    }

    #[test]
    fn truth_is_asked_only_when_both_coins_say_so() {
        let r = ResidualRoulette { pi: 0.5, q: 0.3, u: 0.5 };
        for (k, b) in [(false, false), (false, true), (true, false)] {
            r.estimate(k, b, || panic!("asked for nothing"));
        }
        assert_eq!(ResidualRoulette::EXACT.estimate(true, true, || 0.25), 0.25);
        assert_eq!(ResidualRoulette::EXACT.variance(1.0), 0.0);
    }

    /// What a pair of probabilities contributes to S + lambda C, whose stationary point the rules are.
    fn objective(t: f32, known: &Prediction, price: &Price, pi: f64, u: f64) -> f64 {
        let [t, square, residual] = [t, known.square, known.residual].map(f64::from);
        let moment = t * t * (square + residual * (1.0 / u - 1.0)) / pi;
        moment + f64::from(price.lambda) * pi * (f64::from(price.look) + u * f64::from(price.check))
    }

    #[test]
    fn the_joint_rule_is_the_best_of_a_grid() {
        let grid: Vec<f64> = (0..=300).map(|k| 10f64.powf(-4.0 * f64::from(k) / 300.0)).collect();
        for i in 0..60 {
            let mut u = random(1000 + i);
            let known = Prediction::of_probability(0.03 + 0.94 * u());
            let price = Price { look: 10f32.powf(-2.0 * u()), check: 1.0, lambda: 10f32.powf(2.0 * u() - 1.0) };
            let t = 10f32.powf(3.0 * u() - 2.0);
            let r = ResidualRoulette::joint(t, &known, &price);
            let ours = objective(t, &known, &price, f64::from(r.pi), f64::from(r.u));
            let checks = || grid.iter().copied().filter(|&u| u >= f64::from(LEAST_CHECK));
            let best = grid
                .iter()
                .flat_map(|&pi| checks().map(move |u| (pi, u)))
                .map(|(pi, u)| objective(t, &known, &price, pi, u))
                .fold(f64::INFINITY, f64::min);
            assert!(ours <= best * 1.002, "{known:?} {price:?} {t}: {r:?} has {ours}, the grid {best}");
        }
    }

    #[test]
    fn the_residual_rule_is_the_best_check() {
        for i in 0..200 {
            let mut u = random(5000 + i);
            let known = Prediction::of_probability(u());
            let price = Price { look: 0.1, check: 1.0, lambda: 10f32.powf(2.0 * u() - 1.0) };
            let (t, pi) = (u(), 0.05 + 0.95 * u());
            let r = ResidualRoulette::residual(t, pi, &known, &price);
            let value = |u: f64| objective(t, &known, &price, f64::from(pi), u);
            let best = (2..=100).map(|k| value(f64::from(k) / 100.0)).fold(f64::INFINITY, f64::min);
            // The mean of what is selected pays 1 / pi for the residual, and so does its cost.
            assert!(value(f64::from(r.u)) <= best * 1.01, "{known:?} {price:?} {t} {pi}: {r:?}");
        }
    }

    #[test]
    fn nothing_known_or_nothing_wanted_gives_usable_probabilities() {
        let price = Price { look: 0.1, check: 1.0, lambda: 0.0 };
        for q in [0.0, 0.5, 1.0] {
            for t in [0.0, 1e-30, 1.0, f32::MAX] {
                for lambda in [0.0, 1e-30, 1.0, f32::INFINITY] {
                    let (known, price) = (Prediction::of_probability(q), Price { lambda, ..price });
                    for r in
                        [ResidualRoulette::joint(t, &known, &price), ResidualRoulette::residual(t, 1.0, &known, &price)]
                    {
                        let usable = |p: f32| p > 0.0 && p <= 1.0;
                        assert!(usable(r.pi) && usable(r.u), "{q} {t} {lambda}: {r:?}");
                    }
                }
            }
        }
    }
}
