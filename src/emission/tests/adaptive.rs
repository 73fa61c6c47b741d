//! Edge-adaptive emission against uniform emission: the same means, less variance, exact flux, and no pilot that is reused.

use super::*;
use crate::accel::{Accel, Ray};
use crate::math::stats::z_test_p;

/// What a ray meets first: shape and point.
pub(super) fn first_hit(accel: &Accel, ray: &EmittedRay) -> Option<(u32, Vec3)> {
    let hit = accel.closest(&Ray { o: ray.o, d: ray.d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY })?;
    Some((hit.shape, ray.o + ray.d * hit.t))
}

fn sum(density: &dyn EmissionDensity, pass: u64, f: &dyn Fn(&EmittedRay) -> f64) -> f64 {
    (0..density.count()).filter_map(|i| density.emit(i, pass)).map(|r| f(&r)).sum()
}

/// Mean over passes, variance of one pass.
fn moments(density: &dyn EmissionDensity, passes: u64, f: &dyn Fn(&EmittedRay) -> f64) -> (f64, f64) {
    let values: Vec<f64> = (0..passes).map(|p| sum(density, p, f)).collect();
    let mean = values.iter().sum::<f64>() / passes as f64;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (passes - 1) as f64;
    (mean, variance)
}

#[test]
fn cells_carry_the_power_of_the_light() {
    for (name, scene) in every_light() {
        let accel = Accel::new(&scene.shapes);
        let adaptive = EdgeAdaptive::new(&scene, &accel, 2000, &Settings::default(), 3);
        assert!((1990..=2010).contains(&adaptive.count()), "{name}: {}", adaptive.count());
        let power = f64::from(scene.lights.infos[0].power.y);
        let passes = 20;
        let (mean, _) = moments(&adaptive, passes, &|r| f64::from(r.flux.y));
        // Textures vary inside of cells, and the border of a disk runs through cells of its square.
        let exact = !scene.lights.is_estimated(0, &scene.shapes) && !name.starts_with("spot") && name != "directional";
        let bound = if exact { 1e-4 } else { 0.01 };
        if !["disk, textured", "facets, textured"].contains(&name) {
            assert!((mean / power - 1.0).abs() < bound, "{name}: {mean} {power}");
        }
        let summary = adaptive.summary();
        assert_eq!(summary.cells, adaptive.strata().len());
        if exact && summary.cells > 0 {
            assert!((summary.kept / summary.power - 1.0).abs() < 1e-4, "{name}: {summary:?}");
        }
        // What was drawn in a cell lies in it.
        for r in (0..2000).step_by(7).filter_map(|i| adaptive.emit(i, 5)) {
            if (r.stratum as usize) < summary.cells {
                let (id, f) =
                    adaptive.invert(0, r.o.as_dvec3(), r.d.as_dvec3()).unwrap_or_else(|| panic!("{name}: {r:?}"));
                let near = id == r.stratum as usize || f.iter().any(|x| !(1e-2..0.99).contains(x));
                assert!(near, "{name}: cell {id} for {r:?}, {f:?}");
            }
        }
    }
}

/// A lamp over a floor with a ball between: flux that lands on a small rectangle across the ball's shadow.
fn shadow_scene(light: usize) -> Scene {
    let v = DVec3::new;
    let floor = shape(GeometryDesc::Rectangle, placed(DVec3::ZERO, v(3.0, 0.0, 0.0), v(0.0, 0.0, -3.0)), 0, None);
    let ball = shape(GeometryDesc::Sphere { center: v(0.1, 1.0, 0.2), radius: 0.5 }, DMat4::IDENTITY, 0, None);
    let down = placed(v(0.0, 3.0, 0.0), v(0.12, 0.0, 0.0), v(0.0, 0.0, 0.12));
    let lamp = |g: GeometryDesc| lit(g, down);
    match light {
        0 => scene(vec![floor, ball, lamp(GeometryDesc::Rectangle)], vec![]),
        1 => scene(vec![floor, ball, lamp(GeometryDesc::Disk)], vec![]),
        2 => scene(
            vec![floor, ball, lit(GeometryDesc::Sphere { center: v(0.0, 3.0, 0.0), radius: 0.1 }, DMat4::IDENTITY)],
            vec![],
        ),
        3 => scene(vec![floor, ball], vec![LightDesc::Point { position: v(0.0, 3.0, 0.0), intensity: Vec3::ONE }]),
        _ => scene(
            vec![floor, ball],
            vec![LightDesc::Directional { direction: v(0.1, -1.0, 0.0), irradiance: Vec3::ONE }],
        ),
    }
}

