//! Tokuyoshi & Harada: stochastic light culling.
//!
//! Path tracing  halls with 5,000 and 59,000 lamps ([`super::lamps`]) at equal CPU time: one light of all alike (the paper's "without"), one
//!               by power, culling, and what this renderer does by default, the light tree. Variance ratios beside the paper's
//! Saturation    lights that survive and noise against the number of lights at one bound of the error, deviation of single lights
//! Costs         time per pass and memory against the number of lamps, for all of them and for the photon integrator
//!
//! The paper's seconds and its GPU figures are not quoted: other machines, other scenes.

use super::lamps;
use super::saturation::{self, Saturation};
use super::scaling::{self, Cost};
use super::{Experiment, Findings, Outcomes, ReproduceArgs};
use crate::cli::compare::budget::Budget;
use crate::cli::compare::study::ReferenceFrom;
use crate::cli::{Failure, tell};
use crate::report::plot::{LogLog, Series};
use crate::report::table::{NOTHING, Table, error};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Experiments: name, number of lamps, gain of variance in the paper (RMSE 0.0749 -> 0.0464 and 0.0355 -> 0.0203, squared).
const HALLS: [(&str, u64, f64); 2] = [("lamps-5000", 5_000, 2.6), ("lamps-59000", 59_000, 3.1)];
const UNIFORM: &str = "one of all, alike";
const POWER: &str = "one by power";
const CULLING: &str = "culling";
const PLAIN: &str = "culling, uniform reservoir";
const TREE: &str = "light tree";
/// Budget of each half of a reference, in budgets of a run.
const REFERENCE: u32 = 8;

const DOUBTS: [&str; 2] = [
    "the listing of the roulette divides by the radiance's third over pi, the text by the intensity: the text is followed, with intensity = \
     radiance x area for a lamp that shines to one side",
    "RMSE 0.0017 of the picture without culling is that of interleaving and filter; what the reference is is not said",
];

/// A folder for scenes, removed at the end.
pub struct Scratch(PathBuf);

