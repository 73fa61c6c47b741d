//! Environment maps: look-up against Mitsuba 3.9.1, chi-square and normalisation of the density, mixtures.

use super::*;
use crate::math::stats::{chi_square_p, z_test_p};
use crate::math::warp::sample_sphere;
use std::f64::consts::PI;

fn map(image: u32, scale: f32, to_world: DMat4) -> LightDesc {
    LightDesc::EnvMap { image, scale: Rgb::splat(scale), to_world }
}

/// 4 x 3 texels (1,2,3), (4,5,6), ... row by row.
fn ramp() -> Bitmap {
    Bitmap { width: 4, height: 3, pixels: (0..12).map(|i| Rgb::new(1.0, 2.0, 3.0) + 3.0 * i as f32).collect() }
}

/// 16 x 9 texels, most of them black, one of them a sun.
fn sparse() -> Bitmap {
    let mut pixels = vec![Rgb::ZERO; 16 * 9];
    for i in 0..16 * 9 {
        if hash(3, i as u64).is_multiple_of(3) {
            pixels[i] = Rgb::new(random(1, i as u64, 0), random(1, i as u64, 1), 0.2);
        }
    }
    pixels[16 * 3 + 15] = Rgb::splat(60.0); // also across the seam
    Bitmap { width: 16, height: 9, pixels }
}

fn environment(images: &[Bitmap], descs: &[LightDesc]) -> Lights {
    Lights::new(&[], descs, &[], images, (Vec3::ZERO, 10.0))
}

fn textures(images: &[Bitmap]) -> Textures<'_> {
    Textures { textures: &[], images }
}

#[test]
fn lookup_as_mitsuba() {
    let images = [ramp()];
    let all = environment(&images, &[map(0, 1.0, DMat4::IDENTITY)]);
    for (d, red) in [
        ([0.0, 1.0, 0.0], 5.5),
        ([0.0, -1.0, 0.0], 29.5),
        ([0.0, 0.0, -1.0], 17.5),
        ([1.0, 0.0, 0.0], 14.5),
        ([0.0, 0.0, 1.0], 17.5),
        ([-1.0, 0.0, 0.0], 20.5),
        ([0.3, 0.5, -0.8], 11.39954),
        ([0.3, -0.5, 0.8], 20.85965),
        ([-0.6, 0.1, -0.4], 20.57032),
        ([0.01, 0.95, 0.02], 4.79427),
    ] {
        let found = all.environment(textures(&images), Vec3::from(d).normalize());
        // At the poles the azimuth is arbitrary: there Mitsuba's atan2(0, -0) is pi, ours as well.
        assert!((found - Vec3::new(red, red + 1.0, red + 2.0)).length() < 2e-4, "{d:?}: {found} {red}");
    }
    let turned = environment(&images, &[map(0, 2.0, DMat4::from_rotation_y(30f64.to_radians()))]);
    assert!((turned.environment(textures(&images), Vec3::X) - Vec3::new(31.0, 33.0, 35.0)).length() < 1e-4);
}

/// Cell of a direction: 8 rows of equal cosine steps times 16 columns.
fn cell(w: Vec3) -> usize {
    let row = (((w.y + 1.0) * 4.0) as usize).min(7);
    let turn = w.z.atan2(w.x) / std::f32::consts::TAU + 0.5;
    row * 16 + ((turn * 16.0) as usize).min(15)
}

fn cell_probabilities(pdf: impl Fn(Vec3) -> f32) -> Vec<f64> {
    let (nu, nv) = (1024, 512);
    let mut cells = vec![0.0; 128];
    for i in 0..nu * nv {
        let u = Vec2::new(((i / nu) as f32 + 0.5) / nv as f32, ((i % nu) as f32 + 0.5) / nu as f32);
        let w = sample_sphere(u);
        let w = Vec3::new(w.x, w.z, w.y); // uniform in y
        cells[cell(w)] += pdf(w) as f64 * 4.0 * PI / (nu * nv) as f64;
    }
    cells
}

