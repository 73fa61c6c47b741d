//! `dualux render`: a scene file becomes a picture.

use super::checks::idle_lamps;
use super::load::{SceneArgs, crop_film, scale_film};
use super::output::{Aov, Output, check_name};
use super::progress::Reporter;
use super::{Failure, options, print, tell};
use crate::edge::EdgeDetector;
use crate::formats::Diagnostic;
use crate::image::exr_file::Attribute;
use crate::image::metrics::Reference;
use crate::image::{Window, atomic, read_image};
use crate::integrators::path::{Path, PathSettings};
use crate::integrators::{Counts, Integrator};
use crate::render::{InvalidSample, Progress, RenderSettings, render, replay, tiles_per_pass};
use crate::scene::Scene;
use crate::scene::description::IntegratorDesc;
use crate::transport::World;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Samples per pixel where neither the command line nor the file says anything.
const DEFAULT_PASSES: u64 = 64;

/// Arguments of `render`.
#[derive(Debug, clap::Args)]
pub struct RenderArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Output file, .exr or .png; may be repeated [default: the scene's name with .exr].
    #[arg(short, long, value_name = "FILE")]
    output: Vec<PathBuf>,
    /// Integrator [default: the file's if it is one of ours, else path].
    #[arg(long, value_enum)]
    integrator: Option<IntegratorChoice>,
    /// Number of passes; one sample per pixel each. K and M suffixes are understood.
    #[arg(long, value_parser = options::positive, conflicts_with = "spp")]
    passes: Option<u64>,
    /// Samples per pixel (the same as --passes for `path`).
    #[arg(long, value_parser = options::positive)]
    spp: Option<u64>,
    /// Wall clock limit of the whole process, such as 30s, 2m or 500ms; replaces the file's sample count.
    #[arg(long, value_parser = options::duration)]
    time_limit: Option<Duration>,
    /// Seed of all random numbers [default: the file's, else 0].
    #[arg(long)]
    seed: Option<u64>,
    /// Longest path: 1 = emitters only, 2 = direct light [default: the file's].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    max_depth: Option<u32>,
    /// Depth at which Russian roulette starts [default: the file's, else 5].
    #[arg(long)]
    rr_depth: Option<u32>,
    /// Render only this window of the image, in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = options::window)]
    crop: Option<[u32; 4]>,
    /// Scale the image's size.
    #[arg(long, value_parser = options::factor)]
    scale: Option<f64>,
    /// Layers to write beside the picture (EXR).
    #[arg(long, value_enum, value_delimiter = ',')]
    aov: Vec<Aov>,
    /// Exposure of PNG files, in stops.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = options::stops)]
    exposure: f32,
    /// Write the picture so far at this interval.
    #[arg(long, value_parser = options::duration)]
    save_every: Option<Duration>,
    /// Reference image: print the error (untrimmed relMSE) as the picture converges. Two files are two independent halves.
    #[arg(long, value_name = "FILE", num_args = 1..=2)]
    reference: Vec<PathBuf>,
    /// Write counts, times and the error curve to this file.
    #[arg(long, value_name = "FILE")]
    stats_json: Option<PathBuf>,
    /// Take one sample again, as reported for samples that were not finite, and print it.
    #[arg(long, value_name = "X,Y,PASS", value_parser = options::sample_address)]
    replay: Option<(u32, u32, u64)>,
    /// Show nothing but warnings and errors.
    #[arg(short, long, conflicts_with = "verbose")]
    quiet: bool,
    /// Say more.
    #[arg(short, long)]
    verbose: bool,
}

/// Integrators by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum IntegratorChoice {
    /// Unidirectional path tracing with light sampling: unbiased, the reference for all others.
    Path,
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
    invalid_samples: &'a [InvalidSample],
    remarks: &'a [String],
    error_curve: &'a [super::progress::ErrorPoint],
}

