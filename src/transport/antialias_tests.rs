//! The map against rays through every part of the pixels; what must not fire; filters; determinism.

use super::*;
use crate::accel::Accel;
use crate::formats::{LoadOptions, mitsuba_xml::load_text};
use crate::scene::Scene;
use std::path::Path;

const SIZE: u32 = 48;
const SUB: u32 = 8;

fn scene(filter: &str, body: &str) -> (Scene, Accel) {
    seen_by("type=\"perspective\">", filter, body)
}

fn seen_by(camera: &str, filter: &str, body: &str) -> (Scene, Accel) {
    let text = format!(
        r#"<scene version="3.0.0"><sensor {camera}<float name="fov" value="45"/>
        <transform name="to_world"><lookat origin="0.3, 4, 5" target="0, 0.2, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="{SIZE}"/><integer name="height" value="{SIZE}"/>
        <rfilter type="{filter}"/></film></sensor>
        <shape type="rectangle"><transform name="to_world"><scale value="40"/><rotate x="1" angle="-90"/></transform></shape>
        {body}</scene>"#
    );
    let loaded = load_text(Path::new("aa.xml"), &text, &LoadOptions::default()).expect("valid");
    let scene = Scene::new(loaded.description).expect("valid");
    let accel = Accel::new(&scene.shapes);
    (scene, accel)
}

const THINGS: &str = r#"
    <shape type="cube"><transform name="to_world"><scale x="0.3" y="0.5" z="0.4"/><rotate y="1" angle="25"/>
        <translate x="-0.9" y="0.9" z="0.3"/></transform></shape>
    <shape type="sphere"><point name="center" x="0.7" y="0.6" z="-0.2"/><float name="radius" value="0.35"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.7" y="0.01" z="0.015"/><rotate y="1" angle="-30"/>
        <translate x="0.4" y="0.7" z="1.1"/></transform></shape>"#;

const POINT: &str = r#"<emitter type="point"><point name="position" x="0.8" y="3" z="1.2"/></emitter>"#;
const SUN: &str = r#"<emitter type="directional"><vector name="direction" x="0.5" y="-1" z="-0.3"/></emitter>"#;
const SMALL_LAMP: &str = r#"<shape type="rectangle"><transform name="to_world"><scale value="0.005"/><rotate x="1" angle="90"/>
    <translate x="0.8" y="3" z="1.2"/></transform><emitter type="area"/></shape>"#;
const LARGE_LAMP: &str = r#"<shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="90"/>
    <translate x="0.8" y="3" z="1.2"/></transform><emitter type="area"/></shape>"#;

const CHECKS: &str = r#"<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>
        <translate y="0.1"/></transform><bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
        <transform name="to_uv"><scale value="3"/></transform></texture></bsdf></shape>"#;

/// What rays through the parts of a pixel find: surfaces (facets of cubes apart), and whether the first light reaches them.
fn truth(world: World, x: u32, y: u32, half: f32) -> (bool, bool) {
    let World { scene, accel, .. } = world;
    let (mut surfaces, mut lit, mut turned_away) = (Vec::new(), Vec::new(), false);
    for k in 0..SUB * SUB {
        let part = (Vec2::new((k % SUB) as f32, (k / SUB) as f32) + 0.5) / SUB as f32;
        let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + (part * 2.0 - 1.0) * half;
        let r = scene.camera.ray(at, Vec2::splat(0.5));
        let ray = Ray { o: r.o, d: r.d, tmin: r.tmin, tmax: r.tmax };
        let Some(hit) = accel.closest(&ray) else {
            surfaces.push((u32::MAX, 0));
            continue;
        };
        let at = world.surface(&ray, &hit);
        let mesh = matches!(scene.shapes[at.shape as usize].geometry, Geometry::Mesh(_));
        let face = if mesh { (at.n_geo * 2.0).round().dot(Vec3::new(1.0, 10.0, 100.0)) as i32 } else { 0 };
        surfaces.push((at.shape, face));
        let view = scene.lights.view(&scene.shapes, scene.textures(), 0, at.p);
        let sample = view.and_then(|v| v.sample(Vec2::splat(0.5)));
        // Where the surface turns away from the light, its own shadow fades in: no edge.
        let Some(s) = sample.filter(|s| s.wi.dot(at.n_geo) > 0.05) else {
            turned_away = true;
            continue;
        };
        lit.push(world.transmittance(world.shadow_ray(&at, s.wi, s.distance), false).share > 0.0);
    }
    let differ = surfaces.iter().any(|s| *s != surfaces[0]);
    (differ, !differ && !turned_away && lit.iter().any(|l| *l != lit[0]))
}

