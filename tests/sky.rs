//! Light of the sky that comes through an opening: records gather it ([`dualux::transport::gather_sky`]), and it has the mean of paths.
//!
//! Confidence: differences within five standard errors (6e-7) and the bias stated.

mod common;

use common::*;
use dualux::accel::Accel;
use dualux::integrators::path::PathSettings;
use dualux::integrators::photon::PhotonSettings;
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::scene::description::*;
use dualux::scene::{Description, Scene};
use dualux::transport::World;
use dualux::transport::gather_sky::is_gathered;

/// Standard errors.
const LIMIT: f64 = 5.0;

/// A box of side 2 without its wall at x = 1, in its place two strips that leave a window of the height `window`; a ball on the floor.
fn room(window: f64) -> Description {
    let mut scene = empty_scene(DVec3::new(-0.2, 0.0, 0.95), DVec3::new(0.1, -0.2, -1.0), 16, 16);
    let white = diffuse(&mut scene, 0.6);
    let mut wall = |centre: DVec3, u: DVec3, v: DVec3| {
        let to_world =
            DMat4::from_cols(u.extend(0.0), v.extend(0.0), u.cross(v).normalize().extend(0.0), centre.extend(1.0));
        shape(&mut scene, GeometryDesc::Rectangle, to_world, white, None);
    };
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    wall(-x, y, z);
    wall(-y, z, x);
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
