//! Traces photons, builds a map and asks it once per pixel: speeds, memory, and the layer itself.
//!
//! `photons SCENE.xml COUNT [--global] [--kernel footprint|nearest:K|fixed:R|progressive:R] [--scale S] [--greatest R] [--passes N]
//! [--random] [--nofold] [--seed N] [--layer OUT.f32] [--ply OUT.ply]`
//!
//! The layer is the radiance by photons at the first hits of rays through the centres of pixels, the mean over passes: little-endian
//! f32, three per pixel. One line of JSON on stdout; times are CPU seconds of all threads (wall clock where the system has no /proc).

use dualux::accel::{Accel, Ray};
use dualux::emission::{EmissionDensity, Sequence, Uniform};
use dualux::formats::{self, LoadOptions};
use dualux::math::{Rgb, Vec2};
use dualux::scene::{Bsdf, Scene, SurfacePoint};
use dualux::transport::World;
use dualux::transport::photon_map::{CausticMap, Filter, GlobalMap, Kernel, PhotonSettings};
use dualux::transport::photon_ply::write_ply;
use dualux::transport::photon_walk::{Goal, WalkSettings, trace};
use rayon::prelude::*;
use std::error::Error;
use std::process::ExitCode;
use std::time::Instant;

struct Arguments {
    scene: String,
    count: usize,
    global: bool,
    random: bool,
    passes: u64,
    settings: PhotonSettings,
    layer: Option<String>,
    ply: Option<String>,
}

