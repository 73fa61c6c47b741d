//! Watertightness, scale, re-hits, degenerate and extreme input.

use super::tests::{Random, brute_force, mesh, random_ray, shape, soup};
use super::*;
use crate::scene::shape::{Disk, Rectangle, Sphere};
use crate::scene::{Geometry, SurfacePoint};

/// A closed sphere of `rings` x 2 `rings` quads, bumpy unless `amplitude` is 0.
fn ball(rings: u32, amplitude: f32, scale: f32, center: Vec3) -> Shape {
    let columns = 2 * rings;
    let mut random = Random(77);
    let mut point = |theta: f32, phi: f32| {
        let r = scale * (1.0 + amplitude * random.unit());
        center + r * Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    let pi = std::f32::consts::PI;
    let mut positions = vec![point(0.0, 0.0), point(pi, 0.0)];
    for i in 1..rings {
        for j in 0..columns {
            positions.push(point(pi * i as f32 / rings as f32, 2.0 * pi * j as f32 / columns as f32));
        }
    }
    let at = |i: u32, j: u32| match i {
        0 => 0,
        i if i == rings => 1,
        i => 2 + (i - 1) * columns + j % columns,
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..columns {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            triangles
                .extend([[a, b, c], [a, c, d]].into_iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]));
        }
    }
    mesh(positions, triangles)
}

