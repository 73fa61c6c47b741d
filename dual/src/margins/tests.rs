//! Each margin against its definition, exactness of expansions, robustness in f32.

use num_dual::{Dual2SVec64, DualSVec32, DualSVec64, DualStruct};

use super::*;
use crate::testkit::Rng;
use crate::{Cylinder, Disk, Expansion, Family, Jet, Plane, Ray, Sphere, Vec3, vec3};

type D1 = DualSVec64<2>;
type D2 = Dual2SVec64<2>;

/// Random shapes in the unit cube around (0, 0, 5), seen from near the origin.
struct World {
    rng: Rng,
}

impl World {
    fn family(&mut self) -> Family<f64, 2> {
        let o = self.rng.cube(1.0);
        let target = vec3(0.0, 0.0, 5.0) + self.rng.cube(1.5);
        let stretch = self.rng.range(0.3, 3.0);
        self.rng.family(o, (target - o) * stretch, 0.4)
    }
    fn point(&mut self) -> Vec3<f64> {
        vec3(0.0, 0.0, 5.0) + self.rng.cube(1.0)
    }
}

/// Difference between the expansion and the margin itself, relative to the size of the expansion's terms.
fn truncation(m: &Expansion<f64, 2>, direct: f64, p: [f64; 2]) -> f64 {
    let scale = m.value.abs()
        + m.gradient.iter().map(|g| g.abs()).sum::<f64>()
        + m.hessian.iter().flatten().map(|h| h.abs()).sum::<f64>();
    (m.at(p) - direct).abs() / scale
}

/// Checks that `f` is reproduced at random points from its expansion in type T, to rounding.
macro_rules! exact {
    ($name:ident, $order:ty, $world:ident => $setup:expr, $ray:ident, $shape:ident => $margin:expr) => {
        #[test]
        fn $name() {
            let mut $world = World { rng: Rng::new(0x5eed) };
            for _ in 0..3000 {
                let family = $world.family();
                let $shape = $setup;
                let eval = |$ray: &Ray<$order>| $margin;
                let plain = |$ray: &Ray<f64>| $margin;
                let m = eval(&family.fixed_ray()).expansion();
                for _ in 0..4 {
                    let p = [$world.rng.range(-1.0, 1.0), $world.rng.range(-1.0, 1.0)];
                    let e = truncation(&m, plain(&family.at(p)), p);
                    // The terms themselves cancel inside a margin; a few hundred ulps of their sum remain.
                    assert!(e < 1e-12, "{e:e} for {family:?} {:?} at {p:?}", $shape);
                }
            }
        }
    };
}

exact!(line_is_exact_at_order_1, D1, w => [w.point(), w.point()], ray, s => line(ray, s[0], s[1]));
exact!(facing_is_exact_at_order_1, D1, w => w.point(), ray, n => facing(ray.d, n));
exact!(swap_is_exact_at_order_1, D1,
    w => [Plane::new(w.point(), w.rng.direction()), Plane::new(w.point(), w.rng.direction())], ray, s => swap(ray, &s[0], &s[1]));
exact!(inverse_depth_is_exact_at_order_1, D1,
    w => Plane::new(w.point(), w.rng.direction()), ray, s => inverse_depth(ray, &s));
exact!(sphere_is_exact_at_order_2, D2, w => Sphere::new(w.point(), w.rng.range(0.01, 1.5)), ray, s => sphere(ray, &s));
exact!(sphere_guard_is_exact_at_order_1, D1, w => Sphere::new(w.point(), 1.0), ray, s => sphere_guard(ray, &s));
exact!(rim_is_exact_at_order_2, D2,
    w => Disk::new(w.point(), w.rng.direction() * 2.0, w.rng.range(0.01, 1.5)), ray, s => rim(ray, &s));
exact!(cylinder_is_exact_at_order_2, D2,
    w => Cylinder::new(w.point(), w.point(), w.rng.range(0.01, 1.0)), ray, s => cylinder(ray, &s));
exact!(cone_is_exact_at_order_2, D2,
    w => (w.rng.direction() * 3.0, w.rng.range(-1.0, 1.0)), ray, s => cone(ray.d, s.0, s.1));
exact!(total_reflection_is_exact_at_order_2, D2,
    w => (w.rng.direction(), w.rng.range(1.0, 2.0)), ray, s => total_reflection(ray.d, Vec3::lift(s.0), s.1));

