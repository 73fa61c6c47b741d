//! Uniformity of the samplers against the closed-form solid angle of cells; irradiance against integration.

use super::*;
use crate::math::DVec3;
use crate::math::sampler::{hash, unit_f64};
use crate::math::stats::{chi_square_p, sidak};

fn uniform(seed: u64, i: u64) -> [f64; 2] {
    let f = |k: u64| unit_f64(hash(seed, k));
    [f(2 * i), f(2 * i + 1)]
}

fn rectangle(center: DVec3, ex: DVec3, ey: DVec3) -> SphericalRectangle {
    // From a point that is not the origin, which must make no difference.
    let p = DVec3::new(1.0, -2.0, 0.5);
    RectangleFrame::new(center + p, ex, ey).unwrap().seen_from(p)
}

/// Centre and half edges: near, far, huge, tiny, grazing, elongated, with the foot inside and outside.
fn rectangles() -> Vec<[DVec3; 3]> {
    let v = DVec3::new;
    let mut list = vec![
        [v(0.2, 0.1, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.7, 0.0)],
        [v(3.0, 2.0, 0.5), v(1.0, 0.0, 0.0), v(0.0, 0.7, 0.0)],
        [v(300.0, -200.0, 900.0), v(0.3, 0.4, 0.0), v(-0.4, 0.3, 0.0)],
        [v(0.0, 0.0, 1e-3), v(50.0, 0.0, 0.0), v(0.0, 80.0, 0.0)],
        [v(1.5, 0.0, 1e-3), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)],
        [v(0.5, 3.0, 0.02), v(2.0, 0.0, 0.0), v(0.0, 1.0, 0.0)],
        [v(0.0, 9.0, 1.0), v(0.001, 0.0, 0.0), v(0.0, 4.0, 0.0)],
        [v(3.0, 0.5, 1e-5), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)],
        [v(0.3, 3.0, -1e-5), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)],
        [v(4e3, 1e3, 3e3), v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0)],
    ];
    list.push([v(2.0, -1.0, 3.0), v(0.1, 0.8, 0.2), v(0.4, -0.1, 0.2)]); // orthogonal, not along the axes
    list
}

fn corners([c, x, y]: [DVec3; 3]) -> [DVec3; 4] {
    [c - x - y, c + x - y, c + x + y, c - x + y]
}

#[test]
fn rectangle_solid_angle_agrees_with_two_triangles() {
    for r in rectangles() {
        let ours = rectangle(r[0], r[1], r[2]).solid_angle();
        let reference = solid_angle(&corners(r));
        assert!((ours / reference - 1.0).abs() < 1e-6, "{r:?}: {ours} {reference}");
    }
    // The whole hemisphere, and nothing.
    let wide = rectangle(DVec3::new(0.0, 0.0, 1e-9), DVec3::X, DVec3::Y);
    assert!((wide.solid_angle() - std::f64::consts::TAU).abs() < 1e-6);
    let edge_on = rectangle(DVec3::new(3.0, 0.0, 0.0), DVec3::X, DVec3::Y);
    assert_eq!(edge_on.solid_angle(), 0.0);
    assert!(RectangleFrame::new(DVec3::Z, DVec3::ZERO, DVec3::Y).is_none());
}

/// p-value of points binned in 8 x 8 cells of the shape's own coordinates against the solid angle of the cells.
fn cell_p(cell: impl Fn(f64, f64) -> DVec3, total: f64, draw: impl Fn(u64) -> [f64; 2]) -> f64 {
    const N: usize = 8;
    let count = 20_000;
    let mut observed = vec![0.0; N * N];
    for i in 0..count {
        let p = draw(i).map(|x| ((x * N as f64) as usize).min(N - 1));
        observed[p[1] * N + p[0]] += 1.0;
    }
    let at = |x: usize, y: usize| cell(x as f64 / N as f64, y as f64 / N as f64);
    let expected: Vec<f64> = (0..N * N)
        .map(|i| (i % N, i / N))
        .map(|(x, y)| solid_angle(&[at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]))
        .map(|omega| omega / total * count as f64)
        .collect();
    let sum: f64 = expected.iter().sum();
    assert!((sum / count as f64 - 1.0).abs() < 1e-5, "cells make up the shape: {sum}");
    chi_square_p(&observed, &expected, 5.0)
}

#[test]
fn rectangle_samples_are_uniform_in_solid_angle_and_invert() {
    let list = rectangles();
    for (k, &[c, ex, ey]) in list.iter().enumerate() {
        let s = rectangle(c, ex, ey);
        let own = |p: DVec3| {
            let q = p - c;
            [q.dot(ex) / ex.length_squared(), q.dot(ey) / ey.length_squared()].map(|x| 0.5 + 0.5 * x)
        };
        let cell = |x: f64, y: f64| c + ex * (2.0 * x - 1.0) + ey * (2.0 * y - 1.0);
        let draw = |i| own(s.sample(uniform(k as u64, i)));
        let p = cell_p(cell, s.solid_angle(), draw);
        assert!(p > sidak(0.01, list.len()), "{k}: p = {p}");
        for i in 0..200 {
            let u = uniform(k as u64, i);
            let v = s.invert(s.sample(u));
            assert!((u[0] - v[0]).abs() < 1e-4 && (u[1] - v[1]).abs() < 1e-4, "{k}: {u:?} {v:?}");
        }
    }
    // Companion: uniform by area, from near, is told apart.
    let [c, ex, ey] = list[0];
    let omega = solid_angle(&corners(list[0]));
    let p = cell_p(|x, y| c + ex * (2.0 * x - 1.0) + ey * (2.0 * y - 1.0), omega, |i| uniform(9, i));
    assert!(p < 1e-6);
}

