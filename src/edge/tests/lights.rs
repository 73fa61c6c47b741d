//! What a point sees of a light.

use super::{Rng, ball, quad, scene, scene_of, shape, torus};
use crate::edge::light::Receiver;
use crate::edge::{EdgeDetector, LightVerdict, Settings, oracle};
use crate::math::{DMat4, DVec3, Vec3};
use crate::scene::description::{GeometryDesc, ShapeDesc};
use crate::scene::mesh::MeshData;
use crate::scene::{Color, Material};

fn lamp(mut shape: ShapeDesc) -> ShapeDesc {
    shape.emission = Some(Color::Constant(Vec3::ONE));
    shape
}

/// Boxes, balls and disks round the origin.
fn clutter(rng: &mut Rng) -> Vec<ShapeDesc> {
    let mut shapes = Vec::new();
    for i in 0..14 {
        let (c, a) = (rng.cube(2.0), rng.range(0.0, 6.0));
        let turn = DMat4::from_translation(c) * DMat4::from_rotation_y(a) * DMat4::from_rotation_x(0.3 * a);
        shapes.push(match i % 3 {
            0 => shape(GeometryDesc::Cube, turn * DMat4::from_scale(DVec3::new(0.4, 0.3, 0.05))),
            1 => ball(c, rng.range(0.05, 0.4)),
            _ => shape(GeometryDesc::Disk, turn * DMat4::from_scale(DVec3::splat(0.4))),
        });
    }
    shapes
}

/// A mesh without vertex normals.
fn facets(positions: &[DVec3], triangles: &[[u32; 3]]) -> ShapeDesc {
    let data = MeshData {
        positions: positions.iter().map(|p| p.as_vec3()).collect(),
        triangles: triangles.to_vec(),
        face_normals: true,
        ..MeshData::default()
    };
    shape(GeometryDesc::Mesh(data), DMat4::IDENTITY)
}

/// Points below the clutter and near it, most of them turned upwards.
fn receiver(rng: &mut Rng) -> Receiver {
    let p = DVec3::new(rng.range(-3.0, 3.0), rng.range(-2.5, -1.0), rng.range(-3.0, 3.0));
    Receiver { p, n: Some((DVec3::Y + rng.cube(1.5)).normalize()), facet: None }
}

/// Holds the verdicts on light 0, over clutter, against shadow rays: (visible, blocked, partial), partial without cause.
fn agree(seed: u64, light: ShapeDesc, receivers: usize) -> ([usize; 3], usize) {
    let mut rng = Rng(seed, 0);
    let mut shapes = vec![lamp(light)];
    shapes.extend(clutter(&mut rng));
    let (scene, accel) = scene(shapes);
    let settings = Settings { busy: 200, ..Settings::default() };
    let detector = EdgeDetector::with_settings(&scene, &accel, settings);
    let prepared = detector.lamp(0);
    let (mut counts, mut unsure) = ([0; 3], 0);
    for _ in 0..receivers {
        let from = receiver(&mut rng);
        let Some(truth) = oracle::light(&scene, &accel, 0, &from, 24) else { continue };
        let verdict = detector.light(0, &from, false);
        assert_eq!(verdict, detector.seen_from(&prepared, &from, false));
        match verdict {
            LightVerdict::Visible => counts[0] += 1,
            LightVerdict::Blocked => counts[1] += 1,
            LightVerdict::Partial(_) => counts[2] += 1,
            LightVerdict::Unknown(e) => panic!("{e:?}"),
        }
        if matches!(verdict, LightVerdict::Partial(_)) {
            unsure += usize::from(!truth);
        } else {
            assert!(!truth, "{verdict:?} from {from:?}");
        }
    }
    assert!(counts.iter().all(|&c| c * 30 > receivers), "{counts:?}");
    (counts, unsure)
}

const ABOVE: DVec3 = DVec3::new(0.0, 4.0, 0.0);

#[test]
fn a_rectangles_verdicts_agree_with_shadow_rays() {
    // x cross z points down.
    let (counts, unsure) = agree(8, quad(ABOVE, DVec3::X * 1.2, DVec3::Z * 0.8), 3000);
    assert!(unsure * 10 < counts[2], "{unsure} of {counts:?} only touch");
}

#[test]
fn a_disks_verdicts_agree_with_shadow_rays() {
    let turn = DMat4::from_translation(ABOVE) * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let (counts, unsure) = agree(9, shape(GeometryDesc::Disk, turn), 1500);
    assert!(unsure * 4 < counts[2], "{unsure} of {counts:?} only touch or meet a corner");
}

