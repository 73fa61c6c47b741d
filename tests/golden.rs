//! Every file in scenes/ renders, and matches its golden block means.
//!
//! Golden data: per scene 4 x 4 block means of a converged small render with their standard errors, in
//! tests/golden.json. `cargo test --release --test golden -- --ignored` renders them anew; look at the difference before
//! committing it. Confidence: family-wise 0.01 over all blocks and channels.

use dualux::accel::Accel;
use dualux::formats::{LoadOptions, load};
use dualux::image::film::Film;
use dualux::integrators::path::{Path, PathSettings};
use dualux::render::{RenderSettings, Silent, render};
use dualux::scene::Scene;
use dualux::transport::World;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

const BLOCKS: u32 = 4;
/// Width of the small renders, pixels.
const WIDTH: u32 = 48;
const TEST_PASSES: u64 = 64;
const GOLDEN_PASSES: u64 = 4096;
/// Normal quantile for 0.01 over some 240 values.
const Z_LIMIT: f64 = 4.3;
/// Mean and standard error of each block and channel.
type Golden = BTreeMap<String, Vec<(f64, f64)>>;

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn scene_names() -> Vec<String> {
    let entries = std::fs::read_dir(folder("scenes")).expect("scenes/");
    let mut names: Vec<String> = entries
        .map(|e| e.expect("entry").path())
        .filter(|p| p.extension().is_some_and(|e| e == "xml"))
        .map(|p| p.file_stem().expect("name").to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

fn render_small(name: &str, passes: u64, seed: u64) -> Film {
    let path = folder("scenes").join(name).with_extension("xml");
    let loaded = load(&path, &LoadOptions { strict: true, defines: vec![] }).expect("the scene is valid");
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let mut desc = loaded.description;
    let height = (desc.film.height * WIDTH).div_ceil(desc.film.width);
    (desc.film.width, desc.film.height, desc.film.crop) = (WIDTH, height, [0, 0, WIDTH, height]);
    let scene = Scene::new(desc).expect("the scene is valid");
    let accel = Accel::new(&scene.shapes);
    let mut integrator = Path::new(World::new(&scene, &accel), PathSettings::default());
    let settings =
        RenderSettings { window: scene.film.crop, passes: Some(passes), deadline: None, seed, features: false };
    render(&scene, &mut integrator, &settings, &AtomicBool::new(false), &mut Silent).film
}

fn blocks(film: &Film) -> Vec<(f64, f64)> {
    let mut out = vec![];
    for b in 0..BLOCKS * BLOCKS {
        let ys = (b / BLOCKS * film.height / BLOCKS)..((b / BLOCKS + 1) * film.height / BLOCKS);
        let xs = || (b % BLOCKS * film.width / BLOCKS)..((b % BLOCKS + 1) * film.width / BLOCKS);
        let pixels: Vec<_> = ys
            .flat_map(|y| xs().map(move |x| (y, x)))
            .map(|(y, x)| &film.pixels()[(y * film.width + x) as usize])
            .collect();
        let n = pixels.len() as f64;
        for c in 0..3 {
            let mean = pixels.iter().map(|p| p.mean()[c]).sum::<f64>() / n;
            let error = pixels.iter().map(|p| p.variance()[c]).sum::<f64>().sqrt() / n;
            out.push((mean, error));
        }
    }
    out
}

fn golden() -> Golden {
    let text = std::fs::read_to_string(folder("tests").join("golden.json")).expect("tests/golden.json");
    serde_json::from_str(&text).expect("valid JSON")
}

fn mismatches(name: &str, film: &Film, golden: &[(f64, f64)]) -> Vec<String> {
    // The path tracer finds caustics by chance: a short run does not know its own error, the golden run does.
    let error = |ge: f64| ge * (1.0 + GOLDEN_PASSES as f64 / TEST_PASSES as f64).sqrt();
    let pairs = blocks(film).into_iter().zip(golden).enumerate();
    pairs
        .filter(|(_, ((m, _), (g, ge)))| (m - g).abs() > Z_LIMIT * error(*ge) + 1e-6)
        .map(|(i, ((m, e), (g, _)))| format!("{name}: block {} channel {}: {m:.5} +- {e:.5}, not {g:.5}", i / 3, i % 3))
        .collect()
}

#[test]
fn scenes_match_their_golden_blocks() {
    let golden = golden();
    let names = scene_names();
    assert!(names.len() >= 5 && names.iter().eq(golden.keys()), "regenerate tests/golden.json (see its test)");
    let bad: Vec<String> =
        names.iter().flat_map(|n| mismatches(n, &render_small(n, TEST_PASSES, 77), &golden[n])).collect();
    assert!(bad.is_empty(), "\n{}", bad.join("\n"));
}

#[test]
fn a_wrong_picture_is_seen() {
    let golden = golden();
    let darker: Vec<(f64, f64)> = golden["penumbra"].iter().map(|(m, e)| (m * 0.9, *e)).collect();
    assert!(!mismatches("penumbra", &render_small("penumbra", TEST_PASSES, 77), &darker).is_empty());
}

#[test]
#[ignore = "writes tests/golden.json"]
fn regenerate() {
    let golden: Golden =
        scene_names().into_iter().map(|n| (n.clone(), blocks(&render_small(&n, GOLDEN_PASSES, 1)))).collect();
    let text = serde_json::to_string(&golden).expect("JSON").replace("]],", "]],\n");
    std::fs::write(folder("tests").join("golden.json"), text + "\n").expect("written");
}
