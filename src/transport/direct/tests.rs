//! Closed forms; one mean for all methods, over pictures and their blocks; weights; determinism.

use super::*;
use crate::accel::{Accel, Ray};
use crate::formats::{LoadOptions, mitsuba_xml::load_text};
use crate::math::polygon::irradiance;
use crate::math::stats::{sidak, z_test_p};
use crate::math::{DVec3, Vec2};
use crate::scene::{LobeKind, Scene, Transport};
use rayon::prelude::*;
use std::path::Path;

const SIZE: u32 = 16;
const BLOCK: u32 = 4;

/// A scene with a camera above that looks down on what `body` puts there.
fn scene(body: &str) -> (Scene, Accel) {
    let text = format!(
        r#"<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="50"/>
        <transform name="to_world"><lookat origin="0, 4, 5" target="0, 0.4, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="{SIZE}"/><integer name="height" value="{SIZE}"/>
        <rfilter type="box"/></film></sensor>{body}</scene>"#
    );
    let loaded = load_text(Path::new("direct.xml"), &text, &LoadOptions::default()).expect("valid");
    let scene = Scene::new(loaded.description).expect("valid");
    let accel = Accel::new(&scene.shapes);
    (scene, accel)
}

const FLOOR: &str = r#"<shape type="rectangle"><transform name="to_world"><scale value="6"/><rotate x="1" angle="-90"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.6, 0.7"/></bsdf></shape>"#;

fn lamp(x: f32, y: f32, size: f32, tilt: f32) -> String {
    format!(
        r#"<shape type="rectangle"><transform name="to_world"><scale value="{size}"/><rotate x="1" angle="{tilt}"/>
        <translate x="{x}" y="{y}"/></transform><emitter type="area"><rgb name="radiance" value="5, 4, 3"/></emitter>
        <bsdf type="diffuse"/></shape>"#
    )
}

/// A floor that mirrors an upright lamp towards the camera, not sharply.
const POLISHED: &str = r#"<shape type="rectangle"><transform name="to_world"><scale value="6"/><rotate x="1" angle="-90"/></transform>
    <bsdf type="roughconductor"><float name="alpha" value="0.04"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale x="1.5" y="0.7"/><translate y="2" z="-3"/></transform>
    <emitter type="area"/></shape>"#;

/// Penumbra, sphere and mesh occluders, glossy plates, several kinds of lamps.
fn workshop() -> String {
    let occluders = r#"
    <shape type="sphere"><point name="center" x="-0.8" y="0.5" z="0.4"/><float name="radius" value="0.4"/>
        <bsdf type="diffuse"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.4" y="0.02" z="0.5"/><rotate y="1" angle="20"/>
        <translate x="0.9" y="0.7" z="0.2"/></transform><bsdf type="diffuse"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.6"/><rotate x="1" angle="-70"/>
        <translate x="0.1" y="0.2" z="1"/></transform>
        <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="-60"/>
        <translate x="-1.4" y="0.5" z="-0.8"/></transform>
        <bsdf type="roughconductor"><float name="alpha" value="0.05"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="1.2" y="0.3" z="1.4"/><float name="radius" value="0.3"/>
        <bsdf type="plastic"/></shape>"#;
    let lamps = r#"
    <shape type="sphere"><point name="center" x="2" y="1.8" z="-1"/><float name="radius" value="0.3"/>
        <emitter type="area"><rgb name="radiance" value="6, 2, 1"/></emitter></shape>
    <shape type="disk"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="70"/>
        <translate x="-1.5" y="1.6" z="-1.5"/></transform><emitter type="area"><rgb name="radiance" value="1, 2, 6"/></emitter></shape>
    <emitter type="point"><point name="position" x="0.5" y="2.2" z="1.5"/><rgb name="intensity" value="1, 1, 1"/></emitter>"#;
    format!("{FLOOR}{}{occluders}{lamps}", lamp(0.0, 2.5, 0.6, 90.0))
}