impl Scratch {
    /// The name of a folder, which is made when it is needed.
    pub fn new() -> Self {
        Scratch(std::env::temp_dir().join(format!("dualux-lamps-{}", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed from a folder for temporary files may stay.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The comparisons; the halls are kept in the folder of the reports, if there is one.
pub fn experiments(args: &ReproduceArgs, scratch: &Scratch) -> Result<Vec<Experiment>, Failure> {
    let folder: &Path = args.output.as_deref().unwrap_or(&scratch.0);
    std::fs::create_dir_all(&scratch.0).map_err(|e| format!("{}: {e}", scratch.0.display()))?;
    let flags = |selection: &str| format!("--integrator path --light-selection {selection}");
    let hall = |(name, n, _): (&'static str, u64, f64)| {
        let scene = lamps::write(folder, n).map_err(|e| format!("{}: {e}", folder.display()))?;
        Ok(Experiment {
            name,
            scene,
            configs: vec![
                (UNIFORM, flags("uniform")),
                (POWER, flags("power")),
                (CULLING, flags("culling")),
                (PLAIN, flags("culling --culling-reservoir uniform")),
                (TREE, flags("tree")),
            ],
            budget: Budget::Time(args.budget),
            seeds: args.seeds,
            reference: ReferenceFrom::Rendered {
                flags: flags("tree"),
                budget: Budget::Time(args.budget.saturating_mul(REFERENCE)),
            },
        })
    };
    HALLS.into_iter().map(hall).collect()
}

/// The tables and figures; measures saturation and costs.
pub fn findings(outcomes: &Outcomes, args: &ReproduceArgs, scratch: &Scratch) -> Result<Findings, Failure> {
    if !args.quiet {
        tell("saturation:");
    }
    let study = saturation::study()?;
    let mut costs = Vec::new();
    for n in scaling::COUNTS.into_iter().filter(|n| *n <= args.most_lamps) {
        if !args.quiet {
            tell(format_args!("costs of {n} lamps:"));
        }
        costs.push(scaling::measure(&scratch.0, n, args.scale)?);
    }
    Ok(report(outcomes, &study, &costs))
}

/// Variance of `without` over that of `with`, both at the same CPU time.
fn gain(outcomes: &Outcomes, experiment: &str, without: &str, with: &str) -> Option<f64> {
    let error = |name| outcomes.get(experiment, name).map(|s| s.relmse.mean).filter(|e| *e > 0.0);
    Some(error(without)? / error(with)?)
}

fn report(outcomes: &Outcomes, study: &saturation::Study, costs: &[Cost]) -> Findings {
    let gains = |name, without| gain(outcomes, name, without, CULLING);
    let figures = vec![
        ("max_light_sigma_over_epsilon", Some(study.max_sigma_over_epsilon)),
        ("variance_gain_5000", gains(HALLS[0].0, UNIFORM)),
        ("variance_gain_59000", gains(HALLS[1].0, UNIFORM)),
        ("variance_gain_over_power_5000", gains(HALLS[0].0, POWER)),
        ("variance_gain_over_power_59000", gains(HALLS[1].0, POWER)),
        ("variance_gain_over_light_tree_5000", gains(HALLS[0].0, TREE)),
        ("variance_gain_over_light_tree_59000", gains(HALLS[1].0, TREE)),
        ("survivors_65536_over_4096", survivors(study, 65_536).zip(survivors(study, 4096)).map(|(a, b)| a / b)),
        ("time_per_pass_exponent_path_tree", exponent(costs, scaling::RENDERS[0].0)),
        ("time_per_pass_exponent_path_culling", exponent(costs, scaling::RENDERS[2].0)),
        ("time_per_pass_exponent_photon", exponent(costs, scaling::RENDERS[3].0)),
    ];
    let mut tables = Vec::new();
    for (name, n, paper) in HALLS {
        if !outcomes.all(name).is_empty() {
            tables.push((format!("Path tracing with {n} lamps, equal CPU time"), hall_table(outcomes, name, paper)));
        }
    }
    tables.push((
        format!("Culling against the number of lights, bound of the error {}", error(study.epsilon)),
        saturation_table(&study.rows),
    ));
    if !costs.is_empty() {
        tables.push(("Costs against the number of lamps".into(), cost_table(costs)));
    }
    let curves = vec![("saturation", json!(study.rows)), ("costs", json!(costs))];
    Findings { tables, doubts: DOUBTS.to_vec(), figures, curves, plots: plots(study, costs) }
}

fn survivors(study: &saturation::Study, lights: usize) -> Option<f64> {
    study.rows.iter().find(|r| r.lights == lights).map(|r| r.survivors)
}

/// Seconds of a later pass.
fn later(cost: &Cost, render: &str) -> Option<f64> {
    cost.renders.iter().find(|r| r.0 == render).map(|r| r.3)
}

/// Slope of the time of a pass in the log-log plot, between the fewest and the most lamps: 1 is linear.
fn exponent(costs: &[Cost], render: &str) -> Option<f64> {
    let (first, last) = (costs.first()?, costs.last()?);
    let growth = later(last, render)? / later(first, render)?;
    (last.lamps > first.lamps).then(|| growth.ln() / (last.lamps as f64 / first.lamps as f64).ln())
}

fn hall_table(outcomes: &Outcomes, name: &str, paper: f64) -> Table {
    let header = ["", "passes", "CPU s", "relMSE", "of block means", "variance of the first over it", "paper"];
    let row = |s: &crate::report::comparison::Summary| {
        vec![
            s.name.clone(),
            format!("{:.0}", s.passes),
            format!("{:.2}", s.cpu_seconds.mean),
            error(s.relmse.mean),
            error(s.blocks),
            gain(outcomes, name, UNIFORM, &s.name).map_or(NOTHING.into(), |g| format!("{g:.2}")),
            if s.name == CULLING { format!("{paper:.1}") } else { NOTHING.into() },
        ]
    };
    Table { header: header.map(String::from).to_vec(), rows: outcomes.all(name).iter().map(row).collect() }
}

fn saturation_table(rows: &[Saturation]) -> Table {
    let header = [
        "lights",
        "met",
        "survivors",
        "sigma",
        "its bound",
        "error of the mean, %",
        "culled, us a point",
        "all, us a point",
    ];
    let row = |r: &Saturation| {
        vec![
            r.lights.to_string(),
            format!("{:.1}", r.met),
            format!("{:.1}", r.survivors),
            format!("{:.4}", r.sigma),
            format!("{:.4}", r.sigma_bound),
            format!("{:+.3}", 100.0 * r.mean_error),
            format!("{:.1}", r.culled_us),
            format!("{:.1}", r.all_us),
        ]
    };
    Table { header: header.map(String::from).to_vec(), rows: rows.iter().map(row).collect() }
}

fn cost_table(costs: &[Cost]) -> Table {
    let mut header: Vec<String> = ["lamps", "load, s", "light tree, s"].map(String::from).to_vec();
    for (name, _) in scaling::RENDERS {
        header.extend([format!("{name}: set-up, s"), "first pass, s".into(), "later passes, s".into()]);
    }
    header.push("memory, MiB".into());
    let row = |c: &Cost| {
        let mut row =
            vec![c.lamps.to_string(), format!("{:.2}", c.load_seconds), format!("{:.2}", c.light_tree_seconds)];
        row.extend(c.renders.iter().flat_map(|(_, a, b, c)| [a, b, c].map(|v| format!("{v:.3}"))));
        row.push(c.memory_mib.map_or(NOTHING.into(), |m| format!("{m:.0}")));
        row
    };
    Table { header, rows: costs.iter().map(row).collect() }
}

fn plots(study: &saturation::Study, costs: &[Cost]) -> Vec<(String, String)> {
    let line = |name: &str, points: Vec<(f64, f64)>| Series { name: name.into(), points, runs: Vec::new() };
    let draw = |x: &str, y: &str, series| LogLog { x_label: x.into(), y_label: y.into(), series, guide: false }.svg();
    let of = |value: fn(&Saturation) -> f64| study.rows.iter().map(|r| (r.lights as f64, value(r))).collect();
    let counts = vec![line("met", of(|r| r.met)), line("survivors", of(|r| r.survivors))];
    let noise = vec![line("measured", of(|r| r.sigma)), line("bound", of(|r| r.sigma_bound))];
    let seconds = |name: &str| -> Vec<(f64, f64)> {
        costs.iter().filter_map(|c| Some((c.lamps as f64, later(c, name)?))).collect()
    };
    let passes = scaling::RENDERS.iter().map(|(name, _)| line(name, seconds(name))).collect();
    let memory = costs.iter().filter_map(|c| Some((c.lamps as f64, c.memory_mib?))).filter(|p| p.1 > 0.0).collect();
    let mut out = vec![
        ("Lights at a point".to_string(), draw("lights", "at a point", counts)),
        ("Noise of a point".to_string(), draw("lights", "standard deviation", noise)),
    ];
    if costs.len() > 1 {
        out.push(("CPU seconds of a pass".into(), draw("lamps", "seconds", passes)));
        out.push(("Memory".into(), draw("lamps", "MiB", vec![line("resident", memory)])));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cost(lamps: u64, seconds: f64) -> Cost {
        let renders = scaling::RENDERS.iter().map(|(name, _)| (name.to_string(), 0.1, 0.2, seconds)).collect();
        Cost { lamps, load_seconds: 1.0, light_tree_seconds: 0.5, renders, memory_mib: Some(10.0) }
    }

    fn row(lights: usize, survivors: f64) -> Saturation {
        Saturation {
            lights,
            met: 2.0 * survivors,
            survivors,
            sigma: 0.1,
            sigma_bound: 0.2,
            mean_error: 0.001,
            culled_us: 1.0,
            all_us: 9.0,
        }
    }

    #[test]
    fn figures_follow_from_known_outcomes() {
        let study = saturation::Study {
            rows: vec![row(4096, 200.0), row(65_536, 220.0)],
            epsilon: 0.01,
            max_sigma_over_epsilon: 0.99,
        };
        let costs = [cost(100, 0.1), cost(10_000, 1.0)];
        let found = report(&Outcomes(Vec::new()), &study, &costs);
        let figure = |name: &str| found.figures.iter().find(|f| f.0 == name).unwrap().1;
        assert_eq!(figure("max_light_sigma_over_epsilon"), Some(0.99));
        assert_eq!(figure("variance_gain_5000"), None, "what was not run has no figure");
        assert!((figure("survivors_65536_over_4096").unwrap() - 1.1).abs() < 1e-12);
        assert!((figure("time_per_pass_exponent_photon").unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(found.curves[1].1[1]["lamps"], json!(10_000));
        assert_eq!((found.tables.len(), found.plots.len()), (2, 4));
        let width = found.tables[1].1.header.len();
        assert!(found.tables[1].1.rows.iter().all(|r| r.len() == width));
    }
}
