//! All strategies have the mean of `exact`: by enumeration of coins, by integration between breakpoints, by z-test.
//!
//! Confidence: the z-tests use five standard errors (6e-7 each).

mod lanes;
mod setting;
mod watch;

use self::setting::{Setting, random};
use super::coins::Coin;
use super::*;
use crate::math::Vec3;
use crate::math::sampler::unit_f32;
use crate::transport::eight::{Eight, WIDTH};
use crate::transport::vpl::Vpl;
use crate::transport::vpl_tree::groups::Point;
use clap::ValueEnum;
use std::cell::RefCell;
use std::rc::Rc;

fn close(a: Rgb, b: Rgb, relative: f32) -> bool {
    (a - b).abs().max_element() <= relative * b.abs().max_element()
}

/// Coins that follow a script; beyond it tails, and the probability of it all.
#[derive(Clone, Default)]
struct Scripted(Rc<RefCell<Script>>);

#[derive(Default)]
struct Script {
    heads: Vec<bool>,
    tossed: usize,
    probability: f64,
}

impl Coin for Scripted {
    fn toss(&mut self, p: f32) -> bool {
        assert!(p > 0.0, "a coin that never is heads is a bias");
        if p >= 1.0 {
            return true;
        }
        let s = &mut *self.0.borrow_mut();
        if s.tossed == s.heads.len() {
            s.heads.push(false);
        }
        let heads = s.heads[s.tossed];
        s.tossed += 1;
        s.probability *= if heads { f64::from(p) } else { 1.0 - f64::from(p) };
        heads
    }

    fn toss_many(&mut self, n: u32, p: f32, heads: &mut impl FnMut(u32)) {
        (0..n).filter(|_| self.toss(p)).for_each(heads);
    }
}

/// Mean over all outcomes of all coins, their number, and the sum of probabilities.
fn enumerated(setting: &Setting, many: &ManyLights) -> ([f64; 3], u64, f64) {
    let (mut mean, mut outcomes, mut total) = ([0.0; 3], 0, 0.0);
    let mut waiting: Vec<Vec<bool>> = vec![Vec::new()];
    while let Some(prefix) = waiting.pop() {
        let given = prefix.len();
        let coin = Scripted(Rc::new(RefCell::new(Script { heads: prefix, tossed: 0, probability: 1.0 })));
        let (sum, _) = setting.with(many, [coin.clone(), coin.clone()], 0);
        let script = coin.0.borrow();
        for (m, v) in mean.iter_mut().zip(sum.to_array()) {
            *m += script.probability * f64::from(v);
        }
        total += script.probability;
        outcomes += 1;
        for k in given..script.heads.len() {
            let mut other = script.heads[..k].to_vec();
            other.push(true);
            waiting.push(other);
        }
    }
    (mean, outcomes, total)
}

#[test]
fn the_mean_over_all_coins_is_the_sum() {
    for seed in 0..3 {
        let setting = Setting::new(10, seed);
        let truth = setting.truth();
        assert!(truth.min_element() > 0.0, "something is seen");
        for strategy in [Strategy::Exact, Strategy::Veach, Strategy::Nabata, Strategy::Residual, Strategy::Joint] {
            // From everything checked to next to nothing selected.
            for lambda in [1e-7, 1e-3, 0.3] {
                let (mean, outcomes, total) = enumerated(&setting, &setting.many(strategy, lambda));
                assert!((total - 1.0).abs() < 1e-5, "{strategy:?}: probabilities sum to {total}");
                let mean = Rgb::from_array(mean.map(|m| m as f32));
                assert!(close(mean, truth, 1e-4), "{strategy:?}, {lambda}: {mean} for {truth}");
                let chance = strategy != Strategy::Exact && (lambda > 1e-5 || !strategy.needs_price());
                assert!(!chance || outcomes > 3, "{strategy:?}, {lambda}: only {outcomes} outcomes");
            }
        }
    }
}

