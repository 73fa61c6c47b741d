//! The many-light integrator against the path tracer and against closed forms.
//!
//! Confidence: means of independent renders, five standard errors of the difference (about 6e-7 each with many runs; the numbers of runs here
//! make it 1e-3 at worst), plus the bias that is stated.

mod common;

use clap::ValueEnum;
use common::*;
use dualux::accel::Accel;
use dualux::integrators::many_light::{ManyLight, ManyLightSettings};
use dualux::integrators::path::PathSettings;
use dualux::integrators::photon::Parts;
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::render::{Progress, RenderSettings, Silent, render};
use dualux::scene::description::*;
use dualux::scene::{Description, Material, Scalar, Scene};
use dualux::transport::World;
use dualux::transport::strategies::coins::Coins;
use dualux::transport::strategies::{Strategy, StrategySettings};
use std::sync::atomic::AtomicBool;

const LIMIT: f64 = 5.0;
fn settings(strategy: Strategy) -> ManyLightSettings {
    let strategy = StrategySettings { strategy, ..StrategySettings::default() };
    ManyLightSettings { strategy, vpls: Some(300), cache_points: 40, ..ManyLightSettings::default() }
}

fn render_many(desc: Description, settings: ManyLightSettings, passes: u64, seed: u64) -> Progress {
    let scene = Scene::new(desc).expect("the scene is valid");
    let accel = Accel::new(&scene.shapes);
    let mut integrator =
        ManyLight::new(World::new(&scene, &accel), ManyLightSettings { seed, ..settings }, scene.film.crop);
    let window = scene.film.crop;
    let settings = RenderSettings { window, passes: Some(passes), deadline: None, seed, features: false };
    render(&scene, &mut integrator, &settings, &AtomicBool::new(false), &mut Silent)
}

fn many_mean(runs: u64, passes: u64, scene: &dyn Fn() -> Description, settings: ManyLightSettings) -> (f64, f64) {
    mean_over_runs(runs, |seed| render_many(scene(), settings, passes, seed))
}

fn path_mean(runs: u64, passes: u64, scene: &dyn Fn() -> Description, settings: PathSettings) -> (f64, f64) {
    mean_over_runs(runs, |seed| render_path(scene(), settings, passes, 100 + seed))
}

/// A closed box of side 2, its left wall darker, a lamp below the ceiling, a block on the floor and `things` in it.
fn room(things: &dyn Fn(&mut Description)) -> Description {
    let mut scene = empty_scene(DVec3::new(0.0, 0.0, 0.95), DVec3::new(0.0, -0.3, -1.0), 16, 16);
    let white = diffuse(&mut scene, 0.6);
    shape(&mut scene, GeometryDesc::Cube, DMat4::IDENTITY, white, None);
    scene.shapes[0].flip_normals = true;
    let black = diffuse(&mut scene, 0.0);
    let lamp = DMat4::from_translation(DVec3::new(0.0, 0.9, 0.0))
        * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2)
        * DMat4::from_scale(DVec3::splat(0.3));
    shape(&mut scene, GeometryDesc::Rectangle, lamp, black, Some(10.0));
    let block = DMat4::from_translation(DVec3::new(-0.4, -0.7, -0.3)) * DMat4::from_scale(DVec3::new(0.2, 0.3, 0.2));
    shape(&mut scene, GeometryDesc::Cube, block, white, None);
    things(&mut scene);
    scene
}

fn plain() -> Description {
    room(&|_| ())
}

fn with(m: Material) -> impl Fn() -> Description {
    move || {
        room(&|scene| {
            let id = material(scene, m.clone());
            let ball = GeometryDesc::Sphere { center: DVec3::new(0.3, -0.6, -0.2), radius: 0.4 };
            shape(scene, ball, DMat4::IDENTITY, id, None);
        })
    }
}

#[test]
fn every_strategy_agrees_with_path() {
    let (b, b_error) = path_mean(4, 192, &plain, PathSettings::default());
    for &strategy in Strategy::value_variants() {
        for coins in [Coins::Systematic, Coins::Independent] {
            let mut settings = settings(strategy);
            settings.strategy.coins = coins;
            let (a, a_error) = many_mean(8, 8, &plain, settings);
            let error = a_error.hypot(b_error);
            assert!(error < 0.02 * b, "{strategy:?}: the test has no power, error {error} of {b}");
            assert!((a - b).abs() < LIMIT * error, "{strategy:?} {coins:?}: {a} +- {a_error}, path {b} +- {b_error}");
        }
    }
}

