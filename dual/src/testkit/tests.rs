//! The kit on known geometry: recall of `bounds` must be 1, of `corners` it cannot be; hidden edges; horizons; reports.

use super::*;
use crate::{Cylinder, Disk, Family, Neighbours, Rectangle, Sphere, Test, Triangle, Vec3, vec3};

/// Footprints aimed into the cube of half width 1.5 around (0, 0, 5).
fn views(rng: &mut Rng, count: usize, size: f64) -> Vec<View> {
    (0..count)
        .map(|_| {
            let o = rng.cube(1.0);
            let aim = vec3(0.0, 0.0, 5.0) + rng.cube(1.5);
            let size = size * rng.range(0.2, 1.0);
            let stretch = rng.range(0.5, 2.0);
            rng.family(o, (aim - o) * stretch, size).into()
        })
        .collect()
}

fn at(rng: &mut Rng) -> Vec3<f64> {
    vec3(0.0, 0.0, 5.0) + rng.cube(1.5)
}

fn polygons(rng: &mut Rng) -> Scene {
    Scene::new()
        .with(Triangle::new(at(rng), at(rng), at(rng)))
        .with(Triangle::new(at(rng), at(rng), at(rng)))
        .with(Rectangle::new(at(rng), rng.cube(1.0), rng.cube(1.0)))
}

fn mixed(rng: &mut Rng) -> Scene {
    Scene::new()
        .with(Sphere::new(at(rng), rng.range(0.02, 1.0)))
        .with(Sphere::new(at(rng), rng.range(0.02, 1.0)))
        .with(Triangle::new(at(rng), at(rng), at(rng)))
        .with(Rectangle::new(at(rng), rng.cube(1.0), rng.cube(1.0)))
        .with(Disk::new(at(rng), rng.cube(1.0), rng.range(0.1, 1.0)))
}

/// Cylinders stand apart from the rest, as their swaps are not handled.
fn cylinder(rng: &mut Rng) -> Scene {
    Scene::new().with(Cylinder::new(at(rng), at(rng), rng.range(0.05, 0.6)))
}

/// Totals over many random scenes. (Polygons, quadrics with polygons, cylinders: 170,000 footprints in all.)
fn total(
    make: impl Fn(&mut Rng) -> Scene,
    scenes: usize,
    per_scene: usize,
    n: usize,
    tests: &[(Test, usize)],
) -> Vec<Score> {
    let mut rng = Rng::new(99);
    let mut sum = vec![Score::default(); tests.len()];
    for _ in 0..scenes {
        let scene = make(&mut rng);
        let views = views(&mut rng, per_scene, 0.15);
        for (sum, score) in sum.iter_mut().zip(scene.scores(&views, tests, n)) {
            *sum += score;
        }
    }
    for (score, (test, order)) in sum.iter().zip(tests) {
        println!("{test:?} order {order}: {score}");
    }
    sum
}

const EIGHT: Test = Test::Corners(Neighbours::CornersAndSides);
const FOUR: Test = Test::Corners(Neighbours::Corners);

#[test]
fn bounds_miss_nothing_on_polygons_at_first_order() {
    let s = total(polygons, 1000, 50, 8, &[(Test::Bounds, 1), (EIGHT, 1), (FOUR, 1)]);
    assert_eq!(s[0].misses, 0);
    assert!(s[0].hits > 4_000 && s[0].precision() > 0.85, "{}", s[0]);
    // The oracle can catch a detector that misses.
    assert!(s[2].misses > 100 && s[1].recall() < 1.0, "{}", s[2]);
}

#[test]
fn bounds_miss_nothing_on_quadrics_and_polygons_at_second_order() {
    let s = total(mixed, 1600, 50, 8, &[(Test::Bounds, 2), (Test::Bounds, 1), (EIGHT, 2), (EIGHT, 1), (FOUR, 2)]);
    assert_eq!(s[0].misses, 0);
    assert!(s[0].hits > 8_000 && s[0].precision() > 0.8, "{}", s[0]);
    // First order is no bound for quadrics.
    assert!(s[1].misses > 0 && s[4].misses > 100);
}

#[test]
fn bounds_miss_nothing_on_cylinders() {
    let s = total(cylinder, 800, 50, 8, &[(Test::Bounds, 2), (EIGHT, 2)]);
    assert_eq!(s[0].misses, 0);
    assert!(s[0].hits > 2000 && s[0].precision() > 0.8, "{}", s[0]);
}

#[test]
fn what_a_coarse_oracle_calls_false_is_mostly_true() {
    // Precision against a fine grid, where a false alarm really is one (hidden by several shapes, or thinner still).
    let s = total(mixed, 200, 10, 64, &[(Test::Bounds, 2)]);
    assert_eq!(s[0].misses, 0);
    assert!(s[0].precision() > 0.9, "{}", s[0]);
}

#[test]
fn tiny_spheres_slip_between_neighbours_only() {
    let make =
        |rng: &mut Rng| (0..10).fold(Scene::new(), |scene, _| scene.with(Sphere::new(at(rng), rng.range(0.02, 0.06))));
    let s = total(make, 200, 100, 16, &[(Test::Bounds, 2), (EIGHT, 2)]);
    assert_eq!(s[0].misses, 0);
    assert!(s[0].precision() > 0.8, "{}", s[0]);
    assert!(s[1].recall() < 0.5, "{}", s[1]);
}