#[test]
fn round_lights_verdicts_agree_with_shadow_rays() {
    let (counts, unsure) = agree(10, ball(ABOVE, 0.8), 1500);
    assert!(unsure * 4 < counts[2], "sphere: {unsure} of {counts:?}");
    let ends = (ABOVE - DVec3::X, ABOVE + DVec3::new(1.0, 0.3, 0.4));
    let tube = shape(GeometryDesc::Cylinder { p0: ends.0, p1: ends.1, radius: 0.3 }, DMat4::IDENTITY);
    let (counts, unsure) = agree(11, tube, 1500);
    assert!(unsure * 4 < counts[2], "cylinder: {unsure} of {counts:?}");
}

#[test]
fn a_convex_quadrilateral_of_two_triangles_agrees_with_shadow_rays() {
    let corners = [(-1.2, -0.8), (-1.0, 0.9), (1.4, 0.6), (0.7, -1.0)].map(|(x, z)| DVec3::new(x, 4.0, z));
    // Wound to face down, cut along either diagonal.
    for triangles in [[[0, 2, 1], [0, 3, 2]], [[0, 3, 1], [1, 3, 2]]] {
        let (counts, unsure) = agree(12, facets(&corners, &triangles), 1200);
        assert!(unsure * 8 < counts[2], "{unsure} of {counts:?} only touch");
    }
}

#[test]
fn a_rectangle_held_as_a_mesh_is_seen_as_the_rectangle() {
    let mut rng = Rng(13, 0);
    let (x, z) = (DVec3::X * 1.2, DVec3::Z * 0.8);
    let corners = [ABOVE - x - z, ABOVE + x - z, ABOVE + x + z, ABOVE - x + z];
    let others = clutter(&mut rng);
    let with = |light: ShapeDesc| {
        let mut shapes = vec![lamp(light)];
        shapes.extend(others.iter().cloned());
        scene(shapes)
    };
    let (a, b) = (with(quad(ABOVE, x, z)), with(facets(&corners, &[[0, 1, 2], [0, 2, 3]])));
    let (da, db) = (EdgeDetector::new(&a.0, &a.1), EdgeDetector::new(&b.0, &b.1));
    for _ in 0..2000 {
        let from = receiver(&mut rng);
        let (va, vb) = (da.light(0, &from, true), db.light(0, &from, true));
        assert_eq!(std::mem::discriminant(&va), std::mem::discriminant(&vb), "{va:?} {vb:?}");
        assert_eq!(va.kinds(), vb.kinds());
        // One triangle sees no more than the whole.
        let half = db.light_prim(0, 0, &from, false);
        if matches!(va, LightVerdict::Visible | LightVerdict::Blocked) {
            assert_eq!(half, va);
        }
    }
}

#[test]
fn what_lies_inside_a_globe_makes_it_unknown() {
    let globe = || lamp(ball(ABOVE, 1.0));
    let from = Receiver { p: DVec3::new(0.0, -2.0, 0.0), n: Some(DVec3::Y), facet: None };
    let ask = |shapes: Vec<ShapeDesc>| {
        let (scene, accel) = scene(shapes);
        EdgeDetector::new(&scene, &accel).light(0, &from, false)
    };
    assert_eq!(ask(vec![globe()]), LightVerdict::Visible);
    // A plate inside, in front of the plane of the outline: hidden by the near surface, not the other way round.
    let plate = quad(ABOVE - DVec3::Y * 0.5, DVec3::X * 3.0, DVec3::Z * 3.0);
    assert!(matches!(ask(vec![globe(), plate]), LightVerdict::Unknown(_)));
    assert!(matches!(ask(vec![globe(), ball(ABOVE, 0.9)]), LightVerdict::Visible | LightVerdict::Unknown(_)));
    let before = quad(ABOVE - DVec3::Y * 1.5, DVec3::X * 3.0, DVec3::Z * 3.0);
    assert_eq!(ask(vec![globe(), before]), LightVerdict::Blocked);
}

#[test]
fn the_inner_side_of_a_ball_sees_what_lies_inside() {
    let inner = ball(DVec3::ZERO, 5.0);
    let at = |light: ShapeDesc| {
        let (scene, accel) = scene(vec![lamp(light), inner.clone()]);
        let p = DVec3::new(0.0, -5.0, 0.0);
        let from = Receiver { p, n: Some(DVec3::Y), facet: Some(crate::edge::Facet { shape: 1, prim: 0 }) };
        EdgeDetector::new(&scene, &accel).light(0, &from, false)
    };
    let square = |height: f64, size: f64| quad(DVec3::Y * height, DVec3::X * size, DVec3::Z * size);
    assert_eq!(at(square(2.0, 1.0)), LightVerdict::Visible);
    assert_eq!(at(square(9.0, 1.0)), LightVerdict::Blocked);
    assert!(matches!(at(square(2.0, 8.0)), LightVerdict::Unknown(_)));
    assert_eq!(at(ball(DVec3::Y, 1.0)), LightVerdict::Visible);
}

