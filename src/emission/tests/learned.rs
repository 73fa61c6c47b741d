//! Emission that learns: exact power whatever it has learned, the same means with less noise, nothing of interest left out.

use super::adaptive::first_hit;
use super::interest::{surroundings, wanted};
use super::*;
use crate::accel::Accel;
use crate::emission::arrival_tree::{ArrivalTree, Root};
use crate::emission::targets::{Target, targets};
use crate::math::stats::z_test_p;

/// Kinds of light that are not cut.
fn uncut() -> Vec<(&'static str, Scene)> {
    let wanted = ["cylinder", "cylinder, inwards", "constant", "envmap"];
    let mut scenes: Vec<_> = every_light().into_iter().filter(|(name, _)| wanted.contains(name)).collect();
    // A mesh of more triangles than are cut.
    let n = 9u32;
    let at = |i: u32| Vec3::new((i % (n + 1)) as f32 * 0.1, 1.0 + 0.02 * (i % 7) as f32, (i / (n + 1)) as f32 * 0.1);
    let quad = |i: u32| [i, i + n + 1, i + 1, i + 1, i + n + 1, i + n + 2];
    let corners = (0..n * n).flat_map(|q| quad(q / n * (n + 1) + q % n)).collect::<Vec<_>>();
    let mesh = MeshData {
        positions: (0..(n + 1) * (n + 1)).map(at).collect(),
        normals: vec![],
        uvs: vec![],
        triangles: corners.chunks(3).map(|c| [c[0], c[1], c[2]]).collect(),
        face_normals: true,
        max_smooth_angle: None,
    };
    let floor = shape(GeometryDesc::Rectangle, placed(DVec3::ZERO, DVec3::X, -DVec3::Z), 0, None);
    scenes.push(("mesh", scene(vec![floor, lit(GeometryDesc::Mesh(mesh), DMat4::IDENTITY)], vec![])));
    scenes
}

/// Traces nothing: tells the density that photons have arrived for which `arrives` holds, and to follow it.
fn teach(density: &mut EdgeAdaptive, pass: u64, arrives: &dyn Fn(&EmittedRay) -> bool) -> usize {
    let of = |i| density.emit(i, pass).filter(|r| arrives(r)).map(|r| (i, r.flux.element_sum() / 3.0));
    let arrived: Vec<_> = density.learners().filter_map(of).map(|(index, flux)| Arrival { index, flux }).collect();
    density.note(&arrived, pass);
    density.follow(pass + 1);
    arrived.len()
}

fn sum(density: &dyn EmissionDensity, pass: u64, f: &dyn Fn(&EmittedRay) -> f64) -> f64 {
    (0..density.count()).filter_map(|i| density.emit(i, pass)).map(|r| f(&r)).sum()
}

#[test]
fn photons_carry_the_power_of_the_light_whatever_was_learned() {
    for (name, scene) in uncut() {
        let accel = Accel::new(&scene.shapes);
        let mut density = EdgeAdaptive::new(&scene, &accel, 4000, &Settings::default(), 3);
        assert_eq!(density.learners(), 0..4000, "{name}");
        let power = f64::from(scene.lights.infos[0].power.y);
        // A small part of all rays: those that go up or down, from one side.
        let part = |r: &EmittedRay| r.d.y.abs() > 0.7 && r.o.x + r.o.z > 0.6;
        let first = teach(&mut density, 0, &part);
        let mut last = first;
        for pass in 1..6 {
            assert!((3990..=4010).contains(&density.count()), "{name}: {}", density.count());
            let all = sum(&density, pass, &|r| f64::from(r.flux.y));
            let bound = if name == "envmap" { 0.02 } else { 1e-4 };
            assert!((all / power - 1.0).abs() < bound, "{name}, pass {pass}: {all} {power}");
            last = teach(&mut density, pass, &part);
        }
        assert!(last > first * 11 / 10, "{name}: {first} {last} photons go there");
        // Companion: had each the flux of uniform emission, too much would go where photons are dense.
        let flux = |pass| sum(&density, pass, &|r| if part(r) { f64::from(r.flux.y) } else { 0.0 });
        let wrong = last as f64 / 4000.0 * power;
        assert!(wrong > 1.1 * flux(6), "{name}: {wrong} {}", flux(6));
    }
}

