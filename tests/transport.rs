//! Rules of light transport that a picture of the right mean does not show: light leaks at any scale, hidden lamps, masks,
//! surfaces that are passed, sides of glass. Closed forms; where numbers are random, as stated.

mod common;

use common::*;
use dualux::integrators::path::PathSettings;
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::render::Progress;
use dualux::scene::description::*;
use dualux::scene::{Color, Material, Scalar};
use std::f64::consts::{FRAC_PI_2, PI};

/// A closed room with things in it, all of albedo 1/2 and radiance 1, so that 2 is seen everywhere; outside it is a
/// million times brighter.
fn sealed_room(scale: f64, offset: DVec3) -> Description {
    let place = DMat4::from_translation(offset) * DMat4::from_scale(DVec3::splat(scale));
    let at = |p: DVec3| place.transform_point3(p);
    let mut scene = empty_scene(at(DVec3::new(-0.6, 0.5, -0.7)), at(DVec3::new(0.3, -0.2, 0.4)), 16, 16);
    (scene.camera.near_clip, scene.camera.far_clip) = (1e-4 * scale, 1e3 * scale);
    let grey = diffuse(&mut scene, 0.5);
    let turn = DMat4::from_rotation_y(0.7) * DMat4::from_rotation_x(0.4);
    shape(&mut scene, GeometryDesc::Cube, place * turn.inverse(), grey, Some(1.0));
    scene.shapes[0].flip_normals = true;
    let small = DMat4::from_translation(DVec3::new(0.3, -0.3, 0.3)) * turn * DMat4::from_scale(DVec3::splat(0.2));
    shape(&mut scene, GeometryDesc::Cube, place * small, grey, Some(1.0));
    let ball = GeometryDesc::Sphere { center: DVec3::new(-0.2, 0.1, 0.5), radius: 0.25 };
    shape(&mut scene, ball, place, grey, Some(1.0));
    // A drum: a cylinder closed by two disks.
    let (p0, p1) = (DVec3::new(0.5, 0.1, -0.3), DVec3::new(0.5, 0.4, -0.3));
    shape(&mut scene, GeometryDesc::Cylinder { p0, p1, radius: 0.15 }, place, grey, Some(1.0));
    for (centre, angle) in [(p0, FRAC_PI_2), (p1, -FRAC_PI_2)] {
        let lid = DMat4::from_translation(centre) * DMat4::from_rotation_x(angle);
        shape(&mut scene, GeometryDesc::Disk, place * lid * DMat4::from_scale(DVec3::splat(0.15)), grey, Some(1.0));
    }
    scene.lights.push(LightDesc::Constant { radiance: Rgb::splat(1e6) });
    scene
}

#[test]
fn nothing_leaks_into_a_closed_room_of_any_size_at_any_place() {
    let far = DVec3::new(40.0, -70.0, 90.0);
    for (scale, offset) in
        [(1.0, DVec3::ZERO), (1e-3, DVec3::ZERO), (1e4, DVec3::ZERO), (1.0, far), (1e-3, 1e-3 * far), (1e4, 1e4 * far)]
    {
        let settings = PathSettings::default();
        let (mean, error) = mean_over_runs(8, |seed| render_path(sealed_room(scale, offset), settings, 16, seed));
        // 8 runs, 6 cases, family-wise 0.01: Student's t with 7 degrees of freedom. One leak adds up to 60 to the mean.
        assert!(error < 0.02, "{scale} {offset}: the error {error} means that light leaks in");
        assert!((mean - 2.0).abs() < 5.2 * error + 1e-4, "{scale} {offset}: {mean} +- {error}");
    }
}

#[test]
fn a_room_with_a_gap_is_noticed() {
    let mut scene = sealed_room(1.0, DVec3::ZERO);
    // A tube in place of the room: open at both ends.
    scene.shapes[0].geometry = GeometryDesc::Cylinder { p0: DVec3::NEG_Y, p1: DVec3::Y, radius: 1.4 };
    assert!(render_path(scene, PathSettings::default(), 16, 1).film.mean_and_error().0[0] > 100.0);
}

/// Floor of albedo 1/2 seen from above at the origin through one pixel.
fn floor_from_above() -> Description {
    let mut scene = empty_scene(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, 1, 1);
    if let Projection::Perspective { x_fov, .. } = &mut scene.camera.projection {
        *x_fov = 1e-3;
    }
    let floor = diffuse(&mut scene, 0.5);
    let up = DMat4::from_scale(DVec3::splat(9.0)) * DMat4::from_rotation_x(-FRAC_PI_2);
    shape(&mut scene, GeometryDesc::Rectangle, up, floor, None);
    scene
}

fn red(done: &Progress) -> f64 {
    done.film.mean_and_error().0[0]
}

/// Puts a ball of `material` at `center`.
fn ball(scene: &mut Description, center: DVec3, material: MaterialId, emission: Option<f32>) {
    shape(scene, GeometryDesc::Sphere { center, radius: 0.2 }, DMat4::IDENTITY, material, emission);
}

