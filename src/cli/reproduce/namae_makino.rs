//! Namae & Makino: photon emission, area lights and antialiasing steered by automatic differentiation.
//!
//! Ablation  Table 1 of the paper: everything uniform (16 light samples at every point, 16 samples in every pixel), then the
//!           adaptive parts one after the other, beside plain Owen-Sobol sampling at several settings, which the paper does not
//!           have. CPU time to one error that all reach, as ratios. Pictures with 16 samples in every pixel take
//!           [`FULL_PASSES`] passes, the others [`PASSES`]
//! Shares    pixels that take many samples for light, and for antialiasing: with the other part off, two passes, since
//!           pixels on edges get their samples in the second one
//! Loss      FLIP of direct light between adaptive samples and many uniform ones, beside that of one uniform pass
//! Photons   a fifth of the photons, adaptive, against all of them, uniform, each with the kernel that suits it best of several; only
//!           what photons bring is shown
//! Caustic   the caustic alone at equal CPU time, adaptive against uniform with its best kernel
//!
//! The paper's seconds are quoted as ratios only. Its numbers of photons (25,000 and 500,000; a fifth of them) are ours per pass.

#[cfg(test)]
mod tests;

use super::{Experiment, Findings, Outcomes, ReproduceArgs, existing};
use crate::cli::Failure;
use crate::cli::compare::budget::Budget;
use crate::cli::compare::study::ReferenceFrom;
use crate::report::comparison::Summary;
use crate::report::curve::{arrival, drawable};
use crate::report::table::{NOTHING, Table, count, error, gain};
use serde_json::Value;

/// Caustic and global photons of the paper's uniform and adaptive pictures.
const PAPER_PHOTONS: [[f64; 2]; 2] = [[25_000.0, 500_000.0], [5_000.0, 100_000.0]];
/// Pixels of the paper's picture, and those of them with many samples for light and for antialiasing.
const PAPER_PIXELS: [f64; 3] = [135_000.0, 10_384.0, 3_386.0];
/// The ablation: our name, what the paper calls its row, its seconds.
const PAPER_SECONDS: [(&str, &str, f64); 5] = [
    (UNIFORM, "conventional", 15_538.0),
    (PHOTONS, "photons", 11_056.0),
    (LIGHT, "area light", 2_159.0),
    (BOTH, "photons and area light", 1_272.0),
    (ALL, "all", 121.0),
];
const UNIFORM: &str = "uniform";
const PHOTONS: &str = "photons adaptive";
const LIGHT: &str = "light adaptive";
const BOTH: &str = "photons and light";
const ALL: &str = "all adaptive";
/// Owen-Sobol sampling, with one and with sixteen light samples, and with the photons of the adaptive pictures.
const SOBOL: [&str; 3] = ["Owen-Sobol", "Owen-Sobol, 16 light samples", "Owen-Sobol, few photons"];
/// A fifth of the photons with the kernels of their footprints, as they are and wider: as uniform emission chooses its kernel, so do they.
const FIFTH: [(&str, &str); 3] =
    [("adaptive, 1/5", "ad"), ("adaptive, 1/5, kernels x 1.25", "ad:1.25"), ("adaptive, 1/5, kernels x 1.5", "ad:1.5")];

/// Passes of pictures that do not take 16 samples in every pixel, at most.
const PASSES: u64 = 8;
/// Passes of pictures that do. After one the adaptive picture is better at once, and no time to an equal error could be read.
const FULL_PASSES: u64 = 2;
/// What of the budget runs for the caustic alone get: at the usual one two seconds, in which the adaptive run, its partition charged, ends several
/// passes.
const SHARE_OF_CAUSTIC: u32 = 10;
/// Passes of each half of the reference that the loss is measured against.
const PASSES_OF_LOSS: u64 = 2;

/// Uniform emission with each kernel it may choose from; radii in units of the paper's box. In the first pass a progressive kernel is a fixed one.
const UNIFORM_KERNELS: [(&str, &str); 7] = [
    ("uniform, 50 nearest", "knn:50"),
    ("uniform, 200 nearest", "knn:200"),
    ("uniform, 1000 nearest", "knn:1000"),
    ("uniform, fixed", "fixed"),
    ("uniform, fixed 0.05", "fixed:0.05"),
    ("uniform, fixed 0.1", "fixed:0.1"),
    ("uniform, fixed 0.2", "fixed:0.2"),
];
/// The same where passes go on.
const PROGRESSIVE_KERNELS: [(&str, &str); 6] = [
    ("uniform, 5 nearest", "knn:5"),
    ("uniform, 10 nearest", "knn:10"),
    ("uniform, 20 nearest", "knn:20"),
    ("uniform, 50 nearest", "knn:50"),
    ("uniform, fixed", "fixed"),
    ("uniform, progressive", "progressive"),
];

