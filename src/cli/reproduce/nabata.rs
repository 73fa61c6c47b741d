//! Nabata, Iwasaki, Dobashi, Nishita: probabilistic visibility for many-light rendering.
//!
//! Equal   every strategy with the same virtual lights, one pass: rays per point, saved rays (tables 1 and 2 of the paper), time, error against
//!         `exact` with the same lights and samples (conditional), error against paths (total), share of pairs at the clamps
//! Saved   as table 2 counts, of one ray for every light, back to back or not (Hairball: 37,371 rays for 100,000 lights are called 63 % saved). By
//!         Veach's rule lights that cannot contribute get none, by the paper's clamp a tenth of them do: ours asks no such lights, so that
//!         tenth is added. Beside it the share of those rays that `exact` here traces. Without the rays of the cache
//! Ratio   of what the rays of `exact` cost to all else that it does, from the time of `residual`, which traces next to none: a lower bound, since
//!         look-ups and coins that `exact` does without count as all else. Beside it the speed-up of `nabata`, which is to grow with it
//! Own     strategies whose cost does not grow with the number of lights, with more of them: the efficiency of `veach` and `nabata`,
//!         total error^2 x time, does not depend on their number, since both parts of the product do, in opposite ways; the table shows it
//! Caches  error of `nabata` against the number of cache points
//! Gains   total error^2 (relMSE against a path-traced reference, free of its noise) x CPU time of one strategy over that of `joint`, each with
//!         its best number of lights; the median over the scenes
//!
//! Only what virtual lights bring is rendered (`--only indirect`): direct light is the same for all and would hide them. Its reference are the photon
//! integrator's gathered paths. p: of the test that a strategy's picture and `exact`'s with the same lights have one mean, from blocks of pixels.

use super::{Experiment, Findings, Outcome, Outcomes, ReproduceArgs};
use crate::cli::compare::budget::Budget;
use crate::cli::compare::study::ReferenceFrom;
use crate::math::Rgb;
use crate::math::stats::normal_p;
use crate::report::comparison::Summary;
use crate::report::table::{NOTHING, Table, error};
use crate::transport::strategies::{ManyLightCounts, nabata};
use serde_json::json;
use std::path::Path;

/// Name, file, and the factor that makes its picture about 192 pixels wide.
const SCENES: [(&str, &str, f64); 5] = [
    ("cornell-box", "scenes/cornell-box.xml", 0.375),
    ("cornell-spheres", "scenes/cornell-spheres.xml", 0.64),
    ("hairball-lite", "../shared/ref/hairball-lite.xml", 0.75),
    ("many-lights", "../shared/ref/many-lights.xml", 0.75),
    ("staircase2", "../shared/scenes/staircase2/scene.xml", 0.1875),
];
const EXACT: &str = "exact";
/// Strategies with equal lights.
const EQUAL: [&str; 7] = [EXACT, "veach", "nabata", "residual", "culling", "hierarchical", "joint"];
/// Virtual lights of the equal comparison, and cache points.
const LIGHTS: u32 = 1024;
const CACHE: u32 = 64;
/// Further configurations: name, strategy, lights, cache points.
const OWN: [(&str, &str, u32, u32); 8] = [
    ("veach, 256 lights", "veach", 256, 64),
    ("nabata, 256 lights", "nabata", 256, 64),
    ("culling, 4096 lights", "culling", 4096, 64),
    ("culling, 16384 lights", "culling", 16_384, 64),
    ("hierarchical, 4096 lights", "hierarchical", 4096, 64),
    ("hierarchical, 16384 lights", "hierarchical", 16_384, 64),
    ("joint, 4096 lights", "joint", 4096, 32),
    ("joint, 16384 lights", "joint", 16_384, 32),
];
/// The experiment with more and more cache points (the paper: no better beyond about 2,000), in the first of the scenes.
const CACHES: &str = "cache points";
/// Its configurations: cache points.
const COUNTS: [(&str, u32); 6] = [("16", 16), ("64", 64), ("256", 256), ("1024", 1024), ("2048", 2048), ("4096", 4096)];
/// What the paper reports: rays saved by its method and by Veach's, its speed-up over all rays.
const PAPER: [(&str, f64, f64, f64); 4] = [
    ("San Miguel", 0.88, 0.64, 2.60),
    ("Hairball", 0.90, 0.63, 6.08),
    ("Sponza", 0.90, 0.74, 2.12),
    ("Museum", 0.90, 0.83, 2.56),
];
/// Pixels along a block of the test of means.
const BLOCK: usize = 12;

