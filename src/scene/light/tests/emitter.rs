//! Emitters in view of a point: closed-form irradiance against their own samples, quads of two triangles, bounds.

use super::*;
use crate::math::stats::{sidak, z_test_p};

/// Irradiance by samples and its variance, and the closed form.
fn irradiance_both(shape: Shape, p: Vec3, n: Vec3, seed: u64) -> (f64, f64, Option<f64>) {
    let shapes = [shape];
    let all = lights(&shapes, &[]);
    let count = 20_000;
    let (mut sum, mut square, mut closed) = (0.0, 0.0, Some(0.0));
    for e in 0..all.emitter_count() as u32 {
        let Some(view) = all.view(&shapes, NO_TEXTURES, e, p) else { continue };
        closed = closed.zip(view.irradiance(n)).map(|(a, b)| a + f64::from(b.x));
        for i in 0..count {
            let s = view.sample(random2(seed + u64::from(e), i));
            let value = s.map_or(0.0, |s| f64::from(s.weight.x * s.wi.dot(n).max(0.0)));
            sum += value;
            square += value * value;
        }
    }
    // Emitters are few and alike: the variance of the sum is at most the sum of second moments.
    (sum / count as f64, square / (count as f64).powi(2), closed)
}

fn cases() -> Vec<(&'static str, Shape, Vec3, Vec3)> {
    let v = Vec3::new;
    let disk = |scale: DVec3| lamp(GeometryDesc::Disk, DMat4::from_scale(scale), false, Rgb::splat(3.0));
    let quad = triangles(
        &[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]], [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.0, 2.0, 0.0]]],
        vec![],
    );
    let tilted = v(0.3, -0.5, -0.6).normalize();
    vec![
        ("rectangle above", ceiling(DVec3::new(0.2, 0.1, 2.0), 0.5, 3.0), v(0.1, 0.2, 0.0), Vec3::Z),
        ("rectangle tilted", ceiling(DVec3::new(0.2, 0.1, 2.0), 0.5, 3.0), v(0.1, 0.2, 0.0), -tilted),
        ("rectangle across the horizon", ceiling(DVec3::new(0.2, 0.1, 0.3), 1.5, 3.0), Vec3::ZERO, Vec3::X),
        ("two triangles", lamp(quad.clone(), DMat4::IDENTITY, false, Rgb::ONE), v(0.3, 0.2, 0.9), tilted),
        ("sphere above", sphere(DVec3::new(0.1, 0.2, 1.5), 1.0, false, 2.0), Vec3::ZERO, v(0.1, 0.2, 1.0).normalize()),
        ("disk facing", disk(DVec3::ONE), v(0.0, 0.0, 0.7), Vec3::NEG_Z),
        ("disk aside", disk(DVec3::ONE), v(1.8, -0.4, 0.9), v(-0.5, 0.2, -0.6).normalize()),
        ("disk far aside", disk(DVec3::ONE), v(3.0, 1.0, 0.4), v(-0.9, -0.3, -0.15).normalize()),
        ("disk on the axis", disk(DVec3::ONE), v(0.0, 0.0, 1.9), tilted),
        ("tiny and far", disk(DVec3::splat(1e-3)), v(20.0, -30.0, 40.0), -v(20.0, -30.0, 40.0).normalize()),
    ]
}

#[test]
fn closed_forms_agree_with_samples() {
    let list = cases();
    let tests = list.len();
    for (k, (name, shape, p, n)) in list.into_iter().enumerate() {
        let (mean, variance, closed) = irradiance_both(shape, p, n, 100 * k as u64);
        let closed = closed.unwrap_or_else(|| panic!("{name}: a closed form"));
        // The square root of f32 rounding where samples are all alike.
        let variance = variance + (2e-6 * mean).powi(2);
        let chance = z_test_p(mean, variance, closed);
        assert!(chance > sidak(0.01, tests), "{name}: {mean} +- {} against {closed}", variance.sqrt());
        assert!(z_test_p(mean * 1.05, variance, closed) < 1e-3, "{name}: an error of 5 % is seen");
    }
}

#[test]
fn what_has_no_closed_form_says_so() {
    let squashed = lamp(GeometryDesc::Disk, DMat4::from_scale(DVec3::new(1.0, 0.5, 1.0)), false, Rgb::ONE);
    let p = Vec3::new(0.2, 0.1, 1.0);
    assert!(irradiance_both(squashed, p, Vec3::NEG_Z, 1).2.is_none(), "an ellipse");
    let disk = || lamp(GeometryDesc::Disk, DMat4::IDENTITY, false, Rgb::ONE);
    assert!(irradiance_both(disk(), p, Vec3::X, 1).2.is_none(), "across the horizon");
    let ball = sphere(DVec3::new(0.0, 0.0, 0.5), 0.4, false, 1.0);
    assert!(irradiance_both(ball, Vec3::new(0.0, -2.0, 0.4), Vec3::Z, 1).2.is_none(), "across the horizon");
    let tube = GeometryDesc::Cylinder { p0: DVec3::ZERO, p1: DVec3::Z, radius: 0.5 };
    let tube = lamp(tube, DMat4::IDENTITY, false, Rgb::ONE);
    assert!(irradiance_both(tube, Vec3::new(2.0, 0.0, 0.5), Vec3::NEG_X, 1).2.is_none());
}

