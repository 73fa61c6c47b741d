//! Yue, Onoue & Nishita: extended irradiance caching, records over the whole scene that keep the hits of their gather rays.
//!
//! First frame   records where rays from a few points pierce surfaces, and at points uniform by area; then for what the camera sees
//! Moved camera  records only where there is none yet: the frame is interpolated
//! Moved light   no gather ray: the stored hits are evaluated under the new light ([`IrradianceCache::relight`]), and the frame is interpolated
//!               from what is there. Beside it a cache made anew under that light: what it costs, how far the two frames differ
//!
//! Frames are the indirect irradiance at what every pixel sees, as in the paper's tables; direct light is not part of them. The lights of the scene
//! are replaced by one point light of their power before the first lamp, which can move without a change of the geometry.
//! Times are CPU seconds, the means of [`STEPS`] steps. The paper's seconds stand beside ours as ratios: its machine is not named.

use super::{Findings, ReproduceArgs, existing};
use crate::accel::{Accel, Ray};
use crate::cli::compare::configuration::Config;
use crate::cli::load::{SceneArgs, SimdChoice};
use crate::cli::{Failure, session, tell};
use crate::integrators::photon::places::places;
use crate::math::{DMat4, Rgb, Vec2, Vec3, luminance};
use crate::report::table::{NOTHING, Table, count};
use crate::scene::description::LightDesc;
use crate::scene::light::LightKind;
use crate::scene::{Description, Scene};
use crate::transport::cache_placement::{UniformPlaces, pierced_places};
use crate::transport::gather_cache::GatherHit;
use crate::transport::{CacheSettings, HitLight, IrradianceCache, Place, World};
use cpu_time::ProcessTime;
use serde_json::json;
use std::f64::consts::PI;
use std::path::Path;

/// Steps of the camera and of the light.
const STEPS: u32 = 3;
/// Turn of the camera around what it looks at in each step, degrees.
const TURN: f64 = 5.0;
/// Way of the light in each step: share of what is free before it, and of the scene's radius at most.
const WAY: (f32, f32) = (0.15, 0.1);
/// Points from which rays pierce the scene, in radii from its middle; rays from each; places uniform by area.
const ORIGINS: [[f32; 3]; 5] =
    [[0.0, 0.0, 0.0], [0.3, 0.2, 0.1], [-0.3, 0.1, -0.2], [0.1, -0.2, 0.3], [-0.1, -0.3, -0.3]];
const RAYS: u32 = 2000;
const POINTS: u32 = 100_000;

/// A scene of the paper: name, polygons, gather rays per record, records, seconds for a moved camera and for a moved light.
struct PaperScene {
    name: &'static str,
    polygons: f64,
    rays: f64,
    records: f64,
    camera: f64,
    light: f64,
}

const PAPER: [PaperScene; 2] = [
    PaperScene { name: "a, two spheres", polygons: 18_000.0, rays: 200.0, records: 7_382.0, camera: 1.3, light: 2.7 },
    PaperScene { name: "b, dragon", polygons: 48_000.0, rays: 200.0, records: 13_092.0, camera: 1.7, light: 7.4 },
];

/// The second scene, in the folder of the first.
const SECOND: &str = "textured-vase.xml";

const DOUBTS: [&str; 3] = [
    "the radical inverse as printed (eq. 4) runs up to 2, and e0 = i / N makes the first ray tangent: neither is followed; gather rays are stratified \
     and jittered",
    "no error is stated, and the look-up threshold of the frames is looser than that of the pre-process by an amount that is not given",
    "neither the machine nor the time of the pre-process is given: only the ratio of a moved light to a moved camera can be compared",
];

