//! Tests of the pixel filters.

use super::*;
use crate::math::sampler::{hash, unit_f32};

fn all() -> Vec<PixelFilter> {
    let (b, c) = (1.0 / 3.0, 1.0 / 3.0);
    vec![
        PixelFilter::Box { radius: 0.5 },
        PixelFilter::Box { radius: 1.7 },
        PixelFilter::Tent { radius: 1.0 },
        PixelFilter::Gaussian { stddev: 0.5 },
        PixelFilter::Gaussian { stddev: 0.02 },
        PixelFilter::Mitchell { b, c },
        PixelFilter::Mitchell { b: 0.0, c: 1.0 },
        PixelFilter::CatmullRom,
        PixelFilter::Lanczos { lobes: 3 },
        PixelFilter::Lanczos { lobes: 1 },
    ]
}

/// Integral of `f` over [a, b] by the midpoint rule.
fn integral(f: impl Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    let n = 20_000;
    let h = (b - a) / n as f64;
    (0..n).map(|i| f(a + (i as f64 + 0.5) * h)).sum::<f64>() * h
}

/// Chi-square statistic and degrees of freedom of sampled x offsets against the density |g|, both halves of the support
/// in 20 cells; cells expecting fewer than 5 samples are pooled.
fn chi_square(filter: PixelFilter, g: impl Fn(f64) -> f64) -> (f64, f64) {
    let sampler = FilterSampler::new(filter);
    let radius = filter.radius() as f64;
    let (bins, n) = (20, 40_000u64);
    let mut counts = vec![0.0; bins];
    for i in 0..n {
        let u = Vec2::new(unit_f32(hash(17, 2 * i)), unit_f32(hash(17, 2 * i + 1)));
        let x = sampler.sample(u).0.x as f64;
        counts[(((x / radius + 1.0) * 0.5 * bins as f64) as usize).min(bins - 1)] += 1.0;
    }
    let edge = |i: usize| radius * (2.0 * i as f64 / bins as f64 - 1.0);
    let total = integral(|x| g(x).abs(), -radius, radius);
    let (mut statistic, mut cells, mut pool) = (0.0, 0.0, (0.0, 0.0));
    for (i, count) in counts.iter().enumerate() {
        let expected = n as f64 * integral(|x| g(x).abs(), edge(i), edge(i + 1)) / total;
        pool = (pool.0 + count, pool.1 + expected);
        if pool.1 >= 5.0 {
            statistic += (pool.0 - pool.1) * (pool.0 - pool.1) / pool.1;
            cells += 1.0;
            pool = (0.0, 0.0);
        }
    }
    (statistic, (cells - 1.0f64).max(1.0))
}

/// Upper 0.1 % quantile of chi-square (Wilson and Hilferty 1931): 0.01 for the family of ten filters.
fn critical(degrees: f64) -> f64 {
    let k = 2.0 / (9.0 * degrees);
    degrees * (1.0 - k + 3.09 * k.sqrt()).powi(3)
}

#[test]
fn offsets_follow_the_absolute_filter() {
    for filter in all() {
        let (statistic, degrees) = chi_square(filter, |x| filter.eval_f64(x));
        assert!(statistic < critical(degrees), "{filter:?}: {statistic} > {}", critical(degrees));
    }
}

#[test]
fn a_wrong_density_is_rejected() {
    // The companion: the same samples against a filter 5 % wider.
    for filter in all().into_iter().skip(2) {
        let (statistic, degrees) = chi_square(filter, |x| filter.eval_f64(x / 1.05));
        assert!(statistic > critical(degrees), "{filter:?}: {statistic} < {}", critical(degrees));
    }
}

