//! Area lamps: chi-square of sampled points against their density, equality of both densities, extremes.

use super::super::area::{self, Lamp, LampPoint, Patch};
use super::*;
use crate::math::stats::{chi_square_p, sidak};
use std::f64::consts::PI;

const CELLS: usize = 8;

fn patch(shape: &Shape) -> Option<Patch> {
    match &shape.geometry {
        Geometry::Rectangle(r) => Some(Patch::new(r.clone())),
        _ => None,
    }
}

fn view<T>(shape: &Shape, prim: u32, ask: impl FnOnce(Lamp) -> T) -> T {
    let patch = patch(shape);
    ask(patch.as_ref().map_or(Lamp::Primitive(shape, prim), Lamp::Parallelogram))
}

fn sample(shape: &Shape, prim: u32, p: Vec3, u: Vec2) -> Option<LampPoint> {
    view(shape, prim, |lamp| area::sample(lamp, p, u))
}

fn pdf_dir(shape: &Shape, prim: u32, p: Vec3, at: &SurfacePoint) -> f32 {
    view(shape, prim, |lamp| area::pdf_dir(lamp, p, at))
}

/// Cell of a lamp point: its texture coordinates, which all shapes have.
fn cell(at: &SurfacePoint) -> usize {
    let k = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
    k(at.uv.y) * CELLS + k(at.uv.x)
}

/// Probability of each cell by integrating the density over the lamp's front; last entry: nothing sampled.
fn expected(shape: &Shape, p: Vec3, scale: impl Fn(&SurfacePoint) -> f64) -> Vec<f64> {
    const N: usize = 512;
    let mut cells = vec![0.0; CELLS * CELLS + 1];
    for i in 0..N * N {
        let u = (Vec2::new((i % N) as f32, (i / N) as f32) + 0.5) / N as f32;
        let (at, _) = shape.sample_area(0, 0, u);
        let to = at.p.as_dvec3() - p.as_dvec3();
        let cos = -to.dot(at.n_geo.as_dvec3()) / to.length();
        if cos > 0.0 {
            let per_area = pdf_dir(shape, 0, p, &at) as f64 * cos / to.length_squared();
            cells[cell(&at)] += per_area * shape.primitive_area(0) as f64 / (N * N) as f64 * scale(&at);
        }
    }
    let sum: f64 = cells.iter().sum();
    cells[CELLS * CELLS] = (1.0 - sum).max(0.0);
    cells
}

/// The lamp point that was sampled, as a ray would find it.
fn found(shape: &Shape, p: Vec3, q: &LampPoint) -> SurfacePoint {
    let hit = ShapeHit { t: q.distance, u: q.barycentric.x, v: q.barycentric.y };
    shape.surface_point(0, 0, p, q.wi, hit)
}

fn observed(shape: &Shape, p: Vec3, seed: u64, count: u64) -> Vec<f64> {
    let mut cells = vec![0.0; CELLS * CELLS + 1];
    for i in 0..count {
        match sample(shape, 0, p, random2(seed, i)) {
            Some(q) => {
                let at = found(shape, p, &q);
                assert!((q.wi.length() - 1.0).abs() < 1e-6 && q.distance.is_finite());
                let back = pdf_dir(shape, 0, p, &at);
                // The same number for solid angles. By area the cosine is that of a rounded point: a distance of 40 is
                // rounded to 4e-6, on a surface of radius 1/2 seen at an angle that turns the normal by 1e-5 / cos.
                let inside = matches!(&shape.geometry, Geometry::Sphere(s) if p.distance(s.center) < s.radius);
                let by_area = inside || matches!(shape.geometry, Geometry::Disk(_) | Geometry::Cylinder(_));
                let rounding = if by_area { 1e-5 + 1e-5 / at.n_geo.dot(q.wi).powi(2) } else { 0.0 };
                assert!((back / q.pdf_dir - 1.0).abs() <= rounding, "{at:?}: {back} {}", q.pdf_dir);
                assert!(at.n_geo.dot(q.wi) < 2e-3, "the bright side");
                cells[cell(&at)] += 1.0;
            }
            None => cells[CELLS * CELLS] += 1.0,
        }
    }
    cells
}

