//! One run of a configuration, measured: CPU and wall time, counts, the error at powers of two of the passes.
//!
//! The clock runs while the integrator is prepared and while it renders; measuring errors does not count. CPU time is that of
//! all threads of the process, user and system.

use super::budget::Budget;
use super::configuration::Config;
use crate::accel::Accel;
use crate::cli::{Failure, session};
use crate::image::Picture;
use crate::image::film::Film;
use crate::image::metrics::Reference;
use crate::integrators::Counts;
use crate::render::{COARSE_BLOCK, Observer, RenderSettings, render};
use crate::report::comparison::{Map, Run};
use crate::report::curve::Point;
use crate::scene::Scene;
use crate::transport::World;
use crate::transport::light_tree::LightTree;
use cpu_time::ProcessTime;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Per cent of the pixels that the trimmed relMSE drops.
const TRIM_PERCENT: f64 = 0.1;

/// A scene as the flags want it.
pub struct Prepared {
    /// The scene.
    pub scene: Scene,
    /// Ray queries.
    pub accel: Accel,
    /// The file's seed.
    pub seed: u64,
    /// Width and height of the full film.
    pub frame: (usize, usize),
}

/// A run and what it leaves beside the numbers.
pub struct Measured {
    /// The numbers and the picture.
    pub run: Run,
    /// Name of the integrator.
    pub integrator: &'static str,
    /// Densities over the picture.
    pub maps: Vec<Map>,
    /// What the integrator had to say.
    pub remarks: Vec<String>,
}

/// A clock that can be stopped while something is done that does not count.
struct Clock {
    cpu: ProcessTime,
    wall: Instant,
    cpu_out: Duration,
    wall_out: Duration,
}

impl Clock {
    fn start() -> Result<Clock, Failure> {
        let cpu = ProcessTime::try_now().map_err(|e| format!("the system does not tell the CPU time: {e}"))?;
        Ok(Clock { cpu, wall: Instant::now(), cpu_out: Duration::ZERO, wall_out: Duration::ZERO })
    }

    /// CPU and wall time that count.
    fn times(&self) -> (Duration, Duration) {
        // It could be read at the start, so it can be read now.
        let cpu = self.cpu.try_elapsed().unwrap_or_default();
        (cpu.saturating_sub(self.cpu_out), self.wall.elapsed().saturating_sub(self.wall_out))
    }

    /// Does something that does not count.
    fn outside<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (cpu, wall) = self.times();
        let result = work();
        let (cpu_after, wall_after) = self.times();
        self.cpu_out += cpu_after.saturating_sub(cpu);
        self.wall_out += wall_after.saturating_sub(wall);
        result
    }
}

/// Watches a render: ends it when the budget is spent, and takes the error now and then.
struct Watch<'a> {
    clock: Clock,
    budget: Budget,
    reference: Option<&'a Reference>,
    user_stop: &'a AtomicBool,
    stop: &'a AtomicBool,
    points: Vec<Point>,
    /// Samples taken when the last point was.
    samples_at_point: Option<u64>,
}

impl Watch<'_> {
    fn point(&mut self, passes: u64, counts: &Counts, film: impl FnOnce() -> Film) {
        let (cpu, wall) = self.clock.times();
        let reference = self.reference;
        let relmse = self.clock.outside(|| reference.and_then(|r| r.relmse(&picture(&film())).ok()));
        self.samples_at_point = Some(counts.samples);
        self.points.push(Point {
            passes,
            cpu_seconds: cpu.as_secs_f64(),
            wall_seconds: wall.as_secs_f64(),
            photons: counts.photons,
            relmse: relmse.unwrap_or(f64::NAN),
        });
    }
}

impl Observer for Watch<'_> {
    fn spent(&self) -> f64 {
        match self.budget {
            _ if self.user_stop.load(Ordering::Relaxed) => 1.0,
            Budget::Time(limit) => self.clock.times().0.as_secs_f64() / limit.as_secs_f64(),
            Budget::Passes(_) | Budget::Photons(_) => 0.0,
        }
    }

    fn pass_done(&mut self, passes: u64, counts: &Counts, film: &dyn Fn() -> Film) {
        match self.budget {
            // Nothing to wait for if no photon is ever emitted.
            Budget::Photons(n) if counts.photons >= n || counts.photons == 0 => {
                self.stop.store(true, Ordering::Relaxed)
            }
            _ => {}
        }
        if self.reference.is_some() && passes.is_power_of_two() {
            self.point(passes, counts, film);
        }
    }
}

