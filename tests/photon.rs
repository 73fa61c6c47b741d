//! The photon integrator against the path tracer, part by part, and what it promises of itself.
//!
//! Confidence: z-tests over independent renders, family-wise 0.01 over the cases of this file; interpolated and kernel estimates, which are
//! biased, are held to a stated bound besides.

mod common;

use common::*;
use dualux::accel::Accel;
use dualux::integrators::Integrator;
use dualux::integrators::path::PathSettings;
use dualux::integrators::photon::places::places;
use dualux::integrators::photon::{Antialiasing, Indirect, Parts, Photon, PhotonSettings};
use dualux::math::{DMat4, DVec3, Rgb, Sampler, Vec3};
use dualux::render::{Progress, RenderSettings, Silent, render};
use dualux::scene::description::*;
use dualux::scene::mesh::MeshData;
use dualux::scene::{Description, Material, Scene};
use dualux::transport::light_tree::LightTree;
use dualux::transport::{CacheSettings, HitLight, IrradianceCache, World};
use std::sync::atomic::AtomicBool;

/// Two-sided normal quantile at 0.01 / 40, with the wider tails of a few runs.
const LIMIT: f64 = 5.0;

fn mean(done: &Progress) -> f64 {
    done.film.mean_and_error().0[0]
}

/// Mean and standard error over seeds.
fn photon_mean(runs: u64, passes: u64, scene: &dyn Fn() -> Description, settings: PhotonSettings) -> (f64, f64) {
    mean_over_runs(runs, |seed| render_photon(scene(), PhotonSettings { seed, ..settings }, passes))
}

fn path_mean(runs: u64, passes: u64, scene: &dyn Fn() -> Description) -> (f64, f64) {
    mean_over_runs(runs, |seed| render_path(scene(), PathSettings::default(), passes, 100 + seed))
}

/// A closed white box of side 2 with a lamp below the ceiling and `things` in it.
fn room(things: &dyn Fn(&mut Description)) -> Description {
    let mut scene = empty_scene(DVec3::new(0.0, 0.0, 0.95), DVec3::new(0.0, -0.3, -1.0), 24, 24);
    let white = diffuse(&mut scene, 0.6);
    shape(&mut scene, GeometryDesc::Cube, DMat4::IDENTITY, white, None);
    scene.shapes[0].flip_normals = true;
    let black = diffuse(&mut scene, 0.0);
    let lamp = DMat4::from_translation(DVec3::new(0.0, 0.98, 0.0))
        * DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2)
        * DMat4::from_scale(DVec3::splat(0.3));
    shape(&mut scene, GeometryDesc::Rectangle, lamp, black, Some(10.0));
    things(&mut scene);
    scene
}

fn sphere(x: f64, y: f64, z: f64, radius: f64) -> GeometryDesc {
    GeometryDesc::Sphere { center: DVec3::new(x, y, z), radius }
}

/// A sphere of some material in the room.
fn with(material_of: Material) -> impl Fn() -> Description {
    move || {
        room(&|scene| {
            let id = material(scene, material_of.clone());
            shape(scene, sphere(0.1, -0.5, -0.2, 0.4), DMat4::IDENTITY, id, None);
        })
    }
}

fn materials() -> Vec<(&'static str, Material)> {
    let (eta, one) = (1.5, grey(1.0));
    vec![
        ("diffuse", Material::Diffuse { reflectance: grey(0.8) }),
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
        ("glass", Material::Dielectric { eta, specular_reflectance: one.clone(), specular_transmittance: one.clone() }),
        (
            "plastic",
            Material::Plastic {
                eta,
                diffuse_reflectance: grey(0.5),
                specular_reflectance: one.clone(),
                nonlinear: true,
            },
        ),
        (
            "sharp plastic",
            Material::RoughPlastic {
                eta,
                diffuse_reflectance: grey(0.5),
                specular_reflectance: one,
                nonlinear: true,
                roughness: rough(0.02),
            },
        ),
    ]
}

/// Largest relative difference of means that is laid to the bias of kernels and interpolation.
const BIAS: f64 = 0.01;

#[test]
fn photon_agrees_with_path_on_every_material() {
    for (name, m) in materials() {
        let scene = with(m);
        let (a, a_error) = photon_mean(4, 4, &scene, PhotonSettings::default());
        let (b, b_error) = path_mean(4, 64, &scene);
        let error = a_error.hypot(b_error);
        assert!(error < 0.01 * b, "{name}: the test has no power, error {error} of {b}");
        assert!((a - b).abs() < LIMIT * error + BIAS * b, "{name}: {a} +- {a_error}, path {b} +- {b_error}");
    }
}