/// (found, there, false alarms) of a cause among the pixels.
fn score(map: &[Causes], cause: Causes, truth: &[bool], other: &[bool]) -> (usize, usize, usize) {
    let there = truth.iter().filter(|t| **t).count();
    let found = truth.iter().zip(map).filter(|(t, c)| **t && c.intersects(cause)).count();
    let false_alarms =
        map.iter().zip(truth.iter().zip(other)).filter(|(c, (t, o))| c.intersects(cause) && !**t && !**o);
    (found, there, false_alarms.count())
}

fn maps(filter: &str, light: &str) -> (Vec<Causes>, Vec<bool>, Vec<bool>) {
    let (scene, accel) = scene(filter, &format!("{THINGS}{light}"));
    let world = World::new(&scene, &accel);
    let half = scene.film.filter.radius();
    let both: Vec<(bool, bool)> = (0..SIZE * SIZE).map(|i| truth(world, i % SIZE, i / SIZE, half)).collect();
    let map = causes(world, [0, 0, SIZE, SIZE], false);
    (map, both.iter().map(|b| b.0).collect(), both.iter().map(|b| b.1).collect())
}

#[test]
fn every_edge_that_is_seen_and_every_hard_shadow_edge_is_found() {
    for (name, light) in [("point", POINT), ("sun", SUN), ("small lamp", SMALL_LAMP)] {
        let (map, sight, shadow) = maps("box", light);
        let (found, there, false_alarms) = score(&map, Causes::SIGHT, &sight, &sight);
        assert!(there > 80 && found == there, "{name}: edges {found} of {there}");
        assert!(false_alarms * 4 < there, "{name}: edges: {false_alarms} false alarms, {there} there");
        let (found, there, false_alarms) = score(&map, Causes::SHADOW, &shadow, &sight);
        assert!(there > 50 && found == there, "{name}: shadows {found} of {there}");
        assert!(false_alarms * 2 < there, "{name}: shadows: {false_alarms} false alarms, {there} there");
    }
}

#[test]
fn a_wide_filter_has_a_wide_footprint() {
    let (map, sight, _) = maps("gaussian", LARGE_LAMP);
    let (found, there, _) = score(&map, Causes::SIGHT, &sight, &sight);
    assert_eq!(found, there);
    let (narrow, ..) = maps("box", LARGE_LAMP);
    // Companion: the box filter's map would miss some of them.
    assert!(score(&narrow, Causes::SIGHT, &sight, &sight).0 < there);
}

#[test]
fn soft_shadows_are_not_edges() {
    let (map, ..) = maps("box", LARGE_LAMP);
    assert!(!map.iter().any(|c| c.intersects(Causes::SHADOW)));
}

#[test]
fn mirrors_show_edges_and_checkered_floors_detail() {
    let body = r#"<shape type="rectangle"><transform name="to_world"><scale x="2" y="1"/><translate y="1" z="-1.5"/></transform>
        <bsdf type="conductor"/></shape>
        <shape type="sphere"><point name="center" x="0" y="0.5" z="0.2"/><float name="radius" value="0.3"/></shape>"#;
    let (plain, accel) = scene("box", body);
    let map = causes(World::new(&plain, &accel), [0, 0, SIZE, SIZE], false);
    let mirrored = map.iter().filter(|c| c.intersects(Causes::CHAIN)).count();
    assert!(mirrored > 15, "the ball's image: {mirrored}");
    assert!(!map.iter().any(|c| c.intersects(Causes::TEXTURE)));
    let (checked, accel) = scene("box", CHECKS);
    let map = causes(World::new(&checked, &accel), [0, 0, SIZE, SIZE], false);
    let share = map.iter().filter(|c| c.intersects(Causes::TEXTURE)).count() as f64 / map.len() as f64;
    // Checks of 0.5 under pixels of about 0.1: borders along two directions.
    assert!(share > 0.1 && share < 0.6, "{share}");
}