/// What one scene gave.
#[derive(Clone, Debug, serde::Serialize)]
struct Measured {
    scene: String,
    triangles: usize,
    pixels: usize,
    gather_rays_per_record: usize,
    /// After the first frame.
    records: usize,
    /// Gather rays of records and surfels until then.
    gather_rays: u64,
    stored_hits_mib: f64,
    first_frame_seconds: f64,
    moved_camera_seconds: f64,
    moved_light_seconds: f64,
    anew_seconds: f64,
    moved_camera_new_records: usize,
    moved_camera_records: usize,
    moved_camera_gather_rays: u64,
    moved_light_gather_rays: u64,
    moved_light_shadow_rays: u64,
    /// Share of places without a record after the light has moved.
    moved_light_missing: f64,
    /// Root mean square difference of the relit frame to that of a cache made anew, of its mean.
    moved_light_difference: f64,
}

/// Measures the scenes and puts them beside the paper.
pub fn findings(args: &ReproduceArgs) -> Result<Findings, Failure> {
    let first = existing(&args.scene)?;
    let second = first.with_file_name(SECOND);
    let mut measured = Vec::new();
    for path in [Some(&first), Some(&second).filter(|p| **p != first && p.exists())].into_iter().flatten() {
        if !args.quiet {
            tell(format_args!("{}:", path.display()));
        }
        measured.push(measure(path, args)?);
    }
    Ok(report(&measured))
}

/// The scene with one point light at `position` and a camera turned by `turn` degrees around `target`.
fn variant(base: &Description, (position, intensity): (Vec3, Rgb), turn: f64, target: Vec3) -> Result<Scene, Failure> {
    let mut desc = base.clone();
    desc.shapes.iter_mut().for_each(|s| s.emission = None);
    desc.lights = vec![LightDesc::Point { position: position.as_dvec3(), intensity }];
    let to_world = &mut desc.camera.to_world;
    let up = to_world.y_axis.truncate().normalize();
    let centre = target.as_dvec3();
    let around = DMat4::from_axis_angle(up, turn.to_radians());
    *to_world = DMat4::from_translation(centre) * around * DMat4::from_translation(-centre) * *to_world;
    Ok(Scene::new(desc)?)
}

/// Where a light of the scene's power stands: before its first lamp, or where its first light without extent is.
fn light_of(scene: &Scene) -> (Vec3, Rgb) {
    let (middle, radius) = scene.bounds;
    let power: Rgb = scene.lights.infos.iter().map(|l| l.power).sum();
    let place = match (!scene.lights.is_empty()).then(|| scene.lights.kind(0)) {
        Some(LightKind::Lamp(shape)) => {
            let (at, _) = scene.shapes[shape as usize].sample_area(shape, 0, Vec2::splat(0.5));
            at.p + at.n_shade * (0.1 * radius)
        }
        _ => middle,
    };
    let intensity = power / (4.0 * PI as f32);
    (place, if intensity == Rgb::ZERO { Rgb::ONE } else { intensity })
}

/// The light's next place: some way along the axis with the most room.
fn next_place(world: &World, from: Vec3) -> Vec3 {
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let radius = world.scene.bounds.1;
    let room = |d: Vec3| {
        let ray = Ray { o: from, d, tmin: 0.0, tmax: f32::INFINITY };
        // Where nothing is in the way the light would leave the scene.
        world.accel.closest(&ray).map_or(0.0, |hit| hit.t)
    };
    let (d, free) =
        axes.map(|d| (d, room(d))).into_iter().fold((Vec3::ZERO, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    from + d * (WAY.0 * free).min(WAY.1 * radius)
}

/// Indirect irradiance at every place; black where there is no record.
fn frame(cache: &IrradianceCache, places: &[Place]) -> (Vec<Rgb>, usize) {
    let look = |p: &Place| cache.lookup(p.facet.p, p.facet.n_shade, p.facet.n_geo);
    let found: Vec<Option<Rgb>> = places.iter().map(look).collect();
    let missing = found.iter().filter(|e| e.is_none()).count();
    (found.into_iter().map(Option::unwrap_or_default).collect(), missing)
}

/// Rays so far: (gather rays, shadow rays).
fn rays(cache: &IrradianceCache) -> (u64, u64) {
    let s = cache.statistics();
    let all = s.record_rays + s.surfel_rays;
    (all.rays, all.shadow_rays)
}

fn nothing(_: Vec3, _: Vec3) -> Rgb {
    Rgb::ZERO
}

/// A cache over the whole scene, view-independent, and for what the first camera sees.
fn prepared<'a>(world: World<'a>, seen: &[Place], pixel: f32) -> IrradianceCache<'a> {
    let light = HitLight::Operator { caustic: &nothing };
    let (middle, radius) = world.scene.bounds;
    let origins = ORIGINS.map(|o| middle + Vec3::from_array(o) * radius);
    let mut cache = IrradianceCache::new(world, CacheSettings::default());
    cache.fill(&pierced_places(&world, &origins, RAYS, pixel, 0), &light, usize::MAX);
    cache.fill(&UniformPlaces { points: POINTS, pixel, seed: 0 }.sample(&world), &light, usize::MAX);
    cache.fill(seen, &light, usize::MAX);
    cache.finish();
    cache
}