#[test]
fn values_of_duals_are_the_plain_ones_bit_for_bit() {
    let mut w = World { rng: Rng::new(9) };
    for _ in 0..3000 {
        let family = w.family();
        let (a, b, r) = (w.point(), w.point(), w.rng.range(0.01, 1.5));
        let (n, view) = (w.rng.direction() * 2.0, w.rng.direction());
        let planes = [Plane::new(a, n), Plane::new(b, view)];
        // A function for each number type.
        macro_rules! all {
            ($ray:expr) => {{
                let ray = $ray;
                let sphere = Sphere::new(a, r);
                let disk = Disk::new(a, n, r);
                [
                    line(&ray, a, b),
                    line_distance(&ray, a, b),
                    facing(ray.d, n),
                    swap(&ray, &planes[0], &planes[1]),
                    inverse_depth(&ray, &planes[0]),
                    super::sphere(&ray, &sphere),
                    sphere_guard(&ray, &sphere),
                    sphere_distance(&ray, &sphere),
                    rim(&ray, &disk),
                    rim_guard(&ray, &disk),
                    cylinder(&ray, &Cylinder::new(a, b, r)),
                    cone(ray.d, n, 0.3),
                    cone_guard(ray.d, n, -0.3),
                    total_reflection(ray.d, Vec3::lift(n), 1.4),
                    half_vector(ray.d, Vec3::lift(view), Vec3::lift(n), 0.9),
                ]
                .map(|m| m.re().to_bits())
            }};
        }
        let plain = all!(family.ray::<f64>());
        assert_eq!(plain, all!(family.ray::<D1>()));
        assert_eq!(plain, all!(family.ray::<D2>()));
        assert_eq!(plain, all!(family.fixed_ray::<D2>()));
    }
}

#[test]
fn order_one_is_not_exact_for_quadrics() {
    // The exactness test above can fail: a sphere's margin has curvature.
    let mut w = World { rng: Rng::new(1) };
    let family = w.family();
    let s = Sphere::new(w.point(), 1.0);
    let m = sphere(&family.ray::<D1>(), &s).expansion();
    assert!(truncation(&m, sphere(&family.at([0.9, -0.8]), &s), [0.9, -0.8]) > 1e-6);
}

#[test]
fn signs_agree_with_hits() {
    let mut w = World { rng: Rng::new(2) };
    let (mut hits, mut misses) = (0, 0);
    for _ in 0..20_000 {
        let ray = w.family().ray::<f64>();
        let tri = crate::Triangle::new(w.point(), w.point(), w.point());
        let inside = polygon(&ray, &[tri.a, tri.b, tri.c]).unwrap().all(|m| m > 0.0);
        assert_eq!(inside, tri.hit(&ray, 0.0, 1e9).is_some());
        let s = Sphere::new(w.point(), 0.7);
        let inside = sphere(&ray, &s) > 0.0 && sphere_guard(&ray, &s) > 0.0;
        assert_eq!(inside, s.hit(&ray, 0.0, 1e9).is_some());
        let d = Disk::new(w.point(), w.rng.direction(), 0.7);
        let inside = rim(&ray, &d) > 0.0 && rim_guard(&ray, &d) > 0.0;
        assert_eq!(inside, d.hit(&ray, 0.0, 1e9).is_some());
        let (a, b) = (Plane::new(w.point(), w.rng.direction()), Plane::new(w.point(), w.rng.direction()));
        if let (Some(ta), Some(tb)) = (a.hit(&ray, 0.0, 1e9), b.hit(&ray, 0.0, 1e9)) {
            assert_eq!(swap(&ray, &a, &b) < 0.0, ta < tb);
        }
        if inside { hits += 1 } else { misses += 1 }
    }
    assert!(hits > 1000 && misses > 1000, "{hits} {misses}");
}

#[test]
fn silhouettes_lie_where_the_discriminant_vanishes() {
    let mut w = World { rng: Rng::new(3) };
    for _ in 0..2000 {
        let o = w.rng.cube(1.0);
        let s = Sphere::new(w.point(), 0.8);
        let circle = sphere_silhouette(o, &s).unwrap();
        let n = circle.normal.normalized();
        let u = n.cross(w.rng.direction()).normalized();
        let ray = Ray::new(o, circle.centre + u * circle.radius - o);
        assert!(sphere(&ray, &s).abs() < 1e-12 * ray.d.norm2());
        assert!(rim(&ray, &circle).abs() < 1e-11 * ray.d.norm2() * circle.normal.norm2());

        let c = Cylinder::new(w.point(), w.point(), 0.3);
        if let Some(lines) = cylinder_silhouette(o, &c) {
            for [a, b] in lines {
                let x = a + (b - a) * w.rng.unit();
                let ray = Ray::new(o, x - o);
                assert!(cylinder(&ray, &c).abs() < 1e-10 * ray.d.cross(c.axis()).norm2() + 1e-14);
            }
        } else {
            assert!(!c.is_outside(o));
        }
    }
    assert!(sphere_silhouette(vec3(0.0, 0.0, 5.1), &Sphere::new(vec3(0.0, 0.0, 5.0), 1.0)).is_none());
}

