//! Origins that move: lenses, emission from a patch, chains; and borders of highlights.

use super::{Rng, ball, quad, scene, scene_of, shape, soup};
use crate::edge::confirmed::Question;
use crate::edge::emission::Cells;
use crate::edge::predicted::D1;
use crate::edge::view::to_dual;
use crate::edge::{EdgeDetector, Facet, Kinds, Settings, View, oracle};
use crate::math::{DMat4, DVec3, Vec3};
use crate::scene::description::{GeometryDesc, ShapeDesc};
use crate::scene::material::{Distribution, Roughness};
use crate::scene::{Color, Material, Scalar, SurfacePoint};
use dualux_dual::Family;

/// Edges, flagged, both.
#[derive(Default, Debug)]
struct Count(usize, usize, usize);

impl Count {
    fn add(&mut self, truth: bool, flagged: bool) {
        self.0 += usize::from(truth);
        self.1 += usize::from(flagged);
        self.2 += usize::from(truth && flagged);
    }

    fn recall(&self) -> f64 {
        self.2 as f64 / self.0 as f64
    }

    fn precision(&self) -> f64 {
        self.2 as f64 / self.1 as f64
    }
}

/// Polygons, a cube and balls apart from each other: depth swaps are not predicted.
fn apart(rng: &mut Rng) -> Vec<ShapeDesc> {
    let mut shapes = Vec::new();
    for i in 0..27 {
        let c = DVec3::new(f64::from(i % 3) - 1.0, f64::from(i / 3 % 3) - 1.0, f64::from(i / 9) - 1.0) * 1.5;
        let x = rng.cube(1.0).normalize() * rng.range(0.1, 0.6);
        shapes.push(match i % 3 {
            0 => quad(c, x, x.cross(rng.cube(1.0)).normalize() * 0.4),
            1 => ball(c, rng.range(0.05, 0.6)),
            _ => shape(
                GeometryDesc::Cube,
                DMat4::from_translation(c) * DMat4::from_rotation_y(x.x * 9.0) * DMat4::from_scale(DVec3::splat(0.3)),
            ),
        });
    }
    shapes
}

fn four(rng: &mut Rng, round: bool, footprints: usize, family: impl Fn(&mut Rng) -> Family<f64, 4>) -> Count {
    let (scene, accel) = scene(apart(rng));
    let detector = EdgeDetector::new(&scene, &accel);
    let mut count = Count::default();
    for _ in 0..footprints {
        let family = family(rng);
        let ray = family.ray::<D1<4>>();
        let t = [0.0, f64::INFINITY];
        let front = detector.first(&family, t);
        let question = Question { t, exclude: Facet::NONE, round, grow: 1.0, all: false, swaps: true };
        let flagged = detector.predict_in(&ray, question, || front).needs_samples();
        count.add(oracle::sight4(&scene, &accel, &family, t, 5, round), flagged);
    }
    count
}

#[test]
fn a_thin_lens_sees_the_edges_that_any_of_its_points_sees() {
    let mut rng = Rng(21, 0);
    let lens = |rng: &mut Rng| {
        let o = rng.cube(1.0) + DVec3::Z * 7.0;
        let aim = rng.cube(2.0);
        let (size, r) = (rng.range(0.01, 0.08), rng.range(0.005, 0.08));
        let d = (aim - o) / (aim - o).length();
        let (u, v) = d.any_orthonormal_pair();
        // In focus at the distance of what it aims at, where a pixel is 2 `size` wide.
        let half = |r: f64| [u, v].map(|e| to_dual(e * r));
        let f = Family::between(to_dual(o), half(r), to_dual(aim), half(size));
        // Film first, lens last.
        Family::new(f.o, [f.o_p[2], f.o_p[3], f.o_p[0], f.o_p[1]], f.d, [f.d_p[2], f.d_p[3], f.d_p[0], f.d_p[1]])
    };
    let count = four(&mut rng, true, 1500, lens);
    assert!(count.0 > 300, "{count:?}");
    assert!(count.recall() >= 0.99, "recall {} of {count:?}", count.recall());
    assert!(count.precision() >= 0.8, "precision {} of {count:?}", count.precision());
}