#[test]
fn masks_are_unknown_and_never_clear() {
    let mask = Material::Null;
    let x = DVec3::X * 4.0;
    let lamp = lamp(quad(DVec3::new(0.0, 4.0, 0.0), DVec3::X, DVec3::Z));
    let (masked, accel) = scene_of(vec![lamp, quad(DVec3::ZERO, x, DVec3::Z * 4.0)], mask);
    let detector = EdgeDetector::new(&masked, &accel);
    let from = Receiver { p: DVec3::new(0.0, -2.0, 0.0), n: Some(DVec3::Y), facet: None };
    assert!(matches!(detector.light(0, &from, false), LightVerdict::Unknown(_)));
    let (scene, accel) = scene(vec![scene_lamp(), quad(DVec3::ZERO, x, DVec3::Z * 4.0)]);
    let detector = EdgeDetector::new(&scene, &accel);
    assert_eq!(detector.light(0, &from, false), LightVerdict::Blocked);
}

#[test]
fn whatever_lets_shadow_rays_pass_is_unknown_and_glass_is_not() {
    let white = || Color::Constant(Vec3::ONE);
    let diffuse = Material::Diffuse { reflectance: white() };
    let mask = Material::Mask { opacity: crate::scene::Scalar::Constant(0.5), nested: 0 };
    let half = crate::scene::Scalar::Constant(0.5);
    let glass = Material::Dielectric { eta: 1.5, specular_reflectance: white(), specular_transmittance: white() };
    // Nested in others as well.
    let cases = [
        (vec![diffuse.clone(), mask.clone()], true),
        (vec![diffuse.clone(), mask.clone(), Material::TwoSided { front: 1, back: 0 }], true),
        (vec![diffuse.clone(), mask, Material::Blend { weight: half, first: 0, second: 1, absorbed: 0.0 }], true),
        (vec![diffuse.clone(), glass], false),
        (vec![diffuse], false),
    ];
    let from = Receiver { p: DVec3::new(0.0, -2.0, 0.0), n: Some(DVec3::Y), facet: None };
    for (k, (materials, passes)) in cases.into_iter().enumerate() {
        let mut sheet = quad(DVec3::ZERO, DVec3::X * 4.0, DVec3::Z * 4.0);
        sheet.material = materials.len() as u32 - 1;
        let (scene, accel) = super::scene_with(vec![scene_lamp(), sheet], materials);
        let detector = EdgeDetector::new(&scene, &accel);
        let light = detector.light(0, &from, false);
        // A pixel that sees nothing but the sheet.
        let mut rng = Rng(16, k as u64);
        let view = super::random_view(&mut rng, DVec3::Y * -3.0, DVec3::ZERO, 0.01);
        let pixel = detector.any(&view, None);
        if passes {
            assert!(matches!(light, LightVerdict::Unknown(_)), "case {k}: {light:?}");
            assert!(matches!(pixel, crate::edge::Verdict::Unknown(_)), "case {k}: {pixel:?}");
        } else {
            assert_eq!((light, pixel), (LightVerdict::Blocked, crate::edge::Verdict::Clear), "case {k}");
        }
    }
}

#[test]
fn a_textured_lamp_is_unknown() {
    let mut lamp = scene_lamp();
    lamp.emission = Some(Color::Texture(0));
    let from = Receiver { p: DVec3::new(0.0, -2.0, 0.0), n: Some(DVec3::Y), facet: None };
    let checks = crate::scene::Texture::Checkerboard {
        color0: Color::Constant(Vec3::ONE),
        color1: Color::Constant(Vec3::ZERO),
        to_uv: crate::math::Affine2::IDENTITY,
    };
    let mut description = crate::scene::description::Description::empty(DMat4::IDENTITY, 64, 64);
    description.materials = vec![Material::Diffuse { reflectance: Color::Constant(Vec3::ONE) }];
    description.textures = vec![checks];
    description.shapes = vec![lamp];
    let scene = crate::scene::Scene::new(description).unwrap();
    let accel = crate::accel::Accel::new(&scene.shapes);
    let detector = EdgeDetector::new(&scene, &accel);
    assert!(matches!(detector.light(0, &from, false), LightVerdict::Unknown(_)));
    assert!(matches!(detector.seen_from(&detector.lamp(0), &from, false), LightVerdict::Unknown(_)));
}

