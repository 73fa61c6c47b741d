//! What [`ManyLights::rule`] says is what sums do.

use super::setting::Setting;
use crate::math::sampler::hash;
use crate::math::{Rgb, Sampler};
use crate::transport::strategies::{ManyLights, Strategy, Tally, culling};
use clap::ValueEnum;

/// Mean number of shadow rays of a sum and its standard error.
fn rays(setting: &Setting, many: &ManyLights, runs: u64) -> (f64, f64) {
    let r = setting.receiver();
    let counts: Vec<f64> = (0..runs)
        .map(|run| {
            let mut tally = Tally::default();
            many.sum(&r, &mut Sampler::new(3, hash(run, 1), 0), &mut tally);
            tally.counts().shadow_rays as f64
        })
        .collect();
    let n = runs as f64;
    let mean = counts.iter().sum::<f64>() / n;
    let variance = counts.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn probabilities_of_single_lights_add_up_to_the_rays_of_sums() {
    let setting = Setting::new(300, 7);
    let r = setting.receiver();
    for &strategy in Strategy::value_variants() {
        let mut many = setting.many(strategy, 3e-4);
        many.settings.coins = crate::transport::strategies::coins::Coins::Independent;
        let rules: Vec<_> = (0..setting.vpls.lights.len()).map(|i| many.rule(&r, i)).collect();
        let expected: f64 = rules.iter().flatten().map(|k| f64::from(k.pi) * f64::from(k.u)).sum();
        if strategy == Strategy::Culling {
            // Its chance is that of the ranges, the same for all points of a pass.
            let two_epsilon = culling::two_epsilon(None, &many.price);
            let alive = |pass: u64| {
                let ranges = culling::ranges(&setting.vpls, two_epsilon, hash(5, pass));
                let lights = setting.vpls.lights.iter().zip(&ranges).zip(&rules);
                lights.filter(|((l, range), k)| k.is_some() && (l.p - r.at.p).length_squared() < **range).count() as f64
            };
            let mean = (0..400).map(alive).sum::<f64>() / 400.0;
            // Variances of coins add up to less than their mean.
            assert!((mean - expected).abs() < 5.0 * (expected / 400.0).sqrt(), "{mean} {expected}");
            continue;
        }
        let (mean, error) = rays(&setting, &many, 2000);
        assert!(error < 0.02 * expected, "{strategy:?}: no power, {error} of {expected}");
        assert!((mean - expected).abs() <= 5.0 * error + 1e-9, "{strategy:?}: {mean} +- {error}, rules say {expected}");
        let doubled = rules.iter().flatten().filter(|k| k.u < 1.0 || k.pi < 1.0).count();
        assert!(doubled > 0 || strategy == Strategy::Exact, "{strategy:?} leaves nothing to chance");
    }
}

#[test]
fn lights_that_cannot_contribute_have_no_rule() {
    let setting = Setting::new(40, 2);
    let r = setting.receiver();
    let many = setting.many(Strategy::Joint, 1e-3);
    let dark = |i: &usize| r.tentative(&setting.vpls, &setting.vpls.lights[*i]) == Rgb::ZERO;
    assert!((0..40).any(|i| dark(&i)));
    assert!((0..40).filter(dark).all(|i| many.rule(&r, i).is_none()));
    assert!(many.rule(&r, 40).is_none());
}