#[test]
fn a_lens_looks_through_what_its_clip_plane_takes_away() {
    // A wall before the clip plane, and one that it cuts.
    let wall = |at: DVec3, x: DVec3| quad(at, x, DVec3::Y * 9.0);
    for (k, first) in
        [wall(DVec3::Z * 6.0, DVec3::X * 9.0), wall(DVec3::Z * 5.0, DVec3::new(3.0, 0.0, 2.0))].into_iter().enumerate()
    {
        let (scene, accel) = scene(vec![first, wall(DVec3::ZERO, DVec3::X * 0.7), wall(-DVec3::Z, DVec3::X * 9.0)]);
        let detector = EdgeDetector::new(&scene, &accel);
        let mut rng = Rng(26, k as u64 * 10_000);
        let (mut edges, mut clear) = (0, 0);
        for _ in 0..600 {
            let (o, radius, focus, half) = (DVec3::Z * 8.0, 0.02, 8.0, 0.01);
            let [u, v] = [DVec3::X, DVec3::Y].map(|e| e * radius);
            let d = -DVec3::Z + DVec3::new(rng.range(-0.3, 0.3), rng.range(-0.3, 0.3), 0.0);
            let [o_p, d_p] = [
                [DVec3::ZERO, DVec3::ZERO, u, v],
                [DVec3::X * half, DVec3::Y * half, u * (-1.0 / focus), v * (-1.0 / focus)],
            ];
            let family = Family::new(to_dual(o), o_p.map(to_dual), to_dual(d), d_p.map(to_dual));
            let t = [3.0, f64::INFINITY];
            let sure = detector.clear_lens(&family, t);
            let question = Question { t, exclude: Facet::NONE, round: true, grow: 1.0, all: false, swaps: true };
            let verdict = detector.predict_in(&family.ray::<D1<4>>(), question, || detector.first(&family, t));
            let truth = oracle::sight4(&scene, &accel, &family, t, 6, true);
            edges += usize::from(truth);
            clear += usize::from(sure || !verdict.needs_samples());
            assert!(!(truth && (sure || !verdict.needs_samples())), "{k}: {sure} {verdict:?} along {d}");
        }
        assert!(edges > 20 && clear > 300, "{k}: {edges} {clear}");
    }
}

#[test]
fn cells_of_a_patch_of_a_light_see_the_edges_that_any_of_its_points_sees() {
    let mut rng = Rng(22, 0);
    let cell = |rng: &mut Rng| {
        let n = (-DVec3::Z + rng.cube(0.5)).normalize();
        let cells = Cells::hemicube(DVec3::Z * 5.0 + rng.cube(1.0), n);
        let patch = [cells.faces[0].half[0] * rng.range(0.002, 0.05), cells.faces[0].half[1] * rng.range(0.002, 0.05)];
        let centre = [rng.range(-0.5, 0.5), rng.range(-0.5, 0.5)];
        let half = rng.range(0.003, 0.02);
        cells.patch_cell(0, centre, [half; 2], patch)
    };
    let count = four(&mut rng, false, 1500, cell);
    assert!(count.0 > 200, "{count:?}");
    assert!(count.recall() >= 0.99, "recall {} of {count:?}", count.recall());
    assert!(count.precision() >= 0.8, "precision {} of {count:?}", count.precision());
}

fn chains(seed: u64, material: Material, smooth: ShapeDesc, half: f64, footprints: usize) -> Count {
    let mut rng = Rng(seed, 0);
    let diffuse = Material::Diffuse { reflectance: Color::Constant(Vec3::ONE) };
    let mut shapes: Vec<_> = soup(&mut rng, 24, 3)
        .into_iter()
        .map(|mut s| {
            s.to_world = DMat4::from_translation(DVec3::new(0.0, 0.0, 6.0)) * s.to_world;
            if let GeometryDesc::Sphere { center, .. } = &mut s.geometry {
                center.z += 6.0;
                s.to_world = DMat4::IDENTITY;
            }
            s
        })
        .collect();
    let smooth_at = shapes.len();
    shapes.push(smooth);
    for s in &mut shapes[..smooth_at] {
        s.material = 1;
    }
    let (scene, accel) = super::scene_with(shapes, vec![material, diffuse]);
    let detector = EdgeDetector::new(&scene, &accel);
    let mut count = Count::default();
    for _ in 0..footprints {
        let o = DVec3::new(rng.range(-2.0, 2.0), rng.range(-2.0, 2.0), 2.5);
        let aim = DVec3::new(rng.range(-0.9, 0.9), rng.range(-0.9, 0.9), 0.0);
        let view: View = super::random_view(&mut rng, o, aim, half);
        let Some(truth) = oracle::chain(&detector, &view, 10) else { continue };
        let found = detector.chain(&view.family, view.t, true);
        count.add(truth, found.kinds != Kinds::NONE);
    }
    count
}

fn silver() -> Material {
    let c = |x: f32| Color::Constant(Vec3::splat(x));
    Material::Conductor { eta: c(0.0), k: c(1.0), specular_reflectance: c(1.0) }
}