fn scene_lamp() -> ShapeDesc {
    lamp(quad(DVec3::new(0.0, 4.0, 0.0), DVec3::X, DVec3::Z))
}

#[test]
fn many_edges_are_busy_and_no_work_without_end() {
    // Slats before a lamp, behind a wall that hides half of them.
    let mut shapes = vec![scene_lamp()];
    for i in 0..60 {
        let at = DVec3::new(-1.5 + 0.05 * f64::from(i), 1.0, 0.0);
        shapes.push(quad(at, DVec3::X * 0.02, DVec3::Z * 0.3));
    }
    let (scene, accel) = scene(shapes);
    let from = Receiver { p: DVec3::new(0.0, -2.0, 0.0), n: Some(DVec3::Y), facet: None };
    let ask = |busy: usize, all: bool| {
        let settings = Settings { busy, ..Settings::default() };
        EdgeDetector::with_settings(&scene, &accel, settings).light(0, &from, all)
    };
    assert!(matches!(ask(16, true), LightVerdict::Unknown(e) if e.kinds.intersects(crate::edge::Kinds::BUSY)));
    assert!(matches!(ask(1000, true), LightVerdict::Partial(_)));
    // One edge is enough for `any`.
    assert!(matches!(ask(16, false), LightVerdict::Partial(_)));
}

#[test]
fn the_horizon_of_a_facet_counts_though_its_neighbours_lie_in_it() {
    // Points held in f32 lie beside their facet's plane, so that a neighbour seems to cover the horizon.
    let lamp = lamp(quad(DVec3::new(0.0, 4.0, 0.0), DVec3::X * 3.0, DVec3::Z * 3.0));
    let (scene, accel) = scene(vec![lamp, shape(GeometryDesc::Mesh(torus(192, 96)), DMat4::IDENTITY)]);
    let detector = EdgeDetector::new(&scene, &accel);
    let mut rng = Rng(14, 0);
    let (mut edges, mut missed, mut sure) = (0, 0, 0);
    for _ in 0..6000 {
        let prim = (rng.unit() * 36863.0) as u32;
        let u = crate::math::Vec2::new(rng.unit() as f32, rng.unit() as f32);
        let (at, _) = scene.shapes[1].sample_area(1, prim, u);
        let from = Receiver::new(&at, at.n_geo);
        let Some(truth) = oracle::light(&scene, &accel, 0, &from, 16) else { continue };
        edges += usize::from(truth);
        if matches!(detector.light(0, &from, false), LightVerdict::Visible | LightVerdict::Blocked) {
            sure += 1;
            missed += usize::from(truth);
        }
    }
    assert!(edges > 800 && sure > 500, "{edges} {sure}");
    // Brute force starts off the surface, where it may see over the next facet.
    assert!(missed * 200 <= edges, "{missed} of {edges}");
}

#[test]
fn what_pierces_the_plane_of_a_lamp_cuts_it() {
    // Only a cap or strip of each stands out of the lamp: their silhouettes lie behind it, their shadow ends where they cross it.
    let turn = DMat4::from_translation(ABOVE) * DMat4::from_rotation_y(0.3) * DMat4::from_scale(DVec3::splat(9.0));
    let lying =
        GeometryDesc::Cylinder { p0: DVec3::new(-9.0, 4.25, 0.1), p1: DVec3::new(9.0, 4.25, 0.4), radius: 0.35 };
    let through = [ball(ABOVE + DVec3::Y * 0.5, 0.7), shape(GeometryDesc::Disk, turn), shape(lying, DMat4::IDENTITY)];
    for (k, shape) in through.into_iter().enumerate() {
        let (scene, accel) = scene(vec![scene_lamp(), shape]);
        let detector = EdgeDetector::new(&scene, &accel);
        let mut rng = Rng(15, k as u64 * 10_000);
        let mut partly = 0;
        for _ in 0..500 {
            let from = Receiver { p: rng.cube(0.8) * DVec3::new(1.0, 0.3, 1.0), n: Some(DVec3::Y), facet: None };
            let truth = oracle::light(&scene, &accel, 0, &from, 24).expect("it is turned here");
            let verdict = detector.light(0, &from, false);
            partly += usize::from(truth);
            let sure = matches!(verdict, LightVerdict::Visible | LightVerdict::Blocked);
            assert!(!(sure && truth), "shape {k}: {verdict:?} from {from:?}");
        }
        assert!(partly > 400, "shape {k}: {partly}");
    }
}