/// Rooms of sorts with a light that is not cut, and a ray's luminance on a part of what is wanted.
fn rooms() -> Vec<(&'static str, Scene)> {
    let v = DVec3::new;
    let light = |l: LightDesc| scene([surroundings(0.0), walls()].concat(), vec![l]);
    // Walls with a window on one side.
    fn walls() -> Vec<ShapeDesc> {
        let v = DVec3::new;
        let quad = |c, x, y| shape(GeometryDesc::Rectangle, placed(c, x, y), 0, None);
        vec![
            quad(v(0.0, 3.0, 0.0), v(3.0, 0.0, 0.0), v(0.0, 0.0, 2.0)),
            quad(v(0.0, 1.5, -2.0), v(3.0, 0.0, 0.0), v(0.0, 1.5, 0.0)),
            quad(v(0.0, 1.5, 2.0), v(3.0, 0.0, 0.0), v(0.0, 1.5, 0.0)),
            quad(v(3.0, 1.5, 0.0), v(0.0, 1.5, 0.0), v(0.0, 0.0, 2.0)),
            quad(v(-3.0, 0.5, 0.0), v(0.0, 0.5, 0.0), v(0.0, 0.0, 2.0)),
            quad(v(-3.0, 2.5, 0.0), v(0.0, 0.5, 0.0), v(0.0, 0.0, 2.0)),
        ]
    }
    let tube = GeometryDesc::Cylinder { p0: v(0.0, 2.0, 0.0), p1: v(0.6, 2.3, 0.1), radius: 0.1 };
    vec![
        ("cylinder", scene([surroundings(0.0), vec![lit(tube, DMat4::IDENTITY)]].concat(), vec![])),
        ("constant", light(LightDesc::Constant { radiance: Vec3::ONE })),
        ("envmap", light(LightDesc::EnvMap { image: 0, scale: Vec3::ONE, to_world: DMat4::IDENTITY })),
    ]
}

#[test]
fn means_are_those_of_uniform_emission_with_less_noise() {
    for (name, scene) in rooms() {
        let accel = Accel::new(&scene.shapes);
        let wants = wanted(&scene);
        // What arrives somewhere above on a wanted shape.
        let there = |r: &EmittedRay| first_hit(&accel, r).filter(|(s, _)| wants(*s)).map(|(_, p)| p);
        let arrives = |r: &EmittedRay| there(r).is_some();
        let weight = |r: &EmittedRay| {
            there(r).filter(|p| p.y > 0.4).map_or(0.0, |p| f64::from(r.flux.y) * (1.0 + f64::from(p.x).sin()))
        };
        let settings = Settings { interest: Some(&wants), ..Settings::default() };
        let n = 8000;
        let (mut values, mut stored) = (Vec::new(), Vec::new());
        // Several runs of some passes: the first ones know nothing.
        for seed in 0..24 {
            let mut density = EdgeAdaptive::new(&scene, &accel, n, &settings, seed);
            for pass in 0..8 {
                values.push(sum(&density, pass, &weight));
                stored.push(teach(&mut density, pass, &arrives));
            }
        }
        let uniform = Uniform::new(&scene, n, Sequence::Random, 77);
        let plain: Vec<f64> = (0..1500).map(|pass| sum(&uniform, pass, &weight)).collect();
        let moments = |v: &[f64]| {
            let mean = v.iter().sum::<f64>() / v.len() as f64;
            (mean, v.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (v.len() - 1) as f64)
        };
        let (a, b) = (moments(&values), moments(&plain));
        let of_mean = a.1 / values.len() as f64 + b.1 / plain.len() as f64;
        let p = z_test_p(a.0 - b.0, of_mean, 0.0);
        println!("{name}: mean {:.4e} {:.4e}, variance {:.2e} {:.2e}, stored {:?}", a.0, b.0, a.1, b.1, &stored[..8]);
        assert!(p > 0.003, "{name}: {a:?} {b:?}, p = {p}");
        // Companion: a quarter too much is seen.
        assert!(z_test_p(1.25 * a.0 - b.0, of_mean, 0.0) < 1e-3, "{name}");
        // After the passes that taught.
        let late: Vec<f64> = values.chunks(8).flat_map(|run| run[4..].to_vec()).collect();
        // Known to a fifth or so.
        assert!(moments(&late).1 < 0.65 * b.1, "{name}: {:?} {b:?}", moments(&late));
        assert!(stored[7] > 2 * stored[0], "{name}: {:?}", &stored[..8]);
    }
}

