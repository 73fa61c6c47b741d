//! Tests an edge case of one's own with the test kit: which footprints see the gap between two plates, and how well do the
//! source paper's neighbours do against bounds?
//!
//! `cargo run --release -p dualux-dual --example test_kit`

use dualux_dual::testkit::{Kind, Rng, Scene};
use dualux_dual::{Family, Neighbours, Rectangle, Sphere, Test, vec3};

fn main() {
    // Two plates with a narrow gap, a wall behind, a ball that peeps out of the gap.
    let (up, across) = (vec3(0.0, 2.0, 0.0), vec3(1.0, 0.0, 0.0));
    let scene = Scene::new()
        .with(Rectangle::new(vec3(-1.01, 0.0, 4.0), across, up))
        .with(Rectangle::new(vec3(1.01, 0.0, 4.0), across, up))
        .with(Rectangle::new(vec3(0.0, 0.0, 6.0), vec3(9.0, 0.0, 0.0), vec3(0.0, 9.0, 0.0)))
        .with(Sphere::new(vec3(0.0, 0.5, 4.0), 0.05));

    // One footprint, with the events that must be there: a panic tells what is wrong.
    let half = [vec3(0.01, 0.0, 0.0), vec3(0.0, 0.01, 0.0)];
    let eye = vec3(0.0, 0.0, 0.0);
    scene.expect(&Family::fixed(eye, vec3(0.0, 0.0, 1.0), half).into(), &[Kind::Boundary]);
    scene.expect(&Family::fixed(eye, vec3(0.2, 0.0, 1.0), half).into(), &[]);

    // Many footprints, scored against 16 x 16 real rays each.
    let mut rng = Rng::new(1);
    let one = |_| {
        let d = vec3(0.0, 0.05, 1.0) + rng.cube(0.1);
        rng.family(eye, d, 0.02).into()
    };
    let views: Vec<_> = (0..4000).map(one).collect();
    println!("bounds\n{}", scene.score(&views, Test::Bounds, 2, 16));
    println!("corners\n{}", scene.score(&views, Test::Corners(Neighbours::CornersAndSides), 2, 16));
}
