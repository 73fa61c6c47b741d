//! Cuts along edges and refinement by linearisation: flux, tiles, inverses, and what they find.

use super::*;
use crate::accel::Accel;
use crate::edge::EdgeDetector;
use crate::emission::linearisation::remainder;
use crate::math::Sampler;
use dualux_dual::Family;

/// A glass ball over a floor, under a light.
fn glass_ball(light: LightDesc) -> Scene {
    let v = DVec3::new;
    let floor = shape(GeometryDesc::Rectangle, placed(DVec3::ZERO, v(3.0, 0.0, 0.0), v(0.0, 0.0, -3.0)), 0, None);
    let ball = shape(GeometryDesc::Sphere { center: v(0.1, 1.0, 0.2), radius: 0.5 }, DMat4::IDENTITY, 2, None);
    scene(vec![floor, ball], vec![light])
}

fn point() -> LightDesc {
    LightDesc::Point { position: DVec3::new(0.0, 3.0, 0.0), intensity: Vec3::ONE }
}

/// Strata whose flux is exact: those of a light of constant value, whole (no interest).
#[test]
fn strata_of_every_cut_carry_all_flux_and_invert() {
    for (name, scene) in every_light() {
        let accel = Accel::new(&scene.shapes);
        for (cut, linearity) in [(Cut::Middle, 0.2), (Cut::Edge, f64::INFINITY), (Cut::Edge, 0.2)] {
            let settings = Settings { cut, linearity, ..Settings::default() };
            let adaptive = EdgeAdaptive::new(&scene, &accel, 2000, &settings, 3);
            let summary = adaptive.summary();
            if summary.cells == 0 {
                continue;
            }
            let exact = !scene.lights.is_estimated(0, &scene.shapes) && !name.starts_with("spot");
            if exact && name != "directional" {
                // In f64, in closed form: rounding only.
                let flux: f64 = adaptive.strata().iter().map(|s| s.flux).sum();
                assert!((flux / summary.power - 1.0).abs() < 1e-5, "{name}, {cut:?}: {flux} {summary:?}");
            }
            // Every ray lies in one cell, its numbers give it back, and they are uniform where photons are.
            for i in 0..400 {
                let mut u = Sampler::new(7, 3, i);
                let [a, b, c, d] = u.next_4d().map(f64::from);
                let Some((start, _)) = Source::new(&scene, 0).emit([a, b, c, d]) else { continue };
                let Some((id, f)) = adaptive.invert(0, start.o.as_dvec3(), start.d) else {
                    panic!("{name}, {cut:?}: no cell for {start:?}")
                };
                let s = adaptive.strata()[id];
                let cutter = adaptive.cutter(0).expect("it is cut");
                let back = cutter.draw(&s.cell, f.map(|x| x.clamp(0.0, 1.0))).expect("a ray").0;
                assert!(back.d.distance(start.d) < 2e-3, "{name}, {cut:?}: {} {}", back.d, start.d);
                // The range of a cell's numbers is its own: a neighbour's would miss by whole cells.
                assert!(f.iter().all(|x| (-1e-3..=1.0 + 1e-3).contains(x)), "{name}, {cut:?}: {f:?}");
            }
            // No two cells overlap: measures sum up, so a gap or an overlap would show there or here.
            let cells = adaptive.strata();
            for i in (0..cells.len()).step_by(17) {
                let middle = cells[i].cell.middle();
                let same = |s: &&Stratum| {
                    s.cell.light == cells[i].cell.light
                        && s.cell.face == cells[i].cell.face
                        && s.cell.holds(middle, 0.0)
                };
                assert_eq!(cells.iter().filter(same).count(), 1, "{name}, {cut:?}");
            }
        }
    }
}