#[test]
fn means_agree_and_variance_is_lower_at_equal_budget() {
    for light in 0..5 {
        let scene = shadow_scene(light);
        let accel = Accel::new(&scene.shapes);
        let receiver = |r: &EmittedRay| match first_hit(&accel, r) {
            // The shadow's border crosses it.
            Some((0, p)) if (p.x - 0.9).abs() < 0.8 && (p.z - 0.2).abs() < 0.9 => f64::from(r.flux.y),
            _ => 0.0,
        };
        let n = 2000;
        let random = Uniform::new(&scene, n, Sequence::Random, 1);
        let sobol = Uniform::new(&scene, n, Sequence::OwenSobol, 1);
        let adaptive = EdgeAdaptive::new(&scene, &accel, n, &Settings::default(), 1);
        let passes = 150;
        let [a, b, c] = [&random as &dyn EmissionDensity, &sobol, &adaptive].map(|d| moments(d, passes, &receiver));
        let p = z_test_p(a.0 - c.0, (a.1 + c.1) / passes as f64, 0.0);
        assert!(p > 0.002, "light {light}: {a:?} {c:?}, p = {p}");
        // Equivalence: within 3 % at three standard errors.
        let error = ((a.1 + c.1) / passes as f64).sqrt();
        assert!((a.0 - c.0).abs() + 3.0 * error < 0.06 * a.0, "light {light}: {a:?} {c:?}");
        // Companion: 10 % too much flux is seen.
        assert!(z_test_p(a.0 - 1.1 * c.0, (a.1 + c.1) / passes as f64, 0.0) < 1e-3);
        println!("light {light}: variance random {:.3e}, Sobol {:.3e}, adaptive {:.3e}", a.1, b.1, c.1);
        assert!(c.1 < 0.3 * a.1, "light {light}: against random {a:?} {c:?}");
        assert!(c.1 < 0.9 * b.1, "light {light}: against Sobol {b:?} {c:?}");
    }
}

#[test]
fn cells_are_fine_where_the_light_sees_edges() {
    let scene = shadow_scene(3);
    let accel = Accel::new(&scene.shapes);
    let adaptive = EdgeAdaptive::new(&scene, &accel, 4000, &Settings::default(), 1);
    // The silhouette of the ball, as seen from the light.
    let (o, c, r) = (DVec3::new(0.0, 3.0, 0.0), DVec3::new(0.1, 1.0, 0.2), 0.5);
    let axis = (c - o).normalize();
    let angle = (r / (c - o).length()).asin();
    let side = axis.any_orthonormal_vector();
    let across = axis.cross(side);
    let at = |angle: f64, turn: f64| {
        let d = axis * angle.cos() + (side * turn.cos() + across * turn.sin()) * angle.sin();
        adaptive.strata()[adaptive.invert(0, o, d).expect("a cell").0]
    };
    let mean = |angle: f64| (0..32).map(|i| at(angle, f64::from(i) * 0.19634).flux).sum::<f64>() / 32.0;
    assert!((0..32).all(|i| at(angle, f64::from(i) * 0.19634).event), "the silhouette lies in cells with events");
    assert!(mean(angle) < 0.55 * mean(0.5 * angle), "{} {}", mean(angle), mean(0.5 * angle));
    assert!(!at(0.3 * angle, 1.0).event, "no event in the middle of the ball");
}

