//! Tangents against differences, area sampling against the area element.

use super::super::super::surface::SurfacePoint;
use super::super::point::mesh_point;
use super::*;
use crate::math::Vec2;
use crate::math::sampler::{hash, unit_f32};
use crate::math::stats::chi_square_p;

#[test]
fn tangents_are_the_derivatives_of_the_position() {
    // p(u + h, v) - p(u, v) over h, by points sampled close to one another: solve for the change of uv.
    for shape in zoo(1.0, 0.0) {
        for i in 0..200u64 {
            let u = Vec2::new(unit_f32(hash(i, 5)), unit_f32(hash(i, 6))) * 0.8 + 0.1;
            let prim = (i % shape.primitive_count() as u64) as u32;
            let s = shape.sample_area(0, prim, u).0;
            for step in [Vec2::new(1e-3, 0.0), Vec2::new(0.0, 1e-3)] {
                let q = shape.sample_area(0, prim, u + step).0;
                let duv = q.uv - s.uv;
                if duv.abs().max_element() > 0.3 || (u.x - u.y).abs() < 5e-3 {
                    continue; // across the seam of u or the fold of a warp
                }
                let predicted = s.dp_du * duv.x + s.dp_dv * duv.y;
                let error = (q.p - s.p - predicted).length();
                assert!(error < 0.05 * (q.p - s.p).length() + 2e-5, "{error}: {} {}", q.p - s.p, predicted);
            }
        }
    }
}

#[test]
fn area_samples_are_uniform_and_areas_are_right() {
    for shape in zoo(1.0, 0.0) {
        // Half-space test: the share of samples below a plane through the shape, against a fine lattice of parameters
        // weighted by the area element |dp/du x dp/dv|, which the sampler does not use.
        let n = 20_000u64;
        for prim in [0, shape.primitive_count() as u32 - 1] {
            let (mut seen, mut expected, mut area) = ([0.0f64; 8], [0.0f64; 8], 0.0f64);
            let mid = shape.sample_area(0, prim, Vec2::splat(0.3)).0.p;
            let cell = |p: Vec3| {
                let q = p - mid;
                (q.x > 0.0) as usize + 2 * (q.y > 0.0) as usize + 4 * (q.x + q.z > 0.1) as usize
            };
            for i in 0..n {
                let u = Vec2::new(unit_f32(hash(i, 7)), unit_f32(hash(i, 8)));
                let (s, pdf) = shape.sample_area(0, prim, u);
                seen[cell(s.p)] += 1.0;
                assert!((pdf * shape.primitive_area(prim) - 1.0).abs() < 1e-5);
            }
            let m = 500;
            for j in 0..m {
                for i in 0..m {
                    let q = Vec2::new((i as f32 + 0.5) / m as f32, (j as f32 + 0.5) / m as f32);
                    let Some(s) = at_uv(&shape, prim, q) else { continue };
                    let weight = (s.dp_du.cross(s.dp_dv).length() / (m * m) as f32) as f64;
                    expected[cell(s.p)] += weight;
                    area += weight;
                }
            }
            assert!((area / shape.primitive_area(prim) as f64 - 1.0).abs() < 5e-3, "{area}");
            // Thin cells carry the lattice's error: 5e-3 of 20,000 is below the noise of the counts kept here.
            let expected = expected.map(|e| e / area * n as f64);
            let seen_right = seen.map(|s| s);
            assert!(chi_square_p(&seen_right, &expected, 20.0) > 1e-4, "{seen:?} {expected:?}");
            // The companion: a twentieth of the samples moved to a neighbouring cell.
            let mut wrong = seen;
            let (from, to) = largest_two(&expected);
            wrong[from] -= 0.05 * n as f64;
            wrong[to] += 0.05 * n as f64;
            assert!(chi_square_p(&wrong, &expected, 20.0) < 1e-6);
        }
    }
}

fn largest_two(counts: &[f64; 8]) -> (usize, usize) {
    let mut order: Vec<usize> = (0..8).collect();
    order.sort_by(|&a, &b| counts[b].total_cmp(&counts[a]));
    (order[0], order[1])
}

/// The point with the uv coordinates `q` of an analytic shape, or with barycentrics `q`.
fn at_uv(shape: &Shape, prim: u32, q: Vec2) -> Option<SurfacePoint> {
    let angle = |a: f32| Vec2::from_angle(std::f32::consts::TAU * a);
    Some(match &shape.geometry {
        Geometry::Mesh(m) => {
            if q.x + q.y > 1.0 {
                return None;
            }
            let mut s = mesh_point(m, prim, q.x, q.y);
            let [a, b, c] = m.corners(prim);
            (s.dp_du, s.dp_dv) = (b - a, c - a);
            s
        }
        Geometry::Rectangle(r) => r.point(2.0 * q.x - 1.0, 2.0 * q.y - 1.0),
        Geometry::Disk(d) => {
            let p = q.x * angle(q.y);
            d.point(p.x, p.y)
        }
        Geometry::Sphere(s) => {
            let (sin, cos) = (q.y * std::f32::consts::PI).sin_cos();
            let a = angle(q.x) * sin;
            s.point((s.axes[0] * a.x + s.axes[1] * a.y + s.axes[2] * cos).as_dvec3())
        }
        Geometry::Cylinder(c) => {
            let a = angle(q.x);
            c.point(q.y, (c.reference * a.x + c.binormal * a.y).as_dvec3())
        }
    })
}
