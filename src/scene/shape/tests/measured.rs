//! Positions, sides, uv and tangents against numbers measured with Mitsuba 3.9.1.

use super::super::super::surface::SurfacePoint;
use super::*;

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