#[test]
fn directions_follow_the_density_which_integrates_to_one() {
    let images = [ramp(), sparse()];
    let turn = DMat4::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
    let cases: [&[LightDesc]; 4] = [
        &[map(0, 1.0, DMat4::IDENTITY)],
        &[map(1, 1.0, turn)],
        &[LightDesc::Constant { radiance: Rgb::ONE }],
        &[map(1, 2.0, turn), LightDesc::Constant { radiance: Rgb::splat(0.1) }, map(0, 0.01, turn)],
    ];
    for (k, descs) in cases.iter().enumerate() {
        let all = environment(&images, descs);
        let cells = cell_probabilities(|w| all.pdf_dir_environment(w));
        let sum: f64 = cells.iter().sum();
        assert!((sum - 1.0).abs() < 5e-3, "{k}: {sum}");
        let count = 20_000u64;
        let mut observed = vec![0.0; 128];
        for i in 0..count {
            let sample = all.sample(&[], textures(&images), Vec3::ZERO, random(k as u64, i, 0), random2(k as u64, i));
            let s = sample.expect("light from everywhere it is drawn");
            assert_eq!(s.pdf_dir, all.pdf_dir_environment(s.wi));
            assert_eq!(s.weight, all.environment(textures(&images), s.wi) / s.pdf_dir);
            assert_eq!(s.distance, f32::INFINITY);
            observed[cell(s.wi)] += 1.0;
        }
        let scaled = |f: &dyn Fn(usize) -> f64| {
            (0..128).map(|i| (cells[i] / sum * f(i) * count as f64).max(1e-3)).collect::<Vec<f64>>()
        };
        let p = chi_square_p(&observed, &scaled(&|_| 1.0), 5.0);
        assert!(p > 0.0025, "{k}: p = {p}");
        let wrong = chi_square_p(&observed, &scaled(&|i| if i % 2 == 0 { 1.15 } else { 0.85 }), 5.0);
        assert!(wrong < 1e-3, "{k}: companion, p = {wrong}");
    }
}

#[test]
fn density_is_above_zero_wherever_there_is_light() {
    let images = [sparse()];
    let all = environment(&images, &[map(0, 1.0, DMat4::from_rotation_x(0.3))]);
    let mut dark = 0;
    for i in 0..100_000 {
        let w = sample_sphere(random2(6, i));
        let (pdf, radiance) = (all.pdf_dir_environment(w), all.environment(textures(&images), w));
        assert!(pdf > 0.0 || radiance == Rgb::ZERO, "{w}: {radiance}");
        assert!(pdf.is_finite());
        dark += (pdf == 0.0) as u32;
    }
    assert!(dark > 1000, "black cells are left out: {dark}");
    for w in [Vec3::Y, -Vec3::Y, Vec3::NEG_Z, Vec3::new(0.0, -0.0, -1.0)] {
        assert!(all.pdf_dir_environment(w).is_finite() && all.environment(textures(&images), w).is_finite());
    }
}

#[test]
fn power_and_sampled_integral_agree_with_plain_integration() {
    let images = [sparse()];
    let all = environment(&images, &[map(0, 1.0, DMat4::IDENTITY)]);
    let n = 1 << 18;
    let plain = |i: u64| all.environment(textures(&images), sample_sphere(random2(2, i))).x as f64 * 4.0 * PI;
    let sampled = |i: u64| {
        let s = all.sample(&[], textures(&images), Vec3::ZERO, 0.5, random2(3, i));
        s.map_or(0.0, |s| s.weight.x as f64)
    };
    let stats = |f: &dyn Fn(u64) -> f64| {
        let (s, q) = (0..n).map(f).fold((0.0, 0.0), |(s, q), x| (s + x, q + x * x));
        let mean = s / n as f64;
        (mean, (q / n as f64 - mean * mean) / n as f64)
    };
    let ((a, va), (b, vb)) = (stats(&plain), stats(&sampled));
    assert!(z_test_p(a - b, va + vb, 0.0) > 0.01, "{a} {b}");
    assert!(vb < 0.1 * va, "sampling by radiance pays: {vb} {va}");
    assert!(z_test_p(a * 1.1 - b, va + vb, 0.0) < 0.01);
    // Power counts each cell with the mean of its corners: close to the integral of this coarse map.
    let power = all.infos[0].power.x as f64 / (PI * 100.0);
    assert!((power / b - 1.0).abs() < 0.1, "{power} {b}");
    assert_eq!(all.infos[0].kind, "envmap");
}

#[test]
fn odd_maps_are_handled() {
    let single = Bitmap { width: 1, height: 1, pixels: vec![Rgb::splat(2.0)] };
    let images = [single, Bitmap::default()];
    let all = environment(&images, &[map(0, 1.0, DMat4::IDENTITY), map(1, 1.0, DMat4::IDENTITY)]);
    let t = textures(&images);
    let mut sum = 0.0;
    for i in 0..1000 {
        let w = sample_sphere(random2(5, i));
        assert_eq!(all.environment(t, w), Rgb::splat(2.0));
        sum += all.pdf_dir_environment(w) * 4.0 * PI as f32 / 1000.0;
    }
    assert!((sum - 1.0).abs() < 1e-3, "{sum}");
}
