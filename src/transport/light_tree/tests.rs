//! Probabilities of the tree against itself, against what lights really send, and against brute force.

use super::bounds::Cone;
use super::*;
use crate::formats::{LoadOptions, mitsuba_xml::load_text};
use crate::math::sampler::unit_f64;
use crate::math::stats::{chi_square_p, sidak};
use crate::scene::light::EmitterBounds;
use std::fmt::Write;
use std::path::Path;

fn random(seed: u64, i: u64) -> f32 {
    unit_f32(hash(seed, i))
}

/// Lamps of many kinds, strewn about; with `sky`, light from infinity too.
fn scene(count: u64, sky: bool) -> Scene {
    let mut text = String::from(r#"<scene version="3.0.0"><sensor type="perspective"/>"#);
    for i in 0..count {
        let r = |k| random(i, k);
        let place = format!(
            r#"<rotate x="1" angle="{}"/><rotate y="1" angle="{}"/><translate x="{}" y="{}" z="{}"/>"#,
            360.0 * r(1),
            360.0 * r(2),
            10.0 * r(3),
            4.0 * r(4),
            10.0 * r(5)
        );
        let size = 0.02 + 0.3 * r(6) * r(6);
        let lamp = r#"<emitter type="area"><rgb name="radiance" value="1, 1, 1"/></emitter>"#;
        _ = match i % 5 {
            0 => write!(
                text,
                r#"<shape type="sphere"><transform name="to_world"><scale value="{size}"/>{place}</transform>{lamp}</shape>"#
            ),
            1 => write!(
                text,
                r#"<shape type="cube"><transform name="to_world"><scale value="{size}"/>{place}</transform>{lamp}</shape>"#
            ),
            2 => write!(
                text,
                r#"<emitter type="spot"><transform name="to_world">{place}</transform><float name="cutoff_angle" value="{}"/></emitter>"#,
                5.0 + 60.0 * r(7)
            ),
            3 => write!(text, r#"<emitter type="point"><transform name="to_world">{place}</transform></emitter>"#),
            _ => write!(
                text,
                r#"<shape type="disk"><transform name="to_world"><scale value="{size}"/>{place}</transform>{lamp}</shape>"#
            ),
        };
    }
    if sky {
        text += r#"<emitter type="constant"><rgb name="radiance" value="0.01, 0.01, 0.01"/></emitter>
            <emitter type="directional"><vector name="direction" x="0.3" y="-1" z="0.1"/><rgb name="irradiance" value="0.1, 0.1, 0.1"/></emitter>"#;
    }
    text += "</scene>";
    let loaded = load_text(Path::new("lamps.xml"), &text, &LoadOptions::default()).expect("valid");
    Scene::new(loaded.description).expect("valid")
}

fn points(count: u64) -> impl Iterator<Item = LitPoint> {
    (0..count).map(|i| {
        let r = |k| random(1000 + i, k);
        let p = Vec3::new(10.0 * r(1), 4.0 * r(2), 10.0 * r(3));
        let n = crate::math::warp::sample_sphere(Vec2::new(r(4), r(5)));
        LitPoint { p, n: (i % 3 > 0).then_some(n), matte: i % 5 > 0 }
    })
}

#[test]
fn probabilities_add_up_to_one_and_samples_have_them() {
    let mut whole = 0;
    for (count, sky) in [(1, false), (2, true), (7, false), (200, true), (0, true)] {
        let scene = scene(count, sky);
        let tree = LightTree::new(&scene);
        for (k, at) in points(40).enumerate() {
            let sum: f64 = tree.units().iter().map(|&u| f64::from(tree.pmf(&at, u))).sum();
            for i in 0..20 {
                match tree.sample(&at, f64::from(random(k as u64, i))) {
                    Some((unit, pmf)) => {
                        assert!((tree.pmf(&at, unit) / pmf - 1.0).abs() < 1e-5, "{unit:?} {pmf}");
                        assert!(sum < 1.0 + 1e-4, "{count} {k}: {sum}");
                        whole += u32::from((sum - 1.0).abs() < 1e-4);
                    }
                    // Two children of importance 0 below a node that may contribute: that much is not drawn.
                    None => assert!(sum < 1.0 - 1e-6, "{count} {k}: {sum}"),
                }
            }
        }
    }
    assert!(whole > 1000, "mostly the sum is 1: {whole}");
}

#[test]
fn draws_together_are_those_one_by_one() {
    for (count, sky) in [(1, false), (7, true), (400, true), (400, false), (0, true)] {
        let tree = LightTree::new(&scene(count, sky));
        for (k, at) in points(40).enumerate() {
            let cut = tree.cut(&at);
            let u: Vec<f64> = (0..12).map(|i| unit_f64(hash(k as u64, i))).collect();
            let together = cut.sample_each::<12>(u.iter().copied());
            assert_eq!(together[..], u.iter().map(|&u| cut.sample(u)).collect::<Vec<_>>()[..]);
        }
    }
}

/// A lamp of intensity 1 without extent, which shines to the side of `axis`; everywhere if there is none.
fn point_lamp(p: Vec3, axis: Option<Vec3>) -> Bounds {
    let (cos_normals, even) = if axis.is_some() { (1.0, 0.0) } else { (-1.0, 1.0) };
    let axis = axis.unwrap_or(Vec3::Z);
    Bounds::of(&EmitterBounds { bounds: (p, p), axis, cos_normals, cos_emission: 0.0, intensity: 1.0, even })
}

#[test]
fn importance_is_what_lamps_send_on_average() {
    // Clusters of lamps in a ball of radius 0.3, whose normals lie within a cone; some of ten shine in all directions, some of a hundred the
    // opposite way (one in a hundred: a stray).
    let clusters = [
        (0.0, 0, 0),
        (0.6, 0, 0),
        (1.2, 0, 0),
        (2.0, 0, 0),
        (2.0, 3, 0),
        (0.6, 1, 0),
        (0.05, 0, 15),
        (0.05, 0, 40),
        (0.05, 0, 50),
        (0.3, 2, 50),
        (0.3, 0, 1),
    ];
    let (mut errors, mut least) = (Vec::new(), f32::INFINITY);
    for (k, &(spread, even, opposed)) in clusters.iter().enumerate() {
        let axis = crate::math::warp::sample_sphere(Vec2::new(random(1, k as u64), random(2, k as u64)));
        let frame = crate::math::Frame::from_normal(axis);
        let lamps: Vec<Bounds> = (0..400)
            .map(|i| {
                let r = |c: u64| random(100 * k as u64 + c, i);
                let p = crate::math::warp::sample_sphere(Vec2::new(r(1), r(2))) * (0.3 * r(3).cbrt());
                let z = 1.0 - spread * r(4);
                let (sin, phi) = ((1.0 - z * z).max(0.0).sqrt(), std::f32::consts::TAU * r(5));
                let normal = frame.to_world(Vec3::new(sin * phi.cos(), sin * phi.sin(), z));
                point_lamp(p, (i % 10 >= even).then_some(if i % 100 < opposed { -normal } else { normal }))
            })
            .collect();
        let all = lamps.iter().copied().reduce(Bounds::union).expect("some");
        let mut node = Node::new(None, all.extent.lo, all.extent.hi);
        node.set(0, &all, Child::Emitter(0));
        for i in 0..60u64 {
            let r = |c: u64| random(7, 100 * i + c);
            let towards = crate::math::warp::sample_sphere(Vec2::new(r(1), r(2)));
            let at = LitPoint {
                p: towards * (0.7 + 3.0 * r(3)),
                n: Some(crate::math::warp::sample_sphere(Vec2::new(r(4), r(5)))),
                matte: true,
            };
            let sent = |b: &Bounds| {
                let d = at.p - b.extent.lo;
                let cos = if b.even > 0.0 { 1.0 } else { d.normalize().dot(b.cone.axis).max(0.0) };
                cos * at.n.map_or(1.0, |n| -n.dot(d.normalize())).max(0.0) / d.length_squared()
            };
            let truth: f32 = lamps.iter().map(sent).sum();
            let (found, full) = (node.importance(&at).0[0], 400.0 / at.p.length_squared());
            // Behind or beyond the horizon there is next to nothing.
            if truth > 0.05 * full {
                errors.push((found / truth).ln().abs());
            }
            // What is drawn too seldom is bright when it is.
            if truth > 0.002 * full {
                least = least.min(found / truth);
            }
        }
    }
    errors.sort_by(f32::total_cmp);
    let (median, most) = (errors[errors.len() / 2], errors[errors.len() * 19 / 20]);
    assert!(
        errors.len() > 150 && median < 0.05 && most < 0.4 && least > 0.5,
        "{} {median} {most} {least}",
        errors.len()
    );
}

#[test]
fn frequencies_follow_the_probabilities() {
    let scene = scene(60, true);
    let tree = LightTree::new(&scene);
    let draws = 20_000;
    for (k, at) in points(12).enumerate() {
        let mut seen = vec![0.0; tree.units().len() + 1];
        for i in 0..draws {
            let u = unit_f64(hash(k as u64, i));
            let drawn = tree.sample(&at, u).and_then(|(unit, _)| tree.units().iter().position(|o| *o == unit));
            seen[drawn.unwrap_or(tree.units().len())] += 1.0;
        }
        let mut expected: Vec<f64> = tree.units().iter().map(|&u| f64::from(tree.pmf(&at, u)) * draws as f64).collect();
        let none = draws as f64 - expected.iter().sum::<f64>();
        // Less than rounding of the sum is none at all.
        expected.push(if none > 1e-5 * draws as f64 { none } else { 0.0 });
        let p = chi_square_p(&seen, &expected, 5.0);
        assert!(p > sidak(0.01, 12), "{k}: p = {p}");
        // Companion: even odds are told apart.
        let even = vec![draws as f64 / seen.len() as f64; seen.len()];
        assert!(chi_square_p(&seen, &even, 5.0) < 1e-6);
    }
}

#[test]
fn whatever_sends_light_can_be_drawn() {
    let scene = scene(300, true);
    let tree = LightTree::new(&scene);
    let (mut sent, mut left_out) = (0, 0);
    for (k, at) in points(60).enumerate() {
        for &unit in tree.units() {
            let Unit::Emitter(e) = unit else {
                assert!(tree.pmf(&at, unit) > 0.0);
                continue;
            };
            let view = scene.lights.view(&scene.shapes, scene.textures(), e, at.p);
            let lit = view.is_some_and(|view| {
                (0..8).any(|i| {
                    let u = Vec2::new(random(k as u64, 2 * i), random(k as u64, 2 * i + 1));
                    view.sample(u).is_some_and(|s| at.n.is_none_or(|n| n.dot(s.wi) > 1e-5))
                })
            });
            let pmf = tree.pmf(&at, unit);
            assert!(!lit || pmf > 0.0, "{unit:?} sends light to {at:?}");
            sent += u32::from(lit);
            left_out += u32::from(pmf == 0.0);
        }
    }
    assert!(sent > 1000 && left_out > 1000, "both happen: {sent} {left_out}");
}

#[test]
fn the_tree_draws_in_proportion_to_what_arrives_better_than_by_strength() {
    // Expected square of irradiance / pmf: second moment of the estimate.
    let scene = scene(400, false);
    let tree = LightTree::new(&scene);
    let strength: f64 = (0..scene.lights.emitter_count() as u32)
        .filter_map(|e| scene.lights.emitter_bounds(&scene.shapes, e))
        .map(|b| f64::from(b.intensity))
        .sum();
    let (mut by_tree, mut by_strength) = (Vec::new(), Vec::new());
    for at in points(200).filter(|at| at.n.is_some()).map(|at| LitPoint { matte: true, ..at }) {
        let mut total = 0.0;
        let (mut tree_moment, mut strength_moment) = (0.0, 0.0);
        for e in 0..scene.lights.emitter_count() as u32 {
            let Some(view) = scene.lights.view(&scene.shapes, scene.textures(), e, at.p) else { continue };
            let n = at.n.expect("kept");
            let middle = view.sample(Vec2::splat(0.5)).map(|s| s.weight * s.wi.dot(n).max(0.0));
            let Some(irradiance) = view.irradiance(n).or(middle) else { continue };
            let e2 = f64::from(irradiance.x).powi(2);
            let bounds = scene.lights.emitter_bounds(&scene.shapes, e).expect("finite");
            total += f64::from(irradiance.x);
            if e2 > 0.0 {
                tree_moment += e2 / f64::from(tree.pmf(&at, Unit::Emitter(e)));
                strength_moment += e2 / f64::from(bounds.intensity) * strength;
            }
        }
        if total > 0.0 {
            by_tree.push(tree_moment / (total * total) - 1.0);
            by_strength.push(strength_moment / (total * total) - 1.0);
        }
    }
    let median = |v: &mut Vec<f64>| {
        v.sort_by(f64::total_cmp);
        (v[v.len() / 2], v.iter().sum::<f64>() / v.len() as f64)
    };
    let (tree, strength) = (median(&mut by_tree), median(&mut by_strength));
    assert!(
        tree.0 < 0.4 && tree.1 < 0.8 && strength.0 > 10.0,
        "median and mean relative variances: {tree:?} {strength:?}"
    );
}

#[test]
fn a_lamp_next_to_a_point_is_drawn_nearly_always() {
    let scene = scene(2000, false);
    let tree = LightTree::new(&scene);
    let places: Vec<(u32, Vec3, f32)> = (0..scene.lights.emitter_count() as u32)
        .filter_map(|e| Some((e, scene.lights.emitter_bounds(&scene.shapes, e)?)))
        .filter(|(_, b)| b.bounds.0 == b.bounds.1 && b.cos_normals == -1.0)
        .map(|(e, b)| (e, b.bounds.0, b.intensity))
        .collect();
    assert!(places.len() > 300);
    let strength: f32 = tree.nodes[0].strength.iter().sum();
    let mut probabilities = Vec::new();
    for &(e, p, own) in &places {
        let at = LitPoint { p: p + Vec3::new(0.004, -0.006, 0.003), n: Some(Vec3::Y), matte: true };
        let cut = tree.cut(&at);
        probabilities.push(cut.pmf(Unit::Emitter(e)));
        assert!((tree.pmf(&at, Unit::Emitter(e)) / cut.pmf(Unit::Emitter(e)) - 1.0).abs() < 1e-5);
        assert!(own / strength < 0.1, "companion: by strength alone it is rare");
    }
    probabilities.sort_by(f32::total_cmp);
    let (few, middle) = (probabilities[probabilities.len() / 10], probabilities[probabilities.len() / 2]);
    assert!(few > 0.3 && middle > 0.8, "{few} {middle}");
}

#[test]
fn rounded_boxes_hold_their_lights_and_little_more() {
    let scene = scene(600, false);
    let tree = LightTree::new(&scene);
    let mut wider = 0.0f32;
    for (e, leaf) in tree.leaf.iter().enumerate() {
        let Some((index, lane)) = *leaf else { continue };
        let (lo, hi) = scene.lights.emitter_bounds(&scene.shapes, e as u32).expect("finite").bounds;
        let (node, lane) = (&tree.nodes[index as usize], lane as usize);
        let c = node.centre(lane);
        let (needed, kept) = ((hi - c).max(c - lo).length(), node.radius2(lane).sqrt());
        assert!(kept >= needed * (1.0 - 1e-6), "{needed} {kept}");
        wider = wider.max(kept - 0.5 * (hi - lo).length());
    }
    // Steps are a 65,535th of ten units at most.
    assert!(wider > 0.0 && wider < 6e-4, "{wider}");
}

#[test]
fn turned_cones_hold_the_cone_they_come_from() {
    let mut narrow = 0;
    for i in 0..2000 {
        let r = |k| random(i, k);
        let direction = |k: u64| crate::math::warp::sample_sphere(Vec2::new(r(k), r(k + 1)));
        let cone = Cone { axis: direction(1), cos: 1.0 - 2.0 * r(3) * r(3) };
        let turned = cone.about(direction(4) * (0.1 + r(6)));
        let angle = |c: f32| f64::from(c.clamp(-1.0, 1.0)).acos();
        let needed = angle(turned.axis.dot(cone.axis)) + angle(cone.cos);
        assert!(needed.min(std::f64::consts::PI) <= angle(turned.cos) + 1e-4, "{cone:?} {turned:?}");
        assert!(angle(turned.cos) < needed + 3e-3 || turned.cos == -1.0, "{cone:?} {turned:?}");
        narrow += u32::from(turned.cos > 0.0);
    }
    assert!(narrow > 50, "{narrow}");
}

#[test]
fn cones_hold_what_they_are_made_of() {
    for i in 0..2000 {
        let r = |k| random(i, k);
        let cone = |k: u64| Cone {
            axis: crate::math::warp::sample_sphere(Vec2::new(r(k), r(k + 1))),
            cos: 1.0 - 2.0 * r(k + 2) * r(k + 2),
        };
        let (a, b) = (cone(1), cone(4));
        let both = a.union(b);
        for part in [a, b] {
            let angle = |c: f32| f64::from(c.clamp(-1.0, 1.0)).acos();
            let apart = angle(part.axis.dot(both.axis));
            let reach = (apart + angle(part.cos)).min(std::f64::consts::PI);
            assert!(reach <= angle(both.cos) + 2e-3, "{a:?} {b:?} {both:?}");
        }
    }
}

#[test]
fn no_light_and_lights_without_strength_are_never_drawn() {
    let tree = LightTree::new(&scene(0, false));
    assert!(tree.units().is_empty() && tree.sample(&LitPoint { p: Vec3::ZERO, n: None, matte: false }, 0.5).is_none());
}

#[test]
#[cfg(target_arch = "x86_64")]
fn importance_is_the_same_with_any_instructions() {
    let tree = LightTree::new(&scene(300, false));
    for at in points(200) {
        for node in &tree.nodes {
            let bits = |(a, b): (node::Lanes, node::Lanes)| (a.map(f32::to_bits), b.map(f32::to_bits));
            assert_eq!(bits(node.importance_and_distance2(&at)), bits(node.lanes(&at)));
        }
    }
}