/// Where photons become few, cells are joined: none carries much more than in uniform emission.
#[test]
fn few_photons_after_many_carry_no_huge_parts() {
    let (_, scene) = rooms().remove(1);
    let accel = Accel::new(&scene.shapes);
    let wants = wanted(&scene);
    let settings = Settings { interest: Some(&wants), ..Settings::default() };
    let mut density = EdgeAdaptive::new(&scene, &accel, 8000, &settings, 1);
    for pass in 0..6 {
        // A sheet: there is always more to be cut.
        teach(&mut density, pass, &|r| (r.o.x - 3.0 * r.d.z).abs() < 0.3);
    }
    let strata: std::collections::BTreeSet<u32> =
        (0..density.count()).filter_map(|i| density.emit(i, 6)).map(|r| r.stratum).collect();
    assert!(strata.len() > 300, "{} cells: too few photons for them are many", strata.len());
    let all = |d: &EdgeAdaptive, pass| sum(d, pass, &|r| f64::from(r.flux.y));
    let before = (6..26).map(|pass| all(&density, pass)).sum::<f64>() / 20.0;
    for (pass, n) in [(26, 400), (46, 100)] {
        density.set_count(n, pass);
        assert!((n..=n + n / 4).contains(&density.count()), "{n}: {}", density.count());
        let greatest = (0..density.count()).filter_map(|i| density.emit(i, pass)).map(|r| f64::from(r.flux.y));
        let greatest = greatest.fold(0.0, f64::max);
        assert!(greatest < 15.0 * before / n as f64, "{n}: {greatest}, {} on average", before / n as f64);
        let after = (pass..pass + 20).map(|p| all(&density, p)).sum::<f64>() / 20.0;
        assert!((after / before - 1.0).abs() < 0.05, "{n}: {after} {before}");
    }
}

/// A photon that decides about its own weight: taught by a pass, the density emits the same numbers again.
#[test]
fn a_pass_must_not_be_emitted_again_after_it_has_taught() {
    let (_, scene) = rooms().remove(1);
    let accel = Accel::new(&scene.shapes);
    let wants = wanted(&scene);
    let settings = Settings { interest: Some(&wants), ..Settings::default() };
    let mut density = EdgeAdaptive::new(&scene, &accel, 500, &settings, 1);
    let rays = |d: &EdgeAdaptive, pass| -> Vec<_> { (0..500).filter_map(|i| d.emit(i, pass)).map(|r| r.o).collect() };
    let before = rays(&density, 0);
    assert_eq!(before, rays(&density, 0));
    teach(&mut density, 0, &|_| false);
    for pass in 0..3 {
        let shared = rays(&density, pass).iter().filter(|o| before.contains(o)).count();
        assert_eq!(shared, 0, "pass {pass}: numbers are new");
    }
}

