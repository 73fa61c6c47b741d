//! The maps of lights: derivatives against finite differences, inverses, determinants.

use super::*;
use crate::emission::warp;
use crate::math::stats::{chi_square_p, sidak};
use std::f64::consts::{PI, TAU};

/// Values at u +- h e_k and `factor` times the derivatives at u agree.
fn differences(name: &str, source: &Source, u: [f64; 4], factor: f64, check: &mut usize) {
    // Positions are rounded to f32, and near the rim of a hemisphere derivatives grow without bound.
    let h = 1e-3;
    let Some((start, _)) = source.emit(u) else { return };
    for k in 0..4 {
        let moved = |s: f64| {
            let mut v = u;
            v[k] += s * h;
            v.iter().all(|x| (0.0..1.0).contains(x)).then(|| source.emit(v)).flatten().map(|e| e.0)
        };
        let (Some(a), Some(b)) = (moved(-1.0), moved(1.0)) else { continue };
        let diff = |f: fn(&Start) -> DVec3| {
            let (back, forth) = ((f(&start) - f(&a)) / h, (f(&b) - f(&start)) / h);
            (0.5 * (back + forth), (back - forth).length())
        };
        for (f, want) in [(diff(|s| s.o.as_dvec3()), factor * start.o_u[k]), (diff(|s| s.d), factor * start.d_u[k])] {
            let (got, error) = f;
            // Where the differences to both sides disagree, there is a fold of the map or a rim.
            if error > 0.05 * (1.0 + want.length()) {
                continue;
            }
            *check += 1;
            // Tables have steps in their slopes.
            let steps = if source.is_tabulated() { 0.05 } else { 1e-3 };
            let bound = 2e-3 + error + steps * want.length();
            assert!((got - want).length() <= bound, "{name} at {u:?}, {k}: {got} {want} ({error})");
        }
    }
}

#[test]
fn derivatives_are_those_of_the_map() {
    for (name, scene) in every_light() {
        let source = Source::new(&scene, 0);
        let mut checks = 0;
        for i in 0..400 {
            differences(name, &source, random(1, i), 1.0, &mut checks);
        }
        assert!(checks > 800, "{name}: {checks} comparisons only");
    }
}

#[test]
#[should_panic(expected = "wrong slope")]
fn a_wrong_derivative_is_noticed() {
    let (_, scene) = every_light().swap_remove(0);
    differences("wrong slope", &Source::new(&scene, 0), [0.3, 0.4, 0.5, 0.6], 1.03, &mut 0);
}

#[test]
fn numbers_come_back() {
    for (name, scene) in every_light() {
        let source = Source::new(&scene, 0);
        let mut seen = 0;
        for i in 0..2000 {
            let u = random(2, i);
            let Some((start, _)) = source.emit(u) else { continue };
            let back = source.invert(start.o.as_dvec3(), start.d).unwrap_or_else(|| panic!("{name} at {u:?}: none"));
            let used = [source.has_position(), source.has_position(), source.has_direction(), source.has_direction()];
            // At the borders of a table's cells rounding may move a ray to the next row, with numbers of its own.
            let (again, _) = source.emit(back.map(|x| x.min(1.0 - 1e-12))).expect("it emits");
            let (moved, turned) = (again.o.distance(start.o), (again.d - start.d).length());
            assert!(moved < 1e-3 && turned < 1e-2, "{name}: {u:?} {back:?}: {moved} {turned}");
            for k in (0..4).filter(|&k| used[k] && !source.is_tabulated()) {
                // Angles wrap round; positions are f32, and those of a disk seen edge-on are ill-conditioned.
                let miss = (u[k] - back[k]).abs();
                assert!(miss.min(1.0 - miss) < 2e-3, "{name}: {u:?} {back:?}");
            }
            seen += 1;
        }
        assert!(seen > 1000, "{name}: {seen}");
        // What is no ray of the light has no numbers.
        if let Some((start, _)) = source.emit([0.4, 0.3, 0.6, 0.7]) {
            let far = start.o.as_dvec3() + DVec3::new(40.0, 10.0, -60.0);
            if source.has_position() {
                assert_eq!(source.invert(far, start.d), None, "{name}");
            }
        }
    }
}