fn measure(path: &Path, args: &ReproduceArgs) -> Result<Measured, Failure> {
    let scene = SceneArgs {
        scene: path.to_owned(),
        define: Vec::new(),
        strict: false,
        threads: args.threads,
        simd: SimdChoice::Auto,
    };
    let mut config = Config::new("", "")?.with_scene(&scene);
    config.args.scale = args.scale;
    let base = session::describe(&config.args)?.description;
    let original = Scene::new(base.clone())?;
    let accel = Accel::new(&original.shapes);
    let (position, intensity) = light_of(&original);
    let middle = Vec2::new(original.film.width as f32, original.film.height as f32) * 0.5;
    let axis = original.camera.ray(middle, Vec2::splat(0.5));
    let hit = accel.closest(&Ray { o: axis.o, d: axis.d, tmin: axis.tmin, tmax: axis.tmax });
    let target = hit.map_or(original.bounds.0, |hit| axis.o + axis.d * hit.t);
    let window = original.film.crop;

    let first = variant(&base, (position, intensity), 0.0, target)?;
    let world = World::new(&first, &accel);
    let start = ProcessTime::now();
    let seen = places(world, window, 1, None, false);
    let mut widths: Vec<f32> = seen.iter().map(|p| p.pixel).collect();
    widths.sort_by(f32::total_cmp);
    let pixel = widths.get(widths.len() / 2).copied().unwrap_or(0.0);
    let mut cache = prepared(world, &seen, pixel);
    let _ = frame(&cache, &seen);
    let first_frame_seconds = start.elapsed().as_secs_f64();
    let (records, gather_rays) = (cache.records().len(), rays(&cache).0);

    let per_step = |total: f64| total / f64::from(STEPS);
    let light = HitLight::Operator { caustic: &nothing };
    let mut camera_seconds = 0.0;
    for step in 1..=STEPS {
        let moved = variant(&base, (position, intensity), TURN * f64::from(step), target)?;
        let start = ProcessTime::now();
        let seen = places(World::new(&moved, &accel), window, 1, None, false);
        let before = cache.records().len();
        cache.fill(&seen, &light, usize::MAX);
        if cache.records().len() > before {
            cache.finish();
        }
        let _ = frame(&cache, &seen);
        camera_seconds += start.elapsed().as_secs_f64();
    }
    let (moved_camera_records, moved_camera_rays) = (cache.records().len(), rays(&cache));

    let mut light_scenes = Vec::new();
    let mut place = position;
    for _ in 0..STEPS {
        place = next_place(&world, place);
        light_scenes.push(variant(&base, (place, intensity), 0.0, target)?);
    }
    let (mut light_seconds, mut relit, mut missing) = (0.0, Vec::new(), 0);
    for moved in &light_scenes {
        let world = World::new(moved, &accel);
        let start = ProcessTime::now();
        cache.relight(world, &light);
        let seen = places(world, window, 1, None, false);
        (relit, missing) = frame(&cache, &seen);
        light_seconds += start.elapsed().as_secs_f64();
    }
    let after = rays(&cache);

    let last = World::new(light_scenes.last().unwrap_or(&first), &accel);
    let start = ProcessTime::now();
    let seen = places(last, window, 1, None, false);
    let (anew, _) = frame(&prepared(last, &seen, pixel), &seen);
    let anew_seconds = start.elapsed().as_secs_f64();
    let n = cache.gather_rays().strata.len();
    Ok(Measured {
        scene: path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned()),
        triangles: original.triangle_count(),
        pixels: window[2] as usize * window[3] as usize,
        gather_rays_per_record: n,
        records,
        gather_rays,
        stored_hits_mib: (records * n * size_of::<GatherHit>()) as f64 / f64::from(1 << 20),
        first_frame_seconds,
        moved_camera_seconds: per_step(camera_seconds),
        moved_light_seconds: per_step(light_seconds),
        anew_seconds,
        moved_camera_new_records: moved_camera_records - records,
        moved_camera_records,
        moved_camera_gather_rays: moved_camera_rays.0 - gather_rays,
        moved_light_gather_rays: after.0 - moved_camera_rays.0,
        moved_light_shadow_rays: (after.1 - moved_camera_rays.1) / u64::from(STEPS),
        moved_light_missing: missing as f64 / seen.len().max(1) as f64,
        moved_light_difference: difference(&relit, &anew),
    })
}

