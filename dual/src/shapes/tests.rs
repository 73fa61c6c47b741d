//! Hits against definitions, bit identity per shape and precision, grazing rays.

use num_dual::{Dual2SVec64, DualSVec32, DualSVec64};

use super::*;
use crate::testkit::Rng;
use crate::{Family, Jet, Ray, Real, Vec3, vec3};

struct Shapes<F> {
    sphere: Sphere<F>,
    triangle: Triangle<F>,
    rectangle: Rectangle<F>,
    disk: Disk<F>,
    cylinder: Cylinder<F>,
}

fn random(rng: &mut Rng) -> Shapes<f64> {
    let mut at = || vec3(0.0, 0.0, 3.0) + rng.cube(1.0);
    let (a, b, c, d, e) = (at(), at(), at(), at(), at());
    Shapes {
        sphere: Sphere::new(a, rng.range(0.2, 1.0)),
        triangle: Triangle::new(a, b, c),
        rectangle: Rectangle::new(a, rng.cube(1.0), rng.cube(1.0)),
        disk: Disk::new(b, rng.cube(1.0), rng.range(0.2, 1.0)),
        cylinder: Cylinder::new(d, e, rng.range(0.1, 0.6)),
    }
}

fn to_f32(s: &Shapes<f64>) -> Shapes<f32> {
    Shapes {
        sphere: Sphere::new(s.sphere.centre.cast(), s.sphere.radius as f32),
        triangle: Triangle::new(s.triangle.a.cast(), s.triangle.b.cast(), s.triangle.c.cast()),
        rectangle: Rectangle::new(s.rectangle.centre.cast(), s.rectangle.e1.cast(), s.rectangle.e2.cast()),
        disk: Disk::new(s.disk.centre.cast(), s.disk.normal.cast(), s.disk.radius as f32),
        cylinder: Cylinder::new(s.cylinder.a.cast(), s.cylinder.b.cast(), s.cylinder.radius as f32),
    }
}

/// Everything the shapes can say about a ray: hits, known roots, normals, coordinates.
fn all<T: Real>(s: &Shapes<T::Primitive>, ray: &Ray<T>) -> Vec<T::Primitive> {
    let far = <T::Primitive as crate::Scalar>::of(1e9);
    let zero = <T::Primitive as crate::Scalar>::of(0.0);
    let mut out = Vec::new();
    let mut put = |t: Option<T>| {
        let p = ray.at(t.unwrap_or_else(T::zero));
        out.extend(p.re().to_array());
    };
    put(s.sphere.hit(ray, zero, far).map(|h| h.0));
    put(s.triangle.hit(ray, zero, far));
    put(s.rectangle.hit(ray, zero, far));
    put(s.disk.hit(ray, zero, far));
    put(s.cylinder.hit(ray, zero, far).map(|h| h.0));
    for root in [Root::Near, Root::Far] {
        put(Some(s.sphere.t(ray, root)));
        put(Some(s.cylinder.t(ray, root)));
    }
    let p = ray.at(s.triangle.t(ray));
    out.extend(s.triangle.barycentrics(p).map(|b| b.re()));
    out.extend(s.rectangle.uv(p).map(|b| b.re()));
    out.extend(s.sphere.normal(p).re().to_array());
    out.extend(s.cylinder.normal(p).re().to_array());
    out.push(s.cylinder.height(p).re());
    out
}

#[test]
fn dual_values_equal_plain_values_bit_for_bit() {
    let mut rng = Rng::new(1);
    for _ in 0..5000 {
        let s = random(&mut rng);
        let d = vec3(0.0, 0.0, 1.0) + rng.cube(0.3);
        let f = rng.family(Vec3::zero(), d, 0.2);
        let plain: Vec<_> = all(&s, &f.ray::<f64>()).into_iter().map(f64::to_bits).collect();
        let bits = |v: Vec<f64>| v.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(plain, bits(all(&s, &f.ray::<DualSVec64<2>>())));
        assert_eq!(plain, bits(all(&s, &f.ray::<Dual2SVec64<2>>())));
        let s = to_f32(&s);
        let f = Family::<f32, 2>::fixed(f.o.cast(), f.d.cast(), f.d_p.map(Vec3::cast));
        let bits = |v: Vec<f32>| v.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(all(&s, &f.ray::<f32>())), bits(all(&s, &f.ray::<DualSVec32<2>>())));
    }
}