#[test]
fn cuts_follow_a_straight_edge() {
    // The shadow of a plate whose border is seen along an axis of the cube's face, off the middles of cells.
    let v = DVec3::new;
    let floor = shape(GeometryDesc::Rectangle, placed(DVec3::ZERO, v(9.0, 0.0, 0.0), v(0.0, 0.0, -9.0)), 0, None);
    let plate = shape(GeometryDesc::Rectangle, placed(v(2.37, 1.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -9.0)), 0, None);
    let scene = scene(vec![floor, plate], vec![point()]);
    let accel = Accel::new(&scene.shapes);
    let on_the_floor = |cut: Cut| {
        let settings = Settings { cut, cells: 200, ..Settings::default() };
        let density = EdgeAdaptive::new(&scene, &accel, 1000, &settings, 1);
        let of_pass = |pass: u64| -> f64 {
            let rays = (0..density.count()).filter_map(|i| density.emit(i, pass));
            let lands = |r: &EmittedRay| {
                let ray = crate::accel::Ray { o: r.o, d: r.d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
                accel.closest(&ray).is_some_and(|hit| hit.shape == 0)
            };
            rays.filter(lands).map(|r| f64::from(r.flux.y)).sum()
        };
        let values: Vec<f64> = (0..60).map(of_pass).collect();
        let mean = values.iter().sum::<f64>() / 60.0;
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 59.0)
    };
    let (middle, edge) = (on_the_floor(Cut::Middle), on_the_floor(Cut::Edge));
    assert!((middle.0 / edge.0 - 1.0).abs() < 0.01, "{middle:?} {edge:?}");
    assert!(edge.1 < 0.5 * middle.1, "strata along the edge have nothing to tell apart: {middle:?} {edge:?}");
}

/// The cell of a ball's image of size `half` round the direction `d`, on the face that looks down.
fn family(at: [f64; 2], half: f64) -> Family<f64, 4> {
    let v = |x: f64, y: f64, z: f64| dualux_dual::vec3(x, y, z);
    let zero = dualux_dual::Vec3::zero();
    let o = v(0.0, 3.0, 0.0);
    Family::new(o, [zero; 4], v(at[0], -1.0, at[1]), [zero, zero, v(half, 0.0, 0.0), v(0.0, 0.0, half)])
}

#[test]
fn remainders_are_those_of_the_second_order() {
    let scene = glass_ball(point());
    let accel = Accel::new(&scene.shapes);
    let detector = EdgeDetector::new(&scene, &accel);
    // Flat and in the open: a plane behind a projection is nearly linear, and relative remainders fall with the cell.
    let open = remainder(&detector, &family([0.6, 0.4], 0.01));
    assert!(open < 0.02, "{open}");
    // Off the axis, on which the second order vanishes.
    let focus = [0.15, 0.05];
    let [wide, narrow] = [0.02, 0.01].map(|half| remainder(&detector, &family(focus, half)));
    assert!(wide > 3.0 * open, "glass bends: {wide} {open}");
    // s^T H s / |g|: in proportion to the width, but for the third order.
    assert!((1.5..3.0).contains(&(wide / narrow)), "{wide} {narrow}");
    // A cell across the silhouette has rays that go by the ball.
    assert_eq!(remainder(&detector, &family([0.3, 0.1], 0.05)), f64::INFINITY);
    // Away from everything.
    assert_eq!(remainder(&detector, &family([9.0, 0.1], 0.05)), 0.0);
}

#[test]
fn cells_whose_rays_are_bent_are_finer() {
    let scene = glass_ball(point());
    let accel = Accel::new(&scene.shapes);
    let wanted = |shape: u32| shape == 1;
    let build = |linearity: f64| {
        let settings = Settings { interest: Some(&wanted), linearity, ..Settings::default() };
        EdgeAdaptive::new(&scene, &accel, 4000, &settings, 1)
    };
    let (plain, bent) = (build(f64::INFINITY), build(0.1));
    assert_eq!(plain.summary().bent, 0);
    assert!(bent.summary().bent > 0, "{:?}", bent.summary());
    let share = |d: &EdgeAdaptive| d.summary().events as f64 / d.summary().cells as f64;
    assert!(share(&bent) < share(&plain), "cells went from the silhouette to the ball's inside");
    // Nothing of the flux that reaches the ball gets lost: the ball fills the same part of the light's directions.
    let flux = |d: &EdgeAdaptive| -> f64 {
        let hits = |r: &EmittedRay| {
            let ray = crate::accel::Ray { o: r.o, d: r.d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
            accel.closest(&ray).is_some_and(|hit| hit.shape == 1)
        };
        (0..d.count()).filter_map(|i| d.emit(i, 0)).filter(hits).map(|r| f64::from(r.flux.y)).sum()
    };
    assert!((flux(&plain) / flux(&bent) - 1.0).abs() < 0.01, "{} {}", flux(&plain), flux(&bent));
}