fn all() -> Vec<(&'static str, Shape, Vec<Vec3>)> {
    let v = Vec3::new;
    let one = Rgb::ONE;
    let near = vec![v(0.2, 0.3, 0.2), v(-2.0, 1.0, 1.0), v(3.0, 0.0, 0.3), v(20.0, -9.0, 30.0)];
    let shear = DMat4::from_cols_array_2d(&[
        [1.0, 0.2, 0.0, 0.0],
        [0.7, 0.9, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]);
    let stretch = DMat4::from_scale(DVec3::new(1.0, 0.4, 1.0));
    let tri = || triangles(&[[[-1.0, -1.0, 0.0], [2.0, -1.0, 0.0], [0.0, 1.5, 0.0]]], vec![]);
    let cylinder = GeometryDesc::Cylinder { p0: DVec3::ZERO, p1: DVec3::Z, radius: 0.5 };
    let outside = vec![v(2.0, 0.5, 0.3), v(1.2, 0.0, 0.0), v(-30.0, 20.0, 5.0)];
    vec![
        ("rectangle", lamp(GeometryDesc::Rectangle, stretch, false, one), near.clone()),
        ("parallelogram", lamp(GeometryDesc::Rectangle, shear, false, one), near.clone()),
        ("triangle", lamp(tri(), DMat4::IDENTITY, false, one), near.clone()),
        ("disk", lamp(GeometryDesc::Disk, stretch, false, one), near),
        ("sphere", sphere(DVec3::ZERO, 1.0, false, 1.0), outside.clone()),
        ("sphere inside", sphere(DVec3::ZERO, 1.0, true, 1.0), vec![v(0.1, 0.2, -0.3), v(0.0, 0.8, 0.1)]),
        ("sphere far side", sphere(DVec3::ZERO, 1.0, true, 1.0), outside.clone()),
        ("cylinder", lamp(cylinder.clone(), DMat4::IDENTITY, false, one), outside),
        ("cylinder inside", lamp(cylinder, DMat4::IDENTITY, true, one), vec![v(0.1, 0.2, 0.4), v(1.0, 0.3, 2.0)]),
    ]
}

#[test]
fn sampled_points_follow_the_density_and_found_points_have_it() {
    let list = all();
    let tests = list.iter().map(|(_, _, points)| points.len()).sum();
    let count = 20_000;
    let mut seed = 0;
    for (name, shape, points) in &list {
        for &p in points {
            seed += 1;
            let expected = expected(shape, p, |_| 1.0);
            let sum: f64 = expected[..CELLS * CELLS].iter().sum();
            let whole = if name.contains("cylinder") { sum < 1.001 } else { (sum - 1.0).abs() < 3e-3 };
            assert!(whole, "{name} at {p}: the density integrates to {sum}");
            let counts: Vec<f64> = expected.iter().map(|e| e / sum.max(1.0) * count as f64).collect();
            let observed = observed(shape, p, seed, count);
            // Cells that the quadrature cannot see (less than a sample expected) must not decide: pool them as failures.
            let chi = chi_square_p(&observed, &floor(&counts), 5.0);
            assert!(chi > sidak(0.01, tests), "{name} at {p}: p = {chi}");
        }
    }
}

/// Counts with a tiny value where quadrature found none (cells on a silhouette).
fn floor(counts: &[f64]) -> Vec<f64> {
    counts.iter().map(|&c| c.max(1e-3)).collect()
}

#[test]
fn a_wrong_density_is_rejected() {
    for (name, shape, points) in all() {
        let p = points[1];
        let wrong: Vec<f64> =
            expected(&shape, p, |at| if at.uv.x < 0.5 { 1.1 } else { 0.9 }).iter().map(|e| e * 20_000.0).collect();
        let chi = chi_square_p(&observed(&shape, p, 5, 20_000), &floor(&wrong), 5.0);
        assert!(chi < 1e-3, "{name}: p = {chi}");
    }
}

#[test]
fn tiny_and_distant_lamps_keep_their_digits() {
    // Solid angle of a distant lamp: area x cos / d^2, to first order in size / distance.
    for d in [1e2f32, 1e3, 1e5, 1e7] {
        let p = Vec3::new(0.0, 0.0, d);
        let cases = [
            (sphere(DVec3::ZERO, 1.0, false, 1.0), PI),
            (lamp(GeometryDesc::Rectangle, DMat4::IDENTITY, false, Rgb::ONE), 4.0),
            (lamp(GeometryDesc::Disk, DMat4::IDENTITY, false, Rgb::ONE), PI),
            (
                lamp(
                    triangles(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], vec![]),
                    DMat4::IDENTITY,
                    false,
                    Rgb::ONE,
                ),
                0.5,
            ),
        ];
        for (shape, area) in cases {
            for i in 0..50 {
                let q = sample(&shape, 0, p, random2(3, i)).expect("it faces the point");
                let solid_angle = area / (d as f64).powi(2);
                let first_order = 3.0 / (d as f64).powi(2) + 1e-6;
                assert!((q.pdf_dir as f64 * solid_angle - 1.0).abs() < first_order, "{d}: {q:?}");
                let reached = p + q.wi * q.distance;
                assert!(reached.truncate().length() < 1.5 + d * 1e-6, "{reached}");
            }
        }
    }
}

