//! The pieces of a render that `render` and `compare` share: from flags to a scene, an integrator, limits and references.

use super::Failure;
use super::flags::{IntegratorChoice, Part, Switch};
use super::load::{crop_film, scale_film};
use super::options;
use super::output::Aov;
use super::render::RenderArgs;
use crate::formats::Loaded;
use crate::image::metrics::Reference;
use crate::image::{Window, read_image};
use crate::integrators::Integrator;
use crate::integrators::many_light::{ManyLight, ManyLightSettings};
use crate::integrators::path::{Path, PathSettings};
use crate::integrators::photon::{Parts, Photon, PhotonSettings};
use crate::render::Progress;
use crate::scene::Scene;
use crate::scene::description::{IntegratorDesc, PhotonDesc};
use crate::transport::World;
use crate::transport::cache_file::CacheFileError;
use crate::transport::direct::DirectSettings;
use crate::transport::strategies::StrategySettings;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Samples per pixel where neither the command line nor the file says anything.
const DEFAULT_PASSES: u64 = 64;

/// Reads the scene file and gives the film the size and window that the flags ask for.
pub fn describe(args: &RenderArgs) -> Result<Loaded, Failure> {
    let mut loaded = args.scene.read()?;
    if let Some(scale) = args.scale {
        scale_film(&mut loaded.description, scale)?;
    }
    if let Some(window) = args.crop {
        crop_film(&mut loaded.description, window)?;
    }
    Ok(loaded)
}

/// Which integrator the flags, else the file ask for.
fn choice(args: &RenderArgs, scene: &Scene) -> IntegratorChoice {
    args.integrator.unwrap_or_else(|| IntegratorChoice::of_file(&scene.integrator.name))
}

/// Whether pictures are filtered: those of the photon integrator unless the flags say otherwise.
pub fn denoises(args: &RenderArgs, scene: &Scene) -> bool {
    args.denoise.map_or(choice(args, scene) == IntegratorChoice::Photon, |d| d == Switch::On)
}

/// Photon parameters of the file that mean nothing here, each with the reason.
pub fn unused_words(file: &PhotonDesc) -> Vec<String> {
    let radii = "kernels follow the footprints of photons, or --kernel";
    let words = [
        ("initialRadius", file.initial_radius.is_some_and(|r| r > 0.0), radii),
        ("globalLookupRadius", file.global_lookup_radius.is_some(), radii),
        ("causticLookupRadius", file.caustic_lookup_radius.is_some(), radii),
        ("lookupSize", file.lookup_size.is_some(), radii),
        ("alpha", file.alpha.is_some(), radii),
        ("stepSnapshot", file.step_snapshot.is_some(), "see --save-every"),
        ("directSamples", file.direct_samples.is_some(), "see --light-samples"),
        ("maxSpecularDepth", file.max_specular_depth.is_some(), "see --max-depth"),
    ];
    let unused = words.iter().filter(|w| w.1);
    unused.map(|(word, _, why)| format!("the integrator's {word} is not used: {why}")).collect()
}

/// The integrator that the flags and the file ask for.
pub fn integrator<'a>(args: &RenderArgs, world: World<'a>) -> Box<dyn Integrator + 'a> {
    match choice(args, world.scene) {
        IntegratorChoice::Photon => {
            Box::new(Photon::new(world, photon_settings(args, world.scene), world.scene.film.crop))
        }
        IntegratorChoice::ManyLight => {
            Box::new(ManyLight::new(world, many_light_settings(args, world.scene), world.scene.film.crop))
        }
        IntegratorChoice::Path => Box::new(Path::new(world, path_settings(args, &world.scene.integrator))),
    }
}

/// Hands the integrator the cache that the flags name.
pub fn load_cache(args: &RenderArgs, integrator: &mut dyn Integrator) -> Result<(), Failure> {
    let Some(path) = &args.photon.load_cache else { return Ok(()) };
    integrator.load_cache(path).map_err(|e| match e {
        CacheFileError::Io(text) => text.into(),
        other => format!("{}: {other}", path.display()).into(),
    })
}

/// When to stop: the number of passes, and the limit of the process's wall clock. Either may be absent, but not both.
pub fn limits(args: &RenderArgs, scene: &Scene) -> (Option<u64>, Option<Duration>) {
    let timeout = || scene.integrator.timeout.and_then(|t| Duration::try_from_secs_f64(t).ok());
    let limit = args.time_limit.or_else(timeout).filter(|l| *l <= options::LONGEST);
    // Passes of a progressive photon mapper are ours; its sampler's count is not.
    let photon = choice(args, scene) == IntegratorChoice::Photon;
    let in_file = scene.integrator.photon.max_passes.filter(|_| photon).or(scene.sample_count);
    let passes = args.passes.or(args.spp).or(match limit {
        None => Some(in_file.map_or(DEFAULT_PASSES, u64::from)),
        Some(_) => None,
    });
    (passes, limit)
}

