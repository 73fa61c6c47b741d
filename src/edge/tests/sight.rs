//! What a footprint with one origin sees.

use super::{Rng, ball, quad, random_view, scene, shape, soup, torus};
use crate::accel::Accel;
use crate::accel::footprint::Visitor;
use crate::edge::view::{View, line, to_dual};
use crate::edge::{EdgeDetector, Kinds, Settings, Verdict, oracle};
use crate::math::{DMat4, DVec3, Vec3};
use crate::scene::description::GeometryDesc;
use dualux_dual::num_dual::DualSVec64;
use dualux_dual::{Family, Jet, Neighbours, Test, margins};
use std::collections::BTreeSet;
use std::ops::ControlFlow;

#[test]
fn projected_lines_are_the_dual_margins() {
    let mut rng = Rng(1, 0);
    for _ in 0..1000 {
        let (o, aim) = (rng.cube(1.0), rng.cube(5.0));
        let view = random_view(&mut rng, o, aim, 0.1);
        let (a, b) = (rng.cube(5.0), rng.cube(5.0));
        let ours = line(&view.project(a), &view.project(b));
        let dual = margins::line(&view.family.fixed_ray::<DualSVec64<2>>(), to_dual(a), to_dual(b)).expansion();
        // Equal up to the (positive or negative) volume of the view's frame.
        let f = dual.value / ours[0];
        for (x, y) in [(ours[1], dual.gradient[0]), (ours[2], dual.gradient[1])] {
            assert!((x * f - y).abs() <= 1e-9 * (1.0 + y.abs()), "{x} * {f} is not {y}");
        }
    }
}

#[derive(Default)]
struct All(BTreeSet<(u32, u32)>);

impl Visitor for All {
    fn triangle(&mut self, shape: u32, prim: u32, _: [Vec3; 3]) -> ControlFlow<()> {
        self.0.insert((shape, prim));
        ControlFlow::Continue(())
    }
    fn quadric(&mut self, shape: u32) -> ControlFlow<()> {
        self.0.insert((shape, 0));
        ControlFlow::Continue(())
    }
    fn limit(&self) -> f32 {
        f32::INFINITY
    }
}

#[test]
fn the_walk_visits_whatever_a_ray_of_the_beam_meets() {
    let mut rng = Rng(2, 0);
    let (scene, accel) = scene(soup(&mut rng, 200, 5));
    let mut met = 0;
    for _ in 0..1500 {
        let half = 10f64.powf(rng.range(-4.0, 0.3));
        let (o, aim) = (rng.cube(4.0), rng.cube(3.0));
        let view = random_view(&mut rng, o, aim, half);
        let mut found = All::default();
        accel.walk(&view.beam(10.0), &mut found);
        for _ in 0..20 {
            let r = view.ray_at([rng.range(-1.0, 1.0), rng.range(-1.0, 1.0)]);
            let to = |v: dualux_dual::Vec3<f64>| Vec3::new(v.x as f32, v.y as f32, v.z as f32);
            let ray = crate::accel::Ray { o: to(r.o), d: to(r.d), tmin: 0.0, tmax: f32::INFINITY };
            if let Some(hit) = accel.closest(&ray) {
                met += 1;
                assert!(found.0.contains(&(hit.shape, hit.prim)), "{hit:?} missed");
            }
        }
        assert!(found.0.len() <= scene.shapes.len() + 12);
    }
    assert!(met > 5000, "{met}");
}

/// Visits in order.
#[derive(Default)]
struct Sequence(Vec<(u32, u32, [Vec3; 3])>);

impl Visitor for Sequence {
    fn triangle(&mut self, shape: u32, prim: u32, corners: [Vec3; 3]) -> ControlFlow<()> {
        self.0.push((shape, prim, corners));
        ControlFlow::Continue(())
    }
    fn quadric(&mut self, shape: u32) -> ControlFlow<()> {
        self.0.push((shape, u32::MAX, [Vec3::ZERO; 3]));
        ControlFlow::Continue(())
    }
    fn limit(&self) -> f32 {
        5.0
    }
}

#[test]
fn the_walk_is_the_same_for_all_instructions() {
    let mut rng = Rng(7, 0);
    let (scene, accel) = scene(soup(&mut rng, 300, 5));
    let portable = Accel::with_simd(&scene.shapes, crate::accel::Simd::Portable);
    let mut visits = 0;
    for _ in 0..1500 {
        let half = 10f64.powf(rng.range(-4.0, 0.3));
        let (o, aim) = (rng.cube(4.0), rng.cube(3.0));
        let beam = random_view(&mut rng, o, aim, half).beam(10.0);
        let (mut a, mut b) = (Sequence::default(), Sequence::default());
        accel.walk(&beam, &mut a);
        portable.walk(&beam, &mut b);
        assert_eq!(a.0, b.0);
        visits += a.0.len();
        for (shape, prim, corners) in a.0 {
            if let crate::scene::Geometry::Mesh(mesh) = &scene.shapes[shape as usize].geometry {
                assert_eq!(mesh.corners(prim), corners, "the pack's corners are the mesh's, in order");
            }
        }
    }
    assert!(visits > 3000, "{visits}");
}

