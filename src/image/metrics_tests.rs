//! Tests of the errors. Where a test names figures of the script, they come from the functions of
//! `time_to_error.py` (numpy, f64) on the same pixels.

use super::*;
use crate::math::sampler::{hash, unit_f32};

const W: usize = 20;
const H: usize = 17;

fn noise(seed: u64, amount: f32) -> Picture {
    let value = |i: usize, c: u64| {
        let signal = 0.7 + (i % W) as f32 / W as f32 + 0.3 * c as f32;
        signal + amount * (unit_f32(hash(seed, 3 * i as u64 + c)) - 0.5)
    };
    Picture::new(W, H, (0..W * H).map(|i| Rgb::new(value(i, 0), value(i, 1), value(i, 2))).collect())
}

fn close(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-6 * b.abs().max(1e-3), "{a} is not {b}");
}

#[test]
fn equal_pictures_have_no_error() {
    let picture = noise(1, 0.1);
    let e = Reference::new(&picture, None).unwrap().errors(&picture, 0.1).unwrap();
    assert_eq!([e.rmse, e.relmse, e.relmse_trimmed, e.blocks, e.bias_percent, e.flip], [0.0; 6]);
    assert_eq!((e.pixels, e.masked, e.nonfinite), (W * H, 0, 0));
    assert_eq!(e.relmse_noise_free, None);
}

#[test]
fn constant_pictures_have_the_errors_one_computes_by_hand() {
    let reference = Picture::new(16, 8, vec![Rgb::new(1.0, 2.0, 0.0); 128]);
    let image = Picture::new(16, 8, vec![Rgb::new(1.1, 1.8, 0.1); 128]);
    let e = Reference::new(&reference, None).unwrap().errors(&image, 0.0).unwrap();
    close(e.rmse, ((0.01 + 0.04 + 0.01) / 3.0f64).sqrt());
    let relative = (0.01 / 1.01 + 0.04 / 4.01 + 0.01 / 0.01) / 3.0;
    for value in [e.relmse, e.relmse_trimmed, e.blocks] {
        close(value, relative);
    }
    close(e.bias_rgb_percent[0], 10.0);
    close(e.bias_rgb_percent[1], -10.0);
    assert_eq!(e.bias_rgb_percent[2], f64::INFINITY);
    assert!(e.bias_percent.abs() < 1e-4);
}

#[test]
fn trimming_drops_the_worst_pixels_only() {
    let reference = Picture::new(100, 10, vec![Rgb::ONE; 1000]);
    let mut image = reference.clone();
    image.pixels[123] = Rgb::splat(1001.0);
    image.pixels[500] = Rgb::splat(2.0);
    let reference = Reference::new(&reference, None).unwrap();
    let e = reference.errors(&image, 0.1).unwrap();
    close(e.relmse, (1e6 + 1.0) / 1.01 / 1000.0);
    close(e.relmse_trimmed, 1.0 / 1.01 / 999.0);
    assert_eq!(reference.errors(&image, 0.2).unwrap().relmse_trimmed, 0.0);
    assert!(reference.errors(&image, 100.0).unwrap().relmse_trimmed == 0.0, "one pixel is always kept");
}

#[test]
fn two_halves_cancel_the_noise_of_the_reference() {
    // The picture is exact; against noisy halves the plain error shows their noise, the noise-free one nothing:
    // its standard error is below 6e-4 (blocks: 1e-4), five of them allowed.
    let (exact, a, b) = (noise(0, 0.0), noise(1, 0.5), noise(2, 0.5));
    let e = Reference::new(&a, Some(&b)).unwrap().errors(&exact, 0.1).unwrap();
    assert!(e.relmse > 0.004, "{}", e.relmse);
    assert!(e.relmse_noise_free.unwrap().abs() < 3e-3, "{:?}", e.relmse_noise_free);
    assert!(e.blocks_noise_free.unwrap().abs() < 5e-4, "{:?}", e.blocks_noise_free);
    // The companion: with dependent halves nothing cancels.
    let dependent = Reference::new(&a, Some(&a)).unwrap().errors(&exact, 0.1).unwrap();
    assert!(dependent.relmse_noise_free.unwrap() > 0.008);
}

#[test]
fn masked_and_broken_pixels() {
    let good = noise(1, 0.1);
    let (mut reference, mut image) = (good.clone(), good.clone());
    reference.pixels[0].x = f32::NAN;
    reference.pixels[1].y = f32::INFINITY;
    reference.mask = Some((0..W * H).map(|i| i != 2).collect());
    for i in 0..3 {
        image.pixels[i] = Rgb::splat(1e9);
    }
    let reference = Reference::new(&reference, None).unwrap();
    let e = reference.errors(&image, 0.0).unwrap();
    assert_eq!((e.masked, e.nonfinite), (3, 0));
    assert_eq!([e.rmse, e.relmse, e.blocks, e.bias_percent, e.flip], [0.0; 5]);

    image.pixels[40].z = f32::NAN;
    image.pixels[0] = Rgb::NAN;
    let e = reference.errors(&image, 0.0).unwrap();
    assert_eq!(e.nonfinite, 1, "only counted pixels");
    close(e.relmse, relative_error(Rgb::ZERO, good.pixels[40]) / (W * H - 3) as f64);
}

#[test]
fn sizes_must_agree_and_something_must_count() {
    let picture = noise(1, 0.1);
    let other = Picture::new(3, 2, vec![Rgb::ONE; 6]);
    let reference = Reference::new(&picture, None).unwrap();
    let message = reference.errors(&other, 0.1).unwrap_err();
    assert!(message.contains("3 x 2") && message.contains("20 x 17"), "{message}");
    assert!(Reference::new(&picture, Some(&other)).is_err());
    let nothing = Picture::new(1, 1, vec![Rgb::NAN]);
    assert!(Reference::new(&nothing, None).unwrap().errors(&nothing, 0.1).is_err());
}

#[test]
fn small_pictures_have_no_blocks() {
    let picture = Picture::new(7, 7, vec![Rgb::ONE; 49]);
    let e = Reference::new(&picture, Some(&picture)).unwrap().errors(&picture, 0.1).unwrap();
    assert_eq!((e.blocks, e.blocks_noise_free), (0.0, Some(0.0)));
}