#[test]
fn interleaved_lights_have_the_same_mean() {
    let (b, b_error) = path_mean(4, 192, &plain, PathSettings::default());
    for strategy in [Strategy::Joint, Strategy::Culling] {
        let interleaved = ManyLightSettings { interleave: 3, vpls: Some(900), ..settings(strategy) };
        let (a, a_error) = many_mean(8, 8, &plain, interleaved);
        let error = a_error.hypot(b_error);
        assert!(error < 0.02 * b, "{strategy:?}: the test has no power, error {error} of {b}");
        assert!((a - b).abs() < LIMIT * error, "{strategy:?}: {a} +- {a_error}, path {b} +- {b_error}");
        // Each pixel looks at about a ninth of the lights that it would see otherwise.
        let lights = |s| {
            let counts = render_many(plain(), s, 1, 1).counts.many_light;
            counts.lights as f64 / counts.points as f64
        };
        let share = lights(interleaved) / lights(ManyLightSettings { interleave: 1, ..interleaved });
        assert!((0.08..0.15).contains(&share), "{share}");
    }
}

/// The room with a lamp of each kind, and a ball that is both diffuse and glossy.
fn lamps() -> Description {
    room(&|scene| {
        let coated = Material::RoughPlastic {
            eta: 1.5,
            diffuse_reflectance: grey(0.5),
            specular_reflectance: grey(1.0),
            nonlinear: false,
            roughness: rough(0.2),
        };
        let coated = material(scene, coated);
        let ball = GeometryDesc::Sphere { center: DVec3::new(0.3, -0.6, -0.2), radius: 0.3 };
        shape(scene, ball, DMat4::IDENTITY, coated, None);
        let black = diffuse(scene, 0.0);
        let lamp = GeometryDesc::Sphere { center: DVec3::new(-0.6, 0.2, -0.6), radius: 0.1 };
        shape(scene, lamp, DMat4::IDENTITY, black, Some(20.0));
        let position = DVec3::new(0.6, 0.3, 0.3);
        scene.lights.push(LightDesc::Point { position, intensity: Rgb::splat(0.4) });
        scene.lights.push(LightDesc::Directional { direction: DVec3::Z, irradiance: Rgb::ONE });
    })
}

#[test]
fn lights_on_emitters_agree_with_path() {
    let (b, b_error) = path_mean(4, 256, &lamps, PathSettings::default());
    for (strategy, area) in [(Strategy::Exact, 0.02), (Strategy::Joint, 8.0), (Strategy::Residual, 0.02)] {
        let settings = ManyLightSettings { emitter_vpls: 200, area, ..settings(strategy) };
        let (a, a_error) = many_mean(8, 16, &lamps, settings);
        let error = a_error.hypot(b_error);
        assert!(error < 0.02 * b, "{strategy:?}: the test has no power, error {error} of {b}");
        assert!((a - b).abs() < LIMIT * error, "{strategy:?}: {a} +- {a_error}, path {b} +- {b_error}");
    }
    // Direct light alone, and all of a path of two segments.
    let settings = ManyLightSettings { emitter_vpls: 200, ..settings(Strategy::Joint) };
    let depth = |max_depth| PathSettings { max_depth: Some(max_depth), ..PathSettings::default() };
    let (b, b_error) = path_mean(4, 128, &lamps, depth(2));
    let (a, a_error) = many_mean(8, 16, &lamps, ManyLightSettings { path: depth(2), ..settings });
    assert!((a - b).abs() < LIMIT * a_error.hypot(b_error), "{a} +- {a_error}, path {b} +- {b_error}");
    let shadow_rays = |emitter_vpls| {
        let s = ManyLightSettings { emitter_vpls, ..settings };
        render_many(lamps(), s, 1, 1).counts.direct.shadow_rays
    };
    assert!(shadow_rays(200) < shadow_rays(0), "lamps are sampled for glossy surfaces only");
}

#[test]
fn light_left_out_by_discs_is_missed_without_compensation() {
    let (b, b_error) = path_mean(4, 192, &plain, PathSettings::default());
    let means: Vec<(f64, f64)> = [(true, 8.0), (false, 8.0), (false, 1.0)]
        .map(|(compensate, area)| {
            many_mean(8, 8, &plain, ManyLightSettings { compensate, area, ..settings(Strategy::Exact) })
        })
        .into();
    let off = |i: usize| means[i].0 - b;
    let error = |i: usize| means[i].1.hypot(b_error);
    assert!(off(0).abs() < LIMIT * error(0), "compensated: {means:?}, path {b}");
    assert!(off(1) < -LIMIT * error(1), "large discs leave light out: {means:?}, path {b}");
    assert!(off(1) < 1.5 * off(2), "smaller discs less: {means:?}, path {b}");
}

