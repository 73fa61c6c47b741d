//! `dualux edges`: the map of predicted edges.

use super::load::SceneArgs;
use super::output::{check_name, edge_channels, write_map};
use super::{Failure, print, tell};
use crate::edge::map::{Cell, area_lights};
use crate::edge::score::{
    Score, chain_cost, chain_truth, compare, emission_cost, emission_truth, light_cost, light_truth, pixel_cost,
    pixel_truth,
};
use crate::edge::unrolled::Unrolled;
use crate::edge::{EdgeDetector, Kinds, Settings};
use crate::image::{Window, atomic};
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
    /// The emission domain of area light K, unrolled: a hemicube round its middle, sides round the top.
    #[arg(long, value_name = "K", conflicts_with = "light")]
    emission: Option<usize>,
    /// Cells across the top of the hemicube.
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u16).range(2..=2048))]
    cells: u16,
    /// Compare with brute force of N x N rays per footprint and print recall, precision and cost, for bounds and for corners (`--test corners4`:
    /// the four only). Lamps that the camera does not see count here.
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
highlight pink (light maps: where the light leaves a rough surface's lobe), total reflection cyan; dimmed where seen in a mirror or through glass; busy white, unknown grey.
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
    args.output.iter().try_for_each(|path| check_name(path))?;
    args.json.as_deref().map_or(Ok(()), atomic::check)?;
    let loaded = args.scene.read()?;
    loaded.warnings.iter().for_each(tell);
    let (scene, accel) = args.scene.build(loaded.description)?;
    let settings = Settings { test: args.test.into(), order: usize::from(args.order), ..Settings::default() };
    let hidden = scene.integrator.hide_emitters && args.score.is_none() && args.emission.is_none();
    let detector = EdgeDetector::with_settings(&scene, &accel, settings).hiding_lamps(hidden);
    let lights = area_lights(&scene);
    let light = |option: &str, k: usize| {
        let n = lights.len();
        lights.get(k).copied().ok_or_else(|| format!("{option} {k}: the scene has {n} area lights, counted from 0"))
    };
    let crop = scene.film.crop;
    let (question, frame, window) = match (args.light, args.emission) {
        (Some(k), _) => (Question::Light(light("--light", k)?, k), [scene.film.width, scene.film.height], crop),
        (None, Some(k)) => {
            let cells = Unrolled::new(&scene, light("--emission", k)?, u32::from(args.cells)).ok_or_else(|| {
                format!("--emission {k}: only flat lights, and meshes of at most 64 triangles, have an emission map")
            })?;
            let size = cells.size();
            (Question::Emission(cells, k), [size; 2], [0, 0, size, size])
        }
        (None, None) => (Question::Pixel, [scene.film.width, scene.film.height], crop),
    };
    let map = question.map(&detector, window);
    if let Some(n) = args.score {
        score(args, &detector, &question, window, usize::from(n))?;
    }
    let [x, y, w, h] = window;
    let window = Window { x: x as i32, y: y as i32, width: w as usize, height: h as usize };
    let frame = (frame[0] as usize, frame[1] as usize);
    let colours: Vec<Vec3> = map.iter().map(colour).collect();
    let channels = edge_channels(&map);
    for path in &args.output {
        write_map(path, window, frame, &colours, &channels)?;
    }
    let events = map.iter().filter(|c| c.event).count();
    print(format!("{events} of {} footprints have an edge\n", map.len()))
}

/// Which footprints.
enum Question {
    Pixel,
    /// What pixels see in mirrors and through glass.
    Chain,
    /// Shape, number.
    Light(u32, usize),
    /// Cells, number of the light.
    Emission(Unrolled, usize),
}

impl Question {
    fn map(&self, detector: &EdgeDetector, window: [u32; 4]) -> Vec<Cell> {
        match self {
            Question::Pixel => detector.pixel_map(window),
            Question::Chain => detector.chain_map(window),
            Question::Light(light, _) => detector.light_map(*light, window),
            Question::Emission(cells, _) => cells.map(detector),
        }
    }