#[test]
fn the_walk_of_a_lens_is_the_same_for_all_instructions_and_leaves_out_what_no_ray_meets() {
    let mut rng = Rng(8, 0);
    let (scene, accel) = scene(soup(&mut rng, 300, 3));
    let portable = Accel::with_simd(&scene.shapes, crate::accel::Simd::Portable);
    let (mut with, mut without, mut met) = (0, 0, 0);
    for _ in 0..1000 {
        let (o, aim) = (rng.cube(1.0) + DVec3::Z * 7.0, rng.cube(2.0));
        let d = (aim - o) / rng.range(3.0, 9.0);
        let (u, v) = d.normalize().any_orthonormal_pair();
        let (size, radius) = (rng.range(0.002, 0.02), rng.range(0.05, 0.3));
        let [o2, o3, d0, d1] = [u * radius, v * radius, u * size, v * size];
        let focus = rng.range(3.0, 9.0);
        let o_p = [DVec3::ZERO, DVec3::ZERO, o2, o3].map(to_dual);
        let d_p = [d0, d1, o2 * (-1.0 / focus), o3 * (-1.0 / focus)].map(to_dual);
        let family = Family::new(to_dual(o), o_p, to_dual(d), d_p);
        let [all_o, all_d] = [family.o_p, family.d_p].map(|v| v.map(crate::edge::view::from_dual));
        let lens = crate::edge::lens::Lens::new(o, &all_o, d, &all_d).unwrap();
        let beam = crate::edge::beam::of_lens(&family, &lens, [0.0, f64::INFINITY], 10.0);
        let (mut a, mut b, mut c) = (Sequence::default(), Sequence::default(), Sequence::default());
        accel.walk(&beam, &mut a);
        portable.walk(&beam, &mut b);
        accel.walk(&crate::accel::footprint::Beam { sides: None, ..beam }, &mut c);
        assert_eq!(a.0, b.0);
        with += a.0.len();
        without += c.0.len();
        for _ in 0..20 {
            let (angle, r) = (rng.range(0.0, std::f64::consts::TAU), rng.unit().sqrt());
            let p = [rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), r * angle.cos(), r * angle.sin()];
            let ray = family.at(p);
            let to = |v: dualux_dual::Vec3<f64>| Vec3::new(v.x as f32, v.y as f32, v.z as f32);
            let ray = crate::accel::Ray { o: to(ray.o), d: to(ray.d), tmin: 0.0, tmax: 5.0 };
            if let Some(hit) = accel.closest(&ray) {
                met += 1;
                let seen = |v: &(u32, u32, [Vec3; 3])| v.0 == hit.shape && (v.1 == hit.prim || v.1 == u32::MAX);
                assert!(a.0.iter().any(seen), "{hit:?} missed");
            }
        }
    }
    assert!(met > 3000 && with * 2 < without, "{met} {with} {without}");
}

/// Recall and precision of `any` against the oracle, over random footprints of one origin.
fn sight_score(seed: u64, kinds: usize, footprints: usize, settings: Settings) -> (usize, usize, usize, usize) {
    let mut rng = Rng(seed, 0);
    let (scene, accel) = scene(soup(&mut rng, 120, kinds));
    let detector = EdgeDetector::with_settings(&scene, &accel, settings);
    let (mut edges, mut flagged, mut both, mut missed) = (0, 0, 0, 0);
    for _ in 0..footprints {
        let half = 10f64.powf(rng.range(-3.0, -1.3));
        let (o, aim) = (rng.cube(1.0) + DVec3::new(0.0, 0.0, 7.0), rng.cube(3.0));
        let view = random_view(&mut rng, o, aim, half);
        let predicted = detector.any(&view, None);
        let truth = oracle::sight(&scene, &accel, &view, 12);
        edges += usize::from(truth);
        flagged += usize::from(predicted.needs_samples());
        both += usize::from(truth && predicted.needs_samples());
        missed += usize::from(truth && !predicted.needs_samples());
    }
    (edges, flagged, both, missed)
}

