use super::super::description::{GeometryDesc, ShapeDesc};
use super::super::mesh::MeshData;
use super::super::surface::SurfacePoint;
use super::*;
use crate::math::sampler::{hash, unit_f32};
use crate::math::stats::chi_square_p;
use crate::math::{DMat4, DVec3, Vec2};

fn describe(geometry: GeometryDesc, to_world: DMat4, flip_normals: bool) -> ShapeDesc {
    ShapeDesc { name: "test".into(), geometry, to_world, flip_normals, material: 0, emission: None }
}

fn build(geometry: GeometryDesc, to_world: DMat4, flip_normals: bool) -> Shape {
    Shape::new(describe(geometry, to_world, flip_normals)).expect("a good shape")
}

fn unit_sphere() -> GeometryDesc {
    GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 }
}

fn cylinder(z0: f64, z1: f64) -> GeometryDesc {
    GeometryDesc::Cylinder { p0: DVec3::new(0.0, 0.0, z0), p1: DVec3::new(0.0, 0.0, z1), radius: 1.0 }
}

/// The surface point where the ray from `o` meets the world point `p` on triangle `prim` or shape 0.
fn point_at(shape: &Shape, p: [f32; 3], prim: u32) -> SurfacePoint {
    let p = Vec3::from(p);
    let (u, v) = match &shape.geometry {
        Geometry::Mesh(m) => {
            let [a, b, c] = m.corners(prim).map(|q| q.as_dvec3());
            let n = (b - a).cross(c - a);
            let q = p.as_dvec3() - a;
            let (u, v) = (q.cross(c - a).dot(n), (b - a).cross(q).dot(n));
            ((u / n.length_squared()) as f32, (v / n.length_squared()) as f32)
        }
        _ => (0.0, 0.0),
    };
    let o = p + Vec3::new(0.4, -0.3, 5.0);
    shape.surface_point(7, prim, o, p - o, ShapeHit { t: 1.0, u, v })
}

fn assert_near(got: Vec3, want: [f32; 3], what: &str) {
    assert!((got - Vec3::from(want)).abs().max_element() < 2e-4, "{what}: {got} instead of {want:?}");
}

/// One row measured with Mitsuba 3.9.1 (`scalar_rgb`, four decimals): position, shading normal, uv, dp/du, dp/dv.
type Row = ([f32; 3], [f32; 3], [f32; 2], [f32; 3], [f32; 3]);

fn check(shape: &Shape, prim: u32, (p, n, uv, du, dv): Row, what: &str) {
    let got = point_at(shape, p, prim);
    assert_near(got.p, p, what);
    assert_near(got.n_geo, n, what);
    assert_near(got.n_shade, n, what);
    assert_near(got.uv.extend(0.0), [uv[0], uv[1], 0.0], what);
    // Positions with four decimals leave the tangents that accurate only.
    assert!((got.dp_du - Vec3::from(du)).length() < 2e-3, "{what}: du {}", got.dp_du);
    assert!((got.dp_dv - Vec3::from(dv)).length() < 2e-3, "{what}: dv {}", got.dp_dv);
    assert_eq!((got.shape, got.prim), (7, prim));
}

#[test]
fn points_agree_with_mitsuba_unmirrored() {
    let id = DMat4::IDENTITY;
    let up = [0.0, 0.0, 1.0];
    let rows: [(GeometryDesc, u32, Row); 6] = [
        (GeometryDesc::Rectangle, 0, ([0.3, 0.2, 0.0], up, [0.65, 0.6], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0])),
        (GeometryDesc::Disk, 0, ([0.3, 0.2, 0.0], up, [0.3606, 0.0936], [0.8321, 0.5547, 0.0], [-1.2566, 1.885, 0.0])),
        (
            cylinder(-0.5, 1.0),
            0,
            ([0.9798, 0.2, 0.3], [0.9798, 0.2, 0.0], [0.032, 0.5333], [-1.2566, 6.1562, 0.0], [0.0, 0.0, 1.5]),
        ),
        (
            unit_sphere(),
            0,
            (
                [0.3, 0.2, 0.9327],
                [0.3, 0.2, 0.9327],
                [0.0936, 0.1174],
                [-1.2566, 1.885, 0.0],
                [2.4381, 1.6254, -1.1327],
            ),
        ),
        (GeometryDesc::Cube, 6, ([0.3, 0.2, 1.0], up, [0.6, 0.65], [0.0, 2.0, 0.0], [2.0, 0.0, 0.0])),
        (GeometryDesc::Cube, 4, ([1.0, 0.2, 0.3], [1.0, 0.0, 0.0], [0.6, 0.35], [0.0, 2.0, 0.0], [0.0, 0.0, -2.0])),
    ];
    for (geometry, prim, row) in rows {
        let name = format!("{geometry:?}");
        check(&build(geometry.clone(), id, false), prim, row, &name);
        let (p, n, uv, du, dv) = row;
        check(&build(geometry, id, true), prim, (p, n.map(|c| -c), uv, du, dv), &name);
    }
}