#[test]
fn many_light_agrees_with_path_on_every_material() {
    let one = grey(1.0);
    let materials = [
        ("mirror", Material::Conductor { eta: grey(0.0), k: grey(1.0), specular_reflectance: grey(0.9) }),
        (
            "metal",
            Material::RoughConductor {
                eta: grey(0.0),
                k: grey(1.0),
                specular_reflectance: grey(0.9),
                roughness: rough(0.3),
            },
        ),
        (
            "glass",
            Material::Dielectric { eta: 1.5, specular_reflectance: one.clone(), specular_transmittance: one.clone() },
        ),
        (
            "plastic",
            Material::Plastic {
                eta: 1.5,
                diffuse_reflectance: grey(0.5),
                specular_reflectance: one.clone(),
                nonlinear: true,
            },
        ),
        ("clay", Material::RoughDiffuse { reflectance: grey(0.7), alpha: Scalar::Constant(0.6) }),
    ];
    for (name, m) in materials {
        let scene = with(m);
        let (b, b_error) = path_mean(6, 128, &scene, PathSettings::default());
        // Light that r sends to d by photons, and by paths.
        for photons in [None, Some(0)] {
            let (a, a_error) = many_mean(6, 12, &scene, ManyLightSettings { photons, ..settings(Strategy::Joint) });
            let error = a_error.hypot(b_error);
            assert!(error < 0.02 * b, "{name}: the test has no power, error {error} of {b}");
            // Kernels of photons blur: half a per cent at most.
            let off = (a - b).abs();
            assert!(off < LIMIT * error + 5e-3 * b, "{name} {photons:?}: {a} +- {a_error}, path {b} +- {b_error}");
        }
    }
}

/// The room with a mirror of the material `m` in place of its right wall: half of what the others see.
fn gallery(m: &Material) -> Description {
    let mut scene = plain();
    let id = material(&mut scene, m.clone());
    let wall = DMat4::from_translation(DVec3::new(0.999, 0.0, 0.0))
        * DMat4::from_rotation_y(-std::f64::consts::FRAC_PI_2)
        * DMat4::from_scale(DVec3::splat(0.999));
    shape(&mut scene, GeometryDesc::Rectangle, wall, id, None);
    scene
}

#[test]
fn photons_bring_the_light_of_mirrors_with_less_noise() {
    let grey_mirror = Material::Conductor { eta: grey(0.0), k: grey(1.0), specular_reflectance: grey(0.9) };
    let metal = Material::RoughConductor {
        eta: grey(0.0),
        k: grey(1.0),
        specular_reflectance: grey(0.9),
        roughness: rough(0.2),
    };
    let parts = Parts { direct: false, caustic: false, indirect: true };
    for (name, m) in [("mirror", grey_mirror), ("metal", metal)] {
        let scene = || gallery(&m);
        let few = ManyLightSettings { caustic_photons: Some(1000), ..settings(Strategy::Joint) };
        let with = |photons, parts| ManyLightSettings { photons, parts, ..few };
        let (a, a_error) = many_mean(8, 8, &scene, with(Some(2000), parts));
        let (b, b_error) = many_mean(8, 32, &scene, with(Some(0), parts));
        let error = a_error.hypot(b_error);
        assert!((a - b).abs() < LIMIT * error + 5e-3 * b, "{name}: {a} +- {a_error}, paths {b} +- {b_error}");
        // What a single sample of a pixel is off by, with lights of its own: as the film sees it.
        let noise = |photons| {
            let film = render_many(scene(), with(photons, parts), 24, 5).film;
            film.pixels().iter().map(|p| p.variance().iter().sum::<f64>()).sum::<f64>()
        };
        let gain = noise(Some(0)) / noise(Some(2000));
        assert!(gain > 2.0, "{name}: variance {gain} times lower");
        // Photons of two segments more than a path may have are none.
        let depth = |photons| {
            let path = PathSettings { max_depth: Some(4), ..PathSettings::default() };
            many_mean(8, 12, &scene, ManyLightSettings { path, ..with(photons, parts) })
        };
        let (short, path) = (depth(Some(2000)), depth(Some(0)));
        let error = short.1.hypot(path.1);
        assert!((short.0 - path.0).abs() < LIMIT * error + 5e-3 * path.0, "{name}: {short:?}, paths {path:?}");
        assert!(short.0 < a - LIMIT * a_error, "{name}: depth matters, {short:?} of {a}");
    }
}

