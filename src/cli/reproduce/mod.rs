//! `dualux reproduce`: a paper's tables beside ours, as ratios.
//!
//! A paper is a list of experiments, each a comparison of configurations ([`super::compare`]), and a file that knows what the paper
//! says and which of our numbers stand beside it. What cannot be run is said before anything is, and its figures are `null`.
//!
//! - [`nabata`]: probabilistic visibility for many lights
//! - [`namae_makino`]: adaptive photon mapping by automatic differentiation
//! - [`tokuyoshi`]: stochastic light culling; its halls of lamps come from [`lamps`]
//! - [`yue`]: a cache of gather rays, whose frames are measured without a comparison

mod lamps;
mod nabata;
mod namae_makino;
mod saturation;
mod scaling;
mod tokuyoshi;
mod yue;

use super::compare::budget::Budget;
use super::compare::configuration::Config;
use super::compare::study::{ReferenceFrom, Study};
use super::load::{SceneArgs, SimdChoice};
use super::{Failure, options, print, session, tell};
use crate::image::atomic;
use crate::report::comparison::{Comparison, Summary};
use crate::report::html;
use crate::report::table::Table;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Run a paper's comparisons again and print its figures beside ours.
#[derive(Debug, clap::Args)]
pub struct ReproduceArgs {
    /// The paper.
    #[arg(value_enum)]
    paper: Paper,
    /// Scene file (namae-makino; nabata has a list of its own).
    #[arg(default_value = "scenes/cornell-spheres.xml")]
    scene: PathBuf,
    /// Scene of the caustic alone.
    #[arg(long, value_name = "FILE", default_value = "scenes/caustic-ring.xml")]
    caustic_scene: PathBuf,
    /// Reference image of the scene, or two independent halves of one [default: one is rendered with `path`].
    #[arg(long, value_name = "FILE", num_args = 1..=2)]
    reference: Vec<PathBuf>,
    /// CPU time; namae-makino: runs for the caustic alone get a tenth, each half of their references 2.5 times, and each half of
    /// a rendered reference four times it. nabata: half that of each half of a reference.
    #[arg(long, default_value = "20s", value_parser = options::duration)]
    budget: Duration,
    /// Run these experiments of a paper only, by their names; the figures of others are null.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Runs of each configuration, with as many seeds.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,
    /// Scale the image's size, and numbers of photons with its area.
    #[arg(long, value_parser = options::factor)]
    scale: Option<f64>,
    /// Most lamps of the curve of costs (tokuyoshi).
    #[arg(long, value_name = "N", default_value = "1M", value_parser = options::positive)]
    most_lamps: u64,
    /// Write a report of each experiment to this folder.
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Write all numbers to this file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Number of threads [default: one per core].
    #[arg(short = 't', long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Show nothing but the tables, warnings and errors.
    #[arg(short, long)]
    quiet: bool,
}

/// Papers that can be reproduced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Paper {
    /// Nabata, Iwasaki, Dobashi & Nishita: probabilistic visibility for many-light rendering.
    Nabata,
    /// Namae & Makino: adaptive photon mapping by automatic differentiation.
    NamaeMakino,
    /// Tokuyoshi & Harada: stochastic light culling.
    Tokuyoshi,
    /// Yue, Onoue & Nishita: extended irradiance caching.
    Yue,
}

/// One comparison of a paper.
struct Experiment {
    /// Name, for messages, JSON and files.
    name: &'static str,
    /// Scene file (namae-makino; nabata has a list of its own).
    scene: PathBuf,
    /// Name and flags of each configuration, the baseline first.
    configs: Vec<(&'static str, String)>,
    /// What each run may spend.
    budget: Budget,
    /// Runs of each.
    seeds: u64,
    /// What is true.
    reference: ReferenceFrom,
}

/// What came of an experiment.
struct Outcome {
    name: &'static str,
    comparison: Comparison,
    summaries: Vec<Summary>,
}

/// What came of all.
struct Outcomes(Vec<Outcome>);

impl Outcomes {
    /// The numbers of a configuration.
    fn get(&self, experiment: &str, configuration: &str) -> Option<&Summary> {
        self.all(experiment).iter().find(|s| s.name == configuration)
    }

