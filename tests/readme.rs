//! What the README shows must compile and hold: its Rust snippet stands below, letter by letter.

use dualux_dual::testkit::{Kind, Scene};
use dualux_dual::{Family, Rectangle, Sphere, vec3};

#[test]
fn a_tiny_ball_that_the_centre_ray_misses() {
    let ball = Sphere::new(vec3(0.02, 0.0, 3.0), 0.01);
    let wall = Rectangle::new(vec3(0.0, 0.0, 5.0), vec3(9.0, 0.0, 0.0), vec3(0.0, 9.0, 0.0));
    let half = [vec3(0.02, 0.0, 0.0), vec3(0.0, 0.02, 0.0)];
    let pixel = Family::fixed(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0), half);
    // Panics with a report if margins or oracle disagree.
    Scene::new().with(ball).with(wall).expect(&pixel.into(), &[Kind::Silhouette]);
}

#[test]
fn the_readme_shows_this_very_test() {
    let readme = include_str!("../README.md");
    let mut parts = readme.split("```rust\n");
    let snippet = parts.nth(1).and_then(|rest| rest.split("```").next()).expect("a Rust snippet");
    assert!(parts.next().is_none(), "one snippet only: test the other as well");
    assert!(include_str!("readme.rs").contains(snippet), "README.md and tests/readme.rs differ");
}