#[test]
fn nothing_is_sampled_from_the_dark_side_or_in_the_plane() {
    let rectangle = lamp(GeometryDesc::Rectangle, DMat4::IDENTITY, false, Rgb::ONE);
    let disk = lamp(GeometryDesc::Disk, DMat4::IDENTITY, false, Rgb::ONE);
    let triangle =
        lamp(triangles(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], vec![]), DMat4::IDENTITY, false, Rgb::ONE);
    for shape in [&rectangle, &disk, &triangle] {
        for p in [[0.1, 0.2, -1.0], [0.1, 0.2, 0.0], [5.0, 0.0, 0.0], [0.1, 0.2, 1e-8]] {
            assert!(sample(shape, 0, Vec3::from(p), Vec2::new(0.3, 0.6)).is_none(), "{p:?}");
        }
        assert!(sample(shape, 0, Vec3::new(0.1, 0.2, 1e-5), Vec2::new(0.3, 0.6)).is_some());
    }
    let ball = sphere(DVec3::ZERO, 1.0, false, 1.0);
    assert!(sample(&ball, 0, Vec3::new(0.3, 0.0, 0.2), Vec2::splat(0.5)).is_none());
    assert!(sample(&ball, 0, Vec3::X, Vec2::splat(0.5)).is_none(), "a point of the lamp itself");
}

#[test]
fn triangles_without_area_are_lamps_without_light() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Vec3::from);
    let mesh = crate::scene::Mesh {
        positions: corners.to_vec(),
        normals: vec![],
        uvs: vec![],
        triangles: vec![[0, 1, 2], [0, 1, 3], [1, 1, 1]],
        edges: vec![],
        neighbors: vec![],
    };
    let shape = Shape { geometry: Geometry::Mesh(mesh), ..lamp(GeometryDesc::Disk, DMat4::IDENTITY, false, Rgb::ONE) };
    let p = Vec3::new(0.1, 0.2, 1.0);
    for prim in 0..3 {
        assert_eq!(sample(&shape, prim, p, Vec2::splat(0.5)).is_some(), prim == 1);
    }
    let shapes = [shape];
    let all = lights(&shapes, &[]);
    let drawn = (0..1000).filter(|&i| all.sample(&shapes, NO_TEXTURES, p, random(2, i, 0), random2(2, i)).is_some());
    assert!(drawn.count() > 990);
}

#[test]
fn corners_of_the_unit_square_give_finite_samples() {
    let top = 1.0 - f32::EPSILON / 2.0;
    for (name, shape, points) in all() {
        for p in points {
            for u in [[0.0, 0.0], [0.0, top], [top, 0.0], [top, top], [0.5, top]] {
                if let Some(q) = sample(&shape, 0, p, Vec2::from(u)) {
                    let sane = q.wi.is_finite() && q.pdf_dir.is_finite() && q.pdf_dir > 0.0 && q.distance > 0.0;
                    assert!(sane, "{name} at {p} for {u:?}: {q:?}");
                }
            }
        }
    }
}
