//! `dualux edges`: the map of predicted edges.

use super::Failure;
use super::load::SceneArgs;
use super::output::write_map;
use crate::edge::map::{Cell, area_lights};
use crate::edge::score::{compare, light_cost, light_truth, pixel_cost, pixel_truth};
use crate::edge::{EdgeDetector, Kinds, Settings};
use crate::image::Window;
use crate::math::Vec3;
use dualux_dual::{Neighbours, Test};
use std::path::PathBuf;

/// Arguments of `edges`.
#[derive(Debug, clap::Args)]
#[command(after_help = LEGEND)]
pub struct EdgesArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Files to write: .png (coloured by kind) or .exr (channels `event`, `kinds` as a bit mask, `distance` in half widths).
    #[arg(short, long)]
    output: Vec<PathBuf>,
    /// Order of the expansions of curved edges.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=2))]
    order: u8,
    /// Footprint test.
    #[arg(long, value_enum, default_value_t = TestChoice::Bounds)]
    test: TestChoice,
    /// The map of area light K, counted from 0 as in the file: where it is partly visible.
    #[arg(long, value_name = "K")]
    light: Option<usize>,
    /// Compare with brute force of N x N rays per footprint and print recall, precision and cost, for both tests.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=256))]
    score: Option<u16>,
    /// Write the scores to this file.
    #[arg(long, value_name = "FILE", requires = "score")]
    json: Option<PathBuf>,
}

/// The colours, in order of precedence.
const COLOURS: &[(Kinds, [u8; 3])] = &[
    (Kinds::UNKNOWN, [128, 128, 128]),
    (Kinds::BUSY, [255, 255, 255]),
    (Kinds::SWAP, [255, 0, 255]),
    (Kinds::HORIZON, [0, 160, 0]),
    (Kinds::EMITTER, [160, 160, 0]),
    (Kinds::SILHOUETTE, [255, 80, 40]),
    (Kinds::BOUNDARY, [80, 160, 255]),
    (Kinds::CREASE, [255, 220, 0]),
    (Kinds::HIGHLIGHT, [255, 170, 210]),
    (Kinds::TOTAL_REFLECTION, [0, 200, 200]),
];

const LEGEND: &str = "Colours: boundary blue, crease yellow, silhouette orange, depth swap magenta, horizon green, emitter's back olive, \
highlight pink, total reflection cyan; dimmed where seen in a mirror or through glass; busy white, unknown grey.
Bits of `kinds`: boundary 1, crease 2, silhouette 4, swap 8, horizon 16, emitter 32, highlight 64, total reflection 128, \
mirrored 256, refracted 512, busy 1024, unknown 2048.";

/// Footprint tests on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum TestChoice {
    /// Can a margin vanish anywhere in the footprint?
    Bounds,
    /// The source paper's neighbours: predicted at corners and midpoints of sides.
    Corners,
    /// The four corners only (the paper's photons).
    Corners4,
}

impl From<TestChoice> for Test {
    fn from(choice: TestChoice) -> Test {
        match choice {
            TestChoice::Bounds => Test::Bounds,
            TestChoice::Corners => Test::Corners(Neighbours::CornersAndSides),
            TestChoice::Corners4 => Test::Corners(Neighbours::Corners),
        }
    }
}

/// Runs the command.
pub fn run(args: &EdgesArgs) -> Result<(), Failure> {
    let loaded = args.scene.read()?;
    loaded.warnings.iter().for_each(|w| eprintln!("{w}"));
    let (scene, accel) = args.scene.build(loaded.description)?;
    let settings = Settings { test: args.test.into(), order: usize::from(args.order), ..Settings::default() };
    let detector = EdgeDetector::with_settings(&scene, &accel, settings);
    let crop = scene.film.crop;
    let light = args.light.map(|k| {
        let lights = area_lights(&scene);
        let n = lights.len();
        lights.get(k).copied().ok_or_else(|| format!("--light {k}: the scene has {n} area lights, counted from 0"))
    });
    let light = light.transpose()?;
    let map = map_of(&detector, light, crop);
    if let Some(n) = args.score {
        score(args, &detector, light, crop, usize::from(n))?;
    }
    let [x, y, w, h] = crop;
    let window = Window { x: x as i32, y: y as i32, width: w as usize, height: h as usize };
    let frame = (scene.film.width as usize, scene.film.height as usize);
    let colours: Vec<Vec3> = map.iter().map(colour).collect();
    let channels = [
        ("event", map.iter().map(|c| f32::from(u8::from(c.event))).collect()),
        ("kinds", map.iter().map(|c| f32::from(c.kinds.0)).collect()),
        ("distance", map.iter().map(|c| c.distance as f32).collect::<Vec<f32>>()),
    ];
    for path in &args.output {
        write_map(path, window, frame, &colours, &channels)?;
    }
    let events = map.iter().filter(|c| c.event).count();
    println!("{events} of {} footprints have an edge", map.len());
    Ok(())
}

fn map_of(detector: &EdgeDetector, light: Option<u32>, crop: [u32; 4]) -> Vec<Cell> {
    match light {
        None => detector.pixel_map(crop),
        Some(light) => detector.light_map(light, crop),
    }
}

/// Prints the scores of both tests, and writes them.
fn score(
    args: &EdgesArgs,
    detector: &EdgeDetector,
    light: Option<u32>,
    crop: [u32; 4],
    n: usize,
) -> Result<(), Failure> {
    let truth = match light {
        None => pixel_truth(detector, crop, n),
        Some(light) => light_truth(detector, light, crop, n),
    };
    let family = args.light.map_or("pixel".into(), |k| format!("light:{k}"));
    let mut scores = Vec::new();
    println!(
        "family     test     order  footprints    edges  recall                  precision               cost  ns"
    );
    for test in [TestChoice::Bounds, TestChoice::Corners] {
        let settings = Settings { test: test.into(), ..detector.settings };
        let detector = EdgeDetector::with_settings(detector.scene, detector.accel, settings);
        let name = if test == TestChoice::Bounds { "bounds" } else { "corners" };
        let map = map_of(&detector, light, crop);
        let mut s = compare(family.clone(), name, settings.order, &map, &truth, n);
        (s.cost_ratio, s.query_ns) = match light {
            None => pixel_cost(&detector, crop),
            Some(light) => light_cost(&detector, light, crop),
        };
        let interval = |p: f64, [a, b]: [f64; 2]| format!("{p:.4} [{a:.4}, {b:.4}]");
        println!(
            "{:<10} {:<8} {:>5} {:>11} {:>8}  {}  {}  {:>4.2}  {:.0}",
            s.family,
            s.test,
            s.order,
            s.footprints,
            s.edges,
            interval(s.recall, s.recall_interval),
            interval(s.precision, s.precision_interval),
            s.cost_ratio,
            s.query_ns
        );
        scores.push(s);
    }
    println!("(cost: query over one plain ray; brute force takes {} rays per footprint)", n * n);
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&scores)?;
        std::fs::write(path, text + "\n").map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

/// sRGB codes in 0..1 of a footprint's kind.
fn colour(cell: &Cell) -> Vec3 {
    let Some((_, code)) = COLOURS.iter().find(|(k, _)| cell.kinds.intersects(*k)) else { return Vec3::ZERO };
    let colour = Vec3::from(code.map(f32::from)) / 255.0;
    if cell.event { colour } else { 0.45 * colour }
}