fn triangles() -> Vec<[DVec3; 3]> {
    let v = DVec3::new;
    vec![
        [v(1.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, 1.0)],
        [v(-1.0, -1.0, 0.3), v(2.0, -1.0, 0.3), v(0.0, 3.0, 0.3)],
        [v(500.0, 20.0, 3.0), v(500.0, 20.3, 3.0), v(500.2, 20.1, 3.4)],
        [v(-40.0, -30.0, 1e-3), v(50.0, -20.0, 1e-3), v(3.0, 60.0, 1e-3)],
        [v(1.0, 0.0, 1e-3), v(3.0, -1.0, 1e-3), v(3.0, 1.0, 1e-3)],
        [v(0.0, 5.0, 1.0), v(0.0, 9.0, 1.0), v(0.001, 7.0, 1.0)],
        [v(2.0, 0.0, 1e-6), v(3.0, -1.0, 1e-6), v(3.0, 1.0, 1e-6)],
        [v(4e3, 1e3, 3e3), v(4e3, 1e3 + 1.0, 3e3), v(4e3 - 1.0, 1e3, 3e3 + 0.3)],
        [v(1.0, 2.0, -4.0), v(1.5, 1.0, -1.0), v(-3.0, 0.2, -0.7)],
    ]
}

/// Barycentrics to the square and back: (x, y) -> vertices a (1-x), b x (1-y), c x y.
fn to_square(b: DVec3) -> [f64; 2] {
    let x = 1.0 - b.x;
    [x, b.z / x]
}

#[test]
fn triangle_samples_are_uniform_in_solid_angle_and_invert() {
    let list = triangles();
    for (k, &[a, b, c]) in list.iter().enumerate() {
        let s = SphericalTriangle::new(a, b, c).unwrap();
        assert!((s.solid_angle() / solid_angle(&[a, b, c]) - 1.0).abs() < 3e-7);
        let cell = |x: f64, y: f64| a * (1.0 - x) + b * (x * (1.0 - y)) + c * (x * y);
        let p = cell_p(cell, s.solid_angle(), |i| to_square(s.sample(uniform(k as u64, i)).barycentric));
        assert!(p > sidak(0.01, list.len()), "{k}: p = {p}");
        for i in 0..200 {
            let u = uniform(k as u64, i);
            let q = s.sample(u);
            let p = a * q.barycentric.x + b * q.barycentric.y + c * q.barycentric.z;
            assert!((p - q.position).length() < 1e-9 * p.length(), "{k}: {p} {q:?}");
            assert!((q.barycentric.element_sum() - 1.0).abs() < 1e-12 && q.barycentric.min_element() >= 0.0);
            let v = s.invert(q.position.normalize());
            assert!((u[0] - v[0]).abs() < 1e-4 && (u[1] - v[1]).abs() < 1e-4, "{k}: {u:?} {v:?}");
        }
        for u in [[0.0, 0.0], [1.0 - 1e-16, 1.0 - 1e-16], [0.0, 1.0 - 1e-16], [1.0 - 1e-16, 0.0]] {
            assert!(s.sample(u).position.is_finite(), "{k}: {u:?}");
        }
    }
    let [a, b, c] = list[1];
    let cell = |x: f64, y: f64| a * (1.0 - x) + b * (x * (1.0 - y)) + c * (x * y);
    let p = cell_p(cell, solid_angle(&list[1]), |i| {
        let [u, v] = uniform(9, i);
        [u.sqrt(), v]
    });
    assert!(p < 1e-6, "uniform by area is told apart");
}

#[test]
fn octant_has_half_pi_and_a_quarter_of_the_irradiance() {
    let t = triangles()[0];
    assert!((solid_angle(&t) - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    // Integral of cos over the octant: pi / 4. Edges are precise to some 1e-8, however far away.
    let e = irradiance(&t, DVec3::Z);
    assert!((e - std::f64::consts::FRAC_PI_4).abs() < 1e-7, "{e}");
}

#[test]
fn irradiance_agrees_with_integration_also_across_the_horizon() {
    let v = DVec3::new;
    for r in rectangles().into_iter().take(2).chain([[v(0.3, 0.2, 0.4), v(0.0, 0.5, 0.9), v(0.9, 0.0, 0.0)]]) {
        for n in [v(0.0, 0.0, -1.0), v(0.5, 0.5, 0.7).normalize(), v(-0.6, 0.0, 0.8), v(0.0, 0.0, 1.0)] {
            let s = rectangle(r[0], r[1], r[2]);
            const N: usize = 400;
            let mut sum = 0.0;
            for i in 0..N * N {
                let at = |k: usize| (k as f64 + 0.5) / N as f64;
                sum += s.sample([at(i % N), at(i / N)]).normalize().dot(n).max(0.0);
            }
            let integral = sum / (N * N) as f64 * s.solid_angle();
            let closed = irradiance(&corners(r), n);
            assert!((integral - closed).abs() < 2e-5 * s.solid_angle(), "{r:?} {n}: {integral} {closed}");
        }
    }
}