#[test]
fn parts_add_up() {
    let scene = with(materials()[3].1.clone());
    let none = Parts { direct: false, caustic: false, indirect: false };
    let one = |parts: Parts| {
        let settings = PhotonSettings { parts, adaptive_sampling: false, ..PhotonSettings::default() };
        photon_mean(6, 4, &scene, settings)
    };
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

/// The inside of a sphere that shines with the radiance 1.
fn enclosure(albedo: f32) -> Description {
    let mut scene = empty_scene(DVec3::new(0.1, 0.2, -0.3), DVec3::new(0.5, 0.1, 0.6), 8, 8);
    let wall = diffuse(&mut scene, albedo);
    shape(&mut scene, sphere(0.0, 0.0, 0.0, 1.0), DMat4::IDENTITY, wall, Some(1.0));
    scene.shapes[0].flip_normals = true;
    scene
}

/// No ray may lose light between surfels: at albedo 0.8 a loss of 1 % in each bounce is one of 4 %.
#[test]
fn records_in_an_enclosure_hold_the_light_of_all_bounces() {
    let scene = Scene::new(enclosure(0.8)).expect("the scene is valid");
    let accel = Accel::new(&scene.shapes);
    let mut photon = Photon::new(World::new(&scene, &accel), PhotonSettings::default(), scene.film.crop);
    photon.prepare(0, &|| false);
    let records = photon.cache().expect("a cache").records();
    assert!(!records.is_empty());
    for r in records {
        let share = f64::from(r.irradiance.y) / (0.8 * 5.0 * std::f64::consts::PI);
        assert!((share - 1.0).abs() < 2e-3, "{share}");
    }
}

#[test]
fn closed_enclosures_show_the_geometric_series() {
    for indirect in [Indirect::Cache, Indirect::Gather] {
        for albedo in [0.5f32, 0.8] {
            let scene = || enclosure(albedo);
            let settings = PhotonSettings { indirect, adaptive_sampling: false, ..PhotonSettings::default() };
            let (mean, error) = photon_mean(12, 48, &scene, settings);
            let expected = 1.0 / (1.0 - f64::from(albedo));
            // Diffuse parts meet lamps by light samples alone, and a lamp all around is sampled by area: noisy, not wrong.
            assert!(error < 0.02 * expected, "{indirect:?}: the test has no power: {error}");
            // The cache answers for the irradiance of clusters of points: not exact on a curved wall.
            let bias = if indirect == Indirect::Cache { 3e-3 } else { 2e-5 };
            assert!(
                (mean - expected).abs() < LIMIT * error + bias * expected,
                "{indirect:?}, albedo {albedo}: {mean} +- {error}, expected {expected}"
            );
        }
    }
}

#[test]
fn adaptive_samples_keep_the_mean_of_uniform_ones() {
    let scene = with(materials()[2].1.clone());
    let with = |antialiasing, adaptive_sampling| {
        photon_mean(6, 8, &scene, PhotonSettings { antialiasing, adaptive_sampling, ..PhotonSettings::default() })
    };
    let (a, a_error) = with(Antialiasing::Adaptive, true);
    let (b, b_error) = with(Antialiasing::Off, false);
    assert!((a - b).abs() < LIMIT * a_error.hypot(b_error) + 2e-3 * b, "{a} +- {a_error}, {b} +- {b_error}");
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let picture = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let scene = with(materials()[3].1.clone());
        pool.install(|| render_photon(scene(), PhotonSettings::default(), 3).film.picture(1))
    };
    let one = picture(1);
    assert!(one.iter().any(|c| c.max_element() > 0.1));
    for threads in [2, 7] {
        assert_eq!(one, picture(threads), "{threads} threads");
    }
}

/// Diffuse walls alone, and with a mirror and glass in the room: what is seen in them has fewer bounces left.
#[test]
fn depth_limits_end_paths() {
    for (k, depths) in [(0, &[1, 2, 3, 4, 6][..]), (1, &[3, 5]), (2, &[4])] {
        let scene = with(materials()[k].1.clone());
        let mut before = f64::NEG_INFINITY;
        for &max_depth in depths {
            let path = PathSettings { max_depth: Some(max_depth), ..PathSettings::default() };
            let (a, a_error) = photon_mean(6, 8, &scene, PhotonSettings { path, ..PhotonSettings::default() });
            let (b, b_error) = mean_over_runs(6, |seed| render_path(scene(), path, 64, seed));
            assert!((a - b).abs() <= LIMIT * a_error.hypot(b_error) + 3e-3 * b, "{k}, {max_depth}: {a}, path {b}");
            // Another depth would be seen.
            assert!(b > before + 2.0 * LIMIT * a_error.hypot(b_error), "{k}, {max_depth}: {before}, then {b}");
            before = b;
        }
    }
}

