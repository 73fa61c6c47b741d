//! Figures of the edge-adaptive partition of a scene's lights: cells, time, and how many photons start towards specular surfaces.
//!
//! `cargo run --release --example emission_partition -- scenes/cornell-spheres.xml [photons] [cells]`

use dualux::accel::{Accel, Ray};
use dualux::emission::{EdgeAdaptive, EmissionDensity, Sequence, Settings, Uniform};
use dualux::formats::{LoadOptions, load};
use dualux::scene::{Material, Scene};
use std::path::Path;

/// Whether a material has a specular lobe.
fn is_specular(materials: &[Material], id: u32) -> bool {
    let nested = |m: u32| is_specular(materials, m);
    match &materials[id as usize] {
        Material::Conductor { .. } | Material::Dielectric { .. } | Material::ThinDielectric { .. } => true,
        Material::TwoSided { front, back } => nested(*front) || nested(*back),
        Material::Blend { first, second, .. } => nested(*first) || nested(*second),
        Material::Mask { nested: m, .. } => nested(*m),
        Material::BumpMap { nested: m, .. } | Material::NormalMap { nested: m, .. } => nested(*m),
        _ => false,
    }
}

/// Share of photons and of flux that meet a specular shape first.
fn hits(scene: &Scene, accel: &Accel, density: &dyn EmissionDensity, wanted: &dyn Fn(u32) -> bool) -> (f64, f64) {
    let (mut count, mut flux) = (0, 0.0);
    for r in (0..density.count()).filter_map(|i| density.emit(i, 0)) {
        let ray = Ray { o: r.o, d: r.d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
        if accel.closest(&ray).is_some_and(|h| wanted(h.shape)) {
            count += 1;
            flux += f64::from(r.flux.element_sum()) / 3.0;
        }
    }
    let power: f64 = scene.lights.infos.iter().map(|l| f64::from(l.power.element_sum()) / 3.0).sum();
    (f64::from(count) / density.count().max(1) as f64, flux / power)
}

/// CPU time of the process.
fn seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    text.split_whitespace().next().and_then(|t| t.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-9
}

fn main() {
    if let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global() {
        eprintln!("{error}");
    }
    let args: Vec<String> = std::env::args().collect();
    let Some(path) = args.get(1) else {
        eprintln!("usage: emission_partition SCENE.xml [photons] [cells]");
        std::process::exit(2);
    };
    let number = |k: usize, default: usize| args.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (photons, cells) = (number(2, 20_000), number(3, 0));
    let loaded = match load(Path::new(path), &LoadOptions::default()) {
        Ok(loaded) => loaded,
        Err(errors) => {
            eprintln!("{errors}");
            std::process::exit(1);
        }
    };
    let scene = match Scene::new(loaded.description) {
        Ok(scene) => scene,
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(1);
        }
    };
    let accel = Accel::new(&scene.shapes);
    let wanted = |s: u32| is_specular(&scene.materials, scene.shapes[s as usize].material);
    let time = |what: &str, f: &mut dyn FnMut()| {
        let start = seconds();
        f();
        println!("{what}: {:.1} ms CPU", (seconds() - start) * 1e3);
    };
    for interest in [None, Some(&wanted as &dyn Fn(u32) -> bool)] {
        let settings = Settings { interest, cells, ..Settings::default() };
        let mut density = None;
        let name = if interest.is_some() { "partition, specular first" } else { "partition, everywhere" };
        time(name, &mut || density = Some(EdgeAdaptive::new(&scene, &accel, photons, &settings, 1)));
        let density = density.expect("built");
        let s = density.summary();
        println!(
            "  {} cells ({} with events) of {} looked at, flux kept {:.4}; {} photons",
            s.cells,
            s.events,
            s.probes,
            s.kept / s.power,
            density.count()
        );
        let (count, flux) = hits(&scene, &accel, &density, &wanted);
        println!("  specular first: {count:.4} of photons, {flux:.5} of flux");
        let mut sum = 0.0;
        time("  emission", &mut || {
            sum = (0..density.count()).filter_map(|i| density.emit(i, 1)).map(|r| f64::from(r.flux.x)).sum();
        });
    }
    for sequence in [Sequence::Random, Sequence::OwenSobol] {
        let uniform = Uniform::new(&scene, photons, sequence, 1);
        let (count, flux) = hits(&scene, &accel, &uniform, &wanted);
        println!("uniform, {sequence:?}: {count:.4} of photons, {flux:.5} of flux meet specular shapes first");
        time("  emission", &mut || {
            let sum: f32 = (0..uniform.count()).filter_map(|i| uniform.emit(i, 1)).map(|r| r.flux.x).sum();
            assert!(sum >= 0.0);
        });
    }
}
