//! `dualux render`: a scene file becomes a picture.

use super::checks::idle_lamps;
use super::flags::{IntegratorChoice, ManyLightArgs, PathArgs, PhotonArgs, Switch};
use super::load::SceneArgs;
use super::output::{Aov, Output, check_name};
use super::progress::Reporter;
use super::{Failure, debug_files, options, print, session, tell};
use crate::edge::EdgeDetector;
use crate::formats::Loaded;
use crate::image::atomic;
use crate::image::exr_file::Attribute;
use crate::integrators::Counts;
use crate::render::{InvalidSample, RenderSettings, render, replay, tiles_per_pass};
use crate::transport::World;
use crate::transport::cache_file::CacheFileError;
use crate::transport::light_tree::LightTree;
use clap::ValueEnum;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Arguments of `render`; each configuration of `compare` is a set of them.
#[derive(Clone, Debug, clap::Args)]
pub struct RenderArgs {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output file, .exr or .png; may be repeated [default: the scene's name with .exr].
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Integrator [default: photon].
    #[arg(long, value_enum)]
    pub integrator: Option<IntegratorChoice>,
    /// Number of passes; one sample per pixel each. K and M suffixes are understood.
    #[arg(long, value_parser = options::positive, conflicts_with = "spp")]
    pub passes: Option<u64>,
    /// Samples per pixel (the same as --passes for `path`).
    #[arg(long, value_parser = options::positive)]
    pub spp: Option<u64>,
    /// Wall clock limit of the whole process, such as 30s, 2m or 500ms; replaces the file's sample count.
    #[arg(long, value_parser = options::duration)]
    pub time_limit: Option<Duration>,
    /// Seed of all random numbers [default: the file's, else 0].
    #[arg(long)]
    pub seed: Option<u64>,
    /// Longest path: 1 = emitters only, 2 = direct light [default: the file's].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub max_depth: Option<u32>,
    /// Depth at which Russian roulette starts [default: the file's, else 5].
    #[arg(long)]
    pub rr_depth: Option<u32>,
    #[command(flatten)]
    pub photon: PhotonArgs,
    #[command(flatten)]
    pub many_light: ManyLightArgs,
    #[command(flatten)]
    pub path: PathArgs,
    /// Render only this window of the image, in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = options::window)]
    pub crop: Option<[u32; 4]>,
    /// Scale the image's size.
    #[arg(long, value_parser = options::factor)]
    pub scale: Option<f64>,
    /// Layers to write beside the picture (EXR).
    #[arg(long, value_enum, value_delimiter = ',')]
    pub aov: Vec<Aov>,
    /// Filter the noise that is left: pixels average neighbours from which they differ by noise alone [default: on for photon, off for
    /// many-light and path; `compare` and `reproduce`: off].
    #[arg(long, value_enum)]
    pub denoise: Option<Switch>,
    /// Exposure of PNG files, in stops.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = options::stops)]
    pub exposure: f32,
    /// Write the picture so far at this interval.
    #[arg(long, value_parser = options::duration)]
    pub save_every: Option<Duration>,
    /// Reference image: print the error (untrimmed relMSE) as the picture converges. Two files are two independent halves.
    #[arg(long, value_name = "FILE", num_args = 1..=2)]
    pub reference: Vec<PathBuf>,
    /// Write counts, times and the error curve to this file.
    #[arg(long, value_name = "FILE")]
    pub stats_json: Option<PathBuf>,
    /// Write the points that the last pass was made of (many-light: virtual lights) to this PLY file.
    #[arg(long, value_name = "FILE")]
    pub points: Option<PathBuf>,
    /// Take one sample again, as reported for samples that were not finite, and print it.
    #[arg(long, value_name = "X,Y,INDEX[,PASS]", value_parser = options::sample_address)]
    pub replay: Option<InvalidSample>,
    /// Show nothing but warnings and errors.
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say more.
    #[arg(short, long)]
    pub verbose: bool,
}

/// What a run did, for `--stats-json`.
#[derive(serde::Serialize)]
struct Stats<'a> {
    version: &'static str,
    integrator: &'static str,
    width: u32,
    height: u32,
    passes: u64,
    seed: u64,
    load_seconds: f64,
    total_seconds: f64,
    mean: [f64; 3],
    standard_error: [f64; 3],
    counts: Counts,
    prepared: std::collections::BTreeMap<&'static str, u64>,
    invalid_samples: &'a [InvalidSample],
    remarks: &'a [String],
    error_curve: &'a [super::progress::ErrorPoint],
}