/// Settings of the path tracer: the flags, else the file's.
fn path_settings(args: &RenderArgs, file: &IntegratorDesc) -> PathSettings {
    let default = PathSettings::default();
    PathSettings {
        max_depth: args.max_depth.or(file.max_depth),
        rr_depth: args.rr_depth.or(file.rr_depth).unwrap_or(default.rr_depth),
        hide_emitters: file.hide_emitters,
        lights: args.path.selection(args.seed.unwrap_or(0)),
    }
}

/// Settings of the many-light integrator: the flags, else the defaults.
fn many_light_settings(args: &RenderArgs, scene: &Scene) -> ManyLightSettings {
    let default = ManyLightSettings::default();
    let flags = &args.many_light;
    let photon = photon_settings(args, scene);
    ManyLightSettings {
        path: photon.path,
        direct: photon.direct,
        strategy: StrategySettings {
            strategy: flags.strategy.unwrap_or_default(),
            coins: flags.coins.unwrap_or_default(),
            epsilon: flags.epsilon.map(|e| (e as f32).max(1e-20)),
        },
        vpls: flags.vpls.map(|n| n as usize),
        emitter_vpls: flags.emitter_vpls.map_or(default.emitter_vpls, |n| n as usize),
        cache_points: flags.cache_points.map_or(default.cache_points, |n| n as usize),
        compensate: !flags.no_compensation,
        area: flags.vpl_area.map_or(default.area, |a| a as f32),
        caustic_photons: photon.caustic_photons,
        photons: args.photon.photons,
        interleave: flags.interleave.unwrap_or(default.interleave),
        watched: flags.watch_light,
        parts: photon.parts,
        seed: photon.seed,
    }
}

/// Settings of the photon integrator: the flags, else the defaults.
fn photon_settings(args: &RenderArgs, scene: &Scene) -> PhotonSettings {
    let default = PhotonSettings::default();
    let flags = &args.photon;
    let file = &scene.integrator.photon;
    // Progressive photon mappers have one kind of photons: they count for both maps.
    let progressive = matches!(scene.integrator.name.as_str(), "ppm" | "sppm" | "dppm");
    let caustic = file.caustic_photons.or(file.photon_count.filter(|_| progressive));
    let some = |n: Option<u64>| n.filter(|n| *n > 0);
    let shown = |part| flags.only.is_empty() || flags.only.contains(&part);
    PhotonSettings {
        path: path_settings(args, &scene.integrator),
        emission: flags.emission.unwrap_or(default.emission),
        emission_cut: flags.emission_cut.unwrap_or(default.emission_cut),
        emission_linearity: flags.emission_linearity.unwrap_or(default.emission_linearity),
        kernel: flags.kernel.unwrap_or(default.kernel),
        direct: DirectSettings {
            sampling: flags.light_sampling.unwrap_or(default.direct.sampling),
            samples: flags.light_samples.unwrap_or(default.direct.samples),
            ..default.direct
        },
        adaptive_light_samples: flags.light_samples.is_none(),
        indirect: flags.indirect.unwrap_or(default.indirect),
        filtered: denoises(args, scene),
        antialiasing: flags.aa.unwrap_or(default.antialiasing),
        photons: flags.photons.or(some(file.photon_count)),
        caustic_photons: flags.caustic_photons.or(some(caustic)),
        parts: Parts { direct: shown(Part::Direct), caustic: shown(Part::Caustic), indirect: shown(Part::Indirect) },
        inspect: args.aov.contains(&Aov::Cache),
        seed: args.seed.unwrap_or(scene.seed),
        ..default
    }
}

/// The references, cut to the window: each shows the whole `frame`, or is a picture of the window's size.
pub fn read_reference(
    paths: &[PathBuf],
    frame: (usize, usize),
    [x, y, width, height]: [u32; 4],
) -> Result<Option<Reference>, Failure> {
    let window = Window { x: x as i32, y: y as i32, width: width as usize, height: height as usize };
    let mut pictures = Vec::new();
    for path in paths {
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
pub fn stop_on_signals() -> Result<Arc<AtomicBool>, Failure> {
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

/// What the user should know after the run.
pub fn remarks(scene: &Scene, integrator: &dyn Integrator, done: &Progress) -> Vec<String> {
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
        let first: Vec<String> =
            done.invalid.iter().map(|s| format!("{},{},{},{}", s.x, s.y, s.index, s.pass)).collect();
        let n = done.counts.invalid;
        out.push(format!("{n} samples were not finite and left out; --replay shows one of: {}", first.join(" ")));
    }
    if done.passes == 0 {
        out.push("the render ended within its first pass: parts of the picture are coarse".into());
    }
    out
}