fn direct_of<'a>(world: World<'a>, sampling: LightSampling, change: impl Fn(&mut DirectSettings)) -> Direct<'a> {
    let mut settings = DirectSettings { sampling, ..DirectSettings::default() };
    change(&mut settings);
    Direct::new(world, settings)
}

/// Direct light at the first hit of the camera ray, with the scattered half of the rest, or with it alone.
fn pixel(direct: &Direct, x: u32, y: u32, seed: u64, scattered_weight: impl Fn(f32) -> f32) -> (Rgb, DirectCounts) {
    let World { scene, accel, .. } = direct.world;
    let mut rng = Sampler::new(seed, u64::from(y * SIZE + x), 0);
    let mut counts = DirectCounts::default();
    let jitter = rng.next_2d();
    let r = scene.camera.ray(Vec2::new(x as f32, y as f32) + jitter, Vec2::splat(0.5));
    let ray = Ray { o: r.o, d: r.d, tmin: r.tmin, tmax: r.tmax };
    let Some(hit) = accel.closest(&ray) else { return (Rgb::ZERO, counts) };
    let at = direct.world.surface(&ray, &hit);
    if scene.shapes[at.shape as usize].emission.is_some() {
        return (Rgb::ZERO, counts);
    }
    let wo = -ray.d;
    let (diffuse, rest) = direct.world.bsdf(&at, wo).split();
    let mut sum =
        direct.radiance(&at, diffuse.as_ref(), rest.as_ref().map(Rest::from), wo, Stage::First, &mut rng, &mut counts);
    let Some(rest) = rest else { return (sum, counts) };
    let vantage = Vantage::new(&at, diffuse.as_ref(), Some(&rest).filter(|r| !r.is_delta()), Stage::First);
    let [a, b, c, _] = rng.next_4d();
    let Some(s) = rest.sample(wo, c, Vec2::new(a, b), Transport::Radiance) else { return (sum, counts) };
    let ray = Ray::leaving(&at, s.wi);
    let (radiance, weight) = match accel.closest(&ray) {
        Some(hit) => {
            let lamp = direct.world.surface(&ray, &hit);
            let radiance = scene.lights.emitted(&scene.shapes, scene.textures(), &lamp, -ray.d);
            (radiance, direct.weight_of_scattered(&vantage, s.pdf_dir, Found::Lamp(&lamp)))
        }
        None => {
            let radiance = scene.lights.environment(scene.textures(), ray.d);
            (radiance, direct.weight_of_scattered(&vantage, s.pdf_dir, Found::Environment(ray.d)))
        }
    };
    let weight = if s.lobe == LobeKind::Specular { 1.0 } else { scattered_weight(weight) };
    sum += s.weight * radiance * weight;
    (sum, counts)
}

/// Luminance of the whole picture and of its blocks, over independent runs: mean and variance of the mean.
fn blocks(runs: u64, one: impl Fn(u32, u32, u64) -> Rgb + Sync) -> Vec<(f64, f64)> {
    let per_side = SIZE / BLOCK;
    let count = (per_side * per_side) as usize;
    let pictures: Vec<Vec<f64>> = (0..runs)
        .into_par_iter()
        .map(|run| {
            let mut sums = vec![0.0; count + 1];
            for y in 0..SIZE {
                for x in 0..SIZE {
                    let v = f64::from(crate::math::luminance(one(x, y, run)));
                    sums[(y / BLOCK * per_side + x / BLOCK) as usize] += v / f64::from(BLOCK * BLOCK);
                    sums[count] += v / f64::from(SIZE * SIZE);
                }
            }
            sums
        })
        .collect();
    let n = runs as f64;
    (0..=count)
        .map(|k| {
            let mean = pictures.iter().map(|p| p[k]).sum::<f64>() / n;
            (mean, pictures.iter().map(|p| (p[k] - mean).powi(2)).sum::<f64>() / (n * (n - 1.0)))
        })
        .collect()
}