#[test]
fn enumeration_would_see_a_forgotten_weight() {
    let setting = Setting::new(10, 0);
    let mut many = setting.many(Strategy::Exact, 1.0);
    let (mean, ..) = enumerated(&setting, &many);
    // One light less: the smallest error there could be.
    let mut vpls = Vpls::from_lights(setting.vpls.lights.clone());
    vpls.lights[3].power = Rgb::ZERO;
    many.vpls = &vpls;
    let (less, ..) = enumerated(&setting, &many);
    assert!((mean[0] - less[0]).abs() > 1e-3 * mean[0]);
}

/// Notes probabilities; tails throughout.
#[derive(Clone, Default)]
struct Noting(Rc<RefCell<Vec<f64>>>);

impl Coin for Noting {
    fn toss(&mut self, p: f32) -> bool {
        if p < 1.0 {
            self.0.borrow_mut().push(f64::from(p));
        }
        p >= 1.0
    }

    fn toss_many(&mut self, n: u32, p: f32, _: &mut impl FnMut(u32)) {
        (0..n).for_each(|_| self.0.borrow_mut().push(f64::from(p)));
    }
}

/// One of two kinds of coins.
#[derive(Clone)]
enum Either {
    Systematic(Systematic),
    Noting(Noting),
}

impl Coin for Either {
    fn toss(&mut self, p: f32) -> bool {
        match self {
            Either::Systematic(c) => c.toss(p),
            Either::Noting(c) => c.toss(p),
        }
    }

    fn toss_many(&mut self, n: u32, p: f32, heads: &mut impl FnMut(u32)) {
        match self {
            Either::Systematic(c) => c.toss_many(n, p, heads),
            Either::Noting(c) => c.toss_many(n, p, heads),
        }
    }
}

/// Integral over the offset of systematic coins with these probabilities: of a function that is constant between breakpoints.
fn integral(probabilities: &[f64], mut f: impl FnMut(f64) -> [f64; 3]) -> [f64; 3] {
    let mut sum = 0.0;
    let mut cuts = vec![0.0, 1.0];
    for p in probabilities {
        sum += p;
        // Heads where 1 - offset + k = sum.
        cuts.push(1.0 - f64::fract(sum));
    }
    cuts.sort_by(f64::total_cmp);
    let mut total = [0.0; 3];
    for pair in cuts.windows(2).filter(|p| p[1] - p[0] > 1e-12) {
        let value = f(0.5 * (pair[0] + pair[1]));
        (0..3).for_each(|c| total[c] += (pair[1] - pair[0]) * value[c]);
    }
    total
}

#[test]
fn systematic_coins_integrate_to_the_sum() {
    for seed in 0..3 {
        let setting = Setting::new(60, seed);
        let truth = setting.truth();
        for strategy in [Strategy::Veach, Strategy::Nabata, Strategy::Residual, Strategy::Joint] {
            for lambda in [1e-6, 1e-4, 1e-2] {
                let many = setting.many(strategy, lambda);
                let noting = Noting::default();
                setting.with(&many, [noting.clone(), Noting::default()], 0);
                let selection = noting.0.borrow().clone();
                let mean = integral(&selection, |offset| {
                    let select = Either::Systematic(Systematic::new(offset));
                    let noting = Noting::default();
                    setting.with(&many, [select.clone(), Either::Noting(noting.clone())], 0);
                    let checks = noting.0.borrow().clone();
                    integral(&checks, |offset| {
                        let check = Either::Systematic(Systematic::new(offset));
                        setting.with(&many, [select.clone(), check], 0).0.to_array().map(f64::from)
                    })
                });
                let mean = Rgb::from_array(mean.map(|m| m as f32));
                assert!(close(mean, truth, 1e-4), "{strategy:?}, {lambda}: {mean} for {truth}");
            }
        }
    }
}

