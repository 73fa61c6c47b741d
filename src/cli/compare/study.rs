//! All runs of a comparison, in turn, and their reference.
//!
//! The configurations alternate, one run each per seed, so that a machine that grows slower does so for all of them. Runs of
//! different configurations share their seeds; the reference has seeds of its own.

use super::budget::Budget;
use super::configuration::Config;
use super::measured::{self, Measured, Prepared};
use crate::cli::checks::idle_lamps;
use crate::cli::load::SimdChoice;
use crate::cli::{Failure, session, tell};
use crate::formats::Loaded;
use crate::image::metrics::Reference;
use crate::math::sampler::hash;
use crate::report::comparison::{Comparison, Configuration};
use crate::report::table::error;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// A reference of its own error above this share of the smallest error is spoken of.
const REFERENCE_SHARE: f64 = 0.2;

/// Where the reference comes from.
#[derive(Clone)]
pub enum ReferenceFrom {
    /// One picture or two halves.
    Files(Vec<PathBuf>),
    /// Two halves rendered with flags, this budget each; in words for the report.
    Rendered {
        /// Flags of `render`.
        flags: String,
        /// Budget of each half.
        budget: Budget,
    },
}

/// What is to be run.
pub struct Study {
    /// Configurations of one scene, the baseline first; their names differ.
    pub configs: Vec<Config>,
    /// What each run may spend.
    pub budget: Budget,
    /// Runs of each.
    pub seeds: u64,
    /// First seed, where a configuration has none of its own.
    pub first_seed: Option<u64>,
    /// The reference.
    pub reference: ReferenceFrom,
    /// Exposure of pictures, stops.
    pub exposure: f32,
    /// Whether progress is kept silent.
    pub quiet: bool,
}

/// What makes two configurations need scenes of their own.
type SceneKey = (Vec<(String, String)>, bool, Option<u64>, Option<[u32; 4]>, SimdChoice);

fn scene_key(c: &Config) -> SceneKey {
    let s = &c.args.scene;
    (s.define.clone(), s.strict, c.args.scale.map(f64::to_bits), c.args.crop, s.simd)
}