/// METHODS 3.B, "pilot reuse": one cell, of which a tenth of the flux lands on a receiver. Four photons are right; one that is kept if it lands and is joined by
/// three more if it does not... is wrong, whichever way the stored photon decides.
#[test]
fn a_stored_photon_must_not_decide_about_refinement() {
    let scene = shadow_scene(3);
    let accel = Accel::new(&scene.shapes);
    let settings = Settings { cells: 1, sequence: Sequence::Random, ..Settings::default() };
    let n = 6 * 4;
    let adaptive = EdgeAdaptive::new(&scene, &accel, n.max(40), &settings, 1);
    // The face towards the floor.
    let cells = adaptive.strata();
    let below = cells.iter().position(|s| s.cell.face == 3).expect("a face along -y");
    let s = cells[below];
    assert!(s.photons >= 4, "{s:?}");
    let lands = |k: usize, pass: u64| {
        let r = adaptive.emit(s.first + k, pass).expect("a photon");
        match first_hit(&accel, &r) {
            Some((0, p)) if p.x > 1.3 && p.x < 2.0 => 1.0,
            _ => 0.0,
        }
    };
    let passes = 20_000;
    let mean = |f: &dyn Fn(u64) -> f64| (0..passes).map(f).sum::<f64>() / passes as f64;
    let all = |pass: u64| (0..4).map(|k| lands(k, pass)).sum::<f64>() / 4.0;
    let truth = mean(&|pass| lands(0, pass + 1_000_000));
    let honest = mean(&all);
    let reused = mean(&|pass| if lands(0, pass) > 0.0 { all(pass) } else { 0.0 });
    let error = (truth * (1.0 - truth) / passes as f64).sqrt();
    assert!((0.05..0.3).contains(&truth));
    assert!((honest - truth).abs() < 4.0 * error, "{honest} {truth}");
    assert!(reused < 0.6 * truth, "{reused} {truth}: the trap is there");
}

#[test]
fn the_partition_is_the_same_for_any_number_of_threads() {
    let scene = shadow_scene(0);
    let accel = Accel::new(&scene.shapes);
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| EdgeAdaptive::new(&scene, &accel, 3000, &Settings::default(), 1).strata().to_vec())
    };
    let one = build(1);
    assert_eq!(one, build(2));
    assert_eq!(one, build(7));
}

#[test]
fn the_density_map_averages_to_one_and_is_bright_at_the_silhouette() {
    use crate::emission::chart::{cube, hemicube};
    for light in [0, 3] {
        let scene = shadow_scene(light);
        let accel = Accel::new(&scene.shapes);
        let adaptive = EdgeAdaptive::new(&scene, &accel, 8000, &Settings::default(), 1);
        let map = adaptive.density_map(0, 128).expect("it is cut");
        let faces = if light == 0 { hemicube() } else { cube() };
        assert_eq!((map.width, map.values.len()), (128 * faces.len(), 128 * 128 * faces.len()));
        let (mut sum, mut whole) = (0.0, 0.0);
        for (i, value) in map.values.iter().enumerate() {
            let (face, at) = map.place(i % map.width, i / map.width);
            let face = &faces[face];
            if f64::from(at.y) > face.y[0] {
                let measure = face.density(f64::from(at.x), f64::from(at.y));
                sum += f64::from(*value) * measure;
                whole += measure;
            } else {
                assert_eq!(*value, 0.0, "no cells there");
            }
        }
        // Cells are not whole pixels.
        assert!((sum / whole - 1.0).abs() < 0.05, "{light}: {}", sum / whole);
        assert!(map.values.iter().fold(0f32, |m, v| m.max(*v)) > 1.5);
        assert!(adaptive.density_map(1, 4).is_none(), "there is one light only");
    }
}

#[test]
fn learned_weights_move_photons_between_lights_and_not_flux() {
    let v = DVec3::new;
    let point = |x: f64| LightDesc::Point { position: v(x, 2.0, 0.0), intensity: Vec3::ONE };
    let floor = shape(GeometryDesc::Rectangle, placed(DVec3::ZERO, v(3.0, 0.0, 0.0), v(0.0, 0.0, -3.0)), 0, None);
    let scene = scene(vec![floor], vec![point(-1.0), point(1.0), LightDesc::Constant { radiance: Vec3::splat(0.01) }]);
    let accel = Accel::new(&scene.shapes);
    let mut adaptive = EdgeAdaptive::new(&scene, &accel, 4000, &Settings { cells: 300, ..Settings::default() }, 1);
    let power: f64 = scene.lights.infos.iter().map(|l| f64::from(l.power.y)).sum();
    let of = |d: &EdgeAdaptive, light: u32| {
        (0..d.count()).filter(|&i| d.emit(i, 0).is_some_and(|r| r.light == light)).count()
    };
    let before = [0, 1, 2].map(|l| of(&adaptive, l));
    adaptive.set_light_weights(&[0.0, 1.0, 0.0], 0);
    let after = [0, 1, 2].map(|l| of(&adaptive, l));
    assert!(after[1] > before[1] * 3 / 2 && after.iter().all(|&n| n > 0), "{before:?} {after:?}");
    let (mean, _) = moments(&adaptive, 4, &|r| f64::from(r.flux.y));
    assert!((mean / power - 1.0).abs() < 1e-4, "{mean} {power}");
}