#[test]
fn mirrors_keep_the_side_except_of_spheres_as_in_mitsuba() {
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let up = [0.0, 0.0, 1.0];
    let rows: [(GeometryDesc, u32, Row); 6] = [
        (GeometryDesc::Rectangle, 0, ([0.3, 0.2, 0.0], up, [0.35, 0.6], [-2.0, 0.0, 0.0], [0.0, 2.0, 0.0])),
        (GeometryDesc::Disk, 0, ([0.3, 0.2, 0.0], up, [0.3606, 0.4064], [0.8321, 0.5547, 0.0], [1.2566, -1.885, 0.0])),
        (
            cylinder(-0.5, 1.0),
            0,
            ([0.9798, 0.2, 0.3], [0.9798, 0.2, 0.0], [0.468, 0.5333], [1.2566, -6.1562, 0.0], [0.0, 0.0, 1.5]),
        ),
        (
            unit_sphere(),
            0,
            (
                [0.3, 0.2, 0.9327],
                [-0.3, -0.2, -0.9327],
                [0.4064, 0.1174],
                [1.2566, -1.885, 0.0],
                [2.4381, 1.6254, -1.1327],
            ),
        ),
        (GeometryDesc::Cube, 6, ([0.3, 0.2, 1.0], up, [0.6, 0.35], [0.0, 2.0, 0.0], [-2.0, 0.0, 0.0])),
        // The x = 1 face is the mirrored -x face.
        (GeometryDesc::Cube, 8, ([1.0, 0.2, 0.3], [1.0, 0.0, 0.0], [0.6, 0.65], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0])),
    ];
    for (geometry, prim, row) in rows {
        let name = format!("mirrored {geometry:?}");
        check(&build(geometry, mirror, false), prim, row, &name);
    }
    // Inversion in the origin: rectangles and disks show their -z side.
    let inverted = DMat4::from_scale(DVec3::splat(-1.0));
    for geometry in [GeometryDesc::Rectangle, GeometryDesc::Disk] {
        assert_near(
            point_at(&build(geometry, inverted, false), [0.3, 0.2, 0.0], 0).n_geo,
            [0.0, 0.0, -1.0],
            "inverted",
        );
    }
}

#[test]
fn rotated_and_stretched_points_agree_with_mitsuba() {
    let stretch = DMat4::from_scale(DVec3::new(2.0, 3.0, 4.0));
    let up = [0.0, 0.0, 1.0];
    check(
        &build(GeometryDesc::Disk, stretch, false),
        0,
        ([0.3, 0.2, 0.0], up, [0.1641, 0.0666], [1.8276, 1.2184, 0.0], [-0.8378, 2.8274, 0.0]),
        "stretched disk",
    );
    let turn = DMat4::from_rotation_y(30f64.to_radians());
    check(
        &build(unit_sphere(), turn, false),
        0,
        (
            [0.3, 0.2, 0.9327],
            [0.3, 0.2, 0.9327],
            [0.3776, 0.0928],
            [-1.0883, -1.2979, 0.6283],
            [-2.3237, 2.093, 0.2986],
        ),
        "turned sphere",
    );
    check(
        &build(cylinder(-0.5, 1.0), turn, false),
        0,
        ([1.3046, 0.2, 0.3], [0.8485, 0.2, -0.4899], [0.032, 0.9414], [-1.0883, 6.1562, 0.6283], [0.75, 0.0, 1.299]),
        "turned cylinder",
    );
}