const DOUBTS: [&str; 2] = [
    "with n_0 - 1 = n_d / N nearly every pair ends at the clamp u = eps_2 = 0.1: what the method saves is its clamp (column at the floor)",
    "table 1 compares at equal lights and very different errors; by its own numbers Veach's roulette has the lower variance x time in all four scenes",
];

/// The experiments, and reasons for those that cannot be run.
pub fn experiments(args: &ReproduceArgs) -> (Vec<Experiment>, Vec<(&'static str, String)>) {
    let (mut ready, mut missing, mut curve) = (Vec::new(), Vec::new(), None);
    for (name, file, scale) in SCENES {
        if !Path::new(file).exists() {
            missing.push((name, format!("{file} is not there")));
            continue;
        }
        let scale = scale * args.scale.unwrap_or(1.0);
        let common = format!("--scale {scale} --integrator many-light --only indirect");
        let flags = |strategy: &str, lights: u32, cache: u32| {
            format!("{common} --strategy {strategy} --vpls {lights} --cache-points {cache}")
        };
        let reference = ReferenceFrom::Rendered {
            flags: format!("--scale {scale} --integrator photon --indirect gather --aa off --only indirect"),
            budget: Budget::Time(args.budget.saturating_mul(2)),
        };
        if name == SCENES[0].0 {
            let exact = (EXACT, flags(EXACT, LIGHTS, CACHE));
            let counts = COUNTS.iter().map(|&(name, n)| (name, flags("nabata", LIGHTS, n)));
            curve = Some(Experiment {
                name: CACHES,
                scene: file.into(),
                configs: std::iter::once(exact).chain(counts).collect(),
                budget: Budget::Passes(2),
                seeds: args.seeds,
                reference: reference.clone(),
            });
        }
        let equal = EQUAL.iter().map(|&s| (s, flags(s, LIGHTS, CACHE)));
        let own = OWN.iter().map(|&(name, s, lights, cache)| (name, flags(s, lights, cache)));
        ready.push(Experiment {
            name,
            scene: file.into(),
            configs: equal.chain(own).collect(),
            budget: Budget::Passes(2),
            seeds: args.seeds,
            reference,
        });
    }
    ready.extend(curve);
    (ready, missing)
}

/// Tables and figures.
pub fn findings(outcomes: &Outcomes) -> Findings {
    let mut tables = vec![("The paper".to_string(), paper_table())];
    let scenes: Vec<Scene> = outcomes.0.iter().filter(|o| o.name != CACHES).map(Scene::new).collect();
    tables.extend(
        scenes.iter().map(|s| (format!("{}, only light that virtual lights bring", s.outcome.name), s.table())),
    );
    tables.push(("Speed-up of nabata by the ratio of ray to shading cost".into(), ratio_table(&scenes)));
    tables.push(("Total error^2 x time over that of joint, best number of lights each".into(), gain_table(&scenes)));
    let saved = |name: &str| median(scenes.iter().filter_map(|s| s.saved(name)).collect());
    let of_possible = |name: &str| median(scenes.iter().filter_map(|s| s.saved_of_possible(name)).collect());
    let gain = |name: &str| median(scenes.iter().filter_map(|s| s.gain(name)).collect());
    let caches: Vec<CacheError> = outcomes.0.iter().filter(|o| o.name == CACHES).flat_map(cache_errors).collect();
    if !caches.is_empty() {
        let title = format!("nabata against the number of cache points, {}, {LIGHTS} lights", SCENES[0].0);
        tables.push((title, cache_table(&caches)));
    }
    let last = |of: fn(&CacheError) -> f64| caches.iter().rev().take(2).map(of).collect::<Vec<_>>();
    let flat = Some(last(|c| c.to_exact)).filter(|l| l.len() == 2 && l[1] > 0.0).map(|l| l[0] / l[1]);
    let figures = vec![
        ("error_4096_over_2048_cache_points", flat),
        ("nabata_saved_rays", saved("nabata")),
        ("veach_saved_rays", saved("veach")),
        ("joint_saved_rays", saved("joint")),
        ("nabata_saved_of_possible", of_possible("nabata")),
        ("veach_saved_of_possible", of_possible("veach")),
        ("joint_gain_over_nabata", gain("nabata")),
        ("joint_gain_over_veach", gain("veach")),
        ("joint_gain_over_culling", gain("culling")),
        ("joint_gain_over_hierarchical", gain("hierarchical")),
        ("joint_gain_over_exact", gain(EXACT)),
    ];
    let curves = vec![("cache_points", json!(caches))];
    Findings { tables, doubts: DOUBTS.to_vec(), figures, curves, ..Findings::default() }
}

/// What so many cache points give.
#[derive(Clone, Copy, Debug, serde::Serialize)]
struct CacheError {
    /// Cache points.
    cache_points: u32,
    /// Shadow rays per point, without those of the cache.
    rays: f64,
    /// relMSE against `exact` with the same lights and samples.
    to_exact: f64,
    /// relMSE against paths.
    to_paths: f64,
    /// CPU seconds.
    cpu_seconds: f64,
}

fn cache_errors(outcome: &Outcome) -> Vec<CacheError> {
    let scene = Scene::new(outcome);
    let one = |&(name, cache_points): &(&str, u32)| {
        let s = scene.get(name)?;
        Some(CacheError {
            cache_points,
            rays: per_point(s, |c| c.shadow_rays),
            to_exact: scene.conditional(name)?.0,
            to_paths: s.relmse.mean,
            cpu_seconds: s.cpu_seconds.mean,
        })
    };
    COUNTS.iter().filter_map(one).collect()
}

fn cache_table(rows: &[CacheError]) -> Table {
    let header = ["cache points", "rays", "relMSE to exact", "relMSE to paths", "CPU s"].map(String::from).to_vec();
    let row = |c: &CacheError| {
        let (rays, seconds) = (format!("{:.1}", c.rays), format!("{:.2}", c.cpu_seconds));
        vec![c.cache_points.to_string(), rays, error(c.to_exact), error(c.to_paths), seconds]
    };
    Table { header, rows: rows.iter().map(row).collect() }
}

fn paper_table() -> Table {
    let header = ["scene", "saved rays", "Veach's", "speed-up"].map(String::from).to_vec();
    let row = |&(name, ours, veach, speed): &(&str, f64, f64, f64)| {
        vec![name.to_string(), percent(ours), percent(veach), format!("{speed:.2}")]
    };
    Table { header, rows: PAPER.iter().map(row).collect() }
}

/// What came of a scene.
struct Scene<'a> {
    outcome: &'a Outcome,
}