impl Study {
    /// Runs everything, or what it gets through until `stop` is set.
    pub fn run(&self, stop: &AtomicBool) -> Result<Comparison, Failure> {
        let (worlds, of_config) = self.prepare()?;
        let first = &worlds[of_config[0]];
        let (reference, reference_text, mut notes) = self.reference(first, stop)?;
        let mut done: Vec<Vec<Measured>> = self.configs.iter().map(|_| Vec::new()).collect();
        'seeds: for k in 0..self.seeds {
            let mut round = Vec::new();
            for (i, config) in self.configs.iter().enumerate() {
                let world = &worlds[of_config[i]];
                let seed = config.args.seed.or(self.first_seed).unwrap_or(world.seed).wrapping_add(k);
                let Some(one) = measured::run(world, config, seed, self.budget, &reference, stop)? else {
                    notes.push(format!(
                        "stopped by a signal in run {} of {}; whole rounds only are shown",
                        k + 1,
                        self.seeds
                    ));
                    break 'seeds;
                };
                self.say(&one, config, k);
                round.push(one);
            }
            done.iter_mut().zip(round).for_each(|(all, one)| all.push(one));
        }
        if done[0].is_empty() {
            return Err("stopped by a signal before every configuration had run once".into());
        }
        let name = self.configs[0].args.scene.scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let runs = done[0].len();
        let configurations: Vec<Configuration> =
            self.configs.iter().zip(done).map(|(c, all)| configuration(c, all)).collect();
        let mut comparison = Comparison {
            scene: name,
            equal: format!("{runs} {} of {} each", if runs == 1 { "run" } else { "runs" }, self.budget.text()),
            reference_text,
            reference,
            exposure: self.exposure,
            configurations,
            notes: Vec::new(),
        };
        notes.extend(self.caveats(&comparison));
        comparison.notes = notes;
        Ok(comparison)
    }

    /// The scenes that the configurations need, and which one each needs.
    fn prepare(&self) -> Result<(Vec<Prepared>, Vec<usize>), Failure> {
        let mut keys: Vec<SceneKey> = Vec::new();
        let mut worlds: Vec<Prepared> = Vec::new();
        let mut of_config = Vec::new();
        for c in &self.configs {
            let key = scene_key(c);
            if let Some(i) = keys.iter().position(|k| *k == key) {
                of_config.push(i);
                continue;
            }
            let Loaded { description, warnings } = session::describe(&c.args)?;
            let frame = (description.film.width as usize, description.film.height as usize);
            let (seed, window) = (description.seed, description.film.crop);
            if let Some(first) = worlds.first()
                && (first.frame, first.scene.film.crop) != (frame, window)
            {
                return Err(format!(
                    "configuration \"{}\" has another size of the picture than \"{}\"",
                    c.name, self.configs[0].name
                )
                .into());
            }
            let (scene, accel) = c.args.scene.build(description)?;
            if worlds.is_empty() {
                warnings.iter().for_each(tell);
                idle_lamps(&scene, &accel).iter().for_each(|w| tell(format_args!("warning: {w}")));
            }
            of_config.push(worlds.len());
            keys.push(key);
            worlds.push(Prepared { scene, accel, seed, frame });
        }
        Ok((worlds, of_config))
    }

    /// The reference, what it is in words, and what the reader should know of it.
    fn reference(&self, world: &Prepared, stop: &AtomicBool) -> Result<(Reference, String, Vec<String>), Failure> {
        let (flags, budget) = match &self.reference {
            ReferenceFrom::Files(files) => {
                let reference = session::read_reference(files, world.frame, world.scene.film.crop)?;
                let reference = reference.ok_or("no reference")?;
                let names: Vec<String> =
                    files.iter().map(|f| f.file_name().unwrap_or_default().to_string_lossy().into_owned()).collect();
                return Ok((reference, names.join(" and ") + kind(files.len()), Vec::new()));
            }
            ReferenceFrom::Rendered { flags, budget } => (flags, *budget),
        };
        let mut notes = Vec::new();
        let mut config = Config::new("reference", flags)?;
        let first = &self.configs[0].args;
        config.args.max_depth = config.args.max_depth.or(first.max_depth);
        (config.args.scale, config.args.crop, config.args.scene) = (first.scale, first.crop, first.scene.clone());
        if self.configs.iter().any(|c| c.args.max_depth != first.max_depth) {
            notes.push("the configurations differ in --max-depth; the reference has that of the first".into());
        }
        if !self.quiet {
            tell(format_args!("rendering two halves of a reference, {} each: {flags}", budget.text()));
        }
        let seed = |half: u64| hash(0x7265_6665_7265_6e63, hash(world.seed, half));
        let a = measured::render_only(world, &config, seed(0), budget, stop)?;
        let b = measured::render_only(world, &config, seed(1), budget, stop)?;
        if stop.load(Ordering::Relaxed) {
            return Err("stopped by a signal while the reference was rendered".into());
        }
        if a.1.min(b.1) == 0 {
            return Err(format!(
                "the reference did not get through one pass in {}; give it more by --reference-budget",
                budget.text()
            )
            .into());
        }
        let text = format!(
            "made with {flags}, two halves of {} and {} passes, {:.1} CPU s together (two halves: errors are free of their noise)",
            a.1,
            b.1,
            a.2 + b.2
        );
        Ok((Reference::new(&a.0, Some(&b.0))?, text, notes))
    }

    fn say(&self, one: &Measured, config: &Config, k: u64) {
        let Some(end) = one.run.points.last().filter(|_| !self.quiet) else { return };
        tell(format_args!(
            "run {}/{}  {}: relMSE {}, {} passes, {:.2} CPU s",
            k + 1,
            self.seeds,
            config.name,
            error(end.relmse),
            end.passes,
            end.cpu_seconds
        ));
    }

    /// What limits how far the numbers can be trusted.
    fn caveats(&self, comparison: &Comparison) -> Vec<String> {
        let mut notes = Vec::new();
        let runs = comparison.configurations.iter().flat_map(|c| &c.runs);
        let smallest = runs.clone().filter_map(|r| r.points.last()).map(|p| p.relmse).fold(f64::INFINITY, f64::min);
        if let Some(own) = comparison.self_error()
            && own > REFERENCE_SHARE * smallest
        {
            notes.push(format!(
                "the reference's own relMSE is {}, that of the best run {}: differences are noisier than their intervals say",
                error(own),
                error(smallest)
            ));
        }
        if self.seeds < 2 {
            notes.push("one run each: bias and variance cannot be told apart, and nothing has an interval".into());
        }
        if runs.clone().any(|r| r.points.last().is_some_and(|p| p.passes == 0)) {
            notes.push("a run ended within its first pass: parts of its picture are coarse".into());
        }
        if let Budget::Passes(n) = self.budget
            && self.configs.iter().any(|c| c.passes().is_some_and(|own| own < n))
        {
            notes.push("a configuration ends its runs earlier by its own number of passes".into());
        }
        notes
    }
}

fn kind(files: usize) -> &'static str {
    if files > 1 {
        " (two halves: errors are free of their noise)"
    } else {
        " (one picture: its noise is part of the errors)"
    }
}

fn configuration(config: &Config, all: Vec<Measured>) -> Configuration {
    let first = all.first();
    let maps = first.map(|m| m.maps.clone()).unwrap_or_default();
    let remarks = first.map(|m| m.remarks.clone()).unwrap_or_default();
    Configuration {
        name: config.name.clone(),
        flags: if config.flags.is_empty() { "(defaults)".into() } else { config.flags.clone() },
        integrator: first.map(|m| m.integrator.to_string()).unwrap_or_default(),
        maps,
        remarks,
        runs: all.into_iter().map(|m| m.run).collect(),
    }
}