/// Mirrors on the way of the rays that caches send take segments as well: a room with two opposite walls of mirrors.
#[test]
fn mirrors_on_the_way_of_gather_rays_count_for_the_depth() {
    let scene = || {
        room(&|scene| {
            let mirror = Material::Conductor { eta: grey(0.0), k: grey(1.0), specular_reflectance: grey(0.95) };
            let id = material(scene, mirror);
            for side in [-1.0, 1.0] {
                let wall = DMat4::from_translation(DVec3::new(0.99 * side, 0.0, 0.0))
                    * DMat4::from_rotation_y(-side * std::f64::consts::FRAC_PI_2);
                shape(scene, GeometryDesc::Rectangle, wall, id, None);
            }
        })
    };
    let shown = |max_depth| {
        let path = PathSettings { max_depth: Some(max_depth), ..PathSettings::default() };
        let a = photon_mean(6, 8, &scene, PhotonSettings { path, ..PhotonSettings::default() });
        (a, mean_over_runs(6, |seed| render_path(scene(), path, 256, seed)))
    };
    let ((a, a_error), (b, b_error)) = shown(5);
    let bound = LIMIT * a_error.hypot(b_error) + 5e-3 * b;
    assert!((a - b).abs() <= bound, "{a} +- {a_error}, path {b} +- {b_error}");
    // Companion: one segment more would be seen.
    let (_, (more, _)) = shown(6);
    assert!(more - b > 2.0 * bound, "{b}, then {more}; bound {bound}");
}

/// Mean and variance of single samples of a glass ball in an even sky of radiance 1, where any way through it brings 1.
fn samples_of_a_glass_ball(rr_depth: u32) -> (f64, f64) {
    let mut scene = empty_scene(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 64, 64);
    let (white, eta) = (grey(1.0), 1.5);
    let glass = Material::Dielectric { eta, specular_reflectance: white.clone(), specular_transmittance: white };
    let glass = material(&mut scene, glass);
    shape(&mut scene, sphere(0.0, 0.0, 0.0, 1.0), DMat4::IDENTITY, glass, None);
    scene.lights.push(LightDesc::Constant { radiance: Rgb::ONE });
    let path = PathSettings { rr_depth, ..PathSettings::default() };
    let settings = PhotonSettings { path, antialiasing: Antialiasing::Off, ..PhotonSettings::default() };
    let done = render_photon(scene, settings, 1);
    let samples: Vec<f64> = done.film.picture(1).iter().map(|p| f64::from(p.x)).collect();
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    (mean, samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / samples.len() as f64)
}

/// What is mirrored inside of glass is dim, and one of many rays of the same sample: roulette must not make a speck of it.
#[test]
fn roulette_leaves_no_specks_behind_glass() {
    // Rays that go straight through have left the ball at depth 2.
    let (mean, variance) = samples_of_a_glass_ball(3);
    assert!((mean - 1.0).abs() < LIMIT * (variance / 4096.0).sqrt() + 1e-5, "{mean} {variance}");
    // The ball is a seventh of the picture. Raised to an importance of 1, rays of 0.04 bring 0.015.
    assert!(variance < 1e-3, "{variance}");
    // Companion: where the main rays themselves may end, it is seen.
    let (_, variance) = samples_of_a_glass_ball(2);
    assert!(variance > 4e-3, "{variance}");
}

#[test]
fn a_scene_without_light_or_surface_ends() {
    let dark = || room(&|scene| scene.shapes[1].emission = None);
    assert_eq!(mean(&render_photon(dark(), PhotonSettings::default(), 2)), 0.0);
    let empty = || empty_scene(DVec3::ZERO, DVec3::Z, 4, 4);
    assert_eq!(mean(&render_photon(empty(), PhotonSettings::default(), 2)), 0.0);
}

/// A ball of leaves: no record of the cache reaches further than the leaf it is on.
fn leaves() -> Description {
    let mut scene = empty_scene(DVec3::new(0.0, 0.0, 1.8), DVec3::ZERO, 160, 160);
    let green = diffuse(&mut scene, 0.5);
    let mut rng = Sampler::new(1, 0, 0);
    let mut vector = || {
        let [x, y, z, _] = rng.next_4d();
        Vec3::new(x, y, z) * 2.0 - 1.0
    };
    let mut mesh = MeshData { face_normals: true, ..MeshData::default() };
    for leaf in 0..6000 {
        let center = vector();
        mesh.positions.extend([vector(), vector(), vector()].map(|corner| center + 0.03 * corner));
        mesh.triangles.push([3 * leaf, 3 * leaf + 1, 3 * leaf + 2]);
    }
    shape(&mut scene, GeometryDesc::Mesh(mesh), DMat4::IDENTITY, green, None);
    scene.lights.push(LightDesc::Directional { direction: DVec3::new(-0.3, -1.0, -0.5), irradiance: Rgb::ONE });
    scene
}

