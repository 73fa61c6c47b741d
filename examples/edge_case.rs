//! Asks the edge detector about one pixel of a scene, and brute force as well.
//!
//! `edge_case SCENE.xml X Y [N]`
//!
//! Prints what the footprint of pixel (X, Y) holds, what its centre's first hit sees of each area light, and what N x N
//! real rays (16 by default) say of the same footprints. Exits with 1 where the detector says "nothing" and brute force does not: so a test
//! of an own edge case is a scene file and one call of this program, or these lines in a test.

use dualux::accel::Accel;
use dualux::edge::light::Receiver;
use dualux::edge::map::area_lights;
use dualux::edge::pixel::{self, PixelFamily};
use dualux::edge::{EdgeDetector, LightVerdict, Verdict, oracle};
use dualux::formats::{self, LoadOptions};
use dualux::scene::Scene;
use std::error::Error;
use std::process::ExitCode;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize| args.get(k).and_then(|a| a.parse::<u32>().ok());
    let (Some(scene), Some(x), Some(y)) = (args.first(), number(1), number(2)) else {
        eprintln!("usage: edge_case SCENE.xml X Y [N]");
        return ExitCode::from(2);
    };
    match run(scene, [x, y], number(3).unwrap_or(16).max(2) as usize) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Whether the detector misses nothing.
fn run(path: &str, [x, y]: [u32; 2], n: usize) -> Result<bool, Box<dyn Error>> {
    let loaded = formats::load(path.as_ref(), &LoadOptions::default())?;
    let scene = Scene::new(loaded.description)?;
    let accel = Accel::new(&scene.shapes);
    let detector = EdgeDetector::new(&scene, &accel);

    let verdict = detector.pixel(x, y, true);
    let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
    let truth = match pixel::family(&scene.camera, centre, [0.5; 2]) {
        Some(PixelFamily::Exact(view)) => oracle::sight(&scene, &accel, &view, n),
        Some(PixelFamily::Lens(family, t)) => oracle::sight4(&scene, &accel, &family, t, n.div_ceil(3), true),
        None => false,
    };
    println!("pixel ({x}, {y}): {verdict:?}\n    {n} x {n} rays: {}", if truth { "an edge" } else { "no edge" });
    let mut right = !(truth && verdict == Verdict::Clear);

    if let Some((ray, at)) = detector.first_hit(x, y) {
        let from = Receiver::new(&at, -ray.d);
        for (k, light) in area_lights(&scene).into_iter().enumerate() {
            let verdict = detector.light(light, &from, true);
            let truth = oracle::light(&scene, &accel, light, &from, n);
            println!("light {k}: {verdict:?}\n    {n} x {n} shadow rays: partly visible {truth:?}");
            let sure = matches!(verdict, LightVerdict::Visible | LightVerdict::Blocked);
            right &= !(sure && truth == Some(true));
        }
    }
    Ok(right)
}