    /// The numbers of all configurations; none if the experiment could not be run.
    fn all(&self, experiment: &str) -> &[Summary] {
        self.0.iter().find(|o| o.name == experiment).map_or(&[], |o| &o.summaries)
    }
}

/// What a paper's file makes of the outcomes.
#[derive(Default)]
struct Findings {
    /// Tables with their titles.
    tables: Vec<(String, Table)>,
    /// What is doubtful in the paper.
    doubts: Vec<&'static str>,
    /// Figures by name; `None` where they could not be had.
    figures: Vec<(&'static str, Option<f64>)>,
    /// Measured curves by name, for JSON.
    curves: Vec<(&'static str, Value)>,
    /// Plots with their titles, as SVG.
    plots: Vec<(String, String)>,
}

/// Runs the command.
pub fn run(args: &ReproduceArgs) -> Result<(), Failure> {
    if let Some(folder) = &args.output
        && !folder.is_dir()
    {
        return Err(format!("{}: no such folder", folder.display()).into());
    }
    args.json.as_deref().map_or(Ok(()), atomic::check)?;
    let scratch = tokuyoshi::Scratch::new();
    let (name, (experiments, missing)) = match args.paper {
        Paper::NamaeMakino => ("namae-makino", (namae_makino::experiments(args)?, Vec::new())),
        Paper::Tokuyoshi => ("tokuyoshi", (tokuyoshi::experiments(args, &scratch)?, Vec::new())),
        Paper::Nabata => ("nabata", nabata::experiments(args)),
        Paper::Yue => ("yue", (Vec::new(), Vec::new())),
    };
    let measured_alone = experiments.is_empty();
    let experiments = chosen(experiments, &args.only)?;
    let stop = session::stop_on_signals()?;
    let (ready, mut unavailable) = prepare(args, experiments);
    unavailable.extend(missing);
    for (experiment, reason) in &unavailable {
        tell(format_args!("warning: {experiment} cannot be run: {reason}"));
    }
    if ready.is_empty() && !measured_alone {
        return Err(format!("nothing of {name} can be run by this version").into());
    }
    let mut outcomes = Outcomes(Vec::new());
    for (experiment, study) in ready {
        if !args.quiet {
            tell(format_args!("{experiment}:"));
        }
        outcomes.0.push(execute(experiment, &study, &stop)?);
    }
    let findings = match args.paper {
        Paper::NamaeMakino => namae_makino::findings(&outcomes),
        Paper::Tokuyoshi => tokuyoshi::findings(&outcomes, args, &scratch)?,
        Paper::Nabata => nabata::findings(&outcomes),
        Paper::Yue => yue::findings(args)?,
    };
    if let Some(folder) = &args.output {
        for o in &outcomes.0 {
            let path = folder.join(format!("{name}-{}.html", o.name));
            atomic::write_file(&path, html::page(&o.comparison, &o.summaries).as_bytes())?;
        }
        let path = folder.join(format!("{name}.html"));
        atomic::write_file(&path, html::summary(name, &findings.tables, &findings.plots).as_bytes())?;
    }
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&to_json(name, &findings, &outcomes, &unavailable))? + "\n";
        atomic::write_file(path, text.as_bytes())?;
    }
    print(text(&findings))?;
    for o in &outcomes.0 {
        o.comparison.notes.iter().for_each(|n| tell(format_args!("note: {}: {n}", o.name)));
    }
    Ok(())
}

/// Studies of those experiments that this version has the flags for, and reasons for the others.
#[allow(clippy::type_complexity)] // two lists of named things
fn prepare(
    args: &ReproduceArgs,
    experiments: Vec<Experiment>,
) -> (Vec<(&'static str, Study)>, Vec<(&'static str, String)>) {
    let (mut ready, mut unavailable) = (Vec::new(), Vec::new());
    for e in experiments {
        let name = e.name;
        match study(args, e) {
            Ok(study) => ready.push((name, study)),
            Err(reason) => unavailable.push((name, reason)),
        }
    }
    (ready, unavailable)
}

/// The experiments that are asked for by name; all if none is.
fn chosen(experiments: Vec<Experiment>, only: &[String]) -> Result<Vec<Experiment>, Failure> {
    let names: Vec<&str> = experiments.iter().map(|e| e.name).collect();
    if let Some(unknown) = only.iter().find(|o| !names.contains(&o.as_str())) {
        return Err(format!("--only {unknown}: there is no such experiment; there are: {}", names.join(", ")).into());
    }
    let wanted = |e: &Experiment| only.is_empty() || only.iter().any(|o| o == e.name);
    Ok(experiments.into_iter().filter(wanted).collect())
}

fn study(args: &ReproduceArgs, e: Experiment) -> Result<Study, String> {
    let scene =
        SceneArgs { scene: e.scene, define: Vec::new(), strict: false, threads: args.threads, simd: SimdChoice::Auto };
    let checked = |name: &str, flags: &str| Config::new(name, flags).map_err(|e| format!("\"{flags}\": {e}"));
    let mut configs = Vec::new();
    for (name, flags) in &e.configs {
        let mut config = checked(name, flags)?.with_scene(&scene);
        config.args.scale = config.args.scale.or(args.scale);
        configs.push(config);
    }
    if let ReferenceFrom::Rendered { flags, .. } = &e.reference {
        checked("reference", flags)?;
    }
    Ok(Study {
        configs,
        budget: e.budget,
        seeds: e.seeds,
        first_seed: None,
        reference: e.reference,
        exposure: 0.0,
        quiet: args.quiet,
    })
}

fn execute(name: &'static str, study: &Study, stop: &AtomicBool) -> Result<Outcome, Failure> {
    let comparison = study.run(stop)?;
    if stop.load(Ordering::Relaxed) {
        return Err("stopped by a signal".into());
    }
    let summaries = comparison.summaries();
    Ok(Outcome { name, comparison, summaries })
}

fn text(findings: &Findings) -> String {
    let mut text = String::new();
    for (title, table) in &findings.tables {
        text += &format!("{title}\n\n{}\n", table.text());
    }
    for doubt in &findings.doubts {
        text += &format!("doubtful in the paper: {doubt}\n");
    }
    text.push('\n');
    for (name, value) in &findings.figures {
        text += &format!("{name}: {}\n", value.map_or("not available".into(), |v| format!("{v:.4}")));
    }
    text
}

fn to_json(
    paper: &str,
    findings: &Findings,
    outcomes: &Outcomes,
    unavailable: &[(&'static str, String)],
) -> Map<String, Value> {
    let mut out = Map::new();
    out.insert("paper".into(), json!(paper));
    out.insert("version".into(), json!(env!("CARGO_PKG_VERSION")));
    for (name, value) in &findings.figures {
        out.insert((*name).into(), json!(value));
    }
    for (name, curve) in &findings.curves {
        out.insert((*name).into(), curve.clone());
    }
    let tables = findings.tables.iter().map(|(title, t)| json!({"title": title, "header": t.header, "rows": t.rows}));
    out.insert("tables".into(), tables.collect());
    out.insert("doubtful_in_the_paper".into(), json!(findings.doubts));
    let missing: Map<String, Value> = unavailable.iter().map(|(n, r)| (n.to_string(), json!(r))).collect();
    out.insert("unavailable".into(), missing.into());
    let experiment = |o: &Outcome| {
        let c = &o.comparison;
        let details = json!({
            "scene": c.scene, "equal": c.equal, "reference": c.reference_text, "notes": c.notes, "configurations": o.summaries,
        });
        (o.name.to_string(), details)
    };
    let experiments: Map<String, Value> = outcomes.0.iter().map(experiment).collect();
    out.insert("experiments".into(), experiments.into());
    out
}

/// The file's name checked early, so that a long run does not end in an unknown scene.
fn existing(path: &Path) -> Result<PathBuf, Failure> {
    match path.metadata() {
        Ok(_) => Ok(path.to_owned()),
        Err(e) => Err(format!("{}: {e}", path.display()).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Wrapper {
        #[command(flatten)]
        args: ReproduceArgs,
    }

    fn arguments() -> ReproduceArgs {
        Wrapper::parse_from(["reproduce", "namae-makino", "--scale", "0.05"]).args
    }

    fn experiment(name: &'static str, flags: &str) -> Experiment {
        Experiment {
            name,
            scene: Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box.xml"),
            configs: vec![("a", "--integrator path".into()), ("b", flags.into())],
            budget: Budget::Passes(2),
            seeds: 2,
            reference: ReferenceFrom::Rendered { flags: "--integrator path".into(), budget: Budget::Passes(8) },
        }
    }

    #[test]
    fn experiments_can_be_chosen_by_name() {
        let list = || vec![experiment("first", ""), experiment("second", "")];
        let names = |only: &[&str]| -> Vec<&'static str> {
            let only: Vec<String> = only.iter().map(|o| o.to_string()).collect();
            chosen(list(), &only).unwrap().iter().map(|e| e.name).collect()
        };
        assert_eq!(names(&[]), ["first", "second"]);
        assert_eq!(names(&["second"]), ["second"]);
        let unknown = chosen(list(), &["third".into()]).err().expect("no such experiment").to_string();
        assert!(unknown.contains("third") && unknown.contains("first, second"), "{unknown}");
    }

    #[test]
    fn what_can_be_run_is_run_and_the_rest_is_told() {
        let mut args = arguments();
        args.quiet = true;
        let list = vec![
            experiment("known", "--integrator path --max-depth 3"),
            experiment("unknown", "--integrator path --no-such-flag 3"),
        ];
        let (ready, unavailable) = prepare(&args, list);
        assert_eq!((ready.len(), unavailable.len()), (1, 1));
        assert!(unavailable[0].0 == "unknown" && unavailable[0].1.contains("--no-such-flag"), "{unavailable:?}");
        let outcome = execute(ready[0].0, &ready[0].1, &AtomicBool::new(false)).unwrap();
        let outcomes = Outcomes(vec![outcome]);
        assert!(outcomes.get("known", "b").is_some_and(|s| s.passes == 2.0));
        assert!(outcomes.get("known", "c").is_none() && outcomes.get("unknown", "a").is_none());

        let findings = Findings {
            tables: vec![("Title".into(), Table { header: vec!["x".into()], rows: vec![] })],
            doubts: vec!["a slip"],
            figures: vec![("known_figure", Some(2.0)), ("unknown_figure", None)],
            curves: vec![("curve", json!([1, 2]))],
            plots: Vec::new(),
        };
        let said = text(&findings);
        assert!(said.contains("a slip") && said.contains("unknown_figure: not available"), "{said}");
        let json = to_json("paper", &findings, &outcomes, &unavailable);
        assert_eq!((&json["known_figure"], &json["unknown_figure"]), (&json!(2.0), &Value::Null));
        assert_eq!(json["curve"], json!([1, 2]));
        assert_eq!(json["experiments"]["known"]["configurations"].as_array().unwrap().len(), 2);
        assert!(json["unavailable"]["unknown"].as_str().unwrap().contains("--no-such-flag"));
    }
}