#[test]
fn a_plane_mirror_shows_the_edges_of_what_is_before_it() {
    let mirror = quad(DVec3::ZERO, DVec3::X * 3.0, DVec3::Y * 3.0);
    let count = chains(23, silver(), mirror, 0.01, 3000);
    assert!(count.0 > 300, "{count:?}");
    assert!(count.recall() == 1.0, "recall {} of {count:?}", count.recall());
    assert!(count.precision() >= 0.8, "precision {} of {count:?}", count.precision());
}

#[test]
fn a_glass_ball_shows_the_edges_behind_it_and_in_it() {
    let white = Color::Constant(Vec3::ONE);
    let glass = Material::Dielectric { eta: 1.5, specular_reflectance: white.clone(), specular_transmittance: white };
    let count = chains(24, glass, ball(DVec3::ZERO, 1.5), 0.002, 6000);
    assert!(count.0 > 300, "{count:?}");
    // Eight segments, most of them bent twice and more, of shapes that cross each other.
    assert!(count.recall() >= 0.96, "recall {} of {count:?}", count.recall());
    assert!(count.precision() >= 0.8, "precision {} of {count:?}", count.precision());
}

#[test]
fn highlights_end_where_the_lobe_does() {
    let c = |x: f32| Color::Constant(Vec3::splat(x));
    let alpha = 0.15;
    let roughness = Roughness {
        distribution: Distribution::Ggx,
        alpha_u: Scalar::Constant(alpha),
        alpha_v: Scalar::Constant(alpha),
    };
    let steel = Material::RoughConductor { eta: c(0.0), k: c(1.0), specular_reflectance: c(1.0), roughness };
    let mut lamp = quad(DVec3::new(0.0, 3.0, 0.0), DVec3::X, DVec3::Z);
    lamp.emission = Some(c(1.0));
    let floor = quad(DVec3::ZERO, DVec3::Z * 9.0, DVec3::X * 9.0);
    let (scene, accel) = scene_of(vec![lamp, floor], steel);
    let detector = EdgeDetector::with_settings(&scene, &accel, Settings::default());
    let tau = crate::edge::highlight::TAU;
    let c2 = dualux_dual::margins::ggx_border(f64::from(alpha), tau).unwrap().powi(2);
    let mut rng = Rng(25, 0);
    let mut count = Count::default();
    for _ in 0..4000 {
        let eye = DVec3::new(rng.range(-4.0, 4.0), rng.range(0.5, 4.0), 4.0);
        let o = eye.as_vec3();
        let to = Vec3::new(rng.range(-3.0, 3.0) as f32, 0.0, rng.range(-3.0, 3.0) as f32);
        let ray = crate::accel::Ray { o, d: to - o, tmin: 0.0, tmax: f32::INFINITY };
        let Some(hit) = accel.closest(&ray).filter(|h| h.shape == 1) else { continue };
        let at = crate::scene::shape::ShapeHit { t: hit.t, u: hit.u, v: hit.v };
        let at: SurfacePoint = scene.shapes[1].surface_point(1, hit.prim, ray.o, ray.d, at);
        let w = -(ray.d.as_dvec3()).normalize();
        let n = at.n_geo.as_dvec3() * at.n_geo.as_dvec3().dot(w).signum();
        let mut seen = [false; 2];
        for k in 0..32 * 32 {
            let [x, z] = [k % 32, k / 32].map(|i| (2 * i + 1) as f64 / 32.0 - 1.0);
            let h = (DVec3::new(x, 3.0, z) - at.p.as_dvec3()).normalize() + w;
            seen[usize::from(n.dot(h).powi(2) > c2 * h.length_squared())] = true;
        }
        count.add(seen == [true; 2], detector.highlight(0, &at, -ray.d).is_some());
    }
    assert!(count.0 > 500, "{count:?}");
    assert!(count.recall() >= 0.99 && count.precision() >= 0.9, "{count:?}");
    // A diffuse floor has none.
    let (scene, accel) =
        scene_of(vec![quad(DVec3::ZERO, DVec3::Z * 9.0, DVec3::X * 9.0)], Material::Diffuse { reflectance: c(1.0) });
    let at = scene.shapes[0].surface_point(
        0,
        0,
        Vec3::Y,
        -Vec3::Y,
        crate::scene::shape::ShapeHit { t: 1.0, u: 0.0, v: 0.0 },
    );
    assert!(EdgeDetector::new(&scene, &accel).highlight(0, &at, Vec3::Y).is_none());
}
