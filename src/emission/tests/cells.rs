//! Faces of the cube: measures by quadrature, draws by chi-square, inverses.

use super::*;
use crate::emission::chart::{Face, cube, hemicube};
use crate::math::stats::{chi_square_p, sidak};
use std::f64::consts::{PI, TAU};

fn faces() -> Vec<Face> {
    hemicube().into_iter().chain(cube()).collect()
}

/// A rectangle on a face.
fn rectangle(face: &Face, seed: u64, i: u64, scale: f64) -> ([f64; 2], [f64; 2]) {
    let r = random(seed, i);
    let span = |lo: f64, hi: f64, a: f64, b: f64| {
        let x = lo + a * (hi - lo);
        [x, x + (hi - x) * b * scale]
    };
    let (x, y) = (span(-1.0, 1.0, r[0], r[1]), span(face.y[0], face.y[1], r[2], r[3]));
    ([x[0], y[0]], [x[1], y[1]])
}

#[test]
fn measures_of_rectangles_are_the_integrals_of_their_densities() {
    for (k, face) in faces().iter().enumerate() {
        for i in 0..60 {
            let (lo, hi) = rectangle(face, 20 + k as u64, i, if i % 3 == 0 { 1e-3 } else { 1.0 });
            let n = 60;
            let step = [0, 1].map(|a| (hi[a] - lo[a]) / f64::from(n));
            let mut sum = 0.0;
            for j in 0..n * n {
                let at = [f64::from(j % n), f64::from(j / n)];
                sum += face.density(lo[0] + (at[0] + 0.5) * step[0], lo[1] + (at[1] + 0.5) * step[1]);
            }
            let sum = sum * step[0] * step[1];
            let measure = face.measure(lo, hi);
            assert!((measure - sum).abs() < 1e-3 * sum + 1e-15, "{face:?} {lo:?} {hi:?}: {measure} {sum}");
        }
    }
    let whole = |f: &Face| f.measure([-1.0, f.y[0]], [1.0, f.y[1]]);
    assert!((hemicube().iter().map(whole).sum::<f64>() - PI).abs() < 1e-12);
    assert!((cube().iter().map(whole).sum::<f64>() - 2.0 * TAU).abs() < 1e-12);
}

#[test]
fn points_come_back_as_their_numbers_and_directions_find_their_face() {
    for (k, face) in faces().iter().enumerate() {
        for i in 0..500 {
            let (lo, hi) = rectangle(face, 40 + k as u64, i, if i % 3 == 0 { 1e-2 } else { 1.0 });
            let [a, b, ..] = random(60 + k as u64, i);
            let p = face.point(lo, hi, [a, b]);
            assert!((0..2).all(|k| p[k] >= lo[k] && p[k] <= hi[k]), "{face:?} {lo:?} {hi:?} {p:?}");
            let tiny = (hi[0] - lo[0]) * (hi[1] - lo[1]) < 1e-5;
            let back = face.invert(lo, hi, p);
            let bound = if tiny { 1e-2 } else { 1e-6 };
            assert!(
                (back[0] - a).abs() < bound && (back[1] - b).abs() < bound,
                "{face:?} {lo:?} {hi:?} {p:?} {back:?}"
            );
            let found = face.locate(face.along(p).normalize()).expect("on its face");
            assert!((found[0] - p[0]).abs() + (found[1] - p[1]).abs() < 1e-12);
        }
    }
}

/// Directions drawn on all faces together are those of the whole, in coordinates that the faces do not use.
#[test]
fn faces_together_are_cosine_and_uniform_directions() {
    let n = 40_000;
    let p = |faces: &[Face], skew: f64| {
        let total: f64 = faces.iter().map(|f| f.measure([-1.0, f.y[0]], [1.0, f.y[1]])).sum();
        let mut seen = vec![0.0; 100];
        for i in 0..n {
            let r = random(70, i);
            let mut u = r[0] * total;
            let k = faces.iter().position(|f| {
                u -= f.measure([-1.0, f.y[0]], [1.0, f.y[1]]);
                u < 0.0
            });
            let face = &faces[k.unwrap_or(faces.len() - 1)];
            let q = face.point([-1.0, face.y[0]], [1.0, face.y[1]], [r[1].powf(skew), r[2]]);
            let w = face.along(q).normalize();
            let height = if faces.len() == 5 { w.z * w.z } else { 0.5 * (w.z + 1.0) };
            let cell = |x: f64| ((x * 10.0) as usize).min(9);
            seen[cell(height) * 10 + cell(w.y.atan2(w.x) / TAU + 0.5)] += 1.0;
        }
        chi_square_p(&seen, &[n as f64 / 100.0; 100], 5.0)
    };
    for faces in [hemicube(), cube()] {
        let fit = p(&faces, 1.0);
        assert!(fit > sidak(0.01, 2), "{fit}");
        let wrong = p(&faces, 1.1);
        assert!(wrong < 1e-3, "{wrong}");
    }
}
