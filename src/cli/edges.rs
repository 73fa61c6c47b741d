//! `dualux edges`: the map of predicted edges.

use super::Failure;
use super::load::SceneArgs;
use super::output::write_map;
use crate::edge::map::{Cell, area_lights};
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
    let map = match args.light {
        None => detector.pixel_map(crop),
        Some(k) => {
            let lights = area_lights(&scene);
            let Some(&light) = lights.get(k) else {
                return Err(format!("--light {k}: the scene has {} area lights, counted from 0", lights.len()).into());
            };
            detector.light_map(light, crop)
        }
    };
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

/// sRGB codes in 0..1 of a footprint's kind.
fn colour(cell: &Cell) -> Vec3 {
    let Some((_, code)) = COLOURS.iter().find(|(k, _)| cell.kinds.intersects(*k)) else { return Vec3::ZERO };
    let colour = Vec3::from(code.map(f32::from)) / 255.0;
    if cell.event { colour } else { 0.45 * colour }
}
