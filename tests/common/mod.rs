//! Small scenes made in code, and a render of them.
#![allow(dead_code)] // not every test file uses every function

pub mod cache;

use dualux::accel::{Accel, Simd};
use dualux::integrators::path::{Path, PathSettings};
use dualux::integrators::photon::{Photon, PhotonSettings};
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::render::{Progress, RenderSettings, Silent, render};
use dualux::scene::description::*;
use dualux::scene::material::{Distribution, Roughness};
use dualux::scene::{Color, Description, Material, Scalar, Scene};
use dualux::transport::World;
use dualux::transport::light_tree::LightTree;
use std::sync::atomic::AtomicBool;

/// A pinhole camera at `eye` that looks at `target`; `width` x `height` pixels, box filter, nothing else in the scene.
pub fn empty_scene(eye: DVec3, target: DVec3, width: u32, height: u32) -> Description {
    let z = (target - eye).normalize();
    let up = if z.y.abs() < 0.99 { DVec3::Y } else { DVec3::X };
    let x = up.cross(z).normalize();
    let to_world = DMat4::from_cols(x.extend(0.0), z.cross(x).extend(0.0), z.extend(0.0), eye.extend(1.0));
    Description::empty(to_world, width, height)
}

/// Adds a material and returns its index.
pub fn material(scene: &mut Description, material: Material) -> MaterialId {
    scene.materials.push(material);
    scene.materials.len() as MaterialId - 1
}

/// Adds a diffuse material.
pub fn diffuse(scene: &mut Description, albedo: f32) -> MaterialId {
    material(scene, Material::Diffuse { reflectance: Color::Constant(Rgb::splat(albedo)) })
}

/// A colour without hue.
pub fn grey(v: f32) -> Color {
    Color::Constant(Rgb::splat(v))
}

/// Isotropic GGX.
pub fn rough(alpha: f32) -> Roughness {
    Roughness { distribution: Distribution::Ggx, alpha_u: Scalar::Constant(alpha), alpha_v: Scalar::Constant(alpha) }
}

/// Adds a shape.
pub fn shape(
    scene: &mut Description,
    geometry: GeometryDesc,
    to_world: DMat4,
    material: MaterialId,
    emission: Option<f32>,
) {
    scene.shapes.push(ShapeDesc {
        name: format!("shape {}", scene.shapes.len()),
        geometry,
        to_world,
        flip_normals: false,
        material,
        emission: emission.map(|e| Color::Constant(Rgb::splat(e))),
    });
}

/// Renders with the path tracer.
pub fn render_path(desc: Description, settings: PathSettings, passes: u64, seed: u64) -> Progress {
    render_path_with(desc, settings, passes, seed, Simd::Avx2)
}

/// Renders with the photon integrator.
pub fn render_photon(desc: Description, settings: PhotonSettings, passes: u64) -> Progress {
    let scene = Scene::new(desc).expect("the scene is valid");
    let accel = Accel::new(&scene.shapes);
    let window = scene.film.crop;
    let lights = LightTree::new(&scene);
    let mut integrator = Photon::new(World::new(&scene, &accel).with_lights(&lights), settings, window);
    let run = RenderSettings { window, passes: Some(passes), deadline: None, seed: settings.seed, features: false };
    render(&scene, &mut integrator, &run, &AtomicBool::new(false), &mut Silent)
}

/// Renders with the path tracer and a chosen instruction set.
pub fn render_path_with(desc: Description, settings: PathSettings, passes: u64, seed: u64, simd: Simd) -> Progress {
    let scene = Scene::new(desc).expect("the scene is valid");
    let accel = Accel::with_simd(&scene.shapes, simd);
    let mut integrator = Path::new(World::new(&scene, &accel), settings);
    let settings =
        RenderSettings { window: scene.film.crop, passes: Some(passes), deadline: None, seed, features: false };
    render(&scene, &mut integrator, &settings, &AtomicBool::new(false), &mut Silent)
}

/// Mean and standard error of the picture's first channel from `runs` independent renders.
pub fn mean_over_runs(runs: u64, mut one: impl FnMut(u64) -> Progress) -> (f64, f64) {
    let means: Vec<f64> = (0..runs).map(|seed| one(seed).film.mean_and_error().0[0]).collect();
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let var = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (var / n).sqrt())
}