#[test]
fn lights_seen_from_a_floor() {
    // Occluders, the light's far side (t = 1) and the horizon of a tilted receiver.
    let mut rng = Rng::new(5);
    let mut sum = Score::default();
    for _ in 0..400 {
        let scene = mixed(&mut rng);
        let views: Vec<_> = (0..20)
            .map(|_| {
                let x = rng.cube(1.0);
                View::light(x, rng.direction(), vec3(0.0, 0.0, 5.5) + rng.cube(0.5), [rng.cube(0.6), rng.cube(0.6)])
            })
            .collect();
        sum += scene.score(&views, Test::Bounds, 2, 12);
    }
    println!("lights: {sum}");
    assert_eq!(sum.misses, 0, "{sum}");
    assert!(sum.hits > 1000 && sum.clear > 1000 && sum.precision() > 0.75, "{sum}");
}

#[test]
fn small_moving_footprints_are_predicted_well() {
    let mut rng = Rng::new(6);
    let mut sum = Score::default();
    for _ in 0..400 {
        let scene = mixed(&mut rng);
        let views: Vec<View> = (0..50)
            .map(|_| {
                let (o, aim) = (rng.cube(1.0), at(&mut rng));
                let f = rng.family(o, aim - o, 0.01);
                Family::new(o, [rng.cube(0.02), rng.cube(0.02)], f.d, f.d_p).into()
            })
            .collect();
        sum += scene.score(&views, Test::Bounds, 2, 12);
    }
    println!("moving origin: {sum}");
    assert!(sum.hits > 300 && sum.recall() > 0.98 && sum.precision() > 0.7, "{sum}");
}

fn square(z: f64, half: f64) -> Rectangle<f64> {
    Rectangle::new(vec3(0.0, 0.0, z), vec3(half, 0.0, 0.0), vec3(0.0, half, 0.0))
}

fn pixel() -> Family<f64, 2> {
    Family::fixed(Vec3::zero(), vec3(0.0, 0.0, 1.0), [vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0)])
}

#[test]
fn hidden_edges_are_no_events() {
    let behind = Rectangle::new(vec3(1.0, 0.0, 5.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0));
    let ball = Sphere::new(vec3(0.0, 0.0, 5.0), 0.2);
    Scene::new().with(square(2.0, 1.0)).with(behind).with(ball).expect(&pixel().into(), &[]);
    // The cover itself has an edge in the footprint: what lies behind may show.
    let half = Rectangle::new(vec3(-1.05, 0.0, 2.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0));
    Scene::new().with(half).with(ball).expect(&pixel().into(), &[Kind::Boundary, Kind::Silhouette]);
    // Hidden by a ball.
    let front = Sphere::new(vec3(0.0, 0.0, 3.0), 1.0);
    Scene::new().with(front).with(behind).expect(&pixel().into(), &[]);
}

#[test]
fn swaps_horizons_and_walls() {
    let tilted = Rectangle::new(vec3(0.0, 0.0, 4.0), vec3(2.0, 0.0, 1.0), vec3(0.0, 2.0, 0.0));
    Scene::new().with(square(4.0, 2.0)).with(tilted).expect(&pixel().into(), &[Kind::Swap]);
    let ball = Sphere::new(vec3(0.0, 0.0, 4.5), 0.6);
    Scene::new().with(square(4.0, 2.0)).with(ball).expect(&pixel().into(), &[Kind::Swap]);
    let view = View { horizon: Some(vec3(1.0, 0.0, 0.01)), ..pixel().into() };
    Scene::new().with(square(4.0, 2.0)).expect(&view, &[Kind::Horizon]);
    // Looking along an open tube: the rim between outer and inner wall.
    let tube = Cylinder::new(vec3(0.4, -3.0, 4.0), vec3(0.4, 0.1, 4.0), 0.3);
    let above = Family::fixed(vec3(0.0, 2.0, 2.0), vec3(0.2, -1.0, 1.0), [vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.1)]);
    assert!(Scene::new().with(tube).oracle(&above.into(), 64).has_edge());
    // The shape a ray starts from is no event.
    let own = View { exclude: Some(0), ..pixel().into() };
    Scene::new().with(square(1.0, 0.05)).expect(&own, &[]);
    Scene::new().with(square(1.0, 0.05)).expect(&pixel().into(), &[Kind::Boundary]);
    // An empty scene is clear.
    Scene::new().expect(&pixel().into(), &[]);
}

#[test]
#[should_panic(expected = "expected [Boundary], predicted [Silhouette]")]
fn a_wrong_expectation_panics() {
    Scene::new().with(Sphere::new(vec3(0.0, 0.0, 3.0), 0.1)).expect(&pixel().into(), &[Kind::Boundary]);
}

#[test]
fn chords_are_reported() {
    let scene = Scene::new().with(Rectangle::new(vec3(1.0, 0.0, 2.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 9.0, 0.0)));
    let events = scene.detect(&pixel().into(), Test::Bounds, 1);
    let [event] = &events[..] else { panic!("{events:?}") };
    let chord = event.chord.unwrap();
    assert_eq!(chord.p[0][0].abs() + chord.p[1][0].abs(), 0.0);
    assert_eq!(chord.t, [2.0, 2.0]);
    assert_eq!(event.distance, 0.0);
}