#[test]
fn culling_integrates_to_the_sum_over_its_ranges() {
    let setting = Setting::new(40, 1);
    let mut tree = setting.tree.clone();
    for epsilon in [1e-4f32, 1e-2, 1.0] {
        let mut mean = Rgb::ZERO;
        for (i, light) in setting.vpls.lights.iter().enumerate() {
            let d2 = (light.p - setting.at.p).length_squared();
            let inverse_alpha = culling::inverse_alpha(light.strength, 2.0 * epsilon);
            // Alive for all xi up to this one; all other lights have no range.
            let limit = (inverse_alpha / d2).min(1.0);
            for (xi, weight) in [(limit * 0.999, limit), (limit * 1.001, 1.0 - limit)] {
                let mut ranges = vec![0.0; 40];
                ranges[i] = inverse_alpha / xi.min(1.0);
                tree.set_ranges(&ranges);
                let mut many = setting.many(Strategy::Culling, 1.0);
                (many.tree, many.ranges, many.settings.epsilon) = (&tree, &ranges, Some(epsilon));
                mean += setting.with(&many, [Independent::new(0), Independent::new(1)], 0).0 * weight;
            }
        }
        assert!(close(mean, setting.truth(), 1e-4), "{epsilon}: {mean} for {}", setting.truth());
    }
}

#[test]
fn culling_keeps_each_lights_deviation_below_epsilon() {
    // A white surface that faces the light: I / (pi d^2) with probability p = min(1, 1 / (alpha d^2)).
    let epsilon = 0.02f32;
    let mut largest = 0.0f32;
    for k in 0..2000 {
        let d2 = 10f32.powf(k as f32 / 500.0 - 2.0);
        let light = Vpl::lambertian(Vec3::ZERO, Vec3::Y, Rgb::splat(0.7), 0.0);
        let p = culling::survival(&light, d2, 2.0 * epsilon);
        let t = 0.7 / (std::f32::consts::PI * d2);
        largest = largest.max((t * t * (1.0 / p - 1.0)).sqrt());
    }
    assert!(largest <= epsilon * 1.0001 && largest > 0.99 * epsilon, "{largest}");
}

/// Mean, standard error and variance of the first channel over runs.
fn sampled(setting: &Setting, many: &ManyLights, runs: u64, coins: Coins) -> [f64; 3] {
    let (mut sum, mut square) = (0.0, 0.0);
    for i in 0..runs {
        let key = hash(77, i);
        let [a, b] = [1, 2].map(|k| f64::from(unit_f32(hash(key, k))));
        let (value, _) = match coins {
            Coins::Systematic => setting.with(many, [Systematic::new(a), Systematic::new(b)], key),
            Coins::Independent => setting.with(many, [Independent::new(key), Independent::new(!key)], key),
        };
        let v = f64::from(mean(value));
        sum += v;
        square += v * v;
    }
    let n = runs as f64;
    let variance = (square / n - (sum / n).powi(2)) * n / (n - 1.0);
    [sum / n, (variance / n).sqrt(), variance]
}

#[test]
fn hierarchical_and_all_others_have_the_mean_of_the_sum_by_test() {
    let setting = Setting::new(300, 2);
    let truth = f64::from(mean(setting.truth()));
    for &strategy in Strategy::value_variants().iter().filter(|s| !matches!(s, Strategy::Exact | Strategy::Culling)) {
        for coins in [Coins::Independent, Coins::Systematic] {
            let [m, error, _] = sampled(&setting, &setting.many(strategy, 1e-5), 20_000, coins);
            assert!(error < 0.01 * truth, "{strategy:?}: the test has no power: {error} of {truth}");
            assert!((m - truth).abs() < 5.0 * error + 1e-5 * truth, "{strategy:?} {coins:?}: {m} +- {error}, {truth}");
            // Five per cent too much would be seen.
            assert!((m - 1.05 * truth).abs() > 5.0 * error, "{strategy:?} {coins:?}");
        }
    }
}