impl<'a> Scene<'a> {
    fn new(outcome: &'a Outcome) -> Self {
        Scene { outcome }
    }

    fn get(&self, name: &str) -> Option<&Summary> {
        self.outcome.summaries.iter().find(|s| s.name == name)
    }

    /// Share of the rays to all lights that a strategy saves, with the same lights, as the paper counts.
    fn saved(&self, name: &str) -> Option<f64> {
        let of = self.get(name)?;
        let [lights, pairs] = [per_point(self.get(EXACT)?, |c| c.looks), per_point(self.get(EXACT)?, |c| c.pairs)];
        let in_vain = match name {
            EXACT => 1.0,
            "nabata" => f64::from(nabata::EPSILON_2),
            _ => 0.0,
        };
        let rays = per_point(of, |c| c.shadow_rays) + in_vain * (lights - pairs);
        (lights > 0.0).then_some(1.0 - rays / lights)
    }

    /// Share of the rays of `exact` that a strategy saves.
    fn saved_of_possible(&self, name: &str) -> Option<f64> {
        let [exact, other] = [self.get(EXACT)?, self.get(name)?].map(|s| per_point(s, |c| c.shadow_rays));
        (exact > 0.0).then_some(1.0 - other / exact)
    }

    /// What the rays of `exact` cost over all else (none if that is lost in the noise of the clock), and how many times faster `nabata` is.
    fn ratio_and_speed_up(&self) -> Option<(Option<f64>, f64)> {
        let [exact, few, nabata] = [self.get(EXACT)?, self.get("residual")?, self.get("nabata")?];
        let of_rays = (exact.cpu_seconds.mean - few.cpu_seconds.mean) / self.saved_of_possible("residual")?;
        let ratio = of_rays / (exact.cpu_seconds.mean - of_rays);
        Some((Some(ratio).filter(|r| *r > 0.0), exact.cpu_seconds.mean / nabata.cpu_seconds.mean))
    }

