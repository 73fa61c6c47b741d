//! Light of the sky that comes through an opening: records gather it ([`dualux::transport::gather_sky`]), and it has the mean of paths.
//!
//! Confidence: differences within five standard errors (6e-7) and the bias stated.

mod common;

use common::*;
use dualux::accel::Accel;
use dualux::image::film::PixelSums;
use dualux::integrators::path::PathSettings;
use dualux::integrators::photon::{Parts, PhotonSettings};
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::scene::description::*;
use dualux::scene::{Description, Material, Scene};
use dualux::transport::World;
use dualux::transport::gather_sky::is_gathered;

/// Standard errors.
const LIMIT: f64 = 5.0;

/// A box of side 2 without its wall at x = 1, in its place two strips that leave a window of the height `window`; a ball on the floor.
fn room(window: f64) -> Description {
    let view = [DVec3::new(-0.2, 0.0, 0.95), DVec3::new(0.1, -0.2, -1.0)];
    room_on(window, view, |scene| diffuse(scene, 0.6))
}

/// The same with a floor of its own, seen from the first point towards the second.
fn room_on(window: f64, [eye, target]: [DVec3; 2], floor: impl Fn(&mut Description) -> MaterialId) -> Description {
    let mut scene = empty_scene(eye, target, 16, 16);
    let white = diffuse(&mut scene, 0.6);
    let floor = floor(&mut scene);
    let mut rectangle = |centre: DVec3, u: DVec3, v: DVec3, material: MaterialId| {
        let to_world =
            DMat4::from_cols(u.extend(0.0), v.extend(0.0), u.cross(v).normalize().extend(0.0), centre.extend(1.0));
        shape(&mut scene, GeometryDesc::Rectangle, to_world, material, None);
    };
    rectangle(-DVec3::Y, DVec3::Z, DVec3::X, floor);
    let mut wall = |centre: DVec3, u: DVec3, v: DVec3| rectangle(centre, u, v, white);
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    wall(-x, y, z);
    wall(y, x, z);
    wall(-z, x, y);
    wall(z, y, x);
    let strip = 0.5 * (1.0 - 0.5 * window);
    for side in [-1.0, 1.0] {
        wall(x + y * (side * (1.0 - strip)), z, y * strip);
    }
    let ball = GeometryDesc::Sphere { center: DVec3::new(0.2, -0.7, -0.3), radius: 0.3 };
    shape(&mut scene, ball, DMat4::IDENTITY, white, None);
    scene.lights.push(LightDesc::Constant { radiance: Rgb::ONE });
    scene
}

fn photon_mean(window: f64) -> (f64, f64) {
    mean_over_runs(8, |seed| {
        let settings = PhotonSettings { seed, adaptive_sampling: false, ..PhotonSettings::default() };
        render_photon(room(window), settings, 12)
    })
}

/// A dark floor with a rough coat: what it reflects is mostly the window, found by rays that records guide (`glossy_guide.rs`).
fn polished(scene: &mut Description) -> MaterialId {
    let coated = Material::RoughPlastic {
        eta: 1.8,
        diffuse_reflectance: grey(0.03),
        specular_reflectance: grey(1.0),
        nonlinear: false,
        roughness: rough(0.45),
    };
    material(scene, coated)
}

/// Mean relative variance of a camera sample in a room whose polished floor mirrors the window.
fn noise(parts: Parts) -> f64 {
    let view = [DVec3::new(-0.9, -0.3, 0.3), DVec3::new(0.3, -1.0, 0.2)];
    let settings = PhotonSettings { adaptive_sampling: false, parts, ..PhotonSettings::default() };
    let done = render_photon(room_on(0.8, view, polished), settings, 64);
    let relative = |p: &PixelSums| p.variance()[0] * f64::from(p.count()) / p.mean()[0].powi(2).max(1e-6);
    let all: Vec<f64> = done.film.pixels().iter().map(relative).collect();
    all.iter().sum::<f64>() / all.len() as f64
}

#[test]
fn records_calm_what_polished_floors_reflect() {
    // Without indirect light there are no records.
    let [guided, alone] = [true, false].map(|indirect| noise(Parts { indirect, ..Parts::default() }));
    assert!(guided < 0.3 * alone, "{guided} {alone}");
}

#[test]
fn windows_reflected_by_a_rough_coat_have_the_mean_of_paths() {
    let mut sky = room_on(0.8, [DVec3::new(-0.9, -0.1, 0.3), DVec3::new(0.3, -1.0, 0.2)], polished);
    // Other lights beside it, which light samples find: the weights of the two are one.
    sky.lights.push(LightDesc::Point { position: DVec3::new(-0.5, 0.5, 0.5), intensity: Rgb::splat(0.1) });
    let lamp = DMat4::from_translation(DVec3::new(-0.6, 0.98, -0.4))
        * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2)
        * DMat4::from_scale(DVec3::splat(0.1));
    let black = diffuse(&mut sky, 0.0);
    shape(&mut sky, GeometryDesc::Rectangle, lamp, black, Some(8.0));
    let settings = PhotonSettings { adaptive_sampling: false, ..PhotonSettings::default() };
    let (a, a_error) = mean_over_runs(16, |seed| render_photon(sky.clone(), PhotonSettings { seed, ..settings }, 12));
    let (b, b_error) = mean_over_runs(16, |seed| render_path(sky.clone(), PathSettings::default(), 256, 100 + seed));
    let error = a_error.hypot(b_error);
    assert!(error < 0.004 * b, "the test has no power, error {error} of {b}");
    assert!((a - b).abs() < LIMIT * error + 0.003 * b, "{a} +- {a_error}, path {b} +- {b_error}");
}

#[test]
fn sky_through_a_window_has_the_mean_of_paths() {
    for window in [1.2, 0.3] {
        let scene = Scene::new(room(window)).expect("the scene is valid");
        let accel = Accel::new(&scene.shapes);
        assert!(is_gathered(&World::new(&scene, &accel)), "else this tests nothing");
        let (a, a_error) = photon_mean(window);
        let (b, b_error) =
            mean_over_runs(8, |seed| render_path(room(window), PathSettings::default(), 256, 100 + seed));
        let error = a_error.hypot(b_error);
        assert!(error < 0.015 * b, "{window}: the test has no power, error {error} of {b}");
        // Interpolation and surfels: within 1 %.
        assert!((a - b).abs() < LIMIT * error + 0.01 * b, "{window}: {a} +- {a_error}, path {b} +- {b_error}");
    }
}