#[test]
fn shared_curves_lie_on_both_surfaces() {
    let mut w = World { rng: Rng::new(4) };
    let mut found = [0; 3];
    for _ in 0..3000 {
        let (a, b) = (Sphere::new(w.point(), w.rng.range(0.3, 1.0)), Sphere::new(w.point(), w.rng.range(0.3, 1.0)));
        let plane = Plane::new(w.point(), w.rng.direction() * 2.0);
        if let Some(c) = sphere_sphere_circle(&a, &b) {
            let x = c.centre + c.normal.cross(w.rng.direction()).normalized() * c.radius;
            assert!(((x - a.centre).norm() - a.radius).abs() < 1e-12);
            assert!(((x - b.centre).norm() - b.radius).abs() < 1e-11);
            found[0] += 1;
        }
        if let Some(c) = plane_sphere_circle(&plane, &a) {
            let x = c.centre + c.normal.cross(w.rng.direction()).normalized() * c.radius;
            assert!(((x - a.centre).norm() - a.radius).abs() < 1e-12);
            assert!(plane.tau(x).abs() < 1e-12);
            found[1] += 1;
        }
        let tri = || -> [Vec3<f64>; 3] { [vec3(0.0, 0.0, 0.0); 3] };
        let (mut p, mut q) = (tri(), tri());
        p.iter_mut().chain(q.iter_mut()).for_each(|v| *v = w.point());
        if let Some([x, y]) = shared_segment(&p, &q) {
            let mid = (x + y) * 0.5;
            for corners in [p, q] {
                let t = crate::Triangle::new(corners[0], corners[1], corners[2]);
                assert!(t.normal().dot(mid - t.a).abs() < 1e-9);
                assert!(t.barycentrics(mid).iter().all(|b| *b > -1e-9));
            }
            found[2] += 1;
        }
    }
    assert!(found.iter().all(|n| *n > 100), "{found:?}");
}

#[test]
fn chords_are_where_sampled_points_of_the_segment_project() {
    let mut w = World { rng: Rng::new(5) };
    let (mut seen, mut none) = (0, 0);
    for _ in 0..20_000 {
        let family = w.family();
        let view = Projector::new(&family).unwrap();
        let (a, b) = (w.point(), w.point());
        let chord = view.clip(a, b);
        let mut any = false;
        for i in 0..=64 {
            let s = i as f64 / 64.0;
            let [h, x, y] = view.project(a + (b - a) * s);
            if h > 0.0 && x.abs() <= h && y.abs() <= h {
                any = true;
                let c = chord.expect("a point of the segment is inside");
                assert!(s > c.s[0] - 1e-12 && s < c.s[1] + 1e-12);
            }
        }
        if let Some(c) = chord {
            seen += 1;
            for k in 0..2 {
                // The end really lies on the edge, at that ray parameter.
                let x = a + (b - a) * c.s[k];
                assert!((family.at(c.p[k]).at(c.t[k]) - x).norm() < 1e-9 * (1.0 + x.norm()));
                assert!(c.p[k].iter().all(|p| p.abs() <= 1.0) && c.t[k] > 0.0);
            }
            // The chord predicted from duals agrees: to first order it is exact for the line, near its middle for its extent.
            let line = line(&family.ray::<D1>(), a, b).expansion();
            assert!(line.at(c.p[0]).abs() < 1e-9 && line.at(c.p[1]).abs() < 1e-9);
        } else {
            none += 1;
            assert!(!any);
        }
    }
    assert!(seen > 2000 && none > 2000, "{seen} {none}");
}

