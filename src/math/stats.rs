//! Hypothesis tests: does a sampler follow its density, does a mean agree with a reference?
//!
//! Computes p-values: the probability, if the hypothesis is true, of data at least as far from it as the data seen.
//! Source: Pearson's chi-square statistic X^2 = sum (O - E)^2 / E, whose tail is the regularised incomplete gamma
//! function Q(k/2, X^2/2) (Abramowitz & Stegun 26.4.19); the function itself by its series 6.5.29 below x = a + 1 and
//! by its continued fraction 6.5.31 above (evaluated with Lentz's method); ln Gamma by Lanczos' approximation.
//! Accuracy: about 1e-12 in the gamma functions, far better than any test needs.
//! Not handled: samples that depend on one another. Points of a stratified or low-discrepancy sequence fit *too* well
//! (p near 1), so draw independent numbers when a test is to have its stated confidence.

/// p-value of Pearson's chi-square test of `observed` against `expected` counts.
///
/// Cells that expect fewer than `min_expected` (usually 5) are pooled, smallest first, so that the statistic follows
/// its limit law. Both tables hold counts of the same samples: if a sampler can fail, failures are a cell of their own.
/// The answer is 0 if a sample lies in a cell where none is possible or a value is negative or not finite, and 1 if
/// fewer than two cells are left (there is nothing to compare).
///
/// # Panics
/// If the two tables differ in length.
pub fn chi_square_p(observed: &[f64], expected: &[f64], min_expected: f64) -> f64 {
    assert_eq!(observed.len(), expected.len(), "one expected count per observed one");
    let valid = |x: &f64| x.is_finite() && *x >= 0.0;
    if !observed.iter().all(valid) || !expected.iter().all(valid) {
        return 0.0;
    }
    let mut cells: Vec<(f64, f64)> = Vec::with_capacity(expected.len());
    for (&o, &e) in observed.iter().zip(expected) {
        if e > 0.0 {
            cells.push((e, o));
        } else if o > 0.0 {
            return 0.0;
        }
    }
    // Stable, by expectation alone: pools must not depend on what was observed.
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));

    // Ascending order: once a cell is large enough alone, all later ones are. An unfinished pool joins the cell after it.
    let mut statistic = 0.0;
    let mut groups = 0u32;
    let (mut pool_e, mut pool_o) = (0.0, 0.0);
    for &(e, o) in &cells {
        pool_e += e;
        pool_o += o;
        if pool_e >= min_expected {
            statistic += (pool_o - pool_e) * (pool_o - pool_e) / pool_e;
            groups += 1;
            (pool_e, pool_o) = (0.0, 0.0);
        }
    }
    // Only when every cell together is too small is something left over here: then there is no test.
    if groups < 2 {
        return 1.0;
    }
    gamma_q(0.5 * (groups - 1) as f64, 0.5 * statistic)
}

/// Two-sided p-value of a standard normal deviate: the probability of a value at least `z.abs()` from 0; 0 for NaN.
pub fn normal_p(z: f64) -> f64 {
    if z.is_nan() { 0.0 } else { gamma_q(0.5, 0.5 * z * z) }
}

/// p-value of the z-test that samples with this `mean` and `variance_of_mean` come from a law with mean `reference`.
///
/// With no variance at all the answer is 1 if the two agree to 1e-12 relative, else 0. NaN gives 0.
pub fn z_test_p(mean: f64, variance_of_mean: f64, reference: f64) -> f64 {
    let diff = mean - reference;
    if variance_of_mean > 0.0 {
        normal_p(diff / variance_of_mean.sqrt())
    } else if diff.abs() <= 1e-12 * reference.abs().max(1e-300) {
        1.0
    } else {
        0.0
    }
}

/// Significance of each of `tests` independent tests so that all together err with probability `family` (Sidak 1967).
pub fn sidak(family: f64, tests: usize) -> f64 {
    1.0 - (1.0 - family).powf(1.0 / tests.max(1) as f64)
}