/// Smallest p-value of equal means, block by block.
fn least_p(a: &[(f64, f64)], b: &[(f64, f64)]) -> f64 {
    // f32 rounding counts where there is no noise at all.
    let p = |(a, b): (&(f64, f64), &(f64, f64))| z_test_p(a.0, a.1 + b.1 + (1e-6 * a.0).powi(2), b.0);
    a.iter().zip(b).map(p).fold(1.0, f64::min)
}

fn agree(body: &str, runs: u64, change: impl Fn(&mut DirectSettings) + Copy + Sync) {
    let (scene, accel) = scene(body);
    let world = World::new(&scene, &accel);
    let of = |sampling, k: u64| {
        let direct = direct_of(world, sampling, change);
        blocks(runs, |x, y, run| pixel(&direct, x, y, hash_seed(k, run), |w| w).0)
    };
    let (single, full, adaptive) =
        (of(LightSampling::Single, 1), of(LightSampling::Full, 2), of(LightSampling::Adaptive, 3));
    let level = sidak(0.01, 3 * single.len());
    for (name, a, b) in [
        ("single, full", &single, &full),
        ("full, adaptive", &full, &adaptive),
        ("single, adaptive", &single, &adaptive),
    ] {
        let p = least_p(a, b);
        assert!(p > level, "{name}: p = {p}, means {:?} {:?}", a.last(), b.last());
    }
    // Companion: 3 % more light is noticed.
    let more: Vec<_> = adaptive.iter().map(|(m, v)| (m * 1.03, *v)).collect();
    assert!(least_p(&full, &more) < level, "power");
}

fn hash_seed(k: u64, run: u64) -> u64 {
    crate::math::sampler::hash(k, run)
}

#[test]
fn all_methods_have_one_mean() {
    agree(&workshop(), 100, |_| {});
}

#[test]
fn all_methods_have_one_mean_when_lights_are_drawn() {
    // Rare samples are bright: their variance is known late.
    agree(&workshop(), 1500, |s| s.max_lights = 2);
}

#[test]
fn all_methods_have_one_mean_under_an_environment() {
    let sky = r#"<emitter type="constant"><rgb name="radiance" value="0.5, 0.6, 0.8"/></emitter>
        <emitter type="directional"><vector name="direction" x="0.3" y="-1" z="-0.4"/><rgb name="irradiance" value="2, 2, 2"/></emitter>"#;
    agree(&format!("{}{sky}", workshop()), 100, |_| {});
}

#[test]
fn wrong_weights_are_noticed() {
    let (scene, accel) = scene(POLISHED);
    let world = World::new(&scene, &accel);
    let direct = direct_of(world, LightSampling::Full, |_| {});
    let with = |k: u64, weigh: fn(f32) -> f32| blocks(60, |x, y, run| pixel(&direct, x, y, hash_seed(k, run), weigh).0);
    let right = with(1, |w| w);
    for wrong in [with(2, |_| 1.0), with(3, |_| 0.0)] {
        assert!(least_p(&right, &wrong) < 1e-4, "{right:?} {wrong:?}");
    }
}

#[test]
fn wrong_verdicts_cost_no_bias_with_roulette_but_without() {
    let ball = |i: i32, y: f32| {
        let (x, z) = (0.5 * (i % 5) as f32 - 1.0, 0.5 * (i / 5) as f32 - 1.0);
        format!(
            r#"<shape type="sphere"><point name="center" x="{x}" y="{y}" z="{z}"/><float name="radius" value="0.12"/></shape>"#
        )
    };
    let with_balls = |y: f32| {
        let balls: String = (0..25).map(|i| ball(i, y)).collect();
        scene(&format!("{FLOOR}{}{balls}", lamp(0.0, 2.5, 0.8, 90.0)))
    };
    let (lit, accel) = with_balls(1.0);
    let world = World::new(&lit, &accel);
    // A detector that takes the balls to be elsewhere.
    let (blind, blind_accel) = with_balls(-50.0);
    let of = |sampling, residual: bool, k: u64| {
        let mut direct = direct_of(world, sampling, |s| s.residual = residual);
        direct.detector = EdgeDetector::new(&blind, &blind_accel);
        blocks(200, |x, y, run| pixel(&direct, x, y, hash_seed(k, run), |w| w).0)
    };
    let full = of(LightSampling::Full, false, 1);
    let level = sidak(0.01, 2 * full.len());
    let p = least_p(&full, &of(LightSampling::Adaptive, true, 2));
    assert!(p > level, "checked verdicts: p = {p}");
    let p = least_p(&full, &of(LightSampling::Adaptive, false, 3));
    assert!(p < 1e-6, "unchecked verdicts are told apart: p = {p}");
}

