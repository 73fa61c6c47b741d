//! Samples follow the pdf, weights are value over pdf, energy is kept. The tests have the family-wise significance 0.01
//! over all their cases (Sidak), fixed seeds and independent random numbers; a companion shows that a wrong pdf is
//! noticed.

use super::*;
use crate::math::stats::{chi_square_p, sidak, z_test_p};

const CELLS_THETA: usize = 24;
const CELLS_PHI: usize = 24;
/// Quadrature nodes per axis of a cell. Many in theta: the pdf of rough glass jumps where the facet stands upright.
const FINE_THETA: usize = 40;
const FINE_PHI: usize = 8;
const SAMPLES: u64 = 20_000;

/// Integral over each cell of the sphere (uniform in theta and phi) of a function of direction.
fn integrate(f: impl Fn(Vec3) -> f32) -> Vec<f64> {
    let mut cells = vec![0.0; CELLS_THETA * CELLS_PHI];
    let (nt, np) = (CELLS_THETA * FINE_THETA, CELLS_PHI * FINE_PHI);
    let (dt, dp) = (std::f32::consts::PI / nt as f32, std::f32::consts::TAU / np as f32);
    for i in 0..nt {
        let (sin, cos) = ((i as f32 + 0.5) * dt).sin_cos();
        for j in 0..np {
            let phi = (j as f32 + 0.5) * dp;
            let w = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
            cells[i / FINE_THETA * CELLS_PHI + j / FINE_PHI] += (f(w) * sin) as f64;
        }
    }
    let area = dt as f64 * dp as f64;
    cells.iter().map(|c| c * area).collect()
}

fn cell(w: Vec3) -> usize {
    let theta = (w.z.clamp(-1.0, 1.0).acos() / std::f32::consts::PI * CELLS_THETA as f32) as usize;
    let turn = w.y.atan2(w.x) / std::f32::consts::TAU;
    let phi = ((turn - turn.floor()) * CELLS_PHI as f32) as usize;
    theta.min(CELLS_THETA - 1) * CELLS_PHI + phi.min(CELLS_PHI - 1)
}

/// p-value of samples against the pdf bent by the factor 1 + `wrong` in every other column of cells. The last cell holds
/// what has no density: Dirac samples and failures. Also the integral of the pdf.
fn chi_square(bsdf: &Bsdf, wo: Vec3, seed: u64, wrong: f64) -> (f64, f64) {
    let mut expected = integrate(|wi| bsdf.pdf_dir(wo, wi));
    for (i, e) in expected.iter_mut().enumerate() {
        *e *= SAMPLES as f64 * if i % 2 == 0 { 1.0 + wrong } else { 1.0 - wrong };
    }
    let mut observed = vec![0.0; expected.len() + 1];
    for i in 0..SAMPLES {
        let density = draw(bsdf, wo, seed, i, Transport::Radiance).filter(|s| s.pdf_dir > 0.0);
        observed[density.map_or(expected.len(), |s| cell(s.wi))] += 1.0;
    }
    let total: f64 = expected.iter().sum();
    // A share below a thousandth is within the error of the quadrature.
    let rest = (SAMPLES as f64 - total).max(0.0);
    if rest.max(observed[expected.len()]) > 1e-3 * SAMPLES as f64 {
        expected.push(rest);
    } else {
        observed.pop();
    }
    (chi_square_p(&observed, &expected, 5.0), total / SAMPLES as f64)
}

/// Runs over all cases and views in which something with a density is scattered.
fn for_each_lobe(mut f: impl FnMut(&str, &Bsdf, Vec3, u64)) -> usize {
    let mut n = 0;
    for (name, materials) in cases() {
        for wo in views() {
            let bsdf = resolve(&materials, &flat(), wo);
            let scatters =
                (0..100).any(|i| draw(&bsdf, wo, 1, i, Transport::Radiance).is_some_and(|s| s.pdf_dir > 0.0));
            if scatters {
                n += 1;
                f(name, &bsdf, wo, hash(17, n as u64));
            }
        }
    }
    n
}