#[test]
fn maps_preserve_their_measures() {
    let profile = warp::Profile::new(0.4, 0.9);
    for i in 0..3000 {
        let [a, b, ..] = random(3, i);
        let u = [a, b];
        let q = warp::disk(u);
        let det = q.by[0][0] * q.by[1][1] - q.by[0][1] * q.by[1][0];
        assert!((det - PI).abs() < 1e-9, "disk {u:?}: {det}");
        let area = |w: &Mapped<DVec3>| w.by[0].cross(w.by[1]).dot(w.at);
        let w = warp::hemisphere(u);
        assert!((area(&w).abs() * w.at.z - PI).abs() < 1e-6, "hemisphere {u:?}");
        let w = warp::sphere(u);
        assert!((area(&w).abs() - 2.0 * TAU).abs() < 1e-6 && (w.at.length() - 1.0).abs() < 1e-12, "sphere {u:?}");
        let w = profile.direction(u);
        let density = profile.intensity(w.at.z.acos()) / profile.solid_angle();
        assert!((area(&w).abs() * density - 1.0).abs() < 1e-4, "profile {u:?}: {}", area(&w) * density);
    }
}

#[test]
fn the_integral_of_a_profile_is_the_power_of_a_spot() {
    for (beam, cutoff) in [(0.3, 0.6), (0.5, 0.5), (0.0, 1.2), (1e-4, 2e-4)] {
        let profile = warp::Profile::new(beam, cutoff);
        let n = 100_000;
        let step = cutoff / n as f64;
        let sum: f64 = (0..n).map(|i| (i as f64 + 0.5) * step).map(|t| profile.intensity(t) * t.sin()).sum();
        assert!((profile.solid_angle() / (TAU * sum * step) - 1.0).abs() < 1e-6, "{beam} {cutoff}");
    }
}

/// Corner cases of the square: finite rays, unit directions.
#[test]
fn corners_of_the_square_are_safe() {
    let top = 1.0 - f64::EPSILON;
    for (name, scene) in every_light() {
        let source = Source::new(&scene, 0);
        for k in 0..81 {
            let u = [0, 1, 2, 3].map(|d| [0.0, 0.5, top][k / 3usize.pow(d) % 3]);
            if let Some((start, flux)) = source.emit(u) {
                assert!((start.d.length() - 1.0).abs() < 1e-6 && flux.is_finite(), "{name} {u:?}");
                let spread = start.spread([0.1; 4]);
                assert!(spread.o.iter().chain(&spread.d).all(|v| v.is_finite()), "{name} {u:?}: {spread:?}");
            }
        }
    }
}

/// Directions of the map of the sphere fall uniformly on it: its own determinant could be right and cover half of it twice.
#[test]
fn the_map_of_the_sphere_covers_it_once() {
    let mut seen = vec![0.0; 12 * 12];
    let mut skewed = vec![0.0; 12 * 12];
    for i in 0..50_000 {
        let [a, b, ..] = random(4, i);
        let cell = |w: DVec3| {
            let z = ((w.z + 1.0) * 6.0) as usize;
            let turn = (w.y.atan2(w.x) / TAU + 0.5) * 12.0;
            z.min(11) * 12 + (turn as usize).min(11)
        };
        seen[cell(warp::sphere([a, b]).at)] += 1.0;
        skewed[cell(warp::sphere([a * a, b]).at)] += 1.0;
    }
    let expected = vec![50_000.0 / 144.0; 144];
    assert!(chi_square_p(&seen, &expected, 5.0) > sidak(0.01, 1));
    assert!(chi_square_p(&skewed, &expected, 5.0) < 1e-6);
}

#[test]
fn boxes_round_pieces_of_the_disk_are_tight() {
    for i in 0..2000 {
        let r = random(5, i);
        let size = [1.0, 0.1][i as usize % 2];
        let lo = [r[0], r[1]];
        let hi = [0, 1].map(|k| lo[k] + (1.0 - lo[k]) * r[2 + k] * size);
        let [low, high] = warp::disk_bounds(lo, hi);
        let (mut min, mut max) = ([2.0f64; 2], [-2.0f64; 2]);
        for j in 0..400 {
            let f = [f64::from(j % 20) / 19.0, f64::from(j / 20) / 19.0];
            let q = warp::disk([0, 1].map(|k| lo[k] + f[k] * (hi[k] - lo[k]))).at;
            for k in 0..2 {
                assert!(q[k] >= low[k] - 1e-12 && q[k] <= high[k] + 1e-12, "{lo:?} {hi:?}: {q:?}");
                (min[k], max[k]) = (min[k].min(q[k]), max[k].max(q[k]));
            }
        }
        let slack = 0.15 * (hi[0] - lo[0] + hi[1] - lo[1]) + 1e-12;
        assert!((0..2).all(|k| min[k] - low[k] < slack && high[k] - max[k] < slack), "{lo:?} {hi:?}");
    }
}