    /// Total error^2 x time of a strategy with its best number of lights.
    fn best(&self, strategy: &str) -> Option<f64> {
        let of = |s: &&Summary| s.name == strategy || s.name.starts_with(&format!("{strategy}, "));
        let all = self.outcome.summaries.iter().filter(of).map(|s| s.relmse.mean * s.cpu_seconds.mean);
        all.filter(|p| *p > 0.0).min_by(f64::total_cmp)
    }

    fn gain(&self, over: &str) -> Option<f64> {
        Some(self.best(over)? / self.best("joint")?)
    }

    /// relMSE against `exact` with the same lights and samples, and the p-value of equal means; for equal lights.
    fn conditional(&self, name: &str) -> Option<(f64, f64)> {
        let c = &self.outcome.comparison;
        let runs = |name: &str| c.configurations.iter().find(|c| c.name == name).map(|c| &c.runs);
        let (exact, other) = (runs(EXACT)?, runs(name)?);
        let width = c.reference.width;
        let (mut error, mut blocks) = (0.0, Vec::new());
        for (a, b) in exact.iter().zip(other) {
            error += relative_difference(&a.picture, &b.picture) / exact.len() as f64;
            blocks.extend(block_differences(&a.picture, &b.picture, width));
        }
        let n = blocks.len() as f64;
        let mean = blocks.iter().sum::<f64>() / n;
        let variance = blocks.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let p = if variance > 0.0 { normal_p(mean / (variance / n).sqrt()) } else { 1.0 };
        Some((error, p))
    }

    fn table(&self) -> Table {
        let exact = self.get(EXACT);
        let row = |s: &Summary| {
            let c = &s.counts.many_light;
            let per = |n: u64| format!("{:.1}", n as f64 / c.points.max(1) as f64);
            let share = |n: u64| percent(n as f64 / c.pairs.max(1) as f64);
            let conditional = Some(()).filter(|()| EQUAL.contains(&s.name.as_str()) && s.name != EXACT);
            let conditional = conditional.and_then(|()| self.conditional(&s.name));
            let or = |v: Option<String>| v.unwrap_or(NOTHING.into());
            vec![
                s.name.clone(),
                per(c.looks),
                per(c.shadow_rays),
                or(self.saved(&s.name).filter(|_| EQUAL.contains(&s.name.as_str())).map(percent)),
                or(self.saved_of_possible(&s.name).filter(|_| EQUAL.contains(&s.name.as_str())).map(percent)),
                share(c.floored),
                share(c.certain),
                format!("{:.2}", s.cpu_seconds.mean),
                or(exact.map(|e| format!("{:.2}", e.cpu_seconds.mean / s.cpu_seconds.mean))),
                or(conditional.map(|c| error(c.0))),
                or(conditional.map(|c| error(c.0 * s.cpu_seconds.mean))),
                error(s.relmse.mean),
                error(s.relmse.mean * s.cpu_seconds.mean),
                // Culling shares its chances among all pixels: blocks are no independent samples.
                or(conditional.filter(|_| s.name != "culling").map(|c| format!("{:.3}", c.1))),
            ]
        };
        let header = [
            "",
            "lights looked at",
            "rays",
            "saved",
            "of exact's",
            "at the floor",
            "certain",
            "CPU s",
            "speed-up",
            "relMSE to exact",
            "x s",
            "relMSE to paths",
            "x s",
            "p",
        ];
        Table { header: header.map(String::from).to_vec(), rows: self.outcome.summaries.iter().map(row).collect() }
    }
}

/// A count of the sums over virtual lights, for each point.
fn per_point(s: &Summary, of: impl Fn(&ManyLightCounts) -> u64) -> f64 {
    of(&s.counts.many_light) as f64 / s.counts.many_light.points.max(1) as f64
}

