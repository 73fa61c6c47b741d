//! `dualux compare`: configurations of one scene at equal time, passes or photons, against a reference.
//!
//! - [`configuration`]: a configuration as a string of flags of `render`
//! - [`budget`]: how long each run goes on
//! - [`measured`]: one run, measured
//! - [`study`]: all runs, in turn, and their reference

pub mod budget;
pub mod configuration;
pub mod measured;
pub mod study;

use super::load::SceneArgs;
use super::{Failure, options, print, session, tell};
use crate::image::atomic;
use crate::report::comparison::{Comparison, Summary};
use crate::report::{html, table};
use budget::{Budget, Equal};
use configuration::{Config, DEFAULT};
use std::path::{Path, PathBuf};
use study::{ReferenceFrom, Study};

/// Compare configurations of one scene.
///
/// Runs every configuration several times with different seeds, at equal CPU time, passes or photons, measures the error against
/// a reference as it falls, and prints error, bias and variance, times, counts and the speed-up at equal error. The first
/// configuration is the baseline. An HTML file without network access shows pictures, curves, crops and error maps.
#[derive(Debug, clap::Args)]
pub struct CompareArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// A configuration: a name and flags of `render`; may be repeated [default: uniform against adaptive emission].
    #[arg(long = "config", value_name = "NAME: FLAGS", value_parser = Config::parse)]
    configs: Vec<Config>,
    /// What is equal among the runs.
    #[arg(long, value_enum, default_value_t = Equal::Time)]
    equal: Equal,
    /// What each run may spend: CPU time (10s), passes (64) or photons (1M), as --equal says.
    #[arg(long)]
    budget: Option<String>,
    /// Runs of each configuration, with as many seeds.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// The first seed [default: the file's, else 0].
    #[arg(long)]
    seed: Option<u64>,
    /// Reference image, or two independent halves of one [default: one is rendered with `path`].
    #[arg(long, value_name = "FILE", num_args = 1..=2)]
    reference: Vec<PathBuf>,
    /// What each half of a rendered reference may spend: CPU time with a unit (60s), or passes (1K)
    /// [default: 4 times a run's time, 8 times its passes, or 30 s].
    #[arg(long, value_name = "BUDGET", value_parser = Budget::of_reference, conflicts_with = "reference")]
    reference_budget: Option<Budget>,
    /// Render only this window of the image, in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = options::window)]
    crop: Option<[u32; 4]>,
    /// Scale the image's size.
    #[arg(long, value_parser = options::factor)]
    scale: Option<f64>,
    /// The report [default: the scene's name with -compare.html].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the numbers to this file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Exposure of the pictures in the report, in stops.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = options::stops)]
    exposure: f32,
    /// Show nothing but the table, warnings and errors.
    #[arg(short, long)]
    quiet: bool,
}

/// The JSON file.
#[derive(serde::Serialize)]
struct Json<'a> {
    version: &'static str,
    scene: &'a str,
    width: usize,
    height: usize,
    equal: Equal,
    budget: String,
    threads: usize,
    reference: ReferenceJson<'a>,
    notes: &'a [String],
    configurations: &'a [Summary],
}

#[derive(serde::Serialize)]
struct ReferenceJson<'a> {
    text: &'a str,
    halves: bool,
    self_error: Option<f64>,
}

/// Runs the command.
pub fn run(args: &CompareArgs) -> Result<(), Failure> {
    let budget = Budget::parse(args.equal, args.budget.as_deref())?;
    let configs = configurations(args)?;
    let output = output(args)?;
    let study = Study {
        configs,
        budget,
        seeds: args.seeds,
        first_seed: args.seed,
        reference: match args.reference.as_slice() {
            [] => ReferenceFrom::Rendered {
                flags: "--integrator path".into(),
                budget: args.reference_budget.unwrap_or(budget.for_half_a_reference()),
            },
            files => ReferenceFrom::Files(files.to_vec()),
        },
        exposure: args.exposure,
        quiet: args.quiet,
    };
    let stop = session::stop_on_signals()?;
    let comparison = study.run(&stop)?;
    let summaries = comparison.summaries();
    atomic::write_file(&output, html::page(&comparison, &summaries).as_bytes())?;
    if let Some(path) = &args.json {
        write_json(path, args.equal, budget, &comparison, &summaries)?;
    }
    let mut text = format!(
        "{}, {} x {} pixels, {}\nreference: {}\n\n",
        comparison.scene,
        comparison.reference.width,
        comparison.reference.height,
        comparison.equal,
        comparison.reference_text
    );
    text += &table::of_summaries(&summaries).text();
    print(text)?;
    comparison.notes.iter().for_each(|n| tell(format_args!("note: {n}")));
    for s in &summaries {
        s.remarks.iter().for_each(|r| tell(format_args!("note: {}: {r}", s.name)));
    }
    if args.quiet { Ok(()) } else { print(format!("\n{}\n", output.display())) }
}

/// The configurations, for the scene and film that are common to all.
fn configurations(args: &CompareArgs) -> Result<Vec<Config>, Failure> {
    let mut configs = args.configs.clone();
    if configs.is_empty() {
        for (name, flags) in DEFAULT {
            let config = Config::new(name, flags).map_err(|e| {
                format!("the default configuration \"{name}: {flags}\" cannot be run: {e}\n  give some by --config")
            })?;
            configs.push(config);
        }
    }
    for (i, c) in configs.iter().enumerate() {
        if configs[..i].iter().any(|other| other.name == c.name) {
            return Err(format!("two configurations are named \"{}\"", c.name).into());
        }
    }
    let common = |mut c: Config| {
        c.args.scale = c.args.scale.or(args.scale);
        c.args.crop = c.args.crop.or(args.crop);
        c.with_scene(&args.scene)
    };
    Ok(configs.into_iter().map(common).collect())
}

/// The report's name; fails before the work if a file cannot be written.
fn output(args: &CompareArgs) -> Result<PathBuf, Failure> {
    let stem = || args.scene.scene.file_stem().unwrap_or_else(|| "scene".as_ref()).to_string_lossy().into_owned();
    let output = args.output.clone().unwrap_or_else(|| format!("{}-compare.html", stem()).into());
    let kind = output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    if !matches!(kind.as_deref(), Some("html" | "htm")) {
        return Err(format!("{}: the report's name must end in .html", output.display()).into());
    }
    atomic::check(&output)?;
    args.json.as_deref().map_or(Ok(()), atomic::check)?;
    Ok(output)
}

fn write_json(
    path: &Path,
    equal: Equal,
    budget: Budget,
    comparison: &Comparison,
    summaries: &[Summary],
) -> Result<(), Failure> {
    let json = Json {
        version: env!("CARGO_PKG_VERSION"),
        scene: &comparison.scene,
        width: comparison.reference.width,
        height: comparison.reference.height,
        equal,
        budget: budget.text(),
        threads: rayon::current_num_threads(),
        reference: ReferenceJson {
            text: &comparison.reference_text,
            halves: comparison.reference.halves.is_some(),
            self_error: comparison.self_error(),
        },
        notes: &comparison.notes,
        configurations: summaries,
    };
    Ok(atomic::write_file(path, (serde_json::to_string_pretty(&json)? + "\n").as_bytes())?)
}