#[test]
fn hidden_lamps_have_no_edges_but_in_mirrors() {
    let mirror = r#"<shape type="rectangle"><transform name="to_world"><scale x="2" y="1"/><translate y="1" z="-1.5"/></transform>
        <bsdf type="conductor"/></shape>"#;
    // Before the camera: a ball, and behind it a box whose image is in the mirror.
    let lamps = r#"<shape type="sphere"><point name="center" x="0.2" y="2" z="2.4"/><float name="radius" value="0.15"/><emitter type="area"/></shape>
        <shape type="cube"><transform name="to_world"><scale value="0.3"/><rotate x="1" angle="20"/><translate x="0.1" y="0.8" z="-0.6"/></transform>
        <emitter type="area"/></shape>"#;
    let lens =
        r#"type="thinlens"><float name="aperture_radius" value="0.02"/><float name="focus_distance" value="6"/>"#;
    for camera in ["type=\"perspective\">", lens] {
        let map = |body: &str, hidden: bool| {
            let (scene, accel) = seen_by(camera, "box", body);
            causes(World::new(&scene, &accel), [0, 0, SIZE, SIZE], hidden)
        };
        let sight = |map: &[Causes]| map.iter().map(|c| c.intersects(Causes::SIGHT)).collect::<Vec<bool>>();
        let plain = format!("{THINGS}{mirror}");
        let (without, lit) = (map(&plain, true), map(&format!("{plain}{lamps}"), true));
        assert_eq!(sight(&lit), sight(&without), "{camera}");
        let images = |map: &[Causes]| map.iter().filter(|c| c.intersects(Causes::CHAIN)).count();
        assert!(images(&lit) > images(&without) + 10, "{camera}: {} {}", images(&lit), images(&without));
        let shown = map(&format!("{plain}{lamps}"), false);
        let more = |map: &[Causes]| sight(map).iter().filter(|s| **s).count();
        assert!(more(&shown) > more(&without) + 20, "{camera}: the lamps are out of view");
    }
}

#[test]
fn behind_hidden_lamps_there_are_textures_and_shadows() {
    let map = |body: &str| {
        let (scene, accel) = scene("box", body);
        causes(World::new(&scene, &accel), [0, 0, SIZE, SIZE], true)
    };
    // Many lamps, one behind the other, in the middle of the picture.
    let row: String = (0..100)
        .map(|i| {
            let y = 1.0 + 0.01 * f64::from(i);
            format!(
                r#"<shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="-90"/>
                <translate x="0.1" y="{y}" z="{y}"/></transform><emitter type="area"/></shape>"#
            )
        })
        .collect();
    assert_eq!(map(&format!("{CHECKS}{row}")), map(CHECKS));
    // They cast shadows.
    let shadows = |body: &str| map(body).iter().filter(|c| c.intersects(Causes::SHADOW)).count();
    let lamp = r#"<shape type="sphere"><point name="center" x="0.2" y="1.5" z="0.4"/><float name="radius" value="0.3"/>
        <emitter type="area"/></shape>"#;
    assert!(shadows(&format!("{POINT}{lamp}")) > shadows(POINT) + 20);
}

#[test]
fn samples_follow_the_causes_for_any_window_and_number_of_threads() {
    let (scene, accel) = scene("box", &format!("{THINGS}{POINT}"));
    let world = World::new(&scene, &accel);
    let settings = AntialiasSettings { samples: 5, ..AntialiasSettings::default() };
    let whole = samples_per_pixel(world, [0, 0, SIZE, SIZE], settings);
    let causes = causes(world, [0, 0, SIZE, SIZE], false);
    assert!(whole.iter().zip(&causes).all(|(s, c)| *s == if c.0 == 0 { 1 } else { 5 }));
    let part = samples_per_pixel(world, [10, 20, 7, 5], settings);
    let cut: Vec<u16> =
        (20..25).flat_map(|y| (10..17).map(move |x| (x, y))).map(|(x, y)| whole[(y * SIZE + x) as usize]).collect();
    assert_eq!(part, cut);
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        assert_eq!(pool.install(|| samples_per_pixel(world, [0, 0, SIZE, SIZE], settings)), whole);
    }
    assert!(
        samples_per_pixel(world, [0, 0, SIZE, SIZE], AntialiasSettings { samples: 0, ..AntialiasSettings::default() })
            .iter()
            .all(|s| *s == 1)
    );
}