#[test]
fn predicted_chords_of_small_moving_footprints() {
    let mut w = World { rng: Rng::new(6) };
    let mut seen = 0;
    for _ in 0..4000 {
        let mut family = w.family();
        family.d_p = family.d_p.map(|v| v * 1e-3);
        family.o_p = [w.rng.cube(1e-3), w.rng.cube(1e-3)];
        let x = Ray::new(family.o, family.d).at(w.rng.range(0.5, 2.0));
        let e = w.rng.direction();
        if e.cross(family.d.normalized()).norm() < 0.3 {
            continue;
        }
        let (a, b) = (x - e * 0.5, x + e * 0.5);
        let chord = predicted_chord(&family.ray::<D1>(), a, b).expect("passes through the centre");
        for k in 0..2 {
            let ray = family.at(chord.p[k]);
            assert!((ray.at(chord.t[k]) - (a + (b - a) * chord.s[k])).norm() < 1e-4);
            assert!(line_distance(&ray, a, b).abs() < 1e-5);
        }
        assert!(predicted_chord(&family.ray::<D1>(), a + (b - a) * 10.0, b + (b - a) * 10.0).is_none());
        seen += 1;
    }
    assert!(seen > 2000);
}

#[test]
fn f32_margin_of_a_far_sphere() {
    // METHODS 3.E: the textbook discriminant is off by 0.12 R at distance 1000 R, this form must stay below 1e-3 R.
    let mut rng = Rng::new(7);
    let (mut worst, mut naive) = (0.0f64, 0.0f64);
    for _ in 0..20_000 {
        let dir = rng.direction();
        let c = dir * 1000.0;
        let aim = c + dir.cross(rng.direction()).normalized() * rng.range(0.0, 2.0);
        let d = aim * rng.range(1e-3, 2.0);
        let (c32, d32) = (c.cast::<f32>(), d.cast::<f32>());
        let s = Sphere::new(c32, 1.0f32);
        let family = Family::<f32, 2>::fixed(Vec3::zero(), d32, [vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0)]);
        let got = sphere_distance(&family.ray::<DualSVec32<2>>(), &s).re;
        // Reference: the same rounded inputs in f64.
        let s64 = Sphere::new(c32.cast::<f64>(), 1.0);
        let want = sphere_distance(&Ray::new(Vec3::zero(), d32.cast::<f64>()), &s64);
        worst = worst.max((f64::from(got) - want).abs());
        let dm = d32.dot(c32);
        let text = (dm * dm - d32.norm2() * (c32.norm2() - 1.0)) / (2.0 * d32.norm2());
        naive = naive.max((f64::from(text) - want).abs());
    }
    println!("f32 margin error at distance 1000 R: {worst:.1e} R (textbook form {naive:.1e} R)");
    assert!(worst < 1e-3, "{worst:e}");
    assert!(naive > 1e-2, "the textbook form should fail here: {naive:e}");
}

#[test]
fn silhouettes_of_mesh_edges() {
    let (x, n1, n2) = (vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 1.0), vec3(-1.0, 0.0, 1.0));
    assert!(!is_silhouette(vec3(0.0, 0.0, 5.0), x, n1, n2));
    assert!(is_silhouette(vec3(5.0, 0.0, 1.0), x, n1, n2));
    let near = [vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0)];
    let wide = [vec3(6.0, 0.0, 0.0), vec3(0.0, 0.1, 0.0)];
    assert!(!may_be_silhouette(vec3(0.0, 0.0, 5.0), &near, x, n1, n2));
    assert!(may_be_silhouette(vec3(0.0, 0.0, 5.0), &wide, x, n1, n2));
}

#[test]
fn lobes_fall_to_the_stated_fraction() {
    let cos = phong_border(20.0f64, 0.1);
    assert!((cos.powf(20.0) - 0.1).abs() < 1e-12);
    for (alpha, tau) in [(0.1, 0.1), (0.3, 0.5), (0.05, 0.01)] {
        let c = ggx_border(alpha, tau).unwrap();
        let d = |c: f64| alpha * alpha / (c * c * (alpha * alpha - 1.0) + 1.0f64).powi(2);
        assert!((d(c) / d(1.0) - tau).abs() < 1e-12);
        // The margin is zero where the half vector is at that cosine.
        let n = vec3(0.0, 0.0, 1.0);
        let half = vec3((1.0 - c * c).sqrt(), 0.0, c);
        let view = vec3(0.2, 0.1, 1.0).normalized();
        let light = crate::reflect(-view, half) * 3.0;
        assert!(half_vector(light, view, n, c).abs() < 1e-12);
        assert!(half_vector(vec3(-view.x, -view.y, view.z), view, n, c) > 0.0);
    }
    assert!(ggx_border(0.9, 0.1).is_none());
    assert!(ggx_border(1.0, 0.1).is_none());
}