#[test]
fn bounds_miss_no_edge_of_polygons_and_spheres() {
    let (edges, flagged, both, missed) = sight_score(3, 3, 8000, Settings::default());
    assert!(edges > 1000, "{edges}");
    assert_eq!(missed, 0, "of {edges}");
    assert!(both * 100 >= flagged * 85, "precision {both} of {flagged}");
}

#[test]
fn bounds_miss_no_edge_of_disks_and_cylinders() {
    // Where a cylinder crosses a sphere or cylinder, their order is known at 81 points of the footprint only: none here is missed for that.
    let (edges, flagged, both, missed) = sight_score(3, 5, 6000, Settings::default());
    assert!(edges > 1000, "{edges}");
    assert_eq!(missed, 0, "of {edges}");
    assert!(both * 100 >= flagged * 85, "precision {both} of {flagged}");
}

#[test]
fn a_tube_through_a_wall_swaps_with_it_along_their_ellipse() {
    // Obliquely, the axis no unit vector.
    let (p0, axis, radius) = (DVec3::new(-0.4, -0.3, -0.8), DVec3::new(0.9, 0.7, 1.7), 0.3);
    let tube = shape(GeometryDesc::Cylinder { p0, p1: p0 + axis, radius }, DMat4::IDENTITY);
    let (scene, accel) = scene(vec![quad(DVec3::ZERO, DVec3::X * 9.0, DVec3::Y * 9.0), tube]);
    let detector = EdgeDetector::new(&scene, &accel);
    let mut rng = Rng(9, 0);
    let unit = axis.normalize();
    let (u, v) = unit.any_orthonormal_pair();
    let onto = |x: DVec3| x - axis * (x.z / axis.z);
    let (mut swaps, mut beside) = (0, 0);
    for k in 0..200 {
        let (sin, cos) = (f64::from(k) / 200.0 * std::f64::consts::TAU).sin_cos();
        let out = onto(u * cos + v * sin) * radius;
        let on = onto(p0) + out;
        let mut at = |aim: DVec3| random_view(&mut rng, DVec3::new(0.2, -0.5, 6.0), aim, 5e-4);
        let view = at(on);
        if oracle::sight(&scene, &accel, &view, 16) {
            let verdict = detector.all(&view, None);
            swaps += usize::from(verdict.kinds().intersects(Kinds::SWAP));
            assert!(verdict.needs_samples(), "at {on}");
        }
        // Away from it, no more.
        let view = at(on + out * 0.1);
        if !oracle::sight(&scene, &accel, &view, 16) {
            beside += 1;
            assert!(!detector.all(&view, None).kinds().intersects(Kinds::SWAP), "beside {on}");
        }
    }
    assert!(swaps > 80 && beside > 180, "{swaps} {beside}");
}

#[test]
fn corner_prediction_misses_what_lies_between_the_corners() {
    let settings = Settings { test: Test::Corners(Neighbours::Corners), ..Settings::default() };
    let (edges, _, both, _) = sight_score(3, 5, 3000, settings);
    assert!(both * 100 < edges * 98, "the companion must fail: {both} of {edges}");
}

#[test]
fn nothing_fires_inside_a_smooth_mesh_a_sphere_or_a_wall() {
    // A torus, seen in the middle of its front; a ball; a wall of coplanar triangles.
    let (scene, accel) = scene(vec![
        shape(GeometryDesc::Mesh(torus(192, 96)), DMat4::IDENTITY),
        ball(DVec3::new(4.0, 0.0, 0.0), 0.8),
        shape(GeometryDesc::Cube, DMat4::from_translation(DVec3::new(-5.0, 0.0, 0.0))),
    ]);
    let detector = EdgeDetector::new(&scene, &accel);
    let mut rng = Rng(5, 0);
    let mut inside = 0;
    for _ in 0..2000 {
        let a = rng.range(0.0, std::f64::consts::TAU);
        let targets = [
            DVec3::new(a.cos(), a.sin(), 0.4),
            DVec3::new(4.0 + 0.3 * a.cos(), 0.3 * a.sin(), 0.7),
            DVec3::new(-5.0 + 0.7 * a.cos(), 0.7 * a.sin(), 1.0),
        ];
        for aim in targets {
            let view = random_view(&mut rng, aim + DVec3::new(0.3, 0.2, 6.0), aim, 0.004);
            assert_eq!(detector.any(&view, None), Verdict::Clear, "at {aim}");
            inside += 1;
        }
    }
    assert_eq!(inside, 6000);
    // The companion: at the outline they fire.
    let o = DVec3::new(0.0, 0.0, 60.0);
    for aim in [DVec3::new(1.4, 0.0, 0.0), DVec3::new(4.8, 0.0, 0.0), DVec3::new(-4.0, 0.0, 1.0)] {
        let view = random_view(&mut rng, o, aim, 0.002);
        assert!(detector.any(&view, None).needs_samples(), "at {aim}");
    }
}

