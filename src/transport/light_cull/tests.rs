//! Light culling against enumeration, brute force and the plain sum over all lights.

use super::*;
use crate::accel::{Accel, Ray};
use crate::formats::{LoadOptions, mitsuba_xml::load_text};
use crate::math::stats::{sidak, z_test_p};
use crate::math::{Frame, warp};
use crate::transport::{World, power_heuristic};
use std::f32::consts::PI;
use std::fmt::Write;
use std::path::Path;

fn random(seed: u64, i: u64) -> f32 {
    unit_f32(hash(seed, i))
}

/// `points` point lights and `lamps` spheres, disks and rectangles, above the plane y = 0.
fn scene(points: u64, lamps: u64, size: f32) -> Scene {
    let mut text = String::from(r#"<scene version="3.0.0"><sensor type="perspective"/>"#);
    for i in 0..points + lamps {
        let r = |k| random(77 + i, k);
        let (x, y, z) = (6.0 * r(1), 0.5 + 2.0 * r(2), 6.0 * r(3));
        let brightness = 0.2 + 3.0 * r(4) * r(4);
        let lamp = format!(
            r#"<transform name="to_world"><scale value="{}"/><rotate x="1" angle="{}"/><translate x="{x}" y="{y}" z="{z}"/></transform>
               <emitter type="area"><rgb name="radiance" value="{brightness}, {brightness}, {brightness}"/></emitter>"#,
            size * (0.5 + r(5)),
            60.0 + 60.0 * r(6),
        );
        _ = match i {
            _ if i < points => write!(
                text,
                r#"<emitter type="point"><point name="position" x="{x}" y="{y}" z="{z}"/><rgb name="intensity" value="{brightness}, {brightness}, {brightness}"/></emitter>"#
            ),
            _ if i % 3 == 0 => write!(text, r#"<shape type="sphere">{lamp}</shape>"#),
            _ if i % 3 == 1 => write!(text, r#"<shape type="disk">{lamp}</shape>"#),
            _ => write!(text, r#"<shape type="rectangle">{lamp}</shape>"#),
        };
    }
    text += "</scene>";
    let loaded = load_text(Path::new("lamps.xml"), &text, &LoadOptions::default()).expect("valid");
    Scene::new(loaded.description).expect("valid")
}

fn lit(i: u64) -> LitPoint {
    let r = |k| random(9000 + i, k);
    LitPoint {
        p: Vec3::new(6.0 * r(1), 0.2 * r(2), 6.0 * r(3)),
        n: Some(Vec3::new(0.2, 1.0, 0.1).normalize()),
        matte: true,
    }
}

fn culling(scene: &Scene, error: f32, kept: u32, reservoir: Reservoir) -> LightCulling<'_> {
    let settings = CullingSettings { error: Some(error), kept, reservoir, ..CullingSettings::default() };
    LightCulling::new(Cow::Owned(LightTree::new(scene)), settings, &[], 1)
}

/// Irradiance that a sample brings: first channel.
fn value(s: &LightSample, at: &LitPoint) -> f64 {
    f64::from(s.weight.x * s.wi.dot(at.n.expect("oriented")).max(0.0))
}

/// Irradiance from one emitter by many samples of it, without occlusion.
fn alone(scene: &Scene, e: u32, at: &LitPoint, samples: u64) -> f64 {
    let Some(view) = scene.lights.view(&scene.shapes, scene.textures(), e, at.p) else { return 0.0 };
    let n = if view.is_delta() { 1 } else { samples };
    let sample = |i| view.sample(Sampler::new(5, u64::from(e), i).next_2d()).map_or(0.0, |s| value(&s, at));
    (0..n).map(sample).sum::<f64>() / n as f64
}

impl LightCulling<'_> {
    /// Thresholds of one's own.
    fn set_thresholds(&mut self, xi: impl Fn(u32) -> f32) {
        (0..self.xi.len()).for_each(|e| self.xi[e] = xi(e as u32));
        self.fit();
    }

    /// Thresholds that are independent from trial to trial.
    fn shuffle(&mut self, trial: u64) {
        self.set_thresholds(|e| random(hash(31, trial), u64::from(e)));
    }
}

#[test]
fn all_patterns_of_survival_together_give_the_sum() {
    let scene = scene(8, 0, 0.0);
    let mut culling = culling(&scene, 0.2, 16, Reservoir::Uniform);
    for i in 0..6 {
        let at = lit(i);
        let survival: Vec<f32> = (0..8)
            .map(|e| {
                let view = scene.lights.view(&scene.shapes, scene.textures(), e, at.p).expect("a point light");
                culling.survival_of(e, view.sample(Vec2::ZERO).expect("in view").distance)
            })
            .collect();
        let (mut mean, mut without_division) = (0.0, 0.0);
        for pattern in 0u32..256 {
            let alive = |e: u32| pattern >> e & 1 == 1;
            let probability: f64 = (0..8)
                .map(|e| f64::from(if alive(e) { survival[e as usize] } else { 1.0 - survival[e as usize] }))
                .product();
            if probability == 0.0 {
                continue;
            }
            culling.set_thresholds(|e| {
                let p = survival[e as usize];
                if alive(e) { 0.5 * p } else { 0.5 * (1.0 + p) }
            });
            culling.sample(&scene, &at, &mut Sampler::new(1, 2, 3), |s| {
                mean += probability * value(&s, &at);
                let survived = culling.survival_of(s.light, s.distance);
                without_division += probability * value(&s, &at) * f64::from(survived);
            });
        }
        let truth: f64 = (0..8).map(|e| alone(&scene, e, &at, 1)).sum();
        assert!((mean / truth - 1.0).abs() < 1e-5, "{mean} {truth}");
        assert!(without_division < 0.95 * truth, "companion: {without_division} {truth}");
    }
}

#[test]
fn every_reservoir_has_the_mean_of_all_lights() {
    let scene = scene(6, 18, 0.15);
    let cases = [(Reservoir::Weighted, 1), (Reservoir::Weighted, 3), (Reservoir::Uniform, 1), (Reservoir::Uniform, 3)];
    for (case, (reservoir, kept)) in cases.into_iter().enumerate() {
        let mut culling = culling(&scene, 0.005, kept, reservoir);
        for i in 0..2 {
            let at = lit(20 + i);
            let truth: f64 = (0..scene.lights.emitter_count() as u32).map(|e| alone(&scene, e, &at, 1 << 14)).sum();
            let n = 60_000;
            let (mut sums, mut wrong, mut met) = ([0.0; 2], [0.0; 2], 0);
            for trial in 0..n {
                culling.shuffle(hash(case as u64, trial));
                let (mut v, mut w) = (0.0, 0.0);
                let mut rng = Sampler::new(hash(4, case as u64), i, trial);
                culling.sample(&scene, &at, &mut rng, |s| {
                    v += value(&s, &at);
                    w += value(&s, &at) * f64::from(kept);
                });
                // A reservoir that forgets how many there were.
                let here = culling.count_met(&at);
                met += here;
                w /= here.max(1) as f64;
                for (sums, v) in [(&mut sums, v), (&mut wrong, w)] {
                    sums[0] += v;
                    sums[1] += v * v;
                }
            }
            let p = |[sum, squares]: [f64; 2]| {
                let mean = sum / n as f64;
                z_test_p(mean, (squares / n as f64 - mean * mean) / n as f64, truth)
            };
            assert!(p(sums) > sidak(0.01, 8), "{reservoir:?} {kept}: {} {truth}", sums[0] / n as f64);
            assert!(met as f64 / n as f64 > 1.5 * f64::from(kept), "the reservoir has to choose");
            assert!(p(wrong) < 1e-6, "companion");
        }
    }
}

#[test]
fn weights_of_both_techniques_add_up_for_every_realisation() {
    let scene = scene(0, 40, 0.3);
    let accel = Accel::new(&scene.shapes);
    let world = World::new(&scene, &accel);
    for reservoir in [Reservoir::Weighted, Reservoir::Uniform] {
        let mut culling = culling(&scene, 0.4, 2, reservoir);
        let at = lit(40);
        let n = at.n.expect("oriented");
        let frame = Frame::from_normal(n);
        let seen = |d: Vec3| {
            let ray = Ray { o: at.p, d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
            accel.closest(&ray).map(|hit| world.surface(&ray, &hit))
        };
        let trials = 60_000;
        let (mut plain, mut combined, mut wrong) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let mut compared = 0;
        for trial in 0..trials {
            culling.shuffle(trial);
            let mut rng = Sampler::new(8, 8, trial);
            let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
            culling.sample(&scene, &at, &mut rng, |s| {
                let Some(lamp) = seen(s.wi).filter(|l| scene.lights.emitter_at(l).is_some()) else { return };
                if (lamp.p - at.p).length() < s.distance * (1.0 - 1e-3) {
                    return;
                }
                let pdf_scattered = s.wi.dot(n).max(0.0) / PI;
                let found = culling.pdf_dir_surface(&scene, &at, &lamp);
                if pdf_scattered > 0.0 && trial < 4000 && s.wi.dot(lamp.n_geo).abs() > 0.05 {
                    let sum = power_heuristic(s.pdf_dir, pdf_scattered) + power_heuristic(pdf_scattered, found);
                    assert!((sum - 1.0).abs() < 2e-3, "{reservoir:?}: {} {found} {pdf_scattered}", s.pdf_dir);
                    compared += 1;
                }
                b += value(&s, &at) * f64::from(power_heuristic(s.pdf_dir, pdf_scattered));
            });
            c += b;
            let local = warp::sample_cosine_hemisphere(rng.next_2d());
            let d = frame.to_world(local);
            if let Some(lamp) = seen(d) {
                let radiance = scene.lights.emitted(&scene.shapes, scene.textures(), &lamp, -d).x * PI;
                let (scattered, found) = (local.z / PI, culling.pdf_dir_surface(&scene, &at, &lamp));
                let weight = power_heuristic(scattered, found);
                a += f64::from(radiance);
                b += f64::from(radiance * weight);
                // Companion: the density without the survival.
                let survival =
                    scene.lights.emitter_at(&lamp).map_or(1.0, |e| culling.survival_of(e, (lamp.p - at.p).length()));
                c += f64::from(radiance * power_heuristic(scattered, found / survival));
            }
            for (sums, v) in [(&mut plain, a), (&mut combined, b), (&mut wrong, c)] {
                sums[0] += v;
                sums[1] += v * v;
            }
        }
        let n = f64::from(trials as u32);
        let moments = |[sum, squares]: [f64; 2]| (sum / n, (squares / n - (sum / n).powi(2)) / n);
        let ((a, va), (b, vb), (c, vc)) = (moments(plain), moments(combined), moments(wrong));
        assert!(z_test_p(b, va + vb, a) > sidak(0.01, 2), "{reservoir:?}: {b}, not {a}");
        assert!(vb < 0.5 * va, "the combination has less variance: {vb} {va}");
        assert!(z_test_p(c, va + vc, a) < 1e-4, "companion {reservoir:?}: {c}, not {a}");
        assert!(compared > 1000, "{compared}");
    }
}

#[test]
fn leaves_met_are_those_of_brute_force() {
    let scene = scene(200, 200, 0.1);
    let mut culling = culling(&scene, 0.01, 1, Reservoir::Weighted);
    let (mut met_in_all, mut missed_in_all) = (0, 0);
    for i in 0..60 {
        culling.set_pass(i);
        let at = lit(i);
        let mut met = vec![0u32; scene.lights.emitter_count()];
        culling.for_each_met(&at, |m| {
            met[m.emitter as usize] += 1;
            assert!(m.weight > 0.0 && (m.weight / culling.weight_at(m.emitter, &at) - 1.0).abs() < 1e-5);
        });
        for e in 0..met.len() as u32 {
            let bounds = scene.lights.emitter_bounds(&scene.shapes, e).expect("finite");
            let (lo, hi) = bounds.bounds;
            let d = f64::from((0.5 * (lo + hi) - at.p).length());
            let range =
                (f64::from(bounds.intensity) * f64::from(culling.scale) / f64::from(culling.xi[e as usize])).sqrt();
            let reach = f64::from(0.5 * (hi - lo).length()) + range;
            let expected = u32::from(d < reach && culling.weight_at(e, &at) > 0.0);
            if (d / reach - 1.0).abs() > 1e-4 {
                assert_eq!(met[e as usize], expected, "{e} {d} {reach}");
            }
            // What survives is met.
            if culling.survives(e, d as f32) && culling.weight_at(e, &at) > 0.0 {
                assert_eq!(met[e as usize], 1);
            }
            met_in_all += expected;
            missed_in_all += 1 - expected;
        }
    }
    assert!(met_in_all > 500 && missed_in_all > 5000, "{met_in_all} {missed_in_all}");
}

#[test]
fn the_standard_deviation_of_a_light_is_bounded() {
    let scene = scene(64, 0, 0.0);
    let epsilon = 0.15;
    let mut culling = culling(&scene, epsilon, 1, Reservoir::Weighted);
    assert!((culling.error() / epsilon - 1.0).abs() < 1e-5);
    // Radiance of a white surface, of each light at each point.
    let points: Vec<LitPoint> = (0..24).map(|i| LitPoint { n: Some(Vec3::Y), ..lit(i) }).collect();
    let passes = 1024;
    let mut moments = vec![[0.0f64; 2]; 64 * points.len()];
    for pass in 0..passes {
        culling.set_pass(pass);
        for (i, at) in points.iter().enumerate() {
            for e in 0..64u32 {
                let view = scene.lights.view(&scene.shapes, scene.textures(), e, at.p).expect("a point light");
                let s = view.sample(Vec2::ZERO).expect("in view");
                if culling.survives(e, s.distance) {
                    let v = value(&s, at) / std::f64::consts::PI / f64::from(culling.survival_of(e, s.distance));
                    let m = &mut moments[i * 64 + e as usize];
                    *m = [m[0] + v, m[1] + v * v];
                }
            }
        }
    }
    let n = passes as f64;
    let sd = |[sum, squares]: &[f64; 2]| (squares / n - (sum / n).powi(2)).max(0.0).sqrt();
    let most = moments.iter().map(sd).fold(0.0, f64::max) / f64::from(epsilon);
    assert!(most < 1.01 && most > 0.7, "{most}");
    // The same numbers in all passes: neighbours in time differ, as the golden ratio has it.
    let mut first = Vec::new();
    for pass in 0..2 {
        culling.set_pass(pass);
        first.push(culling.xi[0]);
    }
    let step = (first[1] - first[0]).rem_euclid(1.0);
    assert!((step - 0.618_034).abs() < 1e-6, "{step}");
}

#[test]
fn the_error_follows_from_the_number_of_lights_that_survive() {
    let scene = scene(300, 300, 0.05);
    let probes: Vec<LitPoint> = (0..40).map(lit).collect();
    for wanted in [4.0, 40.0] {
        let settings = CullingSettings { lights: wanted, ..CullingSettings::default() };
        let culling = LightCulling::new(Cow::Owned(LightTree::new(&scene)), settings, &probes, 0);
        let survivors = |at: &LitPoint| -> f64 {
            let of = |e: u32| {
                let (lo, hi) = scene.lights.emitter_bounds(&scene.shapes, e).expect("finite").bounds;
                let lit = culling.weight_at(e, at) > 0.0;
                if lit { f64::from(culling.survival_of(e, (0.5 * (lo + hi) - at.p).length())) } else { 0.0 }
            };
            (0..600).map(of).sum()
        };
        let mean = probes.iter().map(survivors).sum::<f64>() / probes.len() as f64;
        assert!((mean / f64::from(wanted) - 1.0).abs() < 0.08, "{mean} {wanted}");
    }
    // More than there are: all of them, always.
    let settings = CullingSettings { lights: 1e6, ..CullingSettings::default() };
    let culling = LightCulling::new(Cow::Owned(LightTree::new(&scene)), settings, &probes, 0);
    assert!((0..600).all(|e| culling.survival_of(e, 50.0) == 1.0));
}