/// Runs the command; `start` is when the process began.
pub fn run(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    let loaded = args.scene.read()?;
    print_warnings(&loaded.warnings);
    let mut description = loaded.description;
    if let Some(scale) = args.scale {
        scale_film(&mut description, scale)?;
    }
    if let Some(window) = args.crop {
        crop_film(&mut description, window)?;
    }
    let seed = args.seed.unwrap_or(description.seed);
    let frame = (description.film.width as usize, description.film.height as usize);
    // A name that cannot be written must not cost a render.
    let mut output = output(args, frame, seed)?;
    let (scene, accel) = args.scene.build(description)?;
    let mut integrator = Path::new(World::new(&scene, &accel), path_settings(args, &scene.integrator));
    if let Some((x, y, index)) = args.replay {
        let s = replay(&scene, &mut integrator, seed, InvalidSample { x, y, index });
        let radiance = s.radiance.to_array();
        return print(format!("pixel {x},{y} sample {index}: radiance {radiance:?}, filter weight {}\n", s.weight));
    }

    let window = scene.film.crop;
    if output.aovs.contains(&Aov::Edges) {
        output.edges = EdgeDetector::new(&scene, &accel).pixel_map(window);
    }
    let reference = read_reference(args, frame, window)?;
    let timeout = || scene.integrator.timeout.and_then(|t| Duration::try_from_secs_f64(t).ok());
    let limit = args.time_limit.or_else(timeout).filter(|l| *l <= options::LONGEST);
    let passes = args.passes.or(args.spp).or(match limit {
        None => Some(scene.sample_count.map_or(DEFAULT_PASSES, u64::from)),
        Some(_) => None,
    });
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
    if !args.quiet && args.integrator.is_none() && !matches!(named, "" | "path") {
        tell(format_args!(
            "note: the file names the integrator \"{named}\"; \"{}\" runs in its place",
            integrator.name()
        ));
    }

    idle_lamps(&scene, &accel).iter().for_each(|w| tell(format_args!("warning: {w}")));

    let stop = stop_on_signals()?;
    let tiles = passes.map_or(0, |n| n.saturating_mul(tiles_per_pass(window)));
    let mut reporter = Reporter::new(start, tiles, args.quiet, &output);
    (reporter.limit, reporter.save_every, reporter.reference) = (limit, args.save_every, reference);
    let done = render(&scene, &mut integrator, &settings, &stop, &mut reporter);
    reporter.measure(done.passes, &done.film);
    reporter.finish();

    output.write(&done.film, done.passes, start.elapsed(), start.elapsed())?;
    let remarks = remarks(&scene, &integrator, &done);
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
            invalid_samples: &done.invalid,
            remarks: &remarks,
            error_curve: &reporter.curve,
        };
        let text = serde_json::to_string_pretty(&stats)?;
        atomic::write_file(path, (text + "\n").as_bytes())?;
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
    let output = Output { paths, aovs, exposure: args.exposure, frame, edges: Vec::new(), attributes };
    if args.replay.is_none() {
        output.paths.iter().try_for_each(|path| check_name(path))?;
        args.stats_json.as_deref().map_or(Ok(()), atomic::check)?;
    }
    Ok(output)
}

fn path_settings(args: &RenderArgs, file: &IntegratorDesc) -> PathSettings {
    let default = PathSettings::default();
    PathSettings {
        max_depth: args.max_depth.or(file.max_depth),
        rr_depth: args.rr_depth.or(file.rr_depth).unwrap_or(default.rr_depth),
        hide_emitters: file.hide_emitters,
    }
}

/// The references, cut to the window: each shows the whole `frame`, or is a picture of the window's size.
fn read_reference(
    args: &RenderArgs,
    frame: (usize, usize),
    [x, y, width, height]: [u32; 4],
) -> Result<Option<Reference>, Failure> {
    let window = Window { x: x as i32, y: y as i32, width: width as usize, height: height as usize };
    let mut pictures = Vec::new();
    for path in &args.reference {
        let picture = read_image(path)?;
        let (w, h) = (picture.width(), picture.height());
        let fitting = if picture.frame == frame {
            picture.cropped(window)
        } else {
            // A crop that forgot where it came from.
            Some(picture).filter(|p| p.frame == (window.width, window.height) && p.window.area() == window.area())
        };
        let problem = || format!("{}: {w} x {h} pixels do not fit the image of {width} x {height}", path.display());
        pictures.push(fitting.ok_or_else(problem)?);
    }
    let reference = pictures.first().map(|a| Reference::new(a, pictures.get(1)));
    Ok(reference.transpose()?)
}

/// A flag that SIGINT, SIGTERM and SIGHUP set; a second signal ends the process at once.
fn stop_on_signals() -> Result<Arc<AtomicBool>, Failure> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let stop = Arc::new(AtomicBool::new(false));
    let mut signals = vec![SIGINT, SIGTERM];
    #[cfg(unix)]
    signals.push(signal_hook::consts::SIGHUP);
    for signal in signals {
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop))?;
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

fn print_warnings(warnings: &[Diagnostic]) {
    warnings.iter().for_each(tell);
}

/// What the user should know after the run.
fn remarks(scene: &Scene, integrator: &dyn Integrator, done: &Progress) -> Vec<String> {
    let mut out = integrator.remarks(&done.counts);
    if scene.shapes.is_empty() {
        out.push("the scene has no surface".into());
    }
    if scene.lights.is_empty() {
        out.push("the scene has no light: the picture is black".into());
    } else if done.film.pixels().iter().all(|p| p.mean() == [0.0; 3]) {
        out.push(
            "the picture is black: no light reaches the camera (area lights emit on their normal side only)".into(),
        );
    }
    if done.counts.invalid > 0 {
        let first: Vec<String> = done.invalid.iter().map(|s| format!("{},{},{}", s.x, s.y, s.index)).collect();
        let n = done.counts.invalid;
        out.push(format!(
            "{n} samples were not finite and left out; --replay x,y,index shows one of: {}",
            first.join(" ")
        ));
    }
    if done.passes == 0 {
        out.push("the render ended within its first pass: parts of the picture are coarse".into());
    }
    out
}