fn kernel(text: &str) -> Result<Kernel, Box<dyn Error>> {
    let (name, number) = text.split_once(':').unwrap_or((text, ""));
    let radius = || if number.is_empty() { Ok(None) } else { number.parse().map(Some) };
    Ok(match name {
        "footprint" => Kernel::FOOTPRINT,
        "nearest" => Kernel::Nearest { k: number.parse()? },
        "fixed" => Kernel::Fixed { radius: radius()? },
        "progressive" => Kernel::Progressive { radius: radius()? },
        _ => return Err(format!("unknown kernel {name}").into()),
    })
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = |what: &str| args.next().ok_or(format!("{what} is missing"));
    let mut a = Arguments {
        scene: next("the scene")?,
        count: next("the number of photons")?.parse()?,
        global: false,
        random: false,
        passes: 1,
        settings: PhotonSettings::default(),
        layer: None,
        ply: None,
    };
    while let Ok(option) = next("") {
        match option.as_str() {
            "--global" => a.global = true,
            "--random" => a.random = true,
            "--nofold" => a.settings.fold = false,
            "--kernel" => a.settings.kernel = kernel(&next("the kernel")?)?,
            "--scale" => a.settings.scale = next("the scale")?.parse()?,
            "--greatest" => a.settings.greatest = Some(next("the radius")?.parse()?),
            "--passes" => a.passes = next("the number of passes")?.parse()?,
            "--seed" => a.settings.seed = next("the seed")?.parse()?,
            "--layer" => a.layer = Some(next("the file")?),
            "--ply" => a.ply = Some(next("the file")?),
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    Ok(a)
}

enum Map {
    Caustic(Box<CausticMap>),
    Global(Box<GlobalMap>),
}

impl Map {
    fn found(&self, at: &SurfacePoint, wo: dualux::math::Vec3) -> usize {
        let n = if wo.dot(at.n_geo) < 0.0 { -at.n_geo } else { at.n_geo };
        match self {
            Map::Caustic(map) => map.found(at.p, n),
            Map::Global(map) => map.found(at.p, n, Filter::INDIRECT),
        }
    }

    fn radiance(&self, at: &SurfacePoint, diffuse: &Bsdf, wo: dualux::math::Vec3) -> Rgb {
        match self {
            Map::Caustic(map) => map.radiance(at, diffuse, wo),
            Map::Global(map) => map.radiance(at, diffuse, wo, Filter::INDIRECT),
        }
    }
}

/// CPU seconds of all threads so far.
fn seconds(start: Instant) -> f64 {
    let of = |task: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    match std::fs::read_dir("/proc/self/task") {
        Ok(tasks) => tasks.flatten().filter_map(of).sum::<f64>() * 1e-9,
        Err(_) => start.elapsed().as_secs_f64(),
    }
}

fn run(a: &Arguments) -> Result<(), Box<dyn Error>> {
    let loaded = formats::load(a.scene.as_ref(), &LoadOptions::default())?;
    let scene = Scene::new(loaded.description)?;
    let accel = Accel::new(&scene.shapes);
    let world = World::new(&scene, &accel);
    let sequence = if a.random { Sequence::Random } else { Sequence::OwenSobol };
    let density = Uniform::new(&scene, a.count, sequence, a.settings.seed);
    let goal = if a.global { Goal::Classes([false, false, true]) } else { Goal::Caustics };
    let walk = WalkSettings { seed: a.settings.seed, most_segments: None, rr_depth: a.settings.rr_depth, goal };

    let (width, height) = (scene.film.width as usize, scene.film.height as usize);
    let first_hit = |pixel: usize| {
        let film = Vec2::new((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
        let camera = scene.camera.ray(film, Vec2::splat(0.5));
        let ray = Ray { o: camera.o, d: camera.d, tmin: camera.tmin, tmax: camera.tmax };
        let at = world.surface(&ray, &accel.closest(&ray)?);
        Some((at, world.bsdf(&at, -ray.d).split().0?, -ray.d))
    };
    let hits: Vec<_> = (0..width * height).into_par_iter().map(first_hit).collect();
    let asked = hits.iter().flatten().count();

    let begin = Instant::now();
    let mut found = 0;
    let mut layer = vec![Rgb::ZERO; width * height];
    let (mut emit_s, mut trace_s, mut build_s, mut query_s) = (0.0, 0.0, 0.0, 0.0);
    let (mut stored, mut bytes, mut rays) = (0, 0, 0);
    for pass in 0..a.passes {
        let start = seconds(begin);
        let emitted: usize = (0..density.count()).into_par_iter().filter_map(|i| density.emit(i, pass)).count();
        emit_s += seconds(begin) - start;
        assert!(emitted <= density.count());
        let start = seconds(begin);
        let traced = trace(world, &density, &walk, pass);
        trace_s += seconds(begin) - start;
        rays += traced.ledger.total().rays;
        if let (0, Some(file)) = (pass, &a.ply) {
            write_ply(&mut std::io::BufWriter::new(std::fs::File::create(file)?), &traced.photons)?;
        }
        let start = seconds(begin);
        let map = match a.global {
            false => Map::Caustic(Box::new(CausticMap::from_photons(world, traced, &a.settings, pass))),
            true => Map::Global(Box::new(GlobalMap::from_photons(world, traced, &a.settings, pass))),
        };
        build_s += seconds(begin) - start;
        (stored, bytes) = match &map {
            Map::Caustic(m) => (stored + m.stored(), m.bytes()),
            Map::Global(m) => (stored + m.stored(), m.bytes()),
        };
        let start = seconds(begin);
        layer.par_iter_mut().zip(&hits).for_each(|(sum, hit)| {
            if let Some((at, diffuse, wo)) = hit {
                *sum += map.radiance(at, diffuse, *wo);
            }
        });
        query_s += seconds(begin) - start;
        found += hits.iter().flatten().step_by(17).map(|(at, _, wo)| map.found(at, *wo)).sum::<usize>();
    }
    let mean: f32 = layer.iter().map(|c| c.element_sum() / 3.0).sum::<f32>() / (layer.len() as f32 * a.passes as f32);
    println!(
        "{{\"emit_s\": {emit_s:.3}, \"trace_s\": {trace_s:.3}, \"build_s\": {build_s:.3}, \"query_s\": {query_s:.3}, \"stored\": {stored}, \
         \"rays\": {rays}, \"traced_per_s\": {:.0}, \"query_us\": {:.3}, \"found\": {:.1}, \"bytes\": {bytes}, \"mean\": {mean}}}",
        (a.count as u64 * a.passes) as f64 / trace_s,
        query_s / (asked as u64 * a.passes) as f64 * 1e6,
        found as f64 / (asked.div_ceil(17) as u64 * a.passes) as f64,
    );
    if let Some(file) = &a.layer {
        let floats = layer.iter().flat_map(|c| (*c / a.passes as f32).to_array());
        std::fs::write(file, floats.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())?;
    }
    Ok(())
}

fn main() -> ExitCode {
    let run = arguments().and_then(|a| run(&a));
    match run {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