fn ratio_table(scenes: &[Scene]) -> Table {
    let header = ["scene", "rays over all else", "speed-up of nabata"].map(String::from).to_vec();
    let of = |s: &Scene| s.ratio_and_speed_up().map(|(ratio, up)| (s.outcome.name.to_string(), ratio, up));
    let mut rows: Vec<(String, Option<f64>, f64)> = scenes.iter().filter_map(of).collect();
    rows.sort_by(|a, b| a.1.unwrap_or(f64::INFINITY).total_cmp(&b.1.unwrap_or(f64::INFINITY)));
    let text = |ratio: Option<f64>| ratio.map_or(NOTHING.into(), |r| format!("{r:.2}"));
    let row = |(name, ratio, speed)| vec![name, text(ratio), format!("{speed:.2}")];
    Table { header, rows: rows.into_iter().map(row).collect() }
}

fn gain_table(scenes: &[Scene]) -> Table {
    let rows = scenes.iter().map(|s| {
        let gain = |name: &str| s.gain(name).map_or(NOTHING.into(), |g| format!("{g:.2}"));
        let mut row = vec![s.outcome.name.to_string()];
        row.extend(EQUAL.iter().filter(|n| **n != "joint").map(|n| gain(n)));
        row
    });
    let mut header = vec!["scene".to_string()];
    header.extend(EQUAL.iter().filter(|n| **n != "joint").map(|n| n.to_string()));
    Table { header, rows: rows.collect() }
}

fn percent(v: f64) -> String {
    format!("{:.1} %", 100.0 * v)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

/// Mean of (a - b)^2 / (a^2 + 0.01) over pixels and channels.
fn relative_difference(a: &[Rgb], b: &[Rgb]) -> f64 {
    let one = |(a, b): (&Rgb, &Rgb)| {
        let (a, b) = (a.as_dvec3(), b.as_dvec3());
        ((a - b) * (a - b) / (a * a + 0.01)).element_sum() / 3.0
    };
    a.iter().zip(b).map(one).sum::<f64>() / a.len().max(1) as f64
}

/// Mean differences of blocks of pixels.
fn block_differences(a: &[Rgb], b: &[Rgb], width: usize) -> Vec<f64> {
    let columns = width.div_ceil(BLOCK).max(1);
    let mut sums = vec![(0.0, 0u32); columns * (a.len() / width.max(1)).div_ceil(BLOCK)];
    for (i, (a, b)) in a.iter().zip(b).enumerate() {
        let sum = &mut sums[i / width / BLOCK * columns + i % width / BLOCK];
        sum.0 += f64::from((*b - *a).element_sum());
        sum.1 += 1;
    }
    sums.into_iter().filter(|s| s.1 > 0).map(|s| s.0 / f64::from(s.1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_blocks() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, f64::NAN, 3.0]), Some(2.5));
        assert_eq!(median(vec![]), None);
        let a = vec![Rgb::splat(0.5); 30 * 20];
        let b: Vec<Rgb> = (0..600).map(|i| Rgb::splat(if i % 30 < 12 && i / 30 < 12 { 0.6 } else { 0.5 })).collect();
        let d = block_differences(&a, &b, 30);
        assert_eq!(d.len(), 6);
        assert!((d[0] - 0.3).abs() < 1e-6 && d[1..].iter().all(|d| *d == 0.0), "{d:?}");
        assert!((relative_difference(&a, &b) - 0.01 / 0.26 * 144.0 / 600.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_missing_is_said() {
        // Tests run in the project's folder, where the first two scenes are.
        use clap::Parser;
        #[derive(Parser)]
        struct Wrapper {
            #[command(flatten)]
            args: ReproduceArgs,
        }
        let args = Wrapper::parse_from(["reproduce", "nabata"]).args;
        let (ready, missing) = experiments(&args);
        // And the curve of cache points.
        assert_eq!(ready.len() + missing.len(), SCENES.len() + 1);
        assert!(ready.iter().any(|e| e.name == "cornell-box"));
        assert!(missing.iter().all(|(_, reason)| reason.contains("not there")));
    }
}