/// Radiance from a floor point at x under the given lamp, adaptive and without any random choice.
fn at_floor(body: &str, p: Vec3, n: Vec3) -> (Rgb, DirectCounts) {
    let (scene, accel) = scene(body);
    let world = World::new(&scene, &accel);
    let direct = direct_of(world, LightSampling::Adaptive, |s| s.residual = false);
    let o = p + n * 0.01;
    let ray = Ray { o, d: -n, tmin: 0.0, tmax: 1.0 };
    let at = world.surface(&ray, &accel.closest(&ray).expect("a receiver"));
    let (diffuse, rest) = world.bsdf(&at, n).split();
    let mut counts = DirectCounts::default();
    let value = direct.radiance(
        &at,
        diffuse.as_ref(),
        rest.as_ref().map(Rest::from),
        n,
        Stage::First,
        &mut Sampler::new(1, 2, 3),
        &mut counts,
    );
    (value, counts)
}

#[test]
fn unoccluded_rectangles_are_lambert_s_formula_to_rounding_without_a_single_sample() {
    let v = DVec3::new;
    // Above; tilted so that the floor point's horizon cuts it; behind the point.
    let cases = [(0.0, 2.5, 0.6, 90.0), (0.5, 1.0, 0.8, 130.0), (0.3, 0.2, 1.0, 180.0), (0.0, 2.5, 0.6, -90.0)];
    for (k, (x, y, size, tilt)) in cases.into_iter().enumerate() {
        let p = Vec3::new(0.7, 0.0, -1.1);
        let (value, counts) = at_floor(&format!("{FLOOR}{}", lamp(x, y, size, tilt)), p, Vec3::Y);
        let (s, c) = f64::from(tilt).to_radians().sin_cos();
        let (ex, ey) = (v(f64::from(size), 0.0, 0.0), v(0.0, c, s) * f64::from(size));
        let centre = v(f64::from(x), f64::from(y), 0.0) - p.as_dvec3();
        let corners = [centre - ex - ey, centre + ex - ey, centre + ex + ey, centre - ex + ey];
        let front = ex.cross(ey).dot(-centre) > 0.0;
        let e = if front { irradiance(&corners, DVec3::Y) } else { 0.0 };
        let expected = DVec3::new(5.0 * 0.5, 4.0 * 0.6, 3.0 * 0.7) * e / std::f64::consts::PI;
        assert!(
            (value.as_dvec3() - expected).abs().max_element() <= 2e-5 * expected.max_element(),
            "{k}: {value} {expected}"
        );
        assert_eq!((counts.light_samples, counts.shadow_rays), (0, 0), "{k}: {counts:?}");
        assert_eq!(e > 0.0, k != 3, "{k}");
    }
}

#[test]
fn blocked_lamps_give_nothing_and_take_no_samples() {
    let roof = r#"<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/>
        <translate y="1"/></transform></shape>"#;
    let (value, counts) =
        at_floor(&format!("{FLOOR}{roof}{}", lamp(0.0, 2.5, 0.6, 90.0)), Vec3::new(0.1, 0.0, 0.2), Vec3::Y);
    assert_eq!((value, counts.light_samples, counts.blocked), (Rgb::ZERO, 0, 1));
}