#[test]
fn hidden_edges_do_not_count() {
    // A small ball and a small square behind a big wall made of two squares.
    let x = DVec3::X;
    let wall = |c: f64| quad(DVec3::new(c, 0.0, 0.0), x * 2.0, DVec3::Y * 4.0);
    let behind = [ball(DVec3::new(0.5, 0.0, -1.0), 0.05), quad(DVec3::new(0.5, 0.0, -2.0), x * 0.05, DVec3::Y * 0.05)];
    let (scene, accel) = scene(vec![wall(-2.0), wall(2.0), behind[0].clone(), behind[1].clone()]);
    let detector = EdgeDetector::new(&scene, &accel);
    let view = |aim: DVec3, half: f64| {
        let d = aim - DVec3::new(0.0, 0.0, 5.0);
        let half = [DVec3::X * half, DVec3::Y * half].map(|v| to_dual(v * 5.0));
        View::new(Family::fixed(to_dual(DVec3::new(0.0, 0.0, 5.0)), to_dual(d), half), [0.0, f64::INFINITY]).unwrap()
    };
    assert_eq!(detector.all(&view(DVec3::new(0.5, 0.0, 0.0), 0.05), None), Verdict::Clear);
    let seam = detector.all(&view(DVec3::new(0.0, 0.0, 0.0), 0.05), None);
    assert_eq!(seam.kinds(), Kinds::BOUNDARY, "the seam of the wall only");
}

#[test]
fn surfaces_end_where_the_range_of_the_rays_does() {
    // Walls, a ball, a disk and a tube cut by the near and by the far end of the rays.
    let turn = DMat4::from_rotation_y(0.8) * DMat4::from_scale(DVec3::splat(6.0));
    let tube = GeometryDesc::Cylinder { p0: -DVec3::Z * 4.0, p1: DVec3::Z * 4.0, radius: 0.9 };
    let cut = [
        quad(DVec3::ZERO, DVec3::new(4.0, 0.0, 4.0), DVec3::Y * 4.0),
        ball(DVec3::ZERO, 1.5),
        shape(GeometryDesc::Disk, turn),
        shape(tube, DMat4::IDENTITY),
    ];
    for (k, shape) in cut.into_iter().enumerate() {
        // Another wall far behind.
        let (scene, accel) = scene(vec![shape, quad(-DVec3::Z * 30.0, DVec3::X * 90.0, DVec3::Y * 90.0)]);
        let detector = EdgeDetector::new(&scene, &accel);
        let mut rng = Rng(16, k as u64 * 100_000);
        let (mut edges, mut clear) = (0, 0);
        for i in 0..4000 {
            let (o, aim) = (DVec3::Z * 8.0 + rng.cube(0.5), rng.cube(1.0));
            let view = random_view(&mut rng, o, aim, 0.02);
            let end = rng.range(0.85, 1.0);
            let view = view.within(if i % 2 == 0 { [end, f64::INFINITY] } else { [0.0, end] });
            let (truth, verdict) = (oracle::sight(&scene, &accel, &view, 12), detector.any(&view, None));
            edges += usize::from(truth);
            clear += usize::from(verdict == Verdict::Clear);
            assert!(!(truth && verdict == Verdict::Clear), "shape {k}, {:?}", view.t);
        }
        assert!(edges > 100 && clear > 1000, "shape {k}: {edges} {clear}");
    }
}

#[test]
fn parallel_rays_miss_no_edge_that_they_start_beside() {
    // Wide footprints among the surfaces, so that some lie before, some behind and some across the plane the rays start from.
    let mut edges = 0;
    for seed in 0..6 {
        let mut rng = Rng(200 + seed, 0);
        let (scene, accel) = scene(soup(&mut rng, 40, 5));
        let detector = EdgeDetector::with_settings(&scene, &accel, Settings { busy: 2000, ..Settings::default() });
        for _ in 0..3000 {
            let half = 10f64.powf(rng.range(-2.5, -0.1));
            let (o, d) = (rng.cube(5.0), rng.cube(1.0));
            let family = Family::parallel(to_dual(o), [rng.cube(half), rng.cube(half)].map(to_dual), to_dual(d));
            let end = if rng.unit() < 0.3 { 4.0 } else { f64::INFINITY };
            let Some(view) = View::new(family, [0.0, end]) else { continue };
            let truth = oracle::sight(&scene, &accel, &view, 12);
            edges += usize::from(truth);
            assert!(!truth || detector.any(&view, None) != Verdict::Clear, "seed {seed}: {view:?}");
        }
    }
    assert!(edges > 1000, "{edges}");
}