/// Runs the command; `start` is when the process began.
pub fn run(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    let Loaded { description, warnings } = session::describe(args)?;
    warnings.iter().for_each(tell);
    let seed = args.seed.unwrap_or(description.seed);
    let frame = (description.film.width as usize, description.film.height as usize);
    // A name that cannot be written must not cost a render.
    let mut output = output(args, frame, seed)?;
    let (scene, accel) = args.scene.build(description)?;
    let lights = LightTree::new(&scene);
    let mut integrator = session::integrator(args, World::new(&scene, &accel).with_lights(&lights));
    let integrator = integrator.as_mut();
    session::load_cache(args, integrator)?;
    if let Some(path) = &args.photon.save_cache
        && integrator.cache().is_none()
    {
        return Err(format!("{}: {}", path.display(), CacheFileError::NotUsed).into());
    }
    if let Some(at) = args.replay {
        let s = replay(&scene, integrator, seed, at);
        let radiance = s.radiance.to_array();
        return print(format!(
            "pixel {},{} sample {} of pass {}: radiance {radiance:?}, filter weight {}\n",
            at.x, at.y, at.index, at.pass, s.weight
        ));
    }

    if let Some(aov) = output.aovs.iter().find(|a| a.asks().is_some_and(|told| integrator.tells() != Some(told))) {
        let name = aov.to_possible_value().map_or_else(String::new, |v| v.get_name().to_string());
        return Err(format!("--aov {name}: the integrator {} has no such layer", integrator.name()).into());
    }
    if output.aovs.contains(&Aov::Watched) && args.many_light.watch_light.is_none() {
        return Err("--aov watched: no light is watched; --watch-light says which".into());
    }
    debug_files::check(args, integrator)?;
    debug_files::before(args, integrator)?;
    let window = scene.film.crop;
    if output.aovs.contains(&Aov::Edges) {
        output.edges = EdgeDetector::new(&scene, &accel).hiding_lamps(scene.integrator.hide_emitters).pixel_map(window);
    }
    let reference = session::read_reference(&args.reference, frame, window)?;
    let (passes, limit) = session::limits(args, &scene);
    output.denoise = session::denoises(args, &scene);
    let settings = RenderSettings {
        window,
        passes,
        deadline: limit
            .map(|l| start + l.saturating_sub(output.write_time(window[2] as usize * window[3] as usize, l))),
        seed,
        features: output.aovs.iter().any(|a| a.is_feature()),
    };
    let load_seconds = start.elapsed().as_secs_f64();
    if args.verbose {
        tell(format_args!("loaded in {load_seconds:.2} s: {} triangles", scene.triangle_count()));
    }
    let named = scene.integrator.name.as_str();
    if !args.quiet {
        session::unused_words(&scene.integrator.photon).iter().for_each(|w| tell(format_args!("note: {w}")));
    }
    if !args.quiet && args.integrator.is_none() && !matches!(named, "" | "path") && named != integrator.name() {
        tell(format_args!(
            "note: the file names the integrator \"{named}\"; \"{}\" runs in its place",
            integrator.name()
        ));
    }

    idle_lamps(&scene, &accel).iter().for_each(|w| tell(format_args!("warning: {w}")));

    let stop = session::stop_on_signals()?;
    let tiles = passes.map_or(0, |n| n.saturating_mul(tiles_per_pass(window)));
    let mut reporter = Reporter::new(start, tiles, args.quiet, &output);
    (reporter.limit, reporter.save_every, reporter.reference) = (limit, args.save_every, reference);
    let done = render(&scene, integrator, &settings, &stop, &mut reporter);
    reporter.measure(done.passes, &done.film);
    reporter.finish();

    output.write(&done.film, done.passes, start.elapsed(), start.elapsed())?;
    if let Some(path) = &args.points {
        match integrator.points_ply() {
            Some(bytes) => atomic::write_file(path, &bytes)?,
            None => tell(format_args!("note: the integrator {} has no points to write", integrator.name())),
        }
    }
    if let (Some(path), Some(cache)) = (&args.photon.save_cache, integrator.cache()) {
        cache.save(path)?;
    }
    debug_files::after(args, integrator)?;
    let remarks = session::remarks(&scene, integrator, &done);
    let (mean, standard_error) = done.film.mean_and_error();
    let total_seconds = start.elapsed().as_secs_f64();
    if let Some(path) = &args.stats_json {
        let stats = Stats {
            version: env!("CARGO_PKG_VERSION"),
            integrator: integrator.name(),
            width: window[2],
            height: window[3],
            passes: done.passes,
            seed,
            load_seconds,
            total_seconds,
            mean,
            standard_error,
            counts: done.counts,
            prepared: integrator.figures().into_iter().collect(),
            invalid_samples: &done.invalid,
            remarks: &remarks,
            error_curve: &reporter.curve,
        };
        let text = serde_json::to_string_pretty(&stats)?;
        atomic::write_file(path, (text + "\n").as_bytes())?;
    }
    if args.verbose {
        integrator.figures().iter().for_each(|(name, n)| tell(format_args!("{name}: {n}")));
    }
    remarks.iter().for_each(|r| tell(format_args!("note: {r}")));
    if stop.load(Ordering::Relaxed) {
        tell(format_args!("stopped by a signal after {} passes; the picture so far is written", done.passes));
    }
    if !args.quiet {
        for path in &output.paths {
            print(format!("{}: {} passes, {total_seconds:.2} s\n", path.display(), done.passes))?;
        }
    }
    Ok(())
}

/// What files are to be written; fails early if a name is of no known kind or its folder cannot be written to.
fn output(args: &RenderArgs, frame: (usize, usize), seed: u64) -> Result<Output, Failure> {
    let mut paths = args.output.clone();
    if paths.is_empty() {
        let stem = args.scene.scene.file_stem().unwrap_or_else(|| "out".as_ref());
        paths.push(PathBuf::from(stem).with_extension("exr"));
    }
    let command: Vec<String> = std::env::args_os().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
    let attributes = vec![
        ("dualux:version".to_string(), Attribute::Text(env!("CARGO_PKG_VERSION").into())),
        ("dualux:command".to_string(), Attribute::Text(command.join(" "))),
        ("dualux:seed".to_string(), Attribute::Text(seed.to_string())),
    ];
    let mut aovs = Vec::new();
    for aov in &args.aov {
        // A layer that is asked for twice is written once.
        if !aovs.contains(aov) {
            aovs.push(*aov);
        }
    }
    let output = Output { paths, aovs, exposure: args.exposure, denoise: false, frame, edges: Vec::new(), attributes };
    if args.replay.is_none() {
        output.paths.iter().try_for_each(|path| check_name(path))?;
        let files = [&args.stats_json, &args.points, &args.photon.save_cache];
        files.into_iter().flatten().try_for_each(|path| atomic::check(path))?;
    }
    Ok(output)
}
