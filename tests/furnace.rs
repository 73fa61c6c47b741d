//! Scenes whose radiance is known in closed form.
//!
//! Closed furnace: a diffuse enclosure of albedo a whose walls emit 1 shows sum_k a^k = 1/(1-a) everywhere.
//! Confidence: family-wise 0.01 over the cases of this file (Sidak), from the spread of independent renders.

mod common;

use common::*;
use dualux::integrators::path::PathSettings;
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::scene::description::*;
use dualux::scene::{Color, Material};

/// Two-sided quantile of Student's t with 15 degrees of freedom at 0.01 / 12 (12 cases share 0.01).
const T_LIMIT: f64 = 4.2;
const RUNS: u64 = 16;

fn furnace(geometry: GeometryDesc, albedo: f32, emission: f32) -> Description {
    let mut scene = empty_scene(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.5, 0.1, 0.6), 8, 8);
    let wall = diffuse(&mut scene, albedo);
    shape(&mut scene, geometry, DMat4::IDENTITY, wall, Some(emission));
    scene.shapes[0].flip_normals = true;
    scene
}

fn sphere() -> GeometryDesc {
    GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 }
}

#[test]
fn closed_diffuse_enclosures_show_the_geometric_series() {
    for geometry in [sphere(), GeometryDesc::Cube] {
        for albedo in [0.2f32, 0.5, 0.8] {
            let settings = PathSettings::default();
            let (mean, error) =
                mean_over_runs(RUNS, |seed| render_path(furnace(geometry.clone(), albedo, 1.0), settings, 64, seed));
            let expected = 1.0 / (1.0 - f64::from(albedo));
            assert!(error < 0.01 * expected, "the test has no power: error {error}");
            // f32 arithmetic along the path rounds by some 1e-6 per vertex.
            let limit = T_LIMIT * error + 2e-5 * expected;
            assert!((mean - expected).abs() < limit, "albedo {albedo}: {mean} +- {error}, expected {expected}");
        }
    }
}

#[test]
fn the_furnace_test_sees_an_error_of_one_per_cent() {
    let (mean, error) =
        mean_over_runs(RUNS, |seed| render_path(furnace(sphere(), 0.5, 1.01), PathSettings::default(), 64, seed));
    assert!((mean - 2.0).abs() > T_LIMIT * error, "{mean} +- {error}");
}

#[test]
fn depth_limits_cut_the_series() {
    for (max_depth, expected) in [(1, 1.0), (2, 1.5), (3, 1.75)] {
        let settings = PathSettings { max_depth: Some(max_depth), ..PathSettings::default() };
        let (mean, error) = mean_over_runs(RUNS, |seed| render_path(furnace(sphere(), 0.5, 1.0), settings, 64, seed));
        assert!((mean - expected).abs() < T_LIMIT * error + 1e-4, "{max_depth}: {mean} +- {error}, not {expected}");
    }
}

#[test]
fn a_furnace_lit_from_infinity_shows_one_through_any_lossless_surface() {
    // A sphere that loses nothing in an environment of radiance 1 is invisible, whatever its material.
    let white = Color::Constant(Rgb::ONE);
    let glass =
        Material::Dielectric { eta: 1.5, specular_reflectance: white.clone(), specular_transmittance: white.clone() };
    let pane = Material::ThinDielectric {
        eta: 1.5,
        specular_reflectance: white.clone(),
        specular_transmittance: white.clone(),
    };
    let mirror = Material::Conductor {
        eta: Color::Constant(Rgb::ZERO),
        k: Color::Constant(Rgb::ONE),
        specular_reflectance: white.clone(),
    };
    let chalk = Material::Diffuse { reflectance: white };
    for m in [glass, pane, mirror, chalk, Material::Null] {
        let mut scene = empty_scene(DVec3::new(0.0, 0.0, -4.0), DVec3::ZERO, 12, 12);
        let id = material(&mut scene, m.clone());
        shape(&mut scene, sphere(), DMat4::IDENTITY, id, None);
        scene.lights.push(LightDesc::Constant { radiance: Rgb::ONE });
        let (mean, error) = mean_over_runs(RUNS, |seed| render_path(scene.clone(), PathSettings::default(), 64, seed));
        assert!((mean - 1.0).abs() < T_LIMIT * error + 1e-4, "{m:?}: {mean} +- {error}");
    }
}

/// Irradiance at the origin, normal +y, from a rectangle parallel to it at height h with x in [0,a], z in [0,b], radiance 1:
/// the corner form of Lambert's formula (e.g. Howell's catalogue, configuration B-3), pi times the form factor.
fn corner_irradiance(a: f64, b: f64, h: f64) -> f64 {
    let (x, y) = (a / h, b / h);
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    0.5 * (x / rx * (y / rx).atan() + y / ry * (x / ry).atan())
}

#[test]
fn direct_light_of_a_rectangle_matches_the_closed_form() {
    let mut scene = empty_scene(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, 1, 1);
    // A narrow view of the floor at the origin.
    scene.camera.projection = Projection::Perspective {
        x_fov: 1e-3,
        principal_point_offset: [0.0; 2],
        aperture_radius: 0.0,
        focus_distance: 1.0,
    };
    let floor = diffuse(&mut scene, 0.6);
    let black = diffuse(&mut scene, 0.0);
    let up = DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    shape(&mut scene, GeometryDesc::Rectangle, DMat4::from_scale(DVec3::splat(50.0)) * up, floor, None);
    // Lamp at height 2 that faces down: x in [0.3, 1.1], z in [-0.5, 0.7].
    let down = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let place = DMat4::from_translation(DVec3::new(0.7, 2.0, 0.1)) * DMat4::from_scale(DVec3::new(0.4, 1.0, 0.6));
    shape(&mut scene, GeometryDesc::Rectangle, place * down, black, Some(5.0));
    let f = |x: f64, z: f64| x.signum() * z.signum() * corner_irradiance(x.abs(), z.abs(), 2.0);
    let irradiance = 5.0 * (f(1.1, 0.7) - f(0.3, 0.7) - f(1.1, -0.5) + f(0.3, -0.5));
    let expected = 0.6 / std::f64::consts::PI * irradiance;
    let settings = PathSettings { max_depth: Some(2), ..PathSettings::default() };
    let (mean, error) = mean_over_runs(RUNS, |seed| render_path(scene.clone(), settings, 1024, seed));
    assert!(error < 2e-3 * expected, "the test has no power: {error}");
    assert!((mean - expected).abs() < T_LIMIT * error + 1e-4 * expected, "{mean} +- {error}, expected {expected}");
}