#[test]
fn parts_add_up() {
    let scene =
        with(Material::Dielectric { eta: 1.5, specular_reflectance: grey(1.0), specular_transmittance: grey(1.0) });
    let none = Parts { direct: false, caustic: false, indirect: false };
    let one = |parts: Parts| many_mean(6, 8, &scene, ManyLightSettings { parts, ..settings(Strategy::Joint) });
    let all = one(Parts::default());
    let parts = [
        one(Parts { direct: true, ..none }),
        one(Parts { caustic: true, ..none }),
        one(Parts { indirect: true, ..none }),
    ];
    let sum: f64 = parts.iter().map(|p| p.0).sum();
    let error = parts.iter().fold(all.1, |e, p| e.hypot(p.1));
    assert!((sum - all.0).abs() < LIMIT * error + 1e-4 * all.0, "{parts:?}, together {all:?}");
    assert!(parts.iter().all(|p| p.0 > 2e-3 * all.0), "{parts:?}");
}

/// A closed sphere of albedo a that emits 1 everywhere: 1 / (1 - a).
fn furnace(albedo: f32) -> Description {
    let mut scene = empty_scene(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.5, 0.1, 0.6), 8, 8);
    let wall = diffuse(&mut scene, albedo);
    let ball = GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 };
    shape(&mut scene, ball, DMat4::IDENTITY, wall, Some(1.0));
    scene.shapes[0].flip_normals = true;
    scene
}

#[test]
fn a_furnace_of_points_is_exact_whatever_points_there_are() {
    // cos cos / r^2 is 1 / 4 between any two points of a unit sphere: the flux alone counts, and that of the first bounce has no chance in it.
    for albedo in [0.3f32, 0.8] {
        let parts = Parts { direct: false, caustic: false, indirect: true };
        let path = PathSettings { max_depth: Some(3), ..PathSettings::default() };
        let settings = ManyLightSettings { area: 0.0, parts, path, ..settings(Strategy::Exact) };
        let done = render_many(furnace(albedo), settings, 2, 3);
        let expected = f64::from(albedo) * f64::from(albedo);
        for p in done.film.pixels() {
            assert!((p.mean()[0] / expected - 1.0).abs() < 1e-3, "{} for {expected}", p.mean()[0]);
        }
    }
}

#[test]
fn furnaces_show_the_geometric_series() {
    for strategy in [Strategy::Exact, Strategy::Joint, Strategy::Nabata] {
        for (albedo, area) in [(0.5f32, 1.0), (0.8, 0.0)] {
            let scene = || furnace(albedo);
            let (mean, error) = many_mean(12, 48, &scene, ManyLightSettings { area, ..settings(strategy) });
            let expected = 1.0 / (1.0 - f64::from(albedo));
            // Direct light of a lamp all around that is sampled by area: noisy, not wrong.
            assert!(error < 0.02 * expected, "{strategy:?}: the test has no power: {error}");
            assert!((mean - expected).abs() < LIMIT * error + 1e-3 * expected, "{strategy:?}: {mean} +- {error}");
        }
    }
}

#[test]
fn depth_limits_end_paths() {
    for max_depth in [1, 2, 3, 4] {
        let path = PathSettings { max_depth: Some(max_depth), ..PathSettings::default() };
        let (a, a_error) = many_mean(8, 8, &plain, ManyLightSettings { path, ..settings(Strategy::Joint) });
        let (b, b_error) = path_mean(8, 96, &plain, path);
        assert!(
            (a - b).abs() <= LIMIT * a_error.hypot(b_error) + 1e-9,
            "{max_depth}: {a} +- {a_error}, path {b} +- {b_error}"
        );
    }
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    for &strategy in Strategy::value_variants() {
        let picture = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| render_many(plain(), settings(strategy), 3, 1).film.picture(1))
        };
        let one = picture(1);
        assert!(one.iter().any(|c| c.max_element() > 0.1));
        for threads in [2, 7] {
            assert!(one == picture(threads), "{strategy:?}, {threads} threads");
        }
    }
}

#[test]
fn a_scene_without_light_or_surface_ends() {
    let mean = |scene: Description| render_many(scene, settings(Strategy::Joint), 2, 0).film.mean_and_error().0[0];
    assert_eq!(mean(room(&|scene| scene.shapes[1].emission = None)), 0.0);
    assert_eq!(mean(empty_scene(DVec3::ZERO, DVec3::Z, 4, 4)), 0.0);
    let black = |scene: &mut Description| scene.materials[0] = Material::Diffuse { reflectance: grey(0.0) };
    assert!(mean(room(&black)).is_finite());
}