/// A lamp of two triangles with the far corner `d`.
fn two_triangles(d: [f32; 3]) -> Shape {
    let (a, b, c) = ([0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    let mesh = MeshData {
        positions: [a, b, c, d].map(Vec3::from).to_vec(),
        triangles: vec![[0, 2, 1], [0, 1, 3]],
        face_normals: true,
        ..MeshData::default()
    };
    lamp(GeometryDesc::Mesh(mesh), DMat4::IDENTITY, false, Rgb::ONE)
}

#[test]
fn quads_of_two_triangles_are_one_emitter() {
    let square = [two_triangles([0.0, 1.0, 0.0])];
    let all = lights(&square, &[]);
    assert_eq!((all.emitter_count(), all.infos[0].primitives), (1, 2));
    assert!((all.infos[0].power.x - std::f32::consts::PI).abs() < 1e-5);
    // A point found on either half has the density of the whole.
    let p = Vec3::new(0.3, 0.4, 0.8);
    let view = all.view(&square, NO_TEXTURES, 0, p).expect("in front");
    assert_eq!(view.corners().len(), 4);
    for (prim, point) in [(0, Vec3::new(0.7, 0.2, 0.0)), (1, Vec3::new(0.2, 0.7, 0.0))] {
        let (u, v) = (1.0 / 3.0, 1.0 / 3.0);
        let at = square[0].surface_point(0, prim, p, (point - p).normalize(), ShapeHit { t: 1.0, u, v });
        assert_eq!(all.emitter_at(&at), Some(0));
        let pdf = all.pdf_dir_surface(&square, p, &at);
        assert!((pdf * view.solid_angle() - 1.0).abs() < 1e-5);
    }
    let mut mean = Vec3::ZERO;
    for i in 0..4000 {
        let s = view.sample(random2(3, i)).expect("a bright lamp");
        let q = p + s.wi * s.distance;
        assert!(q.z.abs() < 1e-5 && q.min_element() > -1e-5 && q.max_element() < 1.0 + 1e-5);
        mean += q / 4000.0;
    }
    assert!((mean.truncate() - Vec2::new(0.45, 0.47)).length() < 0.06, "all over the square: {mean}");
    // Companions: not a parallelogram, not in one plane.
    for d in [[0.0, 1.1, 0.0], [0.0, 1.0, 0.01]] {
        assert_eq!(lights(&[two_triangles(d)], &[]).emitter_count(), 2, "{d:?}");
    }
}

#[test]
fn bounds_hold_the_emitter_and_all_directions_it_emits_to() {
    let spot = LightDesc::Spot {
        to_world: DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0)) * DMat4::from_rotation_y(0.4),
        intensity: Rgb::ONE,
        cutoff_angle: 0.6,
        beam_width: 0.3,
        texture: None,
    };
    let point = LightDesc::Point { position: DVec3::new(0.1, 0.2, 0.3), intensity: Rgb::ONE };
    let others = [spot, point];
    let mut list: Vec<Shape> = cases().into_iter().map(|c| c.1).collect();
    let lean = Vec3::new(0.6, 0.0, 0.8);
    list.push(lamp(
        triangles(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]], vec![lean; 3]),
        DMat4::IDENTITY,
        false,
        Rgb::ONE,
    ));
    let all = lights(&list, &others);
    for e in 0..all.emitter_count() as u32 {
        let b = all.emitter_bounds(&list, e).expect("finite");
        assert!(b.intensity > 0.0 && (b.axis.length() - 1.0).abs() < 1e-5);
        let reach = b.cos_normals.clamp(-1.0, 1.0).acos() + b.cos_emission.acos();
        let mut lit = 0;
        for i in 0..500 {
            let p = 16.0 * (Vec3::new(random(e as u64, i, 1), random(e as u64, i, 2), random(e as u64, i, 3)) - 0.5);
            let Some(s) = all.view(&list, NO_TEXTURES, e, p).and_then(|v| v.sample(random2(9, i))) else { continue };
            lit += 1;
            let q = p + s.wi * s.distance;
            let slack = 1e-5 * (1.0 + q.abs().max_element());
            assert!(
                (q - b.bounds.0).min_element() > -slack && (b.bounds.1 - q).min_element() > -slack,
                "{e}: {q} {b:?}"
            );
            let angle = (-s.wi).dot(b.axis).clamp(-1.0, 1.0).acos();
            assert!(angle <= reach + 1e-3, "{e}: {angle} > {reach}");
        }
        assert!(lit > 0, "{e}: some point is lit");
    }
}
