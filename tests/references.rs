//! Agreement with converged references of another renderer, where the shared folder with them lies beside the project.
//!
//! Mean of the picture per channel against the mean of the two reference halves over the pixels that count: within 1 % and
//! 4 standard errors (family-wise below 0.01 for 21 values of light tails; caustics, found by chance, have heavier ones).
//! Longer comparisons, public scenes among them: `benches/agreement.py`.

use dualux::accel::Accel;
use dualux::formats::{LoadOptions, load};
use dualux::image::{Picture, read_image};
use dualux::integrators::path::{Path, PathSettings};
use dualux::render::{RenderSettings, Silent, render};
use dualux::scene::Scene;
use dualux::transport::World;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Scene and samples per pixel. The room lit through a gap is left to `benches/agreement.py`.
const SCENES: [(&str, u64); 7] = [
    ("cornell-box", 4),
    ("cornell-spheres", 16),
    ("penumbra", 8),
    ("room-window", 32),
    ("many-lights", 16),
    ("hairball-lite", 8),
    ("caustic-ring", 64),
];
const SIGMAS: f64 = 4.0;
const TOLERANCE: f64 = 0.01;

fn references() -> Option<PathBuf> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/ref");
    folder.join("cornell-box.xml").exists().then_some(folder)
}

/// Our mean with its standard error, and the reference's mean, of one channel.
struct Comparison {
    ours: f64,
    error: f64,
    reference: f64,
}

impl Comparison {
    fn agrees(&self) -> bool {
        (self.ours - self.reference).abs() <= SIGMAS * self.error + TOLERANCE * self.reference
    }
}

fn compare(xml: PathBuf, halves: [Picture; 2], passes: u64) -> [Comparison; 3] {
    let loaded = load(&xml, &LoadOptions::default()).expect("the scene is valid");
    let scene = Scene::new(loaded.description).expect("the scene is valid");
    let accel = Accel::new(&scene.shapes);
    let settings = PathSettings { rr_depth: 6, ..PathSettings::default() };
    let mut integrator = Path::new(World::new(&scene, &accel), settings);
    let run =
        RenderSettings { window: scene.film.crop, passes: Some(passes), deadline: None, seed: 3, features: false };
    let film = render(&scene, &mut integrator, &run, &AtomicBool::new(false), &mut Silent).film;
    let [a, b] = halves;
    let counts = |i: usize| a.mask.as_ref().is_none_or(|m| m[i]) && (a.pixels[i] + b.pixels[i]).is_finite();
    let counted: Vec<usize> = (0..a.pixels.len()).filter(|&i| counts(i)).collect();
    assert_eq!(film.pixels().len(), a.pixels.len(), "{}", xml.display());
    let n = counted.len() as f64;
    let mean = |f: &dyn Fn(usize) -> f64| counted.iter().map(|&i| f(i)).sum::<f64>() / n;
    std::array::from_fn(|c| Comparison {
        ours: mean(&|i| film.pixels()[i].mean()[c]),
        error: (mean(&|i| film.pixels()[i].variance()[c]) / n).sqrt(),
        reference: mean(&|i| 0.5 * f64::from(a.pixels[i][c] + b.pixels[i][c])),
    })
}

#[test]
fn path_agrees_with_converged_references() {
    let Some(folder) = references() else {
        println!("skipped: no references beside the project");
        return;
    };
    let mut bad = vec![];
    for (name, passes) in SCENES {
        let half = |h: &str| read_image(&folder.join(format!("{name}.{h}.exr"))).expect("a reference");
        let channels = compare(folder.join(format!("{name}.xml")), [half("a"), half("b")], passes);
        for (c, r) in channels.iter().enumerate() {
            let line = format!("{name} {c}: {:.5} +- {:.5}, reference {:.5}", r.ours, r.error, r.reference);
            println!("{line}");
            if !r.agrees() {
                bad.push(line);
            }
        }
    }
    assert!(bad.is_empty(), "\n{}", bad.join("\n"));
}

#[test]
fn three_per_cent_would_be_seen() {
    let Some(folder) = references() else {
        println!("skipped: no references beside the project");
        return;
    };
    let brighter = |h: &str| {
        let mut picture = read_image(&folder.join(format!("penumbra.{h}.exr"))).expect("a reference");
        picture.pixels.iter_mut().for_each(|p| *p *= 1.03);
        picture
    };
    let channels = compare(folder.join("penumbra.xml"), [brighter("a"), brighter("b")], 8);
    assert!(channels.iter().all(|c| !c.agrees()));
}
