//! Time and memory against the number of lamps, 10^2 to 10^6: halls of [`super::lamps`] rendered for a few passes.
//!
//! Set-up is everything from the file to the first pass; memory is what the process has resident after the last one (Linux only): the
//! program itself, the scene, and what freed memory the allocator keeps. Loading and acceleration structure hold the lamps' triangles like any others; light set-up is
//! the part that knows of lamps.

use super::lamps;
use crate::cli::Failure;
use crate::cli::compare::configuration::Config;
use crate::cli::load::{SceneArgs, SimdChoice};
use crate::cli::session;
use crate::image::film::Film;
use crate::integrators::Counts;
use crate::render::{Observer, RenderSettings, render};
use crate::transport::World;
use crate::transport::light_tree::LightTree;
use cpu_time::ProcessTime;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Numbers of lamps.
pub const COUNTS: [u64; 5] = [100, 1000, 10_000, 100_000, 1_000_000];
/// Passes of each render.
const PASSES: u64 = 4;

/// Renders: name and flags.
pub const RENDERS: [(&str, &str); 4] = [
    ("path, tree", "--integrator path --light-selection tree"),
    ("path, power", "--integrator path --light-selection power"),
    ("path, culling", "--integrator path --light-selection culling"),
    ("photon", "--integrator photon"),
];

/// One hall.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Cost {
    /// Lamps.
    pub lamps: u64,
    /// CPU seconds to read the file and build scene and acceleration structure.
    pub load_seconds: f64,
    /// CPU seconds to build the light tree.
    pub light_tree_seconds: f64,
    /// Of each render: name, CPU seconds until the first pass starts, in the first pass with what it prepares, and per later pass.
    pub renders: Vec<(String, f64, f64, f64)>,
    /// Resident memory of the process, MiB.
    pub memory_mib: Option<f64>,
}

/// The clock at the end of each pass.
struct Times {
    start: ProcessTime,
    ends: Vec<f64>,
}

impl Observer for Times {
    fn pass_done(&mut self, _: u64, _: &Counts, _: &dyn Fn() -> Film) {
        self.ends.push(self.start.elapsed().as_secs_f64());
    }
}

/// Resident memory of the process, MiB.
fn resident() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<f64>().ok().map(|kib| kib / 1024.0)
}

/// Measures a hall of `n` lamps, whose file goes to `folder`.
pub fn measure(folder: &Path, n: u64, scale: Option<f64>) -> Result<Cost, Failure> {
    let scene = lamps::write(folder, n)?;
    let start = ProcessTime::now();
    let scene_args = SceneArgs { scene, define: Vec::new(), strict: false, threads: None, simd: SimdChoice::Auto };
    let configure = |name, flags| -> Result<Config, Failure> {
        let mut config = Config::new(name, flags)?.with_scene(&scene_args);
        config.args.scale = scale;
        Ok(config)
    };
    let (scene, accel) = scene_args.build(session::describe(&configure("", "")?.args)?.description)?;
    let load_seconds = start.elapsed().as_secs_f64();
    let start = ProcessTime::now();
    let lights = LightTree::new(&scene);
    let light_tree_seconds = start.elapsed().as_secs_f64();
    let mut renders = Vec::new();
    for (name, flags) in RENDERS {
        let config = configure(name, flags)?;
        let start = ProcessTime::now();
        let mut integrator = session::integrator(&config.args, World::new(&scene, &accel).with_lights(&lights));
        let ready = start.elapsed().as_secs_f64();
        let mut times = Times { start, ends: Vec::new() };
        let window = scene.film.crop;
        let settings = RenderSettings { window, passes: Some(PASSES), deadline: None, seed: 0, features: false };
        render(&scene, integrator.as_mut(), &settings, &AtomicBool::new(false), &mut times);
        if let [first, .., last] = times.ends[..] {
            let later = (last - first) / (times.ends.len() - 1) as f64;
            renders.push((name.to_string(), ready, first - ready, later));
        }
    }
    Ok(Cost { lamps: n, load_seconds, light_tree_seconds, renders, memory_mib: resident() })
}