#[test]
fn weights_of_a_direction_add_up_to_one() {
    let (scene, accel) = scene(&format!("{POLISHED}{}", lamp(1.0, 3.0, 0.3, 90.0)));
    let world = World::new(&scene, &accel);
    let (mut tried, mut both) = (0, 0);
    for (max_lights, sampling) in [
        (8, LightSampling::Adaptive),
        (8, LightSampling::Full),
        (1, LightSampling::Adaptive),
        (8, LightSampling::Single),
    ] {
        let direct = direct_of(world, sampling, |s| s.max_lights = max_lights);
        for (stage, x) in [(Stage::First, 0.0), (Stage::Later, 0.2), (Stage::First, 0.5)] {
            let wo = Vec3::new(0.0, 4.0, 5.0).normalize();
            let ray = Ray { o: Vec3::new(x, 0.0, 0.5) + wo, d: -wo, tmin: 0.0, tmax: 9.0 };
            let at = world.surface(&ray, &accel.closest(&ray).expect("the floor"));
            let (diffuse, rest) = world.bsdf(&at, wo).split();
            let vantage = Vantage::new(&at, diffuse.as_ref(), rest.as_ref(), stage);
            let rest = rest.expect("a conductor");
            for e in 0..scene.lights.emitter_count() as u32 {
                let Some(view) = scene.lights.view(&scene.shapes, scene.textures(), e, at.p) else { continue };
                for k in 0..200 {
                    let u = Vec2::new(0.005 * k as f32, (0.37 * k as f32).fract());
                    let Some(s) = view.sample(u) else { continue };
                    let ray = Ray::leaving(&at, s.wi);
                    let Some(hit) = accel.closest(&ray) else { continue };
                    let lamp = world.surface(&ray, &hit);
                    let (f, pdf) = rest.eval_pdf(wo, s.wi, Transport::Radiance);
                    if scene.lights.emitter_at(&lamp) != Some(e) || f.min_element() <= 0.0 {
                        continue;
                    }
                    let point = Point { at: &at, diffuse: None, rest: Some(Rest::from(&rest)), wo, vantage };
                    let drawn = direct.expected_draws(&vantage, Unit::Emitter(e));
                    let by_light = point.rest_reflected(&s, direct.nominal(vantage.stage, drawn)) / f;
                    let by_scatter = direct.weight_of_scattered(&vantage, pdf, Found::Lamp(&lamp));
                    assert!((by_light.x + by_scatter - 1.0).abs() < 1e-4, "{by_light} {by_scatter}");
                    tried += 1;
                    both += u32::from(by_light.x > 1e-3 && by_light.x < 0.999);
                }
            }
        }
    }
    assert!(tried > 1000 && both > 100, "{tried} {both}");
    // A point on no lamp, and one that light sampling does not reach, have the whole weight.
    let ray = Ray { o: Vec3::Y, d: Vec3::NEG_Y, tmin: 0.0, tmax: 9.0 };
    let floor = world.surface(&ray, &accel.closest(&ray).expect("the floor"));
    let direct = direct_of(world, LightSampling::Adaptive, |_| {});
    let vantage = Vantage::new(&floor, None, None, Stage::First);
    assert_eq!(direct.weight_of_scattered(&vantage, 1.0, Found::Lamp(&floor)), 1.0);
    assert_eq!(direct.weight_of_scattered(&vantage, 1.0, Found::Environment(Vec3::Y)), 1.0);
}

#[test]
fn adaptive_needs_few_samples_where_nothing_changes_and_has_less_noise_per_ray() {
    let (scene, accel) = scene(&workshop());
    let world = World::new(&scene, &accel);
    let total = |sampling| {
        let direct = direct_of(world, sampling, |_| {});
        let mut counts = DirectCounts::default();
        for i in 0..SIZE * SIZE {
            counts += pixel(&direct, i % SIZE, i / SIZE, 7, |w| w).1;
        }
        counts
    };
    let (adaptive, full) = (total(LightSampling::Adaptive), total(LightSampling::Full));
    assert_eq!(adaptive.points, full.points);
    assert!(adaptive.shadow_rays * 3 < full.shadow_rays, "{adaptive:?} {full:?}");
    assert!(adaptive.partial > 0 && adaptive.visible > adaptive.partial && adaptive.blocked > 0);
}