/// Other numbers of photons: cells share them anew, each keeps one, and the flux stays the power of the light.
#[test]
fn the_number_of_photons_may_change_between_passes() {
    let scene = shadow_scene(0);
    let accel = Accel::new(&scene.shapes);
    let mut adaptive = EdgeAdaptive::new(&scene, &accel, 2000, &Settings::default(), 3);
    let power = f64::from(scene.lights.infos[0].power.y);
    let cells = adaptive.strata().len();
    let drawn =
        |d: &EdgeAdaptive, pass: u64| -> Vec<EmittedRay> { (0..d.count()).filter_map(|i| d.emit(i, pass)).collect() };
    let first = drawn(&adaptive, 0);
    for (pass, n) in [(1, 8000), (2, 1000), (4, 10)] {
        adaptive.set_count(n, pass);
        // One photon for each cell at least, whatever is asked for.
        let wanted = n.max(cells);
        assert!(adaptive.count().abs_diff(wanted) <= wanted / 100, "{n}: {}", adaptive.count());
        let flux = (pass..pass + 20).map(|p| sum(&adaptive, p, &|r| f64::from(r.flux.y))).sum::<f64>() / 20.0;
        assert!((flux / power - 1.0).abs() < 0.01, "{n}: {flux}, not {power}");
        // Each stratum goes on with its sequence: no photon comes twice.
        let again = drawn(&adaptive, pass).iter().filter(|r| first.iter().any(|f| f.d == r.d && f.o == r.o)).count();
        assert_eq!(again, 0, "{n}");
    }
}

/// A light with cells of its own that can expect less than a photon: it must not share those of the faint ones as well.
#[test]
fn a_light_whose_share_has_become_faint_is_not_emitted_twice() {
    let v = DVec3::new;
    let point =
        |x: f64, intensity: f32| LightDesc::Point { position: v(x, 2.0, 0.0), intensity: Vec3::splat(intensity) };
    let floor = shape(GeometryDesc::Rectangle, placed(DVec3::ZERO, v(3.0, 0.0, 0.0), v(0.0, 0.0, -3.0)), 0, None);
    let scene = scene(
        vec![floor],
        vec![point(-1.0, 1.0), point(1.0, 0.01), LightDesc::Constant { radiance: Vec3::splat(0.002) }],
    );
    let accel = Accel::new(&scene.shapes);
    let mut adaptive = EdgeAdaptive::new(&scene, &accel, 8000, &Settings { cells: 100, ..Settings::default() }, 1);
    for (pass, n) in [(0, 8000), (1, 40)] {
        adaptive.set_count(n, pass);
        for (light, info) in scene.lights.infos.iter().enumerate() {
            let own = |r: &EmittedRay| if r.light == light as u32 { f64::from(r.flux.y) } else { 0.0 };
            let flux = (pass..pass + 20).map(|p| sum(&adaptive, p, &own)).sum::<f64>() / 20.0;
            assert!((flux / f64::from(info.power.y) - 1.0).abs() < 0.02, "{n} photons, light {light}: {flux}");
        }
    }
}

/// What is cut is decided by the photons that later passes may have, and by what interest leaves of the lights.
#[test]
fn a_light_of_a_small_thing_is_cut_for_the_photons_to_come() {
    let scene = shadow_scene(4);
    let accel = Accel::new(&scene.shapes);
    let wanted = |shape: u32| shape == 1;
    let cells = |n: usize, later: usize, lone: bool| {
        let interest: Option<&dyn Fn(u32) -> bool> = if lone { Some(&wanted) } else { None };
        EdgeAdaptive::new(&scene, &accel, n, &Settings { interest, later, ..Settings::default() }, 1).strata().len()
    };
    assert_eq!((cells(20, 0, false) > 0, cells(20, 2000, false) > 0), (false, true));
    // A lone light gets all photons, however little of it is left.
    assert!(cells(40, 0, true) > 0);
}