/// Where all shapes are given up, later caches hold surfels all the same.
#[test]
fn a_cache_that_is_given_up_everywhere_keeps_its_surfels() {
    let scene = Scene::new(leaves()).expect("the scene is valid");
    let (accel, lights) = (Accel::new(&scene.shapes), LightTree::new(&scene));
    let world = World::new(&scene, &accel).with_lights(&lights);
    let mut integrator = Photon::new(world, PhotonSettings::default(), scene.film.crop);
    let mut made = 0;
    for pass in 0..6 {
        integrator.prepare(pass, &|| false);
        let figures = integrator.figures();
        let figure = |name: &str| figures.iter().find(|f| f.0 == name).expect("a figure").1;
        assert_eq!(figure("cache shapes given up"), 1, "pass {pass}");
        assert!(figure("cache surfels") > 1000, "pass {pass}: {}", figure("cache surfels"));
        made = figure("caches");
    }
    assert!(made > 1, "there was no second cache");
}

/// Largest relative difference of means laid to kernels that reach over edges and corners.
const KERNEL_BIAS: f64 = 0.02;

#[test]
fn indirect_light_by_photons_alone_agrees_with_path() {
    let scene = with(materials()[0].1.clone());
    let settings = PhotonSettings { indirect: Indirect::Photons, photons: Some(20_000), ..PhotonSettings::default() };
    let (a, a_error) = photon_mean(4, 8, &scene, settings);
    let (b, b_error) = path_mean(4, 64, &scene);
    let error = a_error.hypot(b_error);
    assert!((a - b).abs() < LIMIT * error + KERNEL_BIAS * b, "{a} +- {a_error}, path {b} +- {b_error}");
    // Without them a good part of the light is missing, so that the comparison would see it.
    let parts = Parts { indirect: false, ..Parts::default() };
    let (c, c_error) = photon_mean(4, 8, &scene, PhotonSettings { parts, ..settings });
    assert!((c - b).abs() > LIMIT * c_error.hypot(b_error) + KERNEL_BIAS * b, "{c}, path {b}");
}

/// A render with a cache whose records see `glow` more irradiance at the ends of their rays than there is.
fn with_wrong_cache(desc: Description, settings: PhotonSettings, passes: u64, glow: f32) -> Progress {
    let scene = Scene::new(desc).expect("the scene is valid");
    let accel = Accel::new(&scene.shapes);
    let (window, lights) = (scene.film.crop, LightTree::new(&scene));
    let world = World::new(&scene, &accel).with_lights(&lights);
    let mut cache = IrradianceCache::new(world, CacheSettings { seed: settings.seed, ..CacheSettings::default() });
    let caustic = |_, _| Rgb::splat(glow);
    cache.fill(&places(world, window, 1, None, false), &HitLight::Operator { caustic: &caustic }, usize::MAX);
    cache.finish();
    let mut integrator = Photon::new(world, settings, window).with_cache(cache).expect("a cache is used");
    let run = RenderSettings { window, passes: Some(passes), deadline: None, seed: settings.seed, features: false };
    render(&scene, &mut integrator, &run, &AtomicBool::new(false), &mut Silent)
}

#[test]
fn residual_roulette_has_the_mean_of_gathering_even_where_the_cache_is_wrong() {
    let scene = with(materials()[0].1.clone());
    let settings = |indirect| PhotonSettings { indirect, adaptive_sampling: false, ..PhotonSettings::default() };
    let (runs, passes) = (8, 16);
    let (b, b_error) = photon_mean(runs, passes, &scene, settings(Indirect::Gather));
    let agrees = |(a, a_error): (f64, f64)| (a - b).abs() < LIMIT * a_error.hypot(b_error);
    let own = photon_mean(runs, passes, &scene, settings(Indirect::Residual));
    assert!(own.1.hypot(b_error) < 0.01 * b, "the test has no power: {own:?}, gathering {b} +- {b_error}");
    assert!(agrees(own), "{own:?}, gathering {b} +- {b_error}");
    let wrong = |indirect, runs| {
        mean_over_runs(runs, |seed| {
            with_wrong_cache(scene(), PhotonSettings { seed, ..settings(indirect) }, passes, 1.0)
        })
    };
    let corrected = wrong(Indirect::Residual, runs);
    assert!(corrected.1.hypot(b_error) < 0.02 * b, "the test has no power: {corrected:?}");
    assert!(agrees(corrected), "{corrected:?}, gathering {b} +- {b_error}");
    // The same cache without correction shows how wrong it is.
    let believed = wrong(Indirect::Cache, 3);
    assert!(!agrees(believed) && believed.0 > 1.2 * b, "{believed:?}, gathering {b}");
}