    fn truth(&self, detector: &EdgeDetector, window: [u32; 4], n: usize) -> Vec<Option<bool>> {
        match self {
            Question::Pixel => pixel_truth(detector, window, n),
            Question::Chain => chain_truth(detector, window, n),
            Question::Light(light, _) => light_truth(detector, *light, window, n),
            Question::Emission(cells, _) => emission_truth(detector, cells, n),
        }
    }

    fn cost(&self, detector: &EdgeDetector, window: [u32; 4]) -> (f64, f64) {
        match self {
            Question::Pixel => pixel_cost(detector, window),
            Question::Chain => chain_cost(detector, window),
            Question::Light(light, _) => light_cost(detector, *light, window),
            Question::Emission(cells, _) => emission_cost(detector, cells),
        }
    }

    fn family(&self) -> String {
        match self {
            Question::Pixel => "pixel".into(),
            Question::Chain => "chain".into(),
            Question::Light(_, k) => format!("light:{k}"),
            Question::Emission(_, k) => format!("emission:{k}"),
        }
    }
}

/// Prints the scores of both tests, and writes them. Pixels that see mirrors or glass without an edge of their own are scored apart.
fn score(
    args: &EdgesArgs,
    detector: &EdgeDetector,
    question: &Question,
    window: [u32; 4],
    n: usize,
) -> Result<(), Failure> {
    print(
        "family     test     order  footprints    edges  recall                  precision               cost  ns\n",
    )?;
    let mut scores = Vec::new();
    score_one(args, detector, question, window, n, &mut scores)?;
    if matches!(question, Question::Pixel) {
        score_one(args, detector, &Question::Chain, window, n, &mut scores)?;
    }
    print(format!("(cost: query over one plain ray; brute force takes {} rays per footprint)\n", n * n))?;
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&scores)?;
        atomic::write_file(path, (text + "\n").as_bytes())?;
    }
    Ok(())
}

fn score_one(
    args: &EdgesArgs,
    detector: &EdgeDetector,
    question: &Question,
    window: [u32; 4],
    n: usize,
    scores: &mut Vec<Score>,
) -> Result<(), Failure> {
    let truth = question.truth(detector, window, n);
    // Beside bounds the source paper's test, with the neighbours asked for. Predictions along chains know the one test only.
    let neighbours = if args.test == TestChoice::Corners4 { TestChoice::Corners4 } else { TestChoice::Corners };
    let tests = match question {
        Question::Chain if truth.iter().all(Option::is_none) => vec![],
        Question::Chain => vec![TestChoice::Bounds],
        _ => vec![TestChoice::Bounds, neighbours],
    };
    for test in tests {
        let settings = Settings { test: test.into(), ..detector.settings };
        let detector = EdgeDetector::with_settings(detector.scene, detector.accel, settings);
        let name = match test {
            TestChoice::Bounds => "bounds",
            TestChoice::Corners => "corners",
            TestChoice::Corners4 => "corners4",
        };
        let map = question.map(&detector, window);
        let mut s = compare(question.family(), name, settings.order, &map, &truth, n);
        (s.cost_ratio, s.query_ns) = question.cost(&detector, window);
        let interval = |p: f64, [a, b]: [f64; 2]| format!("{p:.4} [{a:.4}, {b:.4}]");
        print(format!(
            "{:<10} {:<8} {:>5} {:>11} {:>8}  {}  {}  {:>4.2}  {:.0}\n",
            s.family,
            s.test,
            s.order,
            s.footprints,
            s.edges,
            interval(s.recall, s.recall_interval),
            interval(s.precision, s.precision_interval),
            s.cost_ratio,
            s.query_ns
        ))?;
        scores.push(s);
    }
    Ok(())
}

/// sRGB codes in 0..1 of a footprint's kind.
fn colour(cell: &Cell) -> Vec3 {
    let Some((_, code)) = COLOURS.iter().find(|(k, _)| cell.kinds.intersects(*k)) else { return Vec3::ZERO };
    let colour = Vec3::from(code.map(f32::from)) / 255.0;
    if cell.event { colour } else { 0.45 * colour }
}