/// The cube `[-1,1]^3` (scaled, moved), each side a grid of n x n quads that share their vertices' positions.
fn cube(n: u32, scale: f32, center: Vec3) -> Shape {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for side in 0..6 {
        let base = positions.len() as u32;
        let at = |i: u32| i as f32 / n as f32 * 2.0 - 1.0;
        for i in 0..=n {
            for j in 0..=n {
                let mut p = [0.0; 3];
                p[side % 3] = if side < 3 { 1.0 } else { -1.0 };
                p[(side + 1) % 3] = at(i);
                p[(side + 2) % 3] = at(j);
                positions.push(center + scale * Vec3::from(p));
            }
        }
        for i in 0..n {
            for j in 0..n {
                let a = base + i * (n + 1) + j;
                triangles.extend([[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
            }
        }
    }
    mesh(positions, triangles)
}

/// Rays from inside at points of random edges and at vertices: the number that escape.
fn escapes(shapes: &[Shape], simd: Simd, center: Vec3, scale: f32, rays: usize) -> usize {
    let accel = Accel::with_simd(shapes, simd);
    let Geometry::Mesh(m) = &shapes[0].geometry else { unreachable!() };
    let mut random = Random(99);
    let mut escaped = 0;
    for i in 0..rays {
        let triangle = m.triangles[(random.unit() * m.triangles.len() as f32) as usize % m.triangles.len()];
        let [a, b, _] = triangle.map(|v| m.positions[v as usize]);
        let target = if i % 4 == 0 { a } else { a.lerp(b, random.unit()) };
        // Some origins very near a wall or an edge of the cube, where distances differ most.
        let close = if i % 3 == 0 { 0.55 } else { 0.3 };
        let mut o = center + random.cube() * (scale * close);
        if i % 7 == 0 {
            o = center + (a - center) * (1.0 - 1e-3) + (o - center) * 1e-4;
        }
        let d = (target - o) * if i % 2 == 0 { 1.0 } else { 1.0 / scale };
        let ray = Ray { o, d, tmin: 0.0, tmax: f32::INFINITY };
        escaped += accel.closest(&ray).is_none() as usize;
        escaped += !accel.occluded(&ray) as usize;
    }
    escaped
}

#[test]
fn nothing_escapes_through_shared_edges_and_vertices() {
    for simd in [Simd::Avx2, Simd::Portable] {
        let rays = if simd == Simd::Avx2 { 200_000 } else { 50_000 };
        assert_eq!(escapes(&[ball(40, 0.0, 1.0, Vec3::ZERO)], simd, Vec3::ZERO, 1.0, rays), 0);
        assert_eq!(escapes(&[ball(30, 0.1, 1.0, Vec3::ZERO)], simd, Vec3::ZERO, 1.0, rays), 0);
        assert_eq!(escapes(&[cube(16, 1.0, Vec3::ZERO)], simd, Vec3::ZERO, 1.0, rays), 0);
        assert_eq!(escapes(&[cube(1, 1.0, Vec3::ZERO)], simd, Vec3::ZERO, 1.0, rays), 0);
    }
}

#[test]
fn nothing_escapes_at_any_scale_or_place() {
    for scale in [1e-3, 0.7, 555.0, 1e4] {
        for center in [Vec3::ZERO, Vec3::new(3.0, -7.0, 11.0) * scale] {
            let count = |s: Shape| escapes(&[s], Simd::Avx2, center, scale, 30_000);
            assert_eq!(count(ball(20, 0.05, scale, center)), 0, "{scale}");
            assert_eq!(count(cube(7, scale, center)), 0, "{scale}");
        }
    }
}

/// The companion of the tests above: a missing triangle is noticed.
#[test]
fn a_hole_is_found() {
    let mut shape = cube(16, 1.0, Vec3::ZERO);
    let Geometry::Mesh(m) = &mut shape.geometry else { unreachable!() };
    // The first triangle stays in the list that rays are aimed at, but has no area.
    m.triangles[0] = [0, 1, 1];
    assert!(escapes(&[shape], Simd::Avx2, Vec3::ZERO, 1.0, 200_000) > 0);
}

/// Bounces from the walls of a rotated and an upright room: with an offset origin a ray meets neither its own triangle
/// nor the outside.
#[test]
fn offset_origins_do_not_hit_their_own_wall() {
    for (scale, turn) in [(1e-3, 0.0), (1.0, 0.0), (1e4, 0.0), (1e-3, 0.7), (1.0, 0.7), (1e4, 0.7)] {
        let mut room = cube(3, scale, Vec3::ZERO);
        let Geometry::Mesh(m) = &mut room.geometry else { unreachable!() };
        let rotation = glam::Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), turn);
        m.positions.iter_mut().for_each(|p| *p = rotation * *p);
        let m = m.clone();
        let accel = Accel::new(&[room]);
        let mut random = Random(5);
        let (mut own, mut lost) = (0, 0);
        for _ in 0..40_000 {
            let prim = (random.unit() * m.triangles.len() as f32) as usize % m.triangles.len();
            let [a, b, c] = m.triangles[prim].map(|v| m.positions[v as usize]);
            let (mut u, mut v) = (random.unit(), random.unit());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let w = 1.0 - u - v;
            let mut n_geo = (b - a).cross(c - a).normalize();
            if n_geo.dot(a) > 0.0 {
                n_geo = -n_geo;
            }
            // Error bound of interpolation, gamma(7) of PBR 6.8.
            let p_error = (a.abs() * w + b.abs() * u + c.abs() * v) * (7.0 * 0.5 * f32::EPSILON);
            let p = a * w + b * u + c * v;
            let (zero, uv) = (Vec3::ZERO, glam::Vec2::ZERO);
            let from =
                SurfacePoint { p, p_error, n_geo, n_shade: n_geo, uv, dp_du: zero, dp_dv: zero, shape: 0, prim: 0 };
            let d = (random.cube() + n_geo * (random.unit() * 1.01)).normalize();
            let d = if d.dot(n_geo) < 0.0 { -d } else { d };
            let ray = Ray { o: from.spawn_origin(d), d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
            match accel.closest(&ray) {
                Some(h) if h.prim as usize == prim => own += 1,
                Some(_) => (),
                None => lost += 1,
            }
        }
        assert_eq!((own, lost), (0, 0), "scale {scale}, turned by {turn}");
    }
}

#[test]
fn a_ray_in_the_plane_of_a_wall_or_on_it_does_not_hit_it() {
    let accel = Accel::new(&[cube(4, 1.0, Vec3::ZERO)]);
    let mut random = Random(8);
    for _ in 0..10_000 {
        let p = random.cube() * 0.9;
        let d = random.cube();
        let o = Vec3::new(p.x, -1.0, p.z);
        let d = Vec3::new(d.x, d.y.abs() + 1e-6, d.z);
        let hit = accel.closest(&Ray { o, d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY });
        assert!(hit.is_some_and(|h| h.t > 0.0 && (o + d * h.t).y > -1.0 + 1e-7), "{o} {d} {hit:?}");
    }
}

#[test]
fn spheres_are_hit_precisely_from_afar_and_from_inside() {
    let center = Vec3::new(0.3, -0.2, 0.1);
    let sphere =
        |radius| shape(Geometry::Sphere(Sphere { center, radius, flip: false, axes: [Vec3::X, Vec3::Y, Vec3::Z] }));
    let mut random = Random(9);
    let mut compared = 0;
    for (radius, distance) in [(1.0, 1000.0), (1.0, 1e5), (1e-3, 1.0), (1e4, 2e4), (1.0, 0.5)] {
        let shapes = [sphere(radius)];
        let accel = Accel::new(&shapes);
        for _ in 0..2000 {
            let o = center + random.cube().normalize() * distance;
            let target = center + random.cube() * radius * 0.8;
            let ray = Ray { o, d: target - o, tmin: 0.0, tmax: f32::INFINITY };
            let truth = brute_force(&shapes, &ray).map(|h| h.0 as f32);
            let found = accel.closest(&ray).map(|h| h.t);
            if let (Some(truth), Some(found)) = (truth, found) {
                assert!((truth - found).abs() <= 2.0 * f32::EPSILON * truth, "{truth} {found}");
                compared += 1;
            } else {
                assert_eq!(truth.is_some(), found.is_some());
            }
        }
    }
    assert!(compared > 4000);
}

#[test]
fn degenerate_input_is_never_hit_and_never_panics() {
    let mut random = Random(10);
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let bad = [Vec3::new(nan, 0.0, 0.0), Vec3::new(0.0, inf, 0.0), Vec3::splat(1e30), Vec3::splat(-inf)];
    let mut positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::X * 2.0];
    positions.extend(bad);
    let triangles =
        vec![[0, 0, 0], [0, 1, 1], [0, 1, 3], [4, 1, 2], [0, 5, 2], [0, 1, 6], [7, 6, 5], [0, 1, 99], [u32::MAX, 0, 1]];
    let rectangle = |center, ex| Rectangle { center, ex, ey: Vec3::Y, n: Vec3::Z };
    let disk = |center, ex| Disk { center, ex, ey: Vec3::Y, n: Vec3::Z };
    let ball = |center, radius| Sphere { center, radius, flip: false, axes: [Vec3::X; 3] };
    let mut shapes = vec![
        mesh(positions, triangles),
        mesh(vec![], vec![]),
        shape(Geometry::Rectangle(rectangle(bad[0], Vec3::X))),
        shape(Geometry::Rectangle(rectangle(Vec3::ZERO, Vec3::ZERO))),
        shape(Geometry::Disk(disk(bad[1], Vec3::X))),
        shape(Geometry::Disk(disk(Vec3::ZERO, Vec3::Y))),
        shape(Geometry::Sphere(ball(Vec3::ZERO, 0.0))),
        shape(Geometry::Sphere(ball(Vec3::ZERO, nan))),
        shape(Geometry::Sphere(ball(bad[3], 1.0))),
    ];
    let rays: Vec<Ray> = (0..2000).map(|_| random_ray(&mut random)).collect();
    for simd in [Simd::Avx2, Simd::Portable] {
        let accel = Accel::with_simd(&shapes, simd);
        assert!(rays.iter().all(|r| accel.closest(r).is_none() && !accel.occluded(r)));
        assert!(Accel::with_simd(&[], simd).closest(&rays[0]).is_none());
    }
    // The bad ones do no harm to a good one.
    let good = soup(&mut random, 1, 1.0);
    shapes.push(good.clone());
    let (with, alone) = (Accel::new(&shapes), Accel::new(&[good]));
    assert!(rays.iter().all(|r| with.closest(r).map(|h| h.t) == alone.closest(r).map(|h| h.t)));
    for ray in [
        Ray { d: Vec3::ZERO, ..rays[0] },
        Ray { o: bad[0], ..rays[0] },
        Ray { d: bad[1], ..rays[0] },
        Ray { tmin: nan, tmax: nan, ..rays[0] },
        Ray { tmin: 2.0, tmax: 1.0, ..rays[0] },
    ] {
        assert!(with.closest(&ray).is_none() && !with.occluded(&ray), "{ray:?}");
    }
}

#[test]
fn many_duplicates_and_few_primitives() {
    let mut random = Random(11);
    for count in [1, 2, 4, 5, 9, 100_000] {
        let triangles = vec![[0, 1, 2]; count];
        let accel = Accel::new(&[mesh(vec![Vec3::ZERO, Vec3::X, Vec3::Y], triangles)]);
        for _ in 0..20 {
            let (x, y) = (random.unit() * 0.5, random.unit() * 0.5);
            let ray = Ray { o: Vec3::new(x, y, 1.0), d: -Vec3::Z, tmin: 0.0, tmax: f32::INFINITY };
            let hit = accel.closest(&ray);
            assert!(hit.is_some_and(|h| h.t == 1.0 && h.prim == 0), "{count} {hit:?}");
            assert!(!accel.occluded(&Ray { tmax: 0.99, ..ray }));
        }
    }
}