#[test]
fn the_tally_knows_the_variance_of_roulette() {
    let setting = Setting::new(300, 3);
    for strategy in [Strategy::Veach, Strategy::Residual, Strategy::Joint] {
        let many = setting.many(strategy, 1e-5);
        let [_, _, variance] = sampled(&setting, &many, 8000, Coins::Independent);
        let estimates: f64 = (0..8000)
            .map(|i| {
                let key = hash(78, i);
                setting.with(&many, [Independent::new(key), Independent::new(!key)], key).1.roulette
            })
            .sum::<f64>()
            / 8000.0;
        assert!((estimates / variance - 1.0).abs() < 0.15, "{strategy:?}: {estimates} for {variance}");
    }
}

#[test]
fn systematic_coins_vary_less() {
    let setting = Setting::new(300, 4);
    for strategy in [Strategy::Residual, Strategy::Joint] {
        let many = setting.many(strategy, 1e-5);
        let [i, s] = [Coins::Independent, Coins::Systematic].map(|c| sampled(&setting, &many, 8000, c)[2]);
        assert!(s < i, "{strategy:?}: {s}, independent {i}");
    }
}

#[test]
fn no_light_is_above_the_bounds_of_its_groups() {
    let setting = Setting::new(400, 5);
    for i in 0..200u64 {
        let u = |k| random(31 * i, k) * 2.0 - 1.0;
        let mut at = setting.at;
        at.p = Vec3::new(2.0 * u(0), 1.5 + 1.5 * u(1), 2.0 * u(2));
        let n = Vec3::new(u(3), u(4), u(5)).normalize();
        (at.n_geo, at.n_shade) = (n, n);
        let bsdf = setting.room.world().bsdf(&at, n);
        let r = Receiver::new(&at, &bsdf, n, Rgb::ONE, [0, u32::MAX], 1);
        let point = Point::<Eight>::new(at.p, r.horizon, r.reach);
        for node in setting.tree.groups().nodes() {
            let [bounds, typicals] = node.bounds(&point);
            for lane in (0..WIDTH).filter(|&lane| node.used >> lane & 1 == 1) {
                let (bound, typical) = (bounds[lane / 4][lane % 4], typicals[lane / 4][lane % 4]);
                assert!(typical <= bound && typical >= 0.1 * bound, "{typical} {bound}");
                let (first, count) = (node.first[lane] as usize, node.count[lane] as usize);
                for light in &setting.vpls.lights[first..first + count] {
                    let t = mean(r.tentative(&setting.vpls, light));
                    assert!(t <= bound * 1.0005 + 1e-9, "{t} above {bound} of a group of {count}");
                }
            }
        }
    }
}

#[test]
fn cache_points_have_seen_what_they_say() {
    let setting = Setting::new(80, 7);
    let world = setting.room.world();
    let (mut seen, mut hidden) = (0, 0);
    for (c, point) in setting.cache.points().iter().enumerate() {
        let at = point.surface_point();
        for (light, (visible, telling)) in setting.vpls.lights.iter().zip(setting.cache.bits(c)) {
            let d = light.p - point.p;
            let faces = d.dot(point.n_shade) > 0.0 && d.dot(light.n) < 0.0;
            assert_eq!(telling, faces);
            let ray = world.shadow_ray(&at, d / d.length(), d.length());
            let sees = faces && world.transmittance(ray, false).share > 0.5;
            assert_eq!(visible, sees);
            seen += u32::from(sees);
            hidden += u32::from(faces && !sees);
        }
    }
    assert!(seen > 100 && hidden > 20, "{seen} {hidden}");
}

#[test]
fn thinning_looks_at_few_of_many_lights() {
    let [few, many] = [1000u16, 16_000].map(|n| {
        let setting = Setting::new(u64::from(n), 6);
        // As the price falls with the number of lights of one flux: the sizes of these do not, so lambda rises with its square.
        let lambda = (f32::from(n) / 500.0).powi(2) / LOOK;
        let coins = [Systematic::new(0.3), Systematic::new(0.6)];
        let counts = setting.with(&setting.many(Strategy::Joint, lambda), coins, 0).1.counts();
        (counts.looks + counts.nodes) as f64
    });
    assert!(few < 700.0 && many < 2.0 * few, "{few} of 1000, {many} of 16,000");
}