#[test]
fn bad_transforms_are_errors_with_a_text() {
    let scale = |x, y, z| DMat4::from_scale(DVec3::new(x, y, z));
    let shear = DMat4::from_cols_array(&[1., 0., 0., 0., 0.5, 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]);
    let all = || [GeometryDesc::Rectangle, GeometryDesc::Cube, unit_sphere(), GeometryDesc::Disk, cylinder(0.0, 1.0)];
    for m in [DMat4::ZERO, scale(0.0, 0.0, 0.0), DMat4::NAN, scale(1e30, 1e30, 1e30), scale(f64::INFINITY, 1.0, 1.0)] {
        for geometry in all() {
            let text = Shape::new(describe(geometry.clone(), m, false)).expect_err("degenerate");
            assert!(text.len() > 10, "{geometry:?} {text}");
        }
    }
    let error = |g, m| Shape::new(describe(g, m, false)).expect_err("must be refused");
    assert!(error(unit_sphere(), scale(1.0, 2.0, 1.0)).contains("1 x 2 x 1"));
    assert!(error(unit_sphere(), shear).contains("scale"));
    assert!(error(cylinder(0.0, 1.0), scale(1.0, 2.0, 1.0)).contains("ellipse"));
    let slant = DMat4::from_cols_array(&[1., 0., 0., 0., 0., 1., 0., 0., 0.5, 0., 1., 0., 0., 0., 0., 1.]);
    assert!(error(cylinder(0.0, 1.0), slant).contains("shear"));
    assert!(error(cylinder(1.0, 1.0), DMat4::IDENTITY).contains("same point"));
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let center = DVec3::ZERO;
        assert!(error(GeometryDesc::Sphere { center, radius }, DMat4::IDENTITY).contains("radius"));
    }
    // Flattening a flat thing along its normal leaves it what it is; few digits are still a rotation.
    assert!(Shape::new(describe(GeometryDesc::Rectangle, scale(1.0, 1.0, 0.0), false)).is_ok());
    let mut turned = DMat4::from_rotation_x(0.3) * DMat4::from_rotation_z(1.1) * 3.0;
    turned.w_axis = crate::math::DMat4::IDENTITY.w_axis;
    let rounded = turned.to_cols_array().map(|v| (v * 1e4).round() / 1e4);
    let Geometry::Sphere(s) = build(unit_sphere(), DMat4::from_cols_array(&rounded), false).geometry else {
        panic!("a sphere")
    };
    assert!((s.radius - 3.0).abs() < 1e-3);
}

/// Every kind of shape, turned, at a scale and distance from the origin.
fn zoo(scale: f64, offset: f64) -> Vec<Shape> {
    let rigid = DMat4::from_translation(DVec3::new(1.0, -0.7, 0.4) * offset * scale)
        * DMat4::from_rotation_x(0.4)
        * DMat4::from_rotation_y(1.1)
        * DMat4::from_scale(DVec3::splat(scale));
    let sheared =
        rigid * DMat4::from_cols_array(&[1.0, 0.2, 0., 0., 0.4, 0.8, 0., 0., 0., 0.3, 1.4, 0., 0., 0., 0., 1.]);
    let mesh = MeshData {
        positions: vec![Vec3::ZERO, Vec3::new(2.0, 0.1, 0.3), Vec3::new(0.4, 1.5, -0.3)],
        triangles: vec![[0, 1, 2]],
        ..Default::default()
    };
    vec![
        build(GeometryDesc::Rectangle, sheared, false),
        build(GeometryDesc::Disk, sheared, false),
        build(unit_sphere(), rigid, false),
        build(cylinder(-0.3, 1.7), rigid, true),
        build(GeometryDesc::Cube, sheared, false),
        build(GeometryDesc::Mesh(mesh), rigid, false),
    ]
}