#[test]
fn hits_lie_on_the_surface_and_inside() {
    let mut rng = Rng::new(2);
    let mut count = [0; 5];
    for _ in 0..20_000 {
        let s = random(&mut rng);
        let ray = Ray::new(rng.cube(0.5), vec3(0.0, 0.0, 1.0) + rng.cube(0.3));
        if let Some((t, root)) = s.sphere.hit(&ray, 0.0, 1e9) {
            assert!(((ray.at(t) - s.sphere.centre).norm() - s.sphere.radius).abs() < 1e-12);
            assert_eq!(t, s.sphere.t(&ray, root));
            assert_eq!(root == Root::Near, s.sphere.is_outside(ray.o));
            count[0] += 1;
        }
        if let Some(t) = s.triangle.hit(&ray, 0.0, 1e9) {
            let b = s.triangle.barycentrics(ray.at(t));
            assert!(b.iter().all(|b| *b > -1e-9), "{b:?}");
            let p = s.triangle.a * b[0] + s.triangle.b * b[1] + s.triangle.c * b[2];
            assert!((p - ray.at(t)).norm() < 1e-9);
            count[1] += 1;
        }
        if let Some(t) = s.rectangle.hit(&ray, 0.0, 1e9) {
            let [u, v] = s.rectangle.uv(ray.at(t));
            assert!(u.abs() < 1.0 + 1e-9 && v.abs() < 1.0 + 1e-9);
            let p = s.rectangle.centre + s.rectangle.e1 * u + s.rectangle.e2 * v;
            assert!((p - ray.at(t)).norm() < 1e-8);
            count[2] += 1;
        }
        if let Some(t) = s.disk.hit(&ray, 0.0, 1e9) {
            let q = ray.at(t) - s.disk.centre;
            assert!(q.norm() < s.disk.radius + 1e-9);
            count[3] += 1;
        }
        if let Some((t, _)) = s.cylinder.hit(&ray, 0.0, 1e9) {
            let p = ray.at(t);
            assert!((s.cylinder.normal(p).norm() - 1.0).abs() < 1e-9);
            assert!((0.0..=1.0).contains(&s.cylinder.height(p)));
            count[4] += 1;
        }
    }
    assert!(count.iter().all(|n| *n > 500), "{count:?}");
}

#[test]
fn sphere_is_met_from_inside_and_not_behind() {
    let s = Sphere::new(vec3(0.0, 0.0, 0.0), 1.0);
    let d = vec3(0.0, 0.0, 2.0);
    assert_eq!(s.hit(&Ray::new(vec3(0.0, 0.0, 0.0), d), 0.0, 9.0), Some((0.5, Root::Far)));
    assert_eq!(s.hit(&Ray::new(vec3(0.0, 0.0, 3.0), d), 0.0, 9.0), None);
    assert_eq!(s.hit(&Ray::new(vec3(0.0, 0.0, -3.0), d), 0.0, 0.9), None);
}

#[test]
fn open_cylinder_shows_its_inner_wall() {
    let c = Cylinder::new(vec3(0.0, 0.0, -1.0), vec3(0.0, 0.0, 1.0), 1.0);
    let across = Ray::new(vec3(-3.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0));
    assert_eq!(c.hit(&across, 0.0, 9.0), Some((2.0, Root::Near)));
    // From above through the open end on to the far wall.
    let down = Ray::new(vec3(-3.0, 0.0, 3.0), vec3(1.0, 0.0, -0.75));
    assert_eq!(c.hit(&down, 0.0, 9.0), Some((4.0, Root::Far)));
    // Along the axis: no hit, no panic.
    assert_eq!(c.hit(&Ray::new(vec3(0.0, 0.0, 5.0), vec3(0.0, 0.0, -1.0)), 0.0, 9.0), None);
}

#[test]
fn neighbouring_triangles_leave_no_gap() {
    let mut rng = Rng::new(3);
    for _ in 0..20_000 {
        let (a, b) = (vec3(0.0, 0.0, 3.0) + rng.cube(1.0), vec3(0.0, 0.0, 3.0) + rng.cube(1.0));
        let across = (b - a).cross(vec3(0.0, 0.0, 1.0));
        let left = Triangle::new(a, b, (a + b) * 0.5 + across);
        let right = Triangle::new(b, a, (a + b) * 0.5 - across);
        // Aimed at a point of the common edge, rounding decides the side; one of the two must take it.
        let (o, x) = (rng.cube(0.5), a + (b - a) * rng.range(0.01, 0.99));
        let ray = Ray::new(o, x - o);
        assert!(left.hit(&ray, 0.0, 9.0).is_some() || right.hit(&ray, 0.0, 9.0).is_some());
    }
}

#[test]
fn grazing_rays_stay_finite() {
    type D = Dual2SVec64<2>;
    let finite = |t: D| t.expansion().is_finite();
    let s = Sphere::new(vec3(0.0, 1.0, 5.0), 1.0);
    for nudge in [0.0, 1e-17, -1e-17, 1e-16, 1e-12, -1e-3] {
        let d = vec3(0.0, nudge, 1.0);
        let ray = Family::fixed(vec3(0.0, 0.0, 0.0), d, [vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0)]).ray::<D>();
        assert!(finite(s.t(&ray, Root::Near)) && finite(s.t(&ray, Root::Far)), "{nudge}");
        assert!(finite(s.discriminant(&ray)));
        let c = Cylinder::new(vec3(-1.0, 1.0, 5.0), vec3(1.0, 1.0, 5.0), 1.0);
        assert!(finite(c.t(&ray, Root::Near)) && finite(c.discriminant(&ray)));
    }
    // A touching ray does not hit, so no infinite derivative leaves `hit`.
    let touch = Ray::new(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0));
    assert!(s.hit(&touch, 0.0, 9.0).is_none());
    // Garbage in: no panic, no hit.
    let bad = Ray::new(vec3(f64::NAN, 0.0, 0.0), vec3(0.0, 0.0, 0.0));
    assert!(s.hit(&bad, 0.0, 9.0).is_none());
    let tri = Triangle::new(vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 1.0), vec3(0.0, 1.0, 1.0));
    assert!(tri.hit(&bad, 0.0, 9.0).is_none());
    assert!(Disk::new(vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0), 1.0).hit(&bad, 0.0, 9.0).is_none());
}