#[test]
fn samples_follow_the_pdf_and_the_pdf_integrates_to_one_less_the_failures() {
    let limit = sidak(0.01, for_each_lobe(|_, _, _, _| ()));
    for_each_lobe(|name, bsdf, wo, seed| {
        let (p, total) = chi_square(bsdf, wo, seed, 0.0);
        assert!(total < 1.003, "{name} {wo}: pdf integrates to {total}");
        assert!(p > limit, "{name} {wo}: p = {p}, integral {total}");
    });
}

#[test]
fn a_wrong_pdf_is_noticed() {
    for_each_lobe(|name, bsdf, wo, seed| {
        let (p, _) = chi_square(bsdf, wo, seed, 0.3);
        assert!(p < 1e-4, "{name} {wo}: p = {p}");
    });
}

#[test]
fn weights_are_value_over_pdf_and_average_to_the_integral_of_the_value() {
    let limit = sidak(0.01, for_each_lobe(|_, _, _, _| ()));
    for_each_lobe(|name, bsdf, wo, seed| {
        let (mut sum, mut sum2) = (0.0, 0.0);
        for i in 0..SAMPLES {
            let Some(s) = draw(bsdf, wo, seed, i, Transport::Radiance).filter(|s| s.pdf_dir > 0.0) else {
                continue;
            };
            let (f, pdf) = bsdf.eval_pdf(wo, s.wi, Transport::Radiance);
            assert!((pdf - s.pdf_dir).abs() <= 1e-5 * pdf + 1e-7, "{name}: {pdf} {}", s.pdf_dir);
            assert!((s.weight * pdf - f).abs().max_element() <= 1e-5 * f.max_element() + 1e-7);
            let y = s.weight.y as f64;
            sum += y;
            sum2 += y * y;
        }
        let n = SAMPLES as f64;
        let mean = sum / n;
        let variance = (sum2 / n - mean * mean).max(0.0) / n;
        let integral: f64 = integrate(|wi| bsdf.eval(wo, wi, Transport::Radiance).y).iter().sum();
        // The quadrature is off by up to a thousandth: blur the test by so much.
        let p = z_test_p(mean, variance + (1e-3 * integral).powi(2), integral);
        assert!(p > limit, "{name} {wo}: {mean} against {integral}, p = {p}");
    });
}

#[test]
fn no_more_is_scattered_than_comes_in() {
    for (name, materials) in cases() {
        for wo in views() {
            let bsdf = resolve(&materials, &flat(), wo);
            let n = 4000u64;
            let weights = (0..n).filter_map(|i| draw(&bsdf, wo, 5, i, Transport::Importance));
            let (mut sum, mut sum2) = (0.0, 0.0);
            for s in weights {
                let w = s.weight.max_element() as f64;
                sum += w;
                sum2 += w * w;
            }
            let mean = sum / n as f64;
            let sigma = ((sum2 / n as f64 - mean * mean).max(0.0) / n as f64).sqrt();
            println!("{name} {wo}: albedo {mean:.4} ({:.4})", bsdf.albedo(wo).max_element());
            assert!(mean < 1.0 + 4.0 * sigma + 1e-4, "{name} {wo}: {mean}");
        }
    }
}

/// Irradiance times albedo is what a cache takes the base of a plastic to reflect.
#[test]
fn the_albedo_of_a_diffuse_part_is_its_integral() {
    let mut plastics: Vec<Case> = cases().into_iter().filter(|(name, _)| name.contains("plastic")).collect();
    plastics.push(("rough plastic", vec![plastic(1.49, 0.7, 1.0, false, Some(rough(Ggx, 0.4, 0.4)))]));
    let mut compared = 0;
    for (name, materials) in plastics {
        for wo in views().into_iter().filter(|wo| wo.z > 0.0) {
            let Some(base) = resolve(&materials, &flat(), wo).split().0 else { continue };
            let integral: f64 = integrate(|wi| base.eval(wo, wi, Transport::Radiance).y).iter().sum();
            let albedo = f64::from(base.albedo(wo).y);
            compared += 1;
            assert!((albedo / integral - 1.0).abs() < 0.01, "{name} {wo}: {albedo} against {integral}");
        }
    }
    assert!(compared >= 20, "{compared}");
}