#[test]
fn weighted_moments_are_those_of_the_filter() {
    // On a regular grid of numbers the only errors are those of the grid and the table.
    for filter in all() {
        let sampler = FilterSampler::new(filter);
        let n = 1 << 16;
        let (mut sums, mut weights) = ([0.0; 5], std::collections::BTreeSet::new());
        for i in 0..n {
            let (p, weight) = sampler.sample(Vec2::new((i as f32 + 0.5) / n as f32, 0.5));
            assert!(p.x.abs() <= filter.radius() * 1.000_001);
            weights.insert(weight.abs().to_bits());
            // u.y = 1/2 lies at the centre, where no filter is negative: the y factor of the weight is constant.
            let centre = sampler.sample(Vec2::splat(0.5)).1.sqrt();
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += (weight / centre) as f64 * (p.x as f64).powi(k as i32) / n as f64;
            }
        }
        assert_eq!(weights.len(), 1, "{filter:?}: weights differ in sign only");
        let (r, f) = (filter.radius() as f64, |x: f64| filter.eval_f64(x));
        let mass = integral(f, -r, r);
        for (k, sum) in sums.iter().enumerate() {
            let expected = integral(|x| f(x) * x.powi(k as i32), -r, r) / mass;
            let scale = r.powi(k as i32);
            assert!((sum - expected).abs() < 2e-4 * scale, "{filter:?}, moment {k}: {sum}, expected {expected}");
        }
    }
}

#[test]
fn mean_weight_in_two_dimensions_is_one_and_offsets_are_symmetric() {
    for filter in all() {
        let sampler = FilterSampler::new(filter);
        let n = 256;
        let mut sum = 0.0;
        for i in 0..n * n {
            let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
            let (p, weight) = sampler.sample(u);
            let (q, mirrored) = sampler.sample(Vec2::ONE - u);
            assert!((p + q).length() < 1e-4 * (1.0 + filter.radius()) && weight == mirrored, "{filter:?} {u} {p} {q}");
            sum += weight as f64 / (n * n) as f64;
        }
        assert!((sum - 1.0).abs() < 0.02, "{filter:?}: {sum} (grid of 256 x 256)");
    }
}

#[test]
fn the_ends_of_the_interval_are_safe_and_offsets_grow_with_u() {
    let below_one = 1.0 - f32::EPSILON / 2.0;
    for filter in all() {
        let sampler = FilterSampler::new(filter);
        let mut before = f32::NEG_INFINITY;
        for i in 0..=4000 {
            let (p, weight) = sampler.sample(Vec2::splat((i as f32 / 4000.0).min(below_one)));
            assert!(p.is_finite() && weight.is_finite() && p.x >= before, "{filter:?} at {i}: {p}");
            before = p.x;
        }
    }
}

#[test]
fn known_values() {
    let mitchell = PixelFilter::Mitchell { b: 1.0 / 3.0, c: 1.0 / 3.0 };
    assert!((mitchell.eval_1d(0.0) - 8.0 / 9.0).abs() < 1e-6);
    assert!((mitchell.eval_1d(1.0) - 1.0 / 18.0).abs() < 1e-6);
    assert!((mitchell.eval_1d(-1.5) + 5.0 / 144.0).abs() < 1e-6);
    for x in [1.0, 2.0] {
        assert!(PixelFilter::CatmullRom.eval_1d(x).abs() < 1e-6);
        assert!(PixelFilter::Lanczos { lobes: 3 }.eval_1d(x).abs() < 1e-6);
    }
    let gaussian = PixelFilter::Gaussian { stddev: 0.5 };
    assert!((gaussian.eval_1d(0.5) - ((-0.5f32).exp() - (-8f32).exp())).abs() < 1e-6);
    assert_eq!(gaussian.eval_1d(2.0), 0.0);
}

#[test]
fn filters_without_extent_sample_the_centre() {
    for filter in [
        PixelFilter::Box { radius: 0.0 },
        PixelFilter::Tent { radius: -1.0 },
        PixelFilter::Gaussian { stddev: f32::NAN },
        PixelFilter::Gaussian { stddev: f32::INFINITY },
        PixelFilter::Lanczos { lobes: 0 },
        PixelFilter::Mitchell { b: f32::NAN, c: 0.0 },
    ] {
        assert_eq!(FilterSampler::new(filter).sample(Vec2::new(0.1, 0.9)), (Vec2::ZERO, 1.0), "{filter:?}");
    }
    let huge = FilterSampler::new(PixelFilter::Lanczos { lobes: u32::MAX });
    assert!(huge.sample(Vec2::splat(0.3)).0.is_finite());
}
