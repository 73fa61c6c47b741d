//! Direct light alone: error against CPU time of the ways to sample it.
//!
//! `cargo run --release --example direct_light -- SCENE.xml [reference passes] [passes of full sampling]`
//!
//! Camera rays through the centres of the pixels (antialiasing is another matter) go through mirrors and glass (one of the two ways, at random) to the first surface that reflects light otherwise;
//! its direct light makes the picture. The reference is full sampling over many passes with another seed. Figures: CPU seconds (user
//! and system), shadow rays, relMSE with the reference's own noise taken off, and time x error relative to full sampling.

use dualux::accel::{Accel, Ray};
use dualux::formats::{LoadOptions, load};
use dualux::math::{Rgb, Sampler, Vec2};
use dualux::scene::{Scene, Transport};
use dualux::transport::World;
use dualux::transport::antialias::{self, Causes};
use dualux::transport::direct::{Direct, DirectCounts, DirectSettings, Found, LightSampling, Stage, Vantage};
use dualux::transport::glossy_guide::Rest;
use rayon::prelude::*;
use std::path::Path;

fn sample(direct: &Direct, world: World, x: u32, y: u32, rng: &mut Sampler, counts: &mut DirectCounts) -> Rgb {
    let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
    let r = world.scene.camera.ray(at, Vec2::splat(0.5));
    let mut ray = Ray { o: r.o, d: r.d, tmin: r.tmin, tmax: r.tmax };
    let (mut throughput, mut sum) = (Rgb::ONE, Rgb::ZERO);
    for _ in 0..8 {
        let Some(hit) = world.accel.closest(&ray) else { break };
        let at = world.surface(&ray, &hit);
        let wo = -ray.d;
        let (diffuse, rest) = world.bsdf(&at, wo).split();
        let stage = Stage::First;
        sum +=
            throughput * direct.radiance(&at, diffuse.as_ref(), rest.as_ref().map(Rest::from), wo, stage, rng, counts);
        let Some(rest) = rest else { break };
        let vantage = Vantage::new(&at, diffuse.as_ref(), Some(&rest), stage);
        let [a, b, c, _] = rng.next_4d();
        let Some(s) = rest.sample(wo, c, Vec2::new(a, b), Transport::Radiance) else { break };
        throughput *= s.weight;
        ray = Ray::leaving(&at, s.wi);
        if s.pdf_dir > 0.0 {
            let (scene, textures) = (world.scene, world.scene.textures());
            let (found, weight) = match world.accel.closest(&ray) {
                Some(hit) => {
                    let lamp = world.surface(&ray, &hit);
                    let emitted = scene.lights.emitted(&scene.shapes, textures, &lamp, -ray.d);
                    (emitted, direct.weight_of_scattered(&vantage, s.pdf_dir, Found::Lamp(&lamp)))
                }
                None => {
                    let weight = direct.weight_of_scattered(&vantage, s.pdf_dir, Found::Environment(ray.d));
                    (scene.lights.environment(textures, ray.d), weight)
                }
            };
            sum += throughput * found * weight;
            break;
        }
    }
    sum
}

fn render(world: World, settings: DirectSettings, passes: u64, seed: u64) -> (Vec<Rgb>, DirectCounts) {
    let direct = Direct::new(world, settings);
    let (width, height) = (world.scene.film.width, world.scene.film.height);
    let rows: Vec<(Vec<Rgb>, DirectCounts)> = (0..height)
        .into_par_iter()
        .map(|y| {
            let mut counts = DirectCounts::default();
            let mut pixel = |x: u32| {
                let mut sum = Rgb::ZERO;
                for pass in 0..passes {
                    let mut rng = Sampler::new(seed, u64::from(y) << 32 | u64::from(x), pass);
                    sum += sample(&direct, world, x, y, &mut rng, &mut counts);
                }
                sum / passes as f32
            };
            ((0..width).map(&mut pixel).collect(), counts)
        })
        .collect();
    let mut counts = DirectCounts::default();
    rows.iter().for_each(|r| counts += r.1);
    (rows.into_iter().flat_map(|r| r.0).collect(), counts)
}

