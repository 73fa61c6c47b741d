//! Kernels at borders: light is neither lost there nor doubled where a surface goes on.

use super::*;
use crate::scene::Geometry;
use crate::transport::photon_map::{Filter, GlobalMap};

/// Walls light the floor as well: not asked for.
const DIRECT: Filter = Filter { classes: [true, false, false], most_segments: 1 };

/// Mean ratio of irradiance to its closed form along a line at `x`, on floors that end at x = 0.3 or go on in another shape.
fn at_the_border(shapes: impl Fn(&mut Description, MaterialId), x: f32, fold: bool) -> f64 {
    let mut s = empty();
    let white = diffuse(&mut s, 0.5);
    shapes(&mut s, white);
    let room = Room::new(s);
    let half = [Vec3::X * 1.2, Vec3::Z * 1.2];
    let light = Aimed { o: Vec3::new(0.0, 1.0, 0.0), centre: Vec3::ZERO, half, n: 500, seed: 2, random: false };
    let settings = PhotonSettings { fold, ..settings(Kernel::Fixed { radius: Some(0.05) }) };
    let map = GlobalMap::build(room.world(), &light, &settings, 0, Filter::ALL);
    let ratio = |i: i32| {
        let p = Vec3::new(x, 0.0, i as f32 / 500.0);
        let d = (p - light.o).as_dvec3();
        f64::from(map.irradiance(p, Vec3::Y, DIRECT).x) * d.length().powi(3)
    };
    (-300..300).map(ratio).sum::<f64>() / 600.0
}

/// The floor x < 0.3, |z| < 4.
fn left(s: &mut Description, material: MaterialId) {
    add(s, GeometryDesc::Rectangle, square(DVec3::new(-3.7, 0.0, 0.0), DVec3::Y, 4.0), material);
}

/// The same as a mesh of two triangles.
fn left_mesh(s: &mut Description, material: MaterialId) {
    let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let positions = vec![corner(-7.7, -4.0), corner(-7.7, 4.0), corner(0.3, 4.0), corner(0.3, -4.0)];
    let data = crate::scene::mesh::MeshData {
        positions,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        face_normals: true,
        ..Default::default()
    };
    add(s, GeometryDesc::Mesh(data), DMat4::IDENTITY, material);
}

fn right(s: &mut Description, material: MaterialId) {
    add(s, GeometryDesc::Rectangle, square(DVec3::new(4.3, 0.0, 0.0), DVec3::Y, 4.0), material);
}

#[test]
fn borders_lose_half_of_the_light_unless_it_is_folded_back() {
    for floor in [left, left_mesh] {
        for x in [0.27, 0.2999] {
            let folded = at_the_border(floor, x, true);
            assert!((folded - 1.0).abs() < 0.03, "{x}: {folded}");
        }
        let lost = at_the_border(floor, 0.2999, false);
        assert!((lost - 0.5).abs() < 0.05, "the test has no power: {lost}");
        // Far from it nothing changes but the order of the sum.
        let [folded, plain] = [true, false].map(|fold| at_the_border(floor, 0.2, fold));
        assert!((folded / plain - 1.0).abs() < 1e-6, "{folded}, not {plain}");
    }
}

#[test]
fn floors_of_two_parts_have_no_seam() {
    for floor in [left, left_mesh] {
        let both = |s: &mut Description, m: MaterialId| {
            floor(s, m);
            right(s, m);
        };
        for x in [0.28, 0.2999, 0.3001, 0.32] {
            let seam = at_the_border(both, x, true);
            assert!((seam - 1.0).abs() < 0.02, "{x}: {seam}");
        }
    }
}

#[test]
fn a_wall_at_the_border_is_no_continuation() {
    let corner = |s: &mut Description, m: MaterialId| {
        left(s, m);
        add(s, GeometryDesc::Rectangle, square(DVec3::new(0.3, 4.0, 0.0), DVec3::NEG_X, 4.0), m);
    };
    let folded = at_the_border(corner, 0.2999, true);
    assert!((folded - 1.0).abs() < 0.03, "{folded}");
}

#[test]
fn corners_of_a_floor_keep_their_light() {
    let small = |s: &mut Description, m: MaterialId| {
        add(s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 0.4), m);
    };
    let mut s = empty();
    let white = diffuse(&mut s, 0.5);
    small(&mut s, white);
    let room = Room::new(s);
    let Geometry::Rectangle(r) = &room.scene.shapes[0].geometry else { panic!("a rectangle") };
    let half = [Vec3::X * 1.2, Vec3::Z * 1.2];
    let mean = |fold: bool| {
        let ratio = |seed: u64| {
            let light = Aimed { o: Vec3::new(0.0, 1.0, 0.0), centre: Vec3::ZERO, half, n: 150, seed, random: false };
            let settings = PhotonSettings { fold, ..settings(Kernel::Fixed { radius: Some(0.08) }) };
            let map = GlobalMap::build(room.world(), &light, &settings, 0, Filter::ALL);
            let at = |s: [f32; 2]| {
                let p = r.center + r.ex * s[0] + r.ey * s[1];
                f64::from(map.irradiance(p, Vec3::Y, Filter::ALL).x * (p - light.o).length().powi(3))
            };
            [[0.999, 0.999], [-0.999, 0.999], [0.999, -0.999], [-0.999, -0.999]].map(at).iter().sum::<f64>() / 4.0
        };
        (0..10).map(ratio).sum::<f64>() / 10.0
    };
    let (folded, lost) = (mean(true), mean(false));
    assert!((folded - 1.0).abs() < 0.05, "{folded}");
    assert!((lost - 0.25).abs() < 0.05, "{lost}");
}
