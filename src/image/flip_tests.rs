//! Tests of FLIP. The oracle's figures come from the authors' program: `pip install flip-evaluator` (1.7),
//! `evaluate(reference, test, "LDR", inputsRGB=False, applyMagma=False)` on the pattern below.

use super::*;

const W: usize = 24;
const H: usize = 16;

/// A pattern with edges, ramps and saturated colours.
fn pattern(k: usize) -> Vec<Rgb> {
    let pixel = |i: usize| {
        let (x, y) = (i % W, i / W);
        let r = ((x * 7 + y * 3 * k) % 23) as f32 / 22.0;
        let g = ((x * x + 5 * y + k) % 17) as f32 / 16.0;
        Rgb::new(r, g, if (x / (3 + k)).is_multiple_of(2) { 0.9 } else { 0.1 })
    };
    (0..W * H).map(pixel).collect()
}

#[test]
fn agrees_with_the_authors_program() {
    let cases = [
        (1, 2, 0.447_538_5, [0.302_975_74, 0.404_711_2, 0.918_292_1]),
        (2, 3, 0.466_490_3, [0.309_784_9, 0.316_023_5, 0.960_987_1]),
    ];
    for (a, b, mean, values) in cases {
        let map = flip(&pattern(a), &pattern(b), W, H, PIXELS_PER_DEGREE);
        let ours = map.iter().sum::<f32>() / map.len() as f32;
        assert!((ours - mean).abs() < 5e-6, "mean {ours}, theirs {mean}");
        for (i, theirs) in [0, 8 * W + 12, 15 * W + 23].into_iter().zip(values) {
            assert!((map[i] - theirs).abs() < 2e-5, "pixel {i}: {}, theirs {theirs}", map[i]);
        }
    }
}

#[test]
fn equal_pictures_differ_by_nothing_and_order_does_not_matter() {
    let (a, b) = (pattern(1), pattern(2));
    assert!(flip(&a, &a, W, H, PIXELS_PER_DEGREE).iter().all(|&v| v == 0.0));
    assert_eq!(flip(&a, &b, W, H, PIXELS_PER_DEGREE), flip(&b, &a, W, H, PIXELS_PER_DEGREE));
}

#[test]
fn ends_of_the_scale() {
    let plain = |c: Rgb| vec![c; W * H];
    let mean = |a: Rgb, b: Rgb| flip(&plain(a), &plain(b), W, H, PIXELS_PER_DEGREE)[W * H / 2];
    // Green against blue is the largest difference there is.
    assert!((mean(Rgb::Y, Rgb::Z) - 1.0).abs() < 1e-4);
    assert!(mean(Rgb::splat(0.5), Rgb::splat(0.51)) < 0.1);
    // Values beyond the screen's range, and no values, are clamped.
    assert_eq!(mean(Rgb::splat(7.0), Rgb::ONE), 0.0);
    assert_eq!(mean(Rgb::splat(f32::NAN), Rgb::ZERO), 0.0);
}

#[test]
fn sizes_smaller_than_the_kernels_work() {
    for (w, h) in [(1, 1), (1, 40), (40, 1), (3, 2)] {
        let (a, b) = (vec![Rgb::ONE; w * h], vec![Rgb::ZERO; w * h]);
        assert!(flip(&a, &b, w, h, PIXELS_PER_DEGREE).iter().all(|v| (0.0..=1.0).contains(v)));
    }
}