/// Root mean square difference of two frames over the mean of the second.
fn difference(a: &[Rgb], b: &[Rgb]) -> f64 {
    let level = |c: &Rgb| f64::from(luminance(*c));
    let n = b.len().max(1) as f64;
    let mean = b.iter().map(level).sum::<f64>() / n;
    let square = a.iter().zip(b).map(|(a, b)| (level(a) - level(b)).powi(2)).sum::<f64>() / n;
    square.sqrt() / mean
}

fn report(all: &[Measured]) -> Findings {
    let sum = |value: fn(&Measured) -> f64| all.iter().map(value).sum::<f64>();
    let of = |i: usize, value: fn(&Measured) -> f64| all.get(i).map(value).filter(|v| v.is_finite());
    let share = |m: &Measured| m.moved_camera_new_records as f64 / m.moved_camera_records.max(1) as f64;
    let figures = vec![
        ("moved_light_gather_rays", Some(sum(|m| m.moved_light_gather_rays as f64))),
        (
            "moved_camera_new_records_share",
            Some(sum(|m| m.moved_camera_new_records as f64) / sum(|m| m.moved_camera_records as f64).max(1.0)),
        ),
        ("moved_light_over_moved_camera_a", of(0, |m| m.moved_light_seconds / m.moved_camera_seconds)),
        ("moved_light_over_moved_camera_b", of(1, |m| m.moved_light_seconds / m.moved_camera_seconds)),
        ("first_frame_over_moved_camera_a", of(0, |m| m.first_frame_seconds / m.moved_camera_seconds)),
        ("first_frame_over_moved_camera_b", of(1, |m| m.first_frame_seconds / m.moved_camera_seconds)),
        ("anew_over_moved_light_a", of(0, |m| m.anew_seconds / m.moved_light_seconds)),
        ("anew_over_moved_light_b", of(1, |m| m.anew_seconds / m.moved_light_seconds)),
        ("moved_light_difference_a", of(0, |m| m.moved_light_difference)),
        ("moved_light_difference_b", of(1, |m| m.moved_light_difference)),
    ];
    let mut header = vec![String::new()];
    for (paper, own) in PAPER.iter().zip(all) {
        header.extend([format!("paper: {}", paper.name), own.scene.clone()]);
    }
    let mut rows = Vec::new();
    let mut row = |name: &str, paper: &dyn Fn(&PaperScene) -> Option<String>, own: &dyn Fn(&Measured) -> String| {
        let mut cells = vec![name.to_string()];
        for (p, m) in PAPER.iter().zip(all) {
            cells.extend([paper(p).unwrap_or(NOTHING.into()), own(m)]);
        }
        rows.push(cells);
    };
    let ratio = |v: f64| format!("{v:.2}");
    let percent = |v: f64| format!("{:.2} %", 100.0 * v);
    row("pixels", &|_| Some(count(512.0 * 512.0)), &|m| count(m.pixels as f64));
    row("polygons (ours: triangles of meshes)", &|p| Some(count(p.polygons)), &|m| count(m.triangles as f64));
    row("gather rays per record", &|p| Some(count(p.rays)), &|m| count(m.gather_rays_per_record as f64));
    row("records", &|p| Some(count(p.records)), &|m| count(m.records as f64));
    row("stored hits", &|p| Some(count(p.records * p.rays)), &|m| count((m.records * m.gather_rays_per_record) as f64));
    row("  MiB", &|_| None, &|m| format!("{:.1}", m.stored_hits_mib));
    row("gather rays, first frame", &|_| None, &|m| count(m.gather_rays as f64));
    row("gather rays, moved camera, all steps", &|_| None, &|m| count(m.moved_camera_gather_rays as f64));
    row("gather rays, moved light, all steps", &|_| Some("0".into()), &|m| count(m.moved_light_gather_rays as f64));
    row("shadow rays, moved light, each step", &|_| None, &|m| count(m.moved_light_shadow_rays as f64));
    row("new records of a moved camera, of all", &|_| None, &|m| percent(share(m)));
    row("time: moved light / moved camera", &|p| Some(ratio(p.light / p.camera)), &|m| {
        ratio(m.moved_light_seconds / m.moved_camera_seconds)
    });
    row("time: first frame / moved camera", &|_| None, &|m| ratio(m.first_frame_seconds / m.moved_camera_seconds));
    row("time: first frame / moved light", &|_| None, &|m| ratio(m.first_frame_seconds / m.moved_light_seconds));
    row("time: cache made anew / moved light", &|_| None, &|m| ratio(m.anew_seconds / m.moved_light_seconds));
    row("moved light, rms difference to a cache made anew", &|_| None, &|m| percent(m.moved_light_difference));
    row("moved light, pixels without a record", &|_| None, &|m| percent(m.moved_light_missing));
    let table = ("Extended irradiance caching: indirect light of frames, CPU time".to_string(), Table { header, rows });
    let curves = vec![("scenes", json!(all))];
    Findings { tables: vec![table], doubts: DOUBTS.to_vec(), figures, curves, plots: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(light: f64) -> Measured {
        Measured {
            scene: "s".into(),
            triangles: 12,
            pixels: 100,
            gather_rays_per_record: 256,
            records: 900,
            gather_rays: 300_000,
            stored_hits_mib: 8.0,
            first_frame_seconds: 4.0,
            moved_camera_seconds: 0.5,
            moved_light_seconds: light,
            anew_seconds: 3.0,
            moved_camera_new_records: 100,
            moved_camera_records: 1000,
            moved_camera_gather_rays: 30_000,
            moved_light_gather_rays: 7,
            moved_light_shadow_rays: 10,
            moved_light_missing: 0.01,
            moved_light_difference: 0.02,
        }
    }

    #[test]
    fn figures_follow_from_known_measurements() {
        let found = report(&[known(1.0)]);
        let figure = |name: &str| found.figures.iter().find(|f| f.0 == name).unwrap().1;
        assert_eq!(figure("moved_light_gather_rays"), Some(7.0));
        assert_eq!(figure("moved_camera_new_records_share"), Some(0.1));
        assert_eq!(figure("moved_light_over_moved_camera_a"), Some(2.0));
        assert_eq!(figure("anew_over_moved_light_a"), Some(3.0));
        assert_eq!(figure("moved_light_over_moved_camera_b"), None, "a scene that was not measured has no figure");
        let (_, table) = &found.tables[0];
        assert!(table.rows.iter().all(|r| r.len() == table.header.len()));
        let row = |name: &str| table.rows.iter().find(|r| r[0].starts_with(name)).unwrap();
        assert_eq!(row("time: moved light / moved camera")[1..], ["2.08", "2.00"]);
        assert_eq!(row("records")[1..], ["7382", "900"]);
    }

    #[test]
    fn the_difference_is_relative_to_the_mean() {
        let [a, b] = [[1.0, 3.0], [2.0, 2.0]].map(|v: [f32; 2]| v.map(Rgb::splat));
        assert!((difference(&a, &b) - 0.5).abs() < 1e-6);
    }
}
