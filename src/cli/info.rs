//! `dualux info`: what a scene holds.

use super::Failure;
use super::checks::idle_lamps;
use super::flags::IntegratorChoice;
use super::load::{SceneArgs, filter_name};
use super::session;
use crate::scene::{Geometry, Scene};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Instant;

/// Lights listed one by one in the text; the rest are summed.
const LISTED_LIGHTS: usize = 20;

/// Arguments of `info`.
#[derive(Debug, clap::Args)]
pub struct InfoArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct Light<'a> {
    kind: &'a str,
    name: &'a str,
    /// Watt per channel.
    power: [f32; 3],
    primitives: usize,
}

#[derive(serde::Serialize)]
struct Info<'a> {
    file: String,
    width: u32,
    height: u32,
    crop: [u32; 4],
    filter: &'static str,
    sample_count: Option<u32>,
    file_integrator: &'a str,
    integrator: &'static str,
    max_depth: Option<u32>,
    shapes: BTreeMap<&'static str, usize>,
    triangles: usize,
    materials: usize,
    textures: usize,
    texture_pixels: usize,
    bounds_center: [f32; 3],
    bounds_radius: f32,
    lights: Vec<Light<'a>>,
    load_seconds: f64,
    build_seconds: f64,
    warnings: Vec<String>,
}

/// Runs the command.
pub fn run(args: &InfoArgs) -> Result<(), Failure> {
    let start = Instant::now();
    let loaded = args.scene.read()?;
    let load_seconds = start.elapsed().as_secs_f64();
    let mut warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let (scene, accel) = args.scene.build(loaded.description)?;
    let build_seconds = start.elapsed().as_secs_f64() - load_seconds;
    warnings.extend(session::unused_words(&scene.integrator.photon).into_iter().map(|w| format!("note: {w}")));
    warnings.extend(idle_lamps(&scene, &accel).into_iter().map(|w| format!("warning: {w}")));
    let info = Info {
        file: args.scene.scene.display().to_string(),
        width: scene.film.width,
        height: scene.film.height,
        crop: scene.film.crop,
        filter: filter_name(scene.film.filter),
        sample_count: scene.sample_count,
        file_integrator: &scene.integrator.name,
        integrator: IntegratorChoice::of_file(&scene.integrator.name).name(),
        max_depth: scene.integrator.max_depth,
        shapes: count_shapes(&scene),
        triangles: scene.triangle_count(),
        materials: scene.materials.len(),
        textures: scene.textures.len(),
        texture_pixels: scene.images.iter().map(|i| i.pixels.len()).sum(),
        bounds_center: scene.bounds.0.to_array(),
        bounds_radius: scene.bounds.1,
        lights: lights(&scene),
        load_seconds,
        build_seconds,
        warnings,
    };
    if args.json { super::print(serde_json::to_string_pretty(&info)? + "\n") } else { super::print(table(&info)) }
}

fn count_shapes(scene: &Scene) -> BTreeMap<&'static str, usize> {
    let mut out = BTreeMap::new();
    for shape in &scene.shapes {
        let kind = match shape.geometry {
            Geometry::Mesh(_) => "mesh",
            Geometry::Sphere(_) => "sphere",
            Geometry::Rectangle(_) => "rectangle",
            Geometry::Disk(_) => "disk",
            Geometry::Cylinder(_) => "cylinder",
        };
        *out.entry(kind).or_default() += 1;
    }
    out
}

fn lights(scene: &Scene) -> Vec<Light<'_>> {
    let light = |l: &'_ crate::scene::light::LightInfo| l.power.to_array();
    let infos = scene.lights.infos.iter();
    infos.map(|l| Light { kind: &l.kind, name: &l.name, power: light(l), primitives: l.primitives }).collect()
}

/// The text for people.
fn table(info: &Info) -> String {
    let mut text = String::new();
    let mut line = |parts: std::fmt::Arguments| {
        // Writing to a string cannot fail.
        let _ = text.write_fmt(parts).and_then(|()| text.write_char('\n'));
    };
    line(format_args!("{}", info.file));
    let [x, y, w, h] = info.crop;
    let full = [w, h] == [info.width, info.height];
    let crop = if full { String::new() } else { format!(", crop {x},{y},{w},{h}") };
    line(format_args!("  image       {} x {}, {} filter{crop}", info.width, info.height, info.filter));
    let asked = if info.file_integrator.is_empty() { "none" } else { info.file_integrator };
    let depth = info.max_depth.map_or("unbounded".into(), |d| d.to_string());
    line(format_args!("  integrator  {} (the file names {asked}), depth {depth}", info.integrator));
    if let Some(n) = info.sample_count {
        line(format_args!("  samples     {n} per pixel"));
    }
    let shapes: Vec<String> = info.shapes.iter().map(|(kind, n)| format!("{n} {kind}")).collect();
    line(format_args!("  shapes      {}; {} triangles in meshes", shapes.join(", "), info.triangles));
    line(format_args!(
        "  materials   {}; {} textures, {} texture pixels",
        info.materials, info.textures, info.texture_pixels
    ));
    let [cx, cy, cz] = info.bounds_center;
    line(format_args!("  bounds      centre {cx:.4} {cy:.4} {cz:.4}, radius {:.4}", info.bounds_radius));
    line(format_args!("  lights      {}", info.lights.len()));
    for light in info.lights.iter().take(LISTED_LIGHTS) {
        let [r, g, b] = light.power;
        let parts = if light.primitives > 1 { format!(", {} triangles", light.primitives) } else { String::new() };
        line(format_args!("    {:<20} {:<24} {r:.4} {g:.4} {b:.4} W{parts}", light.kind, light.name));
    }
    if let Some(rest) = info.lights.get(LISTED_LIGHTS..).filter(|r| !r.is_empty()) {
        let sum: [f64; 3] = std::array::from_fn(|c| rest.iter().map(|l| f64::from(l.power[c])).sum());
        line(format_args!("    and {} more: {:.4} {:.4} {:.4} W in all", rest.len(), sum[0], sum[1], sum[2]));
    }
    line(format_args!("  loaded in {:.2} s, built in {:.2} s", info.load_seconds, info.build_seconds));
    line(format_args!("  warnings    {}", info.warnings.len()));
    info.warnings.iter().for_each(|w| line(format_args!("{w}")));
    text
}