fn picture(film: &Film) -> Picture {
    Picture::new(film.width as usize, film.height as usize, film.picture(COARSE_BLOCK))
}

/// Renders the picture alone: for references. Also tells passes and CPU seconds.
pub fn render_only(
    world: &Prepared,
    config: &Config,
    seed: u64,
    budget: Budget,
    user_stop: &AtomicBool,
) -> Result<(Picture, u64, f64), Failure> {
    let (done, watch, _, _) = execute(world, config, seed, budget, None, user_stop)?;
    let cpu = watch.times().0.as_secs_f64();
    Ok((picture(&done.film), done.passes, cpu))
}

/// Runs a configuration; `None` if the user stopped it.
pub fn run(
    world: &Prepared,
    config: &Config,
    seed: u64,
    budget: Budget,
    reference: &Reference,
    user_stop: &AtomicBool,
) -> Result<Option<Measured>, Failure> {
    let (done, _, points, said) = execute(world, config, seed, budget, Some(reference), user_stop)?;
    if user_stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    if matches!(budget, Budget::Photons(_)) && done.counts.photons == 0 {
        let (name, integrator) = (&config.name, said.integrator);
        return Err(format!(
            "configuration \"{name}\": the integrator {integrator} emitted no photon, so that --equal photons has no end; \
             use --equal time or --equal passes"
        )
        .into());
    }
    let picture = picture(&done.film);
    let samples: Vec<u32> = done.film.pixels().iter().map(|p| p.count()).collect();
    let least = samples.iter().copied().min().unwrap_or(0);
    // A budget that ends within a pass leaves pixels that have one sample more: no density worth showing.
    let varied = samples.iter().any(|&s| s > least + 1);
    let map = || Map { title: "Samples per pixel".into(), values: samples.iter().map(|&s| s as f32).collect() };
    let maps = if varied { vec![map()] } else { Vec::new() };
    let above = samples.iter().filter(|&&s| s > least).count();
    let run = Run {
        seed,
        points,
        counts: done.counts,
        favoured_pixels: above as f64 / samples.len().max(1) as f64,
        picture: reference.prepare(&picture)?,
        errors: reference.errors(&picture, TRIM_PERCENT)?,
    };
    Ok(Some(Measured { run, integrator: said.integrator, maps, remarks: said.remarks }))
}

/// What an integrator says of itself.
struct Said {
    integrator: &'static str,
    remarks: Vec<String>,
}

fn execute(
    world: &Prepared,
    config: &Config,
    seed: u64,
    budget: Budget,
    reference: Option<&Reference>,
    user_stop: &AtomicBool,
) -> Result<(crate::render::Progress, Clock, Vec<Point>, Said), Failure> {
    let stop = AtomicBool::new(false);
    let clock = Clock::start()?;
    // Integrators have random numbers of their own: photons, caches.
    let mut args = config.args.clone();
    args.seed = Some(seed);
    let lights = LightTree::new(&world.scene);
    let mut integrator = session::integrator(&args, World::new(&world.scene, &world.accel).with_lights(&lights));
    session::load_cache(&args, integrator.as_mut())?;
    let own = config.passes();
    let settings = RenderSettings {
        window: world.scene.film.crop,
        passes: match budget {
            Budget::Passes(n) => Some(own.map_or(n, |m| m.min(n))),
            _ => own,
        },
        deadline: None,
        seed,
        features: false,
    };
    let mut watch =
        Watch { clock, budget, reference, user_stop, stop: &stop, points: Vec::new(), samples_at_point: None };
    let done = render(&world.scene, integrator.as_mut(), &settings, &stop, &mut watch);
    // A pass that was cut short still counts: its samples are in the film.
    if watch.samples_at_point != Some(done.counts.samples) {
        watch.point(done.passes, &done.counts, || done.film.clone());
    }
    let remarks = session::remarks(&world.scene, integrator.as_ref(), &done);
    let said = Said { integrator: integrator.name(), remarks };
    Ok((done, watch.clock, watch.points, said))
}