#[test]
fn the_tree_closes_in_on_what_arrives_and_forgets_nobody() {
    let mut tree = ArrivalTree::new(vec![Root { share: 1.0, extent: [1.0; 4] }]);
    // A thin sheet across the axes: u0 near to u2.
    let arrives = |u: [f64; 4]| (u[0] - u[2]).abs() < 0.02;
    for round in 0..12 {
        let leaves = tree.weights().len();
        for leaf in 0..leaves {
            let (_, [lo, hi]) = tree.bounds(leaf);
            let n = 4 + (20_000.0 * tree.volume(leaf)) as u64;
            tree.note_tries(leaf, n as usize);
            for i in 0..n {
                let f = random(round * 100_000 + leaf as u64, i);
                let u = std::array::from_fn(|k| lo[k] + f[k] * (hi[k] - lo[k]));
                if arrives(u) {
                    tree.note_arrival(leaf, u, 1.0);
                }
            }
        }
        tree.refine(1000);
    }
    let weights = tree.weights();
    assert!(weights.len() > 200 && weights.iter().all(|w| *w > 0.0), "{}", weights.len());
    let volumes: f64 = (0..weights.len()).map(|leaf| tree.volume(leaf)).sum();
    assert!((volumes - 1.0).abs() < 1e-12);
    // Of photons in proportion to weights, how many are in the sheet? By points of each leaf.
    let total: f64 = weights.iter().sum();
    let share = |leaf: usize| {
        let (_, [lo, hi]) = tree.bounds(leaf);
        let hits = (0..200).filter(|&i| {
            let f = random(7, i + 1000 * leaf as u64);
            arrives(std::array::from_fn(|k| lo[k] + f[k] * (hi[k] - lo[k])))
        });
        hits.count() as f64 / 200.0
    };
    let inside: f64 = (0..weights.len()).map(|leaf| share(leaf) * weights[leaf] / total).sum();
    assert!(inside > 0.2, "{inside} of the photons, of 0.04 without learning");
    // The sheet's neighbourhood only is cut finely: it does not cross most of the small cells' axes.
    let (_, [lo, hi]) =
        tree.bounds((0..weights.len()).min_by(|&a, &b| tree.volume(a).total_cmp(&tree.volume(b))).unwrap());
    assert!(lo[0] - 0.02 < hi[2] && lo[2] - 0.02 < hi[0], "{lo:?} {hi:?} touches the sheet");
}

#[test]
fn every_wanted_shape_lies_in_spheres_and_groups_are_told_apart() {
    let v = DVec3::new;
    let mesh =
        |at: DVec3| shape(roof(false), DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.2)), 1, None);
    let groups = [v(0.0, 0.0, 0.0), v(9.0, 0.0, 0.0), v(0.0, 9.0, 0.0), v(9.0, 9.0, 0.0)];
    let mut shapes: Vec<ShapeDesc> = groups.iter().map(|&g| mesh(g)).collect();
    shapes.push(shape(GeometryDesc::Sphere { center: v(4.0, 4.0, 4.0), radius: 0.5 }, DMat4::IDENTITY, 2, None));
    shapes.push(shape(GeometryDesc::Rectangle, tilted(), 1, None));
    let scene = scene(shapes, vec![]);
    let found = targets(&scene, &vec![true; scene.shapes.len()]);
    assert!((6..=48).contains(&found.len()), "{}", found.len());
    assert!(found.windows(2).all(|w| w[0].radius <= w[1].radius));
    assert!(found.iter().all(|t| t.radius < 1.0), "{found:?}");
    // All lines through points of the shapes meet a sphere; with smaller ones they do not.
    let missed = |targets: &[Target]| {
        let points = (0..2000u64).map(|i| {
            let shape = i as usize % scene.shapes.len();
            let u = random(3, i);
            let prim = (u[0] * scene.shapes[shape].primitive_count() as f64) as u32;
            let (at, _) = scene.shapes[shape].sample_area(shape as u32, prim, Vec2::new(u[1] as f32, u[2] as f32));
            let d = crate::emission::warp::sphere([u[3], u[2]]).at;
            (at.p.as_dvec3() - d * 20.0, d)
        });
        points.filter(|(o, d)| !targets.iter().any(|t| t.meets(*o, *d))).count()
    };
    assert_eq!(missed(&found), 0);
    let shrunk: Vec<Target> = found.iter().map(|t| Target { radius: 0.6 * t.radius, ..*t }).collect();
    assert!(missed(&shrunk) > 20, "{}", missed(&shrunk));
    let curved = |r: f64| found.iter().filter(|t| (t.radius / r - 1.0).abs() < 0.02).map(|t| t.curved).next();
    assert!(curved(0.5).is_some_and(|c| c > 0.99), "the sphere: {found:?}");
    assert!(targets(&scene, &vec![false; scene.shapes.len()]).is_empty());
}
