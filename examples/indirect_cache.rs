//! Indirect irradiance at the pixels of a scene by the cache and by brute force: errors and CPU seconds.
//!
//! `cargo run --release --example indirect_cache -- SCENE.xml [key=value ...]`
//! with the keys error, rays, cell, surfel-rays, light-samples, min (pixels), max (share), stride (finest level), size (width of the
//! image), paths (per reference pixel, 0 = no reference), grid (reference pixels in a row), reference (file to keep them in).
//!
//! The reference is path traced from each point of a coarse grid in two halves A, B; the error is
//! mean((I - A)(I - B) / (R^2 + 0.01)), I = albedo / pi x E, R the whole radiance, which noise of the halves does not raise.

use dualux::accel::Accel;
use dualux::formats::{LoadOptions, load};
use dualux::math::sampler::hash;
use dualux::math::{Frame, Rgb, Sampler, Vec2, Vec3, luminance, warp};
use dualux::scene::Scene;
use dualux::transport::gather_ray::{RayCounts, glossy_direct};
use dualux::transport::surfel_direct::direct_irradiance;
use dualux::transport::surfels::Facet;
use dualux::transport::{CacheSettings, HitLight, IrradianceCache, Place, World};
use rayon::prelude::*;
use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, PI};

/// User and system time of this process, seconds (resolution 10 ms).
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    [11, 12].iter().filter_map(|&i| fields.get(i)?.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// What a pixel sees.
#[derive(Clone, Copy)]
struct Seen {
    place: Place,
    albedo: Rgb,
}

fn seen(world: &World, x: u32, y: u32) -> Option<Seen> {
    let ray = |x: f32, y: f32| world.scene.camera.ray(Vec2::new(x, y), Vec2::splat(0.5));
    let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
    let camera = ray(x, y);
    let pixel = (ray(x + 1.0, y).d.normalize() - camera.d.normalize()).length();
    let mut rng = Sampler::new(7, 1, 1);
    let d = camera.d.normalize();
    let g = world.gather(camera.o, d, &mut rng, &mut RayCounts::default(), |_| {});
    let end = g.end?;
    Some(Seen { place: Place::new(&end.at, end.wo, pixel * g.distance), albedo: end.weight })
}

/// Indirect irradiance by paths.
fn brute_force(world: &World, at: &Facet, paths: std::ops::Range<u64>, stream: u64) -> Rgb {
    let mut counts = RayCounts::default();
    let mut sum = Rgb::ZERO;
    let n = (paths.end - paths.start) as f32;
    for i in paths {
        let mut rng = Sampler::new(99, stream, i);
        let (mut place, mut throughput) = (*at, Rgb::ONE);
        for depth in 0..64 {
            let frame = Frame::from_normal(place.n_shade);
            let d = frame.to_world(warp::sample_cosine_hemisphere(rng.next_2d()));
            let o = place.surface_point().spawn_origin(d);
            let mut glossy = Vec::new();
            let end = world.gather(o, d, &mut rng, &mut counts, |l| glossy.push(l)).end;
            for l in &glossy {
                sum += throughput * glossy_direct(world, l, &mut rng, &mut counts) * PI;
            }
            let Some(end) = end else { break };
            throughput *= end.weight;
            place = Facet::seen_from(&end.at, end.wo);
            sum += throughput * direct_irradiance(world, &place, 1, hash(stream, depth), i, &mut counts);
            let survival = if depth < 3 { 1.0 } else { throughput.max_element().min(0.95) };
            if rng.next_2d().x >= survival {
                break;
            }
            throughput /= survival;
        }
    }
    sum / n
}

fn main() {
    let mut args = std::env::args().skip(1);
    let path = args.next().expect("a scene file");
    let options: HashMap<String, String> =
        args.filter_map(|a| a.split_once('=').map(|(k, v)| (k.to_string(), v.to_string()))).collect();
    let value = |key: &str, default: f32| options.get(key).map_or(default, |v| v.parse().expect("a number"));
    let mut description = load(path.as_ref(), &LoadOptions::default()).expect("a scene").description;
    let film = &mut description.film;
    let width = value("size", film.width as f32);
    film.height = (film.height as f32 * width / film.width as f32).round() as u32;
    film.width = width as u32;
    film.crop = [0, 0, film.width, film.height];
    let (w, h) = (film.width, film.height);
    let scene = Scene::new(description).expect("a valid scene");
    let accel = Accel::new(&scene.shapes);
    let world = World::new(&scene, &accel);

    let d = CacheSettings::default();
    let settings = CacheSettings {
        error: value("error", d.error),
        gather_rays: value("rays", d.gather_rays as f32) as u32,
        surfel_rays: value("surfel-rays", d.surfel_rays as f32) as u32,
        light_samples: value("light-samples", d.light_samples as f32) as u32,
        min_radius_pixels: value("min", d.min_radius_pixels),
        max_radius: value("max", d.max_radius),
        surfel_cell: value("cell", d.surfel_cell),
        bounces: d.bounces,
        guided: true,
        seed: value("seed", 0.0) as u64,
    };
    let none = |_: Vec3, _: Vec3| Rgb::ZERO;
    let light = HitLight::Operator { caustic: &none };
    let start = cpu_seconds();
    let mut cache = IrradianceCache::new(world, settings);
    let finest = value("stride", 2.0) as u32;
    for stride in [16u32, 8, 4, 2, 1].into_iter().filter(|&s| s >= finest) {
        let pixels: Vec<(u32, u32)> = (0..h)
            .step_by(stride as usize)
            .flat_map(|y| (0..w).step_by(stride as usize).map(move |x| (x, y)))
            .collect();
        let places: Vec<Place> = pixels.par_iter().filter_map(|&(x, y)| seen(&world, x, y).map(|s| s.place)).collect();
        let before = cpu_seconds();
        cache.fill(&places, &light, usize::MAX);
        let s = cache.statistics();
        eprintln!(
            "stride {stride:2}: {:6} places, {:5} records ({} smallest), {:6} surfels, CPU {:.2} (fill {:.2})",
            places.len(),
            s.records,
            s.smallest,
            s.surfels,
            cpu_seconds() - start,
            cpu_seconds() - before
        );
    }
    let before = cpu_seconds();
    cache.finish();
    eprintln!("finish {:.2}; all {:.2} CPU s; {:?}", cpu_seconds() - before, cpu_seconds() - start, cache.statistics());

    let before = cpu_seconds();
    let all: Vec<Option<(Seen, Option<Rgb>)>> = (0..w * h)
        .into_par_iter()
        .map(|i| {
            let s = seen(&world, i % w, i / w)?;
            let f = s.place.facet;
            Some((s, cache.lookup(f.p, f.n_shade, f.n_geo)))
        })
        .collect();
    let holes = all.iter().flatten().filter(|(_, e)| e.is_none()).count();
    eprintln!("{} pixels in {:.2} CPU s; {holes} without a record", w * h, cpu_seconds() - before);
    if let Some(file) = options.get("out") {
        let mut bytes = format!("PF\n{w} {h}\n-1.0\n").into_bytes();
        for y in (0..h).rev() {
            for x in 0..w {
                let c = all[(y * w + x) as usize]
                    .map_or(Rgb::ZERO, |(s, e)| e.map_or(Rgb::X, |e| s.albedo * e * FRAC_1_PI));
                c.to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
            }
        }
        std::fs::write(file, bytes).expect("the picture is written");
    }

    if let Some(light) = cache.surfels() {
        // Where the brightest records have their light from.
        let mut order: Vec<usize> = (0..cache.records().len()).collect();
        let bright = |i: usize| luminance(cache.records()[i].irradiance);
        order.sort_by(|&a, &b| bright(b).total_cmp(&bright(a)));
        let median = order.get(order.len() / 2).map_or(0.0, |&i| bright(i));
        for &i in order.iter().take(value("brightest", 0.0) as usize) {
            let sent = cache.gather_rays().hits(i).iter().map(|h| (h.brings(light.irradiance()), h));
            let mut hits: Vec<_> = sent.collect();
            hits.sort_by(|a, b| b.0.total_cmp(&a.0));
            let n = hits.len() as f32;
            let diffuse: f32 = hits.iter().map(|h| h.0).sum::<f32>() / n;
            let top: Vec<String> = hits
                .iter()
                .take(4)
                .map(|(l, h)| {
                    format!(
                        "{:.2} of weight {:.1} at {:.3}",
                        l / n / bright(i),
                        luminance(h.weight),
                        1.0 / h.inverse_distance
                    )
                })
                .collect();
            println!(
                "record {i} at {}: {:.1} x median, radii {}, diffuse ends {:.0} %: {}",
                cache.records()[i].p,
                bright(i) / median,
                cache.records()[i].radii,
                100.0 * diffuse / bright(i),
                top.join("; ")
            );
        }
    }

    let paths = value("paths", 1024.0) as u64;
    if paths == 0 {
        return;
    }
    let grid = value("grid", 64.0) as u32;
    let step = (w / grid).max(1);
    let pixels: Vec<u32> = (0..h / step)
        .flat_map(|y| (0..w / step).map(move |x| (y * step + step / 2) * w + x * step + step / 2))
        .collect();
    let compute = || -> Vec<f32> {
        let rows: Vec<Vec<f32>> = pixels
            .par_iter()
            .map(|&i| {
                let Some((s, _)) = all[i as usize] else { return vec![0.0; 9] };
                let f = s.place.facet;
                let a = brute_force(&world, &f, 0..paths / 2, u64::from(i));
                let b = brute_force(&world, &f, paths / 2..paths, u64::from(i));
                let direct = direct_irradiance(&world, &f, 128, 5, u64::from(i), &mut RayCounts::default());
                [a.to_array(), b.to_array(), direct.to_array()].concat()
            })
            .collect();
        rows.concat()
    };
    let reference = match options.get("reference").map(|f| (f, std::fs::read(f))) {
        Some((_, Ok(bytes))) => bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
        Some((file, Err(_))) => {
            let r = compute();
            std::fs::write(file, r.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>()).expect("written");
            r
        }
        None => compute(),
    };
    let (mut error, mut own, mut bias, mut mean, mut n) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0u32);
    let mut worst: Vec<(f64, u32)> = Vec::new();
    for (&i, r) in pixels.iter().zip(reference.chunks_exact(9)) {
        n += 1;
        let Some((s, Some(e))) = all[i as usize] else { continue };
        let [a, b, direct] = [0, 3, 6].map(|k| s.albedo * Rgb::new(r[k], r[k + 1], r[k + 2]) * FRAC_1_PI);
        let indirect = s.albedo * e * FRAC_1_PI;
        let whole = direct + 0.5 * (a + b);
        let one = ((indirect - a) * (indirect - b) / (whole * whole + 0.01)).element_sum() as f64 / 3.0;
        error += one;
        worst.push((one, i));
        own += ((a - b) * (a - b) / (whole * whole + 0.01)).element_sum() as f64 / 12.0;
        bias += luminance(indirect - 0.5 * (a + b)) as f64;
        mean += luminance(whole) as f64;
    }
    worst.sort_by(|x, y| y.0.total_cmp(&x.0));
    let n = f64::from(n.max(1));
    println!(
        "relMSE of the indirect part {:.2e} (reference's own {:.1e}), bias {:+.3} % of the mean radiance",
        error / n,
        own / n,
        100.0 * bias / mean
    );
    let share: f64 = worst.iter().take(worst.len() / 100 + 1).map(|w| w.0).sum::<f64>() / error;
    let top: Vec<String> = worst.iter().take(8).map(|(e, i)| format!("{},{}: {e:.1e}", i % w, i / w)).collect();
    println!("the worst 1 % make {:.0} % of it: {}", 100.0 * share, top.join("  "));
}