/// User and system time of this process, s.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<f64> =
        stat.rsplit(')').next().unwrap_or_default().split_whitespace().map(|f| f.parse().unwrap_or(0.0)).collect();
    (fields.get(11).unwrap_or(&0.0) + fields.get(12).unwrap_or(&0.0)) / 100.0
}

/// mean (I - A)(I - B) / (R^2 + 0.01) over pixels and channels, R = (A + B) / 2: free of the noise of two independent references.
fn relmse(image: &[Rgb], [a, b]: &[Vec<Rgb>; 2]) -> f64 {
    let one = |i: usize, c: usize| {
        let (v, a, b) = (f64::from(image[i][c]), f64::from(a[i][c]), f64::from(b[i][c]));
        let r = 0.5 * (a + b);
        (v - a) * (v - b) / (r * r + 0.01)
    };
    (0..image.len()).flat_map(|i| (0..3).map(move |c| (i, c))).map(|(i, c)| one(i, c)).sum::<f64>()
        / (3 * image.len()) as f64
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let Some(path) = args.get(1) else {
        eprintln!("usage: direct_light SCENE.xml [reference passes] [passes of full sampling]");
        std::process::exit(2);
    };
    let number = |k: usize, default: u64| args.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (reference_passes, passes) = (number(2, 32), number(3, 2));
    let scene = match load(Path::new(path), &LoadOptions::default()).map(|l| Scene::new(l.description)) {
        Ok(Ok(scene)) => scene,
        Ok(Err(e)) => return eprintln!("{e}"),
        Err(e) => return eprintln!("{e:?}"),
    };
    let accel = Accel::new(&scene.shapes);
    let world = World::new(&scene, &accel);
    let of = |sampling, max_lights| DirectSettings { sampling, max_lights, ..DirectSettings::default() };
    let full = of(LightSampling::Full, 8);
    let references = [101, 102].map(|seed| render(world, full, reference_passes, seed).0);
    let window = [0, 0, scene.film.width, scene.film.height];
    let start = cpu_seconds();
    let map = antialias::causes(world, window, false);
    let share = |cause: Option<Causes>| {
        let counts = |c: &&Causes| cause.map_or(**c != Causes::default(), |k| c.intersects(k));
        100.0 * map.iter().filter(counts).count() as f64 / map.len() as f64
    };
    println!(
        "antialiasing: {:.2} % of the pixels in {:.2} CPU s (sight {:.2}, chain {:.2}, shadow {:.2}, texture {:.2})",
        share(None),
        cpu_seconds() - start,
        share(Some(Causes::SIGHT)),
        share(Some(Causes::CHAIN)),
        share(Some(Causes::SHADOW)),
        share(Some(Causes::TEXTURE))
    );
    let mut base = None;
    println!(
        "{:24} {:>8} {:>12} {:>10} {:>10} {:>10}  verdicts (visible blocked partial unknown)",
        "method", "CPU s", "shadow rays", "relMSE", "t x e", "gain"
    );
    for (name, settings, factor) in [
        ("full", full, 1),
        ("single", of(LightSampling::Single, 8), 8),
        ("adaptive", of(LightSampling::Adaptive, 8), 2),
        ("adaptive unchecked", DirectSettings { residual: false, ..of(LightSampling::Adaptive, 8) }, 2),
        ("adaptive, 1 of many", of(LightSampling::Adaptive, 1), 4),
        ("adaptive, 2 of many", of(LightSampling::Adaptive, 2), 4),
    ] {
        let start = cpu_seconds();
        let (image, c) = render(world, settings, passes * factor, 7);
        let time = cpu_seconds() - start;
        let error = relmse(&image, &references);
        let product = time * error;
        let base = *base.get_or_insert(product);
        println!(
            "{name:24} {time:8.2} {:12} {error:10.3e} {product:10.3e} {:9.2}x  {} {} {} {}; oversampled {:.1} %",
            c.shadow_rays,
            base / product,
            c.visible,
            c.blocked,
            c.partial,
            c.unknown,
            100.0 * c.oversampled as f64 / c.points.max(1) as f64
        );
    }
}