#[test]
fn hidden_lamps_let_the_camera_through_and_light_the_scene_all_the_same() {
    let mut scene = floor_from_above();
    let black = diffuse(&mut scene, 0.0);
    ball(&mut scene, DVec3::new(0.0, 1.0, 0.0), black, Some(7.0));
    let hide = PathSettings { max_depth: Some(2), hide_emitters: true, ..PathSettings::default() };
    // Lambert: albedo L sin^2 of the half angle under which the ball is seen.
    let expected = 0.5 * 7.0 * 0.04;
    let hidden = red(&render_path(scene.clone(), hide, 256, 1));
    assert!((hidden / expected - 1.0).abs() < 2e-3, "{hidden} instead of {expected}");
    let seen = red(&render_path(scene.clone(), PathSettings { hide_emitters: false, ..hide }, 4, 1));
    assert_eq!(seen, 7.0);
    // Nor does the camera see light from infinity, which lights the floor.
    scene.shapes.clear();
    scene.lights.push(LightDesc::Constant { radiance: Rgb::ONE });
    assert_eq!(red(&render_path(scene, hide, 4, 1)), 0.0);
}

#[test]
fn light_samples_and_the_camera_cross_masks_and_null_surfaces_without_a_bounce() {
    let direct = PathSettings { max_depth: Some(2), ..PathSettings::default() };
    let light = LightDesc::Point { position: DVec3::new(0.0, 2.0, 2.0), intensity: Rgb::splat(8.0) };
    // albedo / pi x I / d^2 x cos
    let open = 0.5 / PI * 8.0 / 8.0 * 0.5f64.sqrt();
    // Material 0 is the floor's.
    let render = |between: Material| {
        let mut scene = floor_from_above();
        scene.lights.push(light.clone());
        let between = material(&mut scene, between);
        let nothing = material(&mut scene, Material::Null);
        // Light crosses the first ball (twice its wall), the camera the second.
        ball(&mut scene, DVec3::new(0.0, 1.0, 1.0), between, None);
        ball(&mut scene, DVec3::new(0.0, 1.0, 0.0), nothing, None);
        render_path(scene, direct, 64, 3)
    };
    let opacity = Scalar::Constant(0.25);
    let masked = red(&render(Material::Mask { opacity, nested: 0 }));
    assert!((masked / (open * 0.75 * 0.75) - 1.0).abs() < 1e-4, "{masked}");
    let nothing = render(Material::Null);
    assert!((red(&nothing) / open - 1.0).abs() < 1e-4, "{}", red(&nothing));
    assert_eq!(nothing.counts.blocked_by_specular, 0);
    let white = Color::Constant(Rgb::ONE);
    let glass = Material::Dielectric { eta: 1.5, specular_reflectance: white.clone(), specular_transmittance: white };
    let blocked = render(glass);
    assert_eq!(red(&blocked), 0.0);
    assert!(blocked.counts.blocked_by_specular == 1 && blocked.counts.probed_shadow_rays == 1, "{:?}", blocked.counts);
}

#[test]
fn what_blocks_light_behind_a_null_surface_is_what_counts_as_specular_or_not() {
    let mut scene = floor_from_above();
    scene.lights.push(LightDesc::Point { position: DVec3::new(0.0, 2.0, 2.0), intensity: Rgb::ONE });
    let (black, nothing) = (diffuse(&mut scene, 0.0), material(&mut scene, Material::Null));
    ball(&mut scene, DVec3::new(0.0, 0.5, 0.5), nothing, None);
    ball(&mut scene, DVec3::new(0.0, 1.2, 1.2), black, None);
    let done = render_path(scene, PathSettings { max_depth: Some(2), ..PathSettings::default() }, 1, 1);
    assert_eq!((done.counts.probed_shadow_rays, done.counts.blocked_by_specular), (1, 0));
}

#[test]
fn turning_the_normals_of_glass_swaps_its_sides() {
    let white = Color::Constant(Rgb::ONE);
    let picture = |eta: f32, flip: bool| {
        let mut scene = empty_scene(DVec3::new(0.0, 0.3, -3.0), DVec3::ZERO, 24, 24);
        let glass = material(
            &mut scene,
            Material::Dielectric { eta, specular_reflectance: white.clone(), specular_transmittance: white.clone() },
        );
        let grey = diffuse(&mut scene, 0.5);
        shape(&mut scene, GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 }, DMat4::IDENTITY, glass, None);
        scene.shapes[0].flip_normals = flip;
        let wall = DMat4::from_translation(DVec3::new(1.0, 0.0, 3.0)) * DMat4::from_rotation_y(PI);
        shape(&mut scene, GeometryDesc::Rectangle, wall, grey, Some(3.0));
        scene.lights.push(LightDesc::Constant { radiance: Rgb::splat(0.1) });
        render_path(scene, PathSettings::default(), 256, 2)
    };
    let [normal, turned, inverse] = [(1.5, false), (1.5, true), (1.0 / 1.5, false)].map(|(e, f)| picture(e, f));
    // The same random numbers take the same decisions, but for rounding.
    let (a, b) = (red(&turned), red(&inverse));
    assert!((a / b - 1.0).abs() < 2e-3, "{a} {b}");
    assert!((red(&normal) / a - 1.0).abs() > 0.02, "the two sides differ");
}