const DOUBTS: [&str; 2] = [
    "15,538 stands for the seconds of the conventional picture and for its stored caustic photons; one is probably a slip. No ratio \
     to it is quoted (the text's \"below 1/100\" would mean 12,100 s and more)",
    "the conventional picture oversamples every pixel for light and antialiasing; Owen-Sobol sampling beside it is the harder baseline",
];

/// The experiments.
pub fn experiments(args: &ReproduceArgs) -> Result<Vec<Experiment>, Failure> {
    let (scene, ring) = (existing(&args.scene)?, existing(&args.caustic_scene)?);
    let area = args.scale.map_or(1.0, |s| s * s);
    let photons = |[caustic, global]: [f64; 2]| {
        let n = |v: f64| (v * area).round().max(1.0);
        format!("--caustic-photons {} --photons {}", n(caustic), n(global))
    };
    let [many, few] = PAPER_PHOTONS.map(photons);
    let base = "--integrator photon --indirect photons";
    let uniform = format!("{base} --emission uniform --kernel knn {many}");
    let adaptive = format!("{base} --emission adaptive --kernel ad {few}");
    let full = "--light-sampling full --aa full";

    let ablation = Experiment {
        name: "ablation",
        scene: scene.clone(),
        configs: vec![
            (UNIFORM, format!("{uniform} {full} --passes {FULL_PASSES}")),
            (PHOTONS, format!("{adaptive} {full} --passes {FULL_PASSES}")),
            (LIGHT, format!("{uniform} --light-sampling adaptive --aa full --passes {FULL_PASSES}")),
            (BOTH, format!("{adaptive} --light-sampling adaptive --aa full --passes {FULL_PASSES}")),
            (ALL, format!("{adaptive} --light-sampling adaptive --aa adaptive")),
            (SOBOL[0], format!("{uniform} --light-sampling single --aa off")),
            (SOBOL[1], format!("{uniform} --light-sampling full --aa off")),
            (SOBOL[2], format!("{base} --emission uniform --kernel ad {few} --light-sampling single --aa off")),
        ],
        budget: Budget::Passes(PASSES),
        seeds: args.seeds,
        reference: match args.reference.as_slice() {
            [] => rendered("--integrator path", Budget::Time(args.budget.saturating_mul(4))),
            files => ReferenceFrom::Files(files.to_vec()),
        },
    };
    let shares = Experiment {
        name: "shares",
        scene: scene.clone(),
        configs: vec![
            ("light", format!("{adaptive} --light-sampling adaptive --aa off")),
            ("antialiasing", format!("{adaptive} --light-sampling single --aa adaptive")),
        ],
        budget: Budget::Passes(2),
        seeds: 1,
        // Nothing is measured against it.
        reference: rendered("--integrator path", Budget::Passes(1)),
    };
    let direct = format!("{base} --emission uniform --only direct");
    let loss = Experiment {
        name: "loss",
        scene: scene.clone(),
        configs: vec![
            (UNIFORM, format!("{direct} {full} --passes 1")),
            (ALL, format!("{direct} --light-sampling adaptive --aa adaptive")),
        ],
        budget: Budget::Passes(PASSES),
        seeds: 1,
        reference: rendered(&format!("{direct} {full}"), Budget::Passes(PASSES_OF_LOSS)),
    };

    let layers = "--only caustic,indirect --light-sampling single --aa off";
    let mut configs: Vec<(&'static str, String)> = UNIFORM_KERNELS
        .iter()
        .map(|(name, kernel)| (*name, format!("{base} --emission uniform --kernel {kernel} {many} {layers}")))
        .collect();
    configs.extend(
        FIFTH
            .iter()
            .map(|(name, kernel)| (*name, format!("{base} --emission adaptive --kernel {kernel} {few} {layers}"))),
    );
    // Indirect light by paths, without kernels that blur; 24 passes of 25 times the caustic photons, twice: 1200 x the photons.
    let truth = photons([25.0 * PAPER_PHOTONS[0][0], PAPER_PHOTONS[0][1]]);
    let truth = format!("--integrator photon --indirect gather --emission uniform {truth} {layers}");
    let fifth = Experiment {
        name: "photons",
        scene: scene.clone(),
        configs,
        budget: Budget::Passes(1),
        seeds: args.seeds,
        reference: rendered(&truth, Budget::Passes(24)),
    };

    let caustic = |name: &'static str, scene| {
        let layer = "--integrator photon --only caustic --aa off";
        let mut configs: Vec<(&'static str, String)> = PROGRESSIVE_KERNELS
            .iter()
            .map(|(name, kernel)| (*name, format!("{layer} --emission uniform --kernel {kernel}")))
            .collect();
        configs.push(("adaptive", format!("{layer} --emission adaptive --kernel ad")));
        let truth = format!("{layer} --emission uniform");
        Experiment {
            name,
            scene,
            configs,
            budget: Budget::Time(args.budget / SHARE_OF_CAUSTIC),
            seeds: args.seeds,
            // 25 times a run's time for each half, which are independent: the noise of the reference is not counted.
            reference: rendered(&truth, Budget::Time(args.budget.saturating_mul(5) / 2)),
        }
    };
    Ok(vec![ablation, shares, loss, fifth, caustic("caustic", ring), caustic("caustic-of-the-scene", scene)])
}

fn rendered(flags: &str, budget: Budget) -> ReferenceFrom {
    ReferenceFrom::Rendered { flags: flags.into(), budget }
}

/// The tables and figures.
pub fn findings(outcomes: &Outcomes) -> Findings {
    let speedup_all = outcomes.get("ablation", ALL).and_then(|s| s.speed_up.as_ref()).map(|g| g.ratio);
    let light_share = outcomes.get("shares", "light").and_then(light_share);
    let aa_share = outcomes.get("shares", "antialiasing").map(|s| s.favoured_pixels);
    let fifth = FIFTH.map(|(name, _)| outcomes.get("photons", name).map(|s| s.relmse.mean));
    let uniform = best_uniform(outcomes.all("photons")).map(|best| best.relmse.mean);
    let of_uniform = |ours: Option<f64>| Some(ours? / uniform?);
    let photon_ratio = of_uniform(fifth.into_iter().flatten().min_by(f64::total_cmp));
    let caustic = |experiment| {
        // A run that did not end its first pass shows blocks, and says nothing of emission.
        let ended = |s: &&Summary| s.passes >= 1.0;
        let adaptive = outcomes.get(experiment, "adaptive").filter(ended)?.relmse.mean;
        let uniform: Vec<Summary> = outcomes.all(experiment).iter().filter(ended).cloned().collect();
        best_uniform(&uniform).map(|best| best.relmse.mean / adaptive)
    };
    let figures = vec![
        ("speedup_all", speedup_all),
        ("light_share", light_share),
        ("aa_share", aa_share),
        ("photon_error_ratio_at_one_fifth", photon_ratio),
        ("photon_error_ratio_at_one_fifth_with_usual_kernels", of_uniform(fifth[0])),
        ("caustic_relmse_gain_equal_time", caustic("caustic")),
        ("caustic_relmse_gain_equal_time_in_the_scene", caustic("caustic-of-the-scene")),
        ("speedup_over_owen_sobol", speedup_all.and_then(|_| speedup_over_best(outcomes.all("ablation")))),
        ("flip_against_full_sampling", outcomes.get("loss", ALL).map(|s| s.flip)),
        ("flip_of_one_uniform_pass", outcomes.get("loss", UNIFORM).map(|s| s.flip)),
    ];
    let mut tables = Vec::new();
    if !outcomes.all("ablation").is_empty() {
        tables.push(ablation_table(outcomes.all("ablation")));
    }
    if light_share.is_some() || aa_share.is_some() {
        tables.push(share_table(light_share, aa_share));
    }
    for (experiment, title) in [
        ("photons", "Only what photons bring, one pass"),
        ("caustic", "The caustic alone, equal CPU time"),
        ("caustic-of-the-scene", "The caustic of the main scene alone, equal CPU time"),
    ] {
        if !outcomes.all(experiment).is_empty() {
            tables.push((title.to_string(), error_table(outcomes.all(experiment))));
        }
    }
    Findings { tables, doubts: DOUBTS.to_vec(), figures, curves: Vec::new(), plots: Vec::new() }
}

/// Time of the fastest Owen-Sobol setting over that of all adaptive parts, to the lowest error that both reach.
fn speedup_over_best(all: &[Summary]) -> Option<f64> {
    let curve = |s: &Summary| drawable(&s.curve, |p| p.cpu_seconds);
    let ours = curve(all.iter().find(|s| s.name == ALL)?);
    let others = all.iter().filter(|s| SOBOL.contains(&s.name.as_str())).map(curve);
    let ratio = |other: Vec<(f64, f64)>| {
        let error = ours.last()?.1.max(other.last()?.1);
        Some(arrival(&other, error)?.0 / arrival(&ours, error)?.0)
    };
    others.filter_map(ratio).min_by(f64::total_cmp)
}

/// Points with many light samples, of all samples: one per pixel where antialiasing is off.
fn light_share(s: &Summary) -> Option<f64> {
    // By the name that the integrator gives it in the counts.
    let counts = serde_json::to_value(s.counts).ok()?;
    let many = counts.pointer("/direct/oversampled").and_then(Value::as_f64)?;
    (s.counts.samples > 0).then(|| many / s.counts.samples as f64)
}

/// The configuration of uniform emission with the lowest error.
fn best_uniform(all: &[Summary]) -> Option<&Summary> {
    let uniform = all.iter().filter(|s| s.name.starts_with(UNIFORM) && s.relmse.mean > 0.0);
    uniform.min_by(|a, b| a.relmse.mean.total_cmp(&b.relmse.mean))
}

/// Seconds to the lowest error that all reach, the paper's and ours as ratios to photons alone.
fn ablation_table(all: &[Summary]) -> (String, Table) {
    let curve = |s: &Summary| drawable(&s.curve, |p| p.cpu_seconds);
    let common = all.iter().filter_map(|s| curve(s).last().map(|p| p.1)).fold(0.0, f64::max);
    let seconds = |name: &str| {
        let s = all.iter().find(|s| s.name == name)?;
        arrival(&curve(s), common).map(|(t, _)| t)
    };
    let paper_base = PAPER_SECONDS[1].2;
    let ratio = |v: Option<f64>| v.map_or(NOTHING.into(), |v: f64| format!("{v:.3}"));
    let row = |s: &Summary| {
        let paper = PAPER_SECONDS.iter().find(|p| p.0 == s.name);
        // The doubtful one is shown, and no ratio made of it.
        let doubtful = s.name == UNIFORM;
        vec![
            s.name.clone(),
            paper.map_or(NOTHING.into(), |p| format!("{:.0}{}", p.2, if doubtful { " (?)" } else { "" })),
            ratio(paper.filter(|_| !doubtful).map(|p| p.2 / paper_base)),
            ratio(seconds(&s.name)),
            ratio(seconds(&s.name).zip(seconds(PHOTONS)).map(|(a, b)| a / b)),
            s.speed_up.as_ref().map_or(NOTHING.into(), gain),
            error(s.relmse.mean),
            format!("{:+.2}", s.bias.percent),
        ]
    };
    let header = [
        "",
        "paper, s",
        "of photons only",
        "ours, CPU s",
        "of photons only",
        "speed-up over uniform (95 %)",
        "relMSE at the end",
        "bias of the mean, %",
    ];
    let table = Table { header: header.map(String::from).to_vec(), rows: all.iter().map(row).collect() };
    (format!("Ablation: time to a relMSE of {}", error(common)), table)
}

fn share_table(light: Option<f64>, aa: Option<f64>) -> (String, Table) {
    let percent = |v: f64| format!("{:.1} %", 100.0 * v);
    let row = |name: &str, paper: f64, ours: Option<f64>| {
        vec![name.to_string(), percent(paper / PAPER_PIXELS[0]), ours.map_or(NOTHING.into(), percent)]
    };
    let header = ["pixels with many samples", "paper", "ours"].map(String::from).to_vec();
    let rows = vec![row("for light", PAPER_PIXELS[1], light), row("for antialiasing", PAPER_PIXELS[2], aa)];
    ("Where samples go".into(), Table { header, rows })
}

fn error_table(all: &[Summary]) -> Table {
    let best = best_uniform(all).map(|s| s.relmse.mean);
    let row = |s: &Summary| {
        vec![
            s.name.clone(),
            count(s.photons),
            format!("{:.1}", s.passes),
            format!("{:.2}", s.cpu_seconds.mean),
            error(s.relmse.mean),
            s.relmse.sd.map_or(NOTHING.into(), error),
            s.relmse.bias_sq.map_or(NOTHING.into(), error),
            s.relmse.variance.map_or(NOTHING.into(), error),
            best.map_or(NOTHING.into(), |b| format!("{:.2}", s.relmse.mean / b)),
        ]
    };
    let header = ["", "photons", "passes", "CPU s", "relMSE", "sd", "bias squared", "variance", "of the best uniform"];
    Table { header: header.map(String::from).to_vec(), rows: all.iter().map(row).collect() }
}