/// Distance of `p` from the exact surface of an analytic shape (from its f32 fields) or triangle, in f64.
fn distance(shape: &Shape, prim: u32, p: Vec3) -> f64 {
    let p = p.as_dvec3();
    let plane = |c: Vec3, n: DVec3| (p - c.as_dvec3()).dot(n.normalize()).abs();
    match &shape.geometry {
        Geometry::Mesh(m) => {
            let [a, b, c] = m.corners(prim);
            plane(a, (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3()))
        }
        Geometry::Rectangle(r) => plane(r.center, r.ex.as_dvec3().cross(r.ey.as_dvec3())),
        Geometry::Disk(d) => plane(d.center, d.ex.as_dvec3().cross(d.ey.as_dvec3())),
        Geometry::Sphere(s) => ((p - s.center.as_dvec3()).length() - s.radius as f64).abs(),
        Geometry::Cylinder(c) => {
            let (q, a) = (p - c.p0.as_dvec3(), c.axis.as_dvec3().normalize());
            ((q - a * q.dot(a)).length() - c.radius as f64).abs()
        }
    }
}

#[test]
fn error_bounds_hold_and_spawned_origins_leave_the_surface_at_every_scale() {
    for (scale, offset) in [(1e-3, 0.0), (1.0, 0.0), (555.0, 1.0), (1e4, 3.0), (1.0, 100.0)] {
        for shape in zoo(scale, offset) {
            for i in 0..2000u64 {
                let u = Vec2::new(unit_f32(hash(i, 1)), unit_f32(hash(i, 2)));
                let prim = (i % shape.primitive_count() as u64) as u32;
                let s = shape.sample_area(0, prim, u).0;
                let bound = s.n_geo.abs().dot(s.p_error) as f64;
                let off = distance(&shape, prim, s.p);
                assert!(off <= bound, "{} at {scale}: off by {off:e}, bound {bound:e}", shape.name);
                assert!(bound <= 1e-5 * scale * (1.0 + offset), "bound {bound:e} at {scale}: too wide");
                assert!(s.n_geo.is_normalized() && s.n_shade.is_normalized());
                let (lo, hi) = shape.bounds();
                assert!((s.p - s.p_error).cmple(hi).all() && (s.p + s.p_error).cmpge(lo).all());
                for d in [s.n_geo, -s.n_geo] {
                    let moved = s.spawn_origin(d) - s.p;
                    assert!(moved.dot(d) >= 0.9 * bound as f32, "moved by {moved}, bound {bound:e}");
                }
            }
        }
    }
}

#[test]
fn a_hit_comes_back_as_the_point_that_was_aimed_at() {
    for (scale, offset) in [(1e-3, 0.0), (1.0, 1.0), (1e4, 3.0)] {
        for shape in zoo(scale, offset) {
            for i in 0..500u64 {
                let u = Vec2::new(unit_f32(hash(i, 3)), unit_f32(hash(i, 4)));
                let prim = (i % shape.primitive_count() as u64) as u32;
                let s = shape.sample_area(5, prim, u).0;
                // A distant origin: o + t d is inaccurate there, the recomputed point must not be.
                let o = s.p + (s.n_geo + Vec3::new(0.3, -0.2, 0.1)) * (200.0 * scale as f32);
                let at = |t: f32| {
                    let b = match &shape.geometry {
                        Geometry::Mesh(_) => crate::math::warp::sample_triangle(u),
                        _ => Vec2::ZERO,
                    };
                    shape.surface_point(5, prim, o, s.p - o, ShapeHit { t, u: b.x, v: b.y })
                };
                let hit = at(1.0f32.next_up());
                assert!(distance(&shape, prim, hit.p) <= hit.n_geo.abs().dot(hit.p_error) as f64);
                let apart = (hit.p - s.p).length() / scale as f32;
                assert!(apart < 2e-3, "{apart} at {scale}");
                let delta = (hit.uv - s.uv).abs();
                let delta = delta.min((Vec2::ONE - delta).abs());
                assert!(delta.max_element() < 2e-2, "{} and {}", hit.uv, s.uv);
            }
        }
    }
}

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
            let mut s = super::point::mesh_point(m, prim, q.x, q.y);
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