/// Half width, in standard errors, of the central interval of probability `confidence` of Student's t with `dof` degrees
/// of freedom: 1.96 for 0.95 and many, 12.7 for one. Infinite for no degree of freedom or a confidence of 1; 0 for 0.
///
/// Source: Abramowitz & Stegun 26.7.3 and 26.7.4 (closed forms for whole degrees of freedom), inverted by bisection.
pub fn student_t_half_width(confidence: f64, dof: u32) -> f64 {
    if dof == 0 || confidence >= 1.0 {
        return f64::INFINITY;
    }
    // P(|T| < t) with t = sqrt(dof) tan(theta).
    let inside = |theta: f64| {
        let (sin, cos) = theta.sin_cos();
        let odd = dof % 2 == 1;
        // Terms cos^k (k-1)!!/k!! up to k = dof - 2, from k = 1 or 0; the sum may stop where nothing is added.
        let (mut term, mut k) = if odd { (cos, 1) } else { (1.0, 0) };
        let mut sum = 0.0;
        while k + 2 <= dof && term > 1e-18 {
            sum += term;
            term *= cos * cos * f64::from(k + 1) / f64::from(k + 2);
            k += 2;
        }
        if odd { std::f64::consts::FRAC_2_PI * (theta + sin * sum) } else { sin * sum }
    };
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if inside(middle) < confidence {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::from(dof).sqrt() * low.tan()
}

/// Regularised upper incomplete gamma function Q(a, x) = Gamma(a, x) / Gamma(a), a > 0.
///
/// 1 for x <= 0, NaN for a NaN argument or a <= 0.
pub fn gamma_q(a: f64, x: f64) -> f64 {
    if a.is_nan() || x.is_nan() || a <= 0.0 {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 1.0;
    }
    if x == f64::INFINITY {
        return 0.0;
    }
    // The common factor x^a e^-x / Gamma(a).
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    // Both expansions converge in O(sqrt(a)) terms near x = a.
    let max_terms = 200 + (20.0 * a.sqrt()) as usize;
    if x < a + 1.0 {
        let mut term = 1.0 / a;
        let mut sum = term;
        for n in 1..max_terms {
            term *= x / (a + n as f64);
            sum += term;
            if term < sum * 1e-16 {
                break;
            }
        }
        (1.0 - front * sum).clamp(0.0, 1.0)
    } else {
        let tiny = 1e-300;
        let mut b = x + 1.0 - a;
        let mut c = 1.0 / tiny;
        let mut d = 1.0 / b;
        let mut h = d;
        for n in 1..max_terms {
            let k = -(n as f64) * (n as f64 - a);
            b += 2.0;
            d = k * d + b;
            d = 1.0 / if d.abs() < tiny { tiny } else { d };
            c = b + k / c;
            c = if c.abs() < tiny { tiny } else { c };
            h *= d * c;
            if (d * c - 1.0).abs() < 1e-15 {
                break;
            }
        }
        (front * h).clamp(0.0, 1.0)
    }
}

/// ln Gamma(x) for x > 0 (Lanczos 1964, g = 7, nine terms).
fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    let x = x - 1.0;
    let t = x + 7.5;
    let mut sum = C[0];
    for (i, c) in C.iter().enumerate().skip(1) {
        sum += c / (x + i as f64);
    }
    0.5 * (2.0 * std::f64::consts::PI).ln() + (x + 0.5) * t.ln() - t + sum.ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32};

    #[test]
    fn gamma_q_has_its_closed_forms() {
        // Q(1, x) = e^-x; Q(n, x) = e^-x sum_{k<n} x^k / k!.
        for x in [1e-3, 0.5, 1.0, 3.0, 20.0, 100.0] {
            assert!((gamma_q(1.0, x) - (-x).exp()).abs() < 1e-13);
            let (mut term, mut sum) = (1.0, 0.0);
            for k in 0..30 {
                sum += term;
                term *= x / (k + 1) as f64;
            }
            assert!((gamma_q(30.0, x) - (-x).exp() * sum).abs() < 1e-12, "{x}");
        }
        assert_eq!(gamma_q(2.0, 0.0), 1.0);
        assert_eq!(gamma_q(2.0, f64::INFINITY), 0.0);
        assert!(gamma_q(f64::NAN, 1.0).is_nan());
        // The median of chi-square with k degrees of freedom is close to k (1 - 2/(9k))^3 (Wilson & Hilferty).
        for k in [10.0, 1000.0, 1e5] {
            let median = k * (1.0f64 - 2.0 / (9.0 * k)).powi(3);
            assert!((gamma_q(0.5 * k, 0.5 * median) - 0.5).abs() < 1e-3, "{k}");
        }
    }

    #[test]
    fn quantiles_of_the_tables() {
        assert!((normal_p(1.959_963_985) - 0.05).abs() < 1e-9);
        assert!((normal_p(-2.575_829_304) - 0.01).abs() < 1e-9);
        // 95 % quantile of chi-square with 9 degrees of freedom: 16.919.
        assert!((gamma_q(4.5, 16.918_977_605 / 2.0) - 0.05).abs() < 1e-9);
        assert!((z_test_p(1.2, 0.01, 1.0) - 0.045_500_264).abs() < 1e-8);
        assert_eq!(z_test_p(f64::NAN, 0.01, 1.0), 0.0);
        assert_eq!((z_test_p(1.0, 0.0, 1.0), z_test_p(1.1, 0.0, 1.0)), (1.0, 0.0));
        assert!((1.0 - (1.0 - sidak(0.01, 7)).powi(7) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn student_t_has_the_tables_values() {
        let table = [
            (0.95, 1, 12.706_204_736),
            (0.95, 2, 4.302_652_730),
            (0.95, 4, 2.776_445_105),
            (0.95, 7, 2.364_624_252),
            (0.90, 4, 2.131_846_786),
            (0.99, 30, 2.749_995_654),
            (0.95, 63, 1.998_340_543),
        ];
        for (confidence, dof, expected) in table {
            let got = student_t_half_width(confidence, dof);
            assert!((got / expected - 1.0).abs() < 1e-8, "{confidence} {dof}: {got}");
        }
        assert!((student_t_half_width(0.95, 1_000_000) - 1.959_964).abs() < 1e-5);
        assert_eq!((student_t_half_width(0.95, 0), student_t_half_width(0.0, 3)), (f64::INFINITY, 0.0));
    }

    /// p-values of fair-die experiments, thrown with a die whose face 0 has the weight 1/6 + bias.
    fn dice(bias: f64, experiments: u64) -> Vec<f64> {
        (0..experiments)
            .map(|e| {
                let mut seen = [0.0; 6];
                for i in 0..600 {
                    let u = unit_f32(hash(hash(1, e), i)) as f64;
                    let p0 = 1.0 / 6.0 + bias;
                    let face = if u < p0 { 0.0 } else { 1.0 + (u - p0) / (1.0 - p0) * 5.0 };
                    seen[(face as usize).min(5)] += 1.0;
                }
                chi_square_p(&seen, &[100.0; 6], 5.0)
            })
            .collect()
    }

    #[test]
    fn p_values_of_a_true_hypothesis_are_uniform_and_of_a_false_one_are_not() {
        // Ten cells of 2000 p-values; the outer test is at 0.01.
        let histogram = |ps: Vec<f64>| {
            let mut cells = [0.0; 10];
            ps.iter().for_each(|p| cells[((p * 10.0) as usize).min(9)] += 1.0);
            chi_square_p(&cells, &[200.0; 10], 5.0)
        };
        let p = histogram(dice(0.0, 2000));
        assert!(p > 0.01, "{p}");
        assert!(histogram(dice(0.02, 2000)) < 1e-6, "a loaded die is noticed");
    }

    #[test]
    fn small_cells_are_pooled_and_impossible_ones_refused() {
        // Two groups: 100 cells of 0.1 that pool to two of 5, and two of 50.
        let mut e = vec![0.1; 100];
        e.extend([50.0, 50.0]);
        let mut o = vec![0.0; 100];
        (0..10).for_each(|i| o[i * 10] = 1.0);
        o.extend([50.0, 50.0]);
        assert!(chi_square_p(&o, &e, 5.0) > 0.3);
        o[0] = 30.0;
        assert!(chi_square_p(&o, &e, 5.0) < 1e-6);
        assert_eq!(chi_square_p(&[1.0, 9.0, 9.0], &[0.0, 9.0, 9.0], 5.0), 0.0);
        assert_eq!(chi_square_p(&[f64::NAN, 9.0], &[9.0, 9.0], 5.0), 0.0);
        assert_eq!(chi_square_p(&[1.0, 2.0], &[2.0, 1.0], 5.0), 1.0, "too few samples say nothing");
        assert_eq!(chi_square_p(&[], &[], 5.0), 1.0);
    }
}
