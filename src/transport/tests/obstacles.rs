//! Kernels at the foot of what stands on a surface: nothing leaks through, nothing is lost.

use super::*;
use crate::transport::photon_map::{Filter, GlobalMap};

/// Mean ratio of irradiance to its closed form, without what stands on the floor, at the given places; light comes from (0, 1, 0).
fn ratio(stands: impl Fn(&mut Description, MaterialId), places: &[Vec3]) -> f64 {
    let mut s = empty();
    let white = diffuse(&mut s, 0.5);
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 4.0), white);
    stands(&mut s, white);
    let room = Room::new(s);
    let half = [Vec3::X * 1.2, Vec3::Z * 1.2];
    let light = Aimed { o: Vec3::new(0.0, 1.0, 0.0), centre: Vec3::ZERO, half, n: 500, seed: 2, random: false };
    let settings = settings(Kernel::Fixed { radius: Some(0.05) });
    let map = GlobalMap::build(room.world(), &light, &settings, 0, Filter::ALL);
    let direct = Filter { classes: [true, false, false], most_segments: 1 };
    let at = |p: &Vec3| f64::from(map.irradiance(*p, Vec3::Y, direct).x * (*p - light.o).length().powi(3));
    places.iter().map(at).sum::<f64>() / places.len() as f64
}

fn nothing(_: &mut Description, _: MaterialId) {}

/// A wall without thickness in the middle of the floor.
fn wall(s: &mut Description, m: MaterialId) {
    add(s, GeometryDesc::Rectangle, square(DVec3::new(0.3, 4.0, 0.0), DVec3::NEG_X, 4.0), m);
}

/// The same, slanting away from the light.
fn slanting(s: &mut Description, m: MaterialId) {
    let n = DVec3::new(-1.0, 0.4, 0.0).normalize();
    let up = DVec3::new(0.4, 1.0, 0.0).normalize();
    let centre = DVec3::new(0.3, 0.0, 0.0) + up * 0.99;
    let cols = DMat4::from_cols((up).extend(0.0), (DVec3::Z * 4.0).extend(0.0), n.extend(0.0), centre.extend(1.0));
    add(s, GeometryDesc::Rectangle, cols, m);
}

/// A ring around the light.
fn ring(s: &mut Description, m: MaterialId) {
    let cylinder = GeometryDesc::Cylinder { p0: DVec3::ZERO, p1: DVec3::Y * 0.9, radius: 0.3 };
    add(s, cylinder, DMat4::IDENTITY, m);
}

/// Places on a line, or on a circle, at x.
fn line(x: f32) -> Vec<Vec3> {
    (-300..300).map(|i| Vec3::new(x, 0.0, i as f32 / 500.0)).collect()
}
fn circle(r: f32) -> Vec<Vec3> {
    (0..600).map(|i| Vec3::new(r * (i as f32 * 0.01).cos(), 0.0, r * (i as f32 * 0.01).sin())).collect()
}

#[test]
fn walls_in_the_middle_of_a_floor_neither_leak_nor_darken_their_foot() {
    for stands in [wall, slanting] {
        for x in [0.2999, 0.27] {
            let near = ratio(stands, &line(x));
            assert!((near - 1.0).abs() < 0.04, "{x}: {near}");
        }
        for x in [0.302, 0.31, 0.33] {
            assert!(ratio(stands, &line(x)) < 1e-3, "light behind the wall at {x}");
        }
    }
    assert!((ratio(nothing, &line(0.31)) - 1.0).abs() < 0.02, "there is light without the wall");
}

#[test]
fn a_ring_keeps_the_light_inside() {
    for r in [0.298, 0.27] {
        let near = ratio(ring, &circle(r));
        // The tangent at the nearest point stands for the ring: a little is lost.
        assert!((near - 1.0).abs() < 0.1, "{r}: {near}");
    }
    for r in [0.303, 0.32] {
        let behind = ratio(ring, &circle(r));
        assert!(behind < 0.01, "{r}: {behind}");
    }
}

#[test]
fn a_post_hides_what_lies_behind_it_only() {
    // Thinner than a kernel: the floor around it keeps its light.
    let post = |s: &mut Description, m: MaterialId| {
        let post =
            GeometryDesc::Cylinder { p0: DVec3::new(0.3, 0.0, 0.0), p1: DVec3::new(0.3, 0.2, 0.0), radius: 0.01 };
        add(s, post, DMat4::IDENTITY, m);
    };
    let beside: Vec<Vec3> = (0..40).map(|i| Vec3::new(0.27 + 0.001 * i as f32, 0.0, 0.04)).collect();
    let near = ratio(post, &beside);
    assert!((near - 1.0).abs() < 0.15, "{near}");
}
