//! Error bounds, spawned origins and recomputed hits at all scales.

use super::*;
use crate::math::sampler::{hash, unit_f32};
use crate::math::{Vec2, warp};

/// Signed distance of `p` from the exact surface of an analytic shape (from its f32 fields) or triangle, in f64:
/// above zero outside or on the side of the parametrisation's normal.
fn distance(shape: &Shape, prim: u32, p: Vec3) -> f64 {
    let p = p.as_dvec3();
    let plane = |c: Vec3, n: DVec3| (p - c.as_dvec3()).dot(n.normalize());
    match &shape.geometry {
        Geometry::Mesh(m) => {
            let [a, b, c] = m.corners(prim);
            plane(a, (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3()))
        }
        Geometry::Rectangle(r) => plane(r.center, r.ex.as_dvec3().cross(r.ey.as_dvec3())),
        Geometry::Disk(d) => plane(d.center, d.ex.as_dvec3().cross(d.ey.as_dvec3())),
        Geometry::Sphere(s) => (p - s.center.as_dvec3()).length() - s.radius as f64,
        Geometry::Cylinder(c) => {
            let (q, a) = (p - c.p0.as_dvec3(), c.axis.as_dvec3().normalize());
            (q - a * q.dot(a)).length() - c.radius as f64
        }
    }
}

#[test]
fn error_bounds_hold_and_spawned_origins_leave_the_surface_at_every_scale() {
    for (scale, offset) in [(1e-3, 0.0), (1.0, 0.0), (555.0, 1.0), (1e4, 3.0), (1.0, 100.0)] {
        for shape in zoo(scale, offset) {
            for i in 0..2000u64 {
                let u = Vec2::new(unit_f32(hash(i, 1)), unit_f32(hash(i, 2)));
                let prim = (i % shape.primitive_count() as u64) as u32;
                let s = shape.sample_area(0, prim, u).0;
                let bound = s.n_geo.abs().dot(s.p_error) as f64;
                let off = distance(&shape, prim, s.p).abs();
                assert!(off <= bound, "{} at {scale}: off by {off:e}, bound {bound:e}", shape.name);
                assert!(bound <= 1e-5 * scale * (1.0 + offset), "bound {bound:e} at {scale}: too wide");
                assert!(s.n_geo.is_normalized() && s.n_shade.is_normalized());
                let (lo, hi) = shape.bounds();
                assert!((s.p - s.p_error).cmple(hi).all() && (s.p + s.p_error).cmpge(lo).all());
                let side = distance(&shape, prim, s.p + s.n_geo * (0.01 * scale as f32)).signum();
                for d in [s.n_geo, -s.n_geo, s.n_geo + Vec3::new(0.3, 0.2, 0.1)] {
                    let origin = s.spawn_origin(d);
                    let moved = (origin.as_dvec3() - s.p.as_dvec3()).dot(s.n_geo.as_dvec3()).abs();
                    assert!(moved >= bound, "moved by {moved:e}, bound {bound:e}");
                    let out = distance(&shape, prim, origin) * side * d.dot(s.n_geo).signum() as f64;
                    assert!(out > 0.0, "{:?} at {scale}: {out:e} on the wrong side", shape.geometry);
                }
            }
        }
    }
}

#[test]
fn a_hit_comes_back_as_the_point_that_was_aimed_at() {
    for (scale, offset) in [(1e-3, 0.0), (1.0, 1.0), (1e4, 3.0)] {
        for shape in zoo(scale, offset) {
            for i in 0..500u64 {
                let u = Vec2::new(unit_f32(hash(i, 3)), unit_f32(hash(i, 4)));
                let prim = (i % shape.primitive_count() as u64) as u32;
                let s = shape.sample_area(5, prim, u).0;
                // A distant origin: o + t d is inaccurate there, the recomputed point must not be.
                let o = s.p + (s.n_geo + Vec3::new(0.3, -0.2, 0.1)) * (200.0 * scale as f32);
                let at = |t: f32| {
                    let b = match &shape.geometry {
                        Geometry::Mesh(_) => warp::sample_triangle(u),
                        _ => Vec2::ZERO,
                    };
                    shape.surface_point(5, prim, o, s.p - o, ShapeHit { t, u: b.x, v: b.y })
                };
                let hit = at(1.0f32.next_up());
                assert!(distance(&shape, prim, hit.p).abs() <= hit.n_geo.abs().dot(hit.p_error) as f64);
                let apart = (hit.p - s.p).length() / scale as f32;
                assert!(apart < 2e-3, "{apart} at {scale}");
                let delta = (hit.uv - s.uv).abs();
                let delta = delta.min((Vec2::ONE - delta).abs());
                assert!(delta.max_element() < 2e-2, "{} and {}", hit.uv, s.uv);
            }
        }
    }
}

#[test]
fn degenerate_uv_and_normals_fall_back_to_a_frame_and_the_face() {
    let mut data = MeshData {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        normals: vec![Vec3::ZERO, Vec3::new(0.0, 0.6, 0.8), Vec3::Z],
        uvs: vec![Vec2::new(0.5, 0.5); 3],
        triangles: vec![[0, 1, 2]],
        ..Default::default()
    };
    let at = |data: &MeshData, u, v| {
        let shape = build(GeometryDesc::Mesh(data.clone()), DMat4::IDENTITY, false);
        shape.surface_point(0, 0, Vec3::Z, -Vec3::Z, ShapeHit { t: 1.0, u, v })
    };
    let s = at(&data, 0.25, 0.5);
    assert_eq!((s.uv, s.n_geo), (Vec2::splat(0.5), Vec3::Z));
    assert!((s.n_shade - Vec3::new(0.0, 0.15, 0.7).normalize()).length() < 1e-6);
    assert!(s.dp_du.is_normalized() && s.dp_du.cross(s.dp_dv).dot(s.n_shade) > 0.99);
    assert_eq!(at(&data, 0.0, 0.0).n_shade, Vec3::Z, "only the vertex without a normal counts here");
    data.uvs = vec![Vec2::new(0.0, 1.0), Vec2::new(0.0, 3.0), Vec2::new(4.0, 1.0)];
    let s = at(&data, 0.25, 0.5);
    assert_eq!((s.uv, s.dp_du, s.dp_dv), (Vec2::new(2.0, 1.5), Vec3::Y / 4.0, Vec3::X / 2.0));
    // Without uv: barycentrics.
    data.uvs.clear();
    let s = at(&data, 0.25, 0.5);
    assert_eq!((s.uv, s.dp_du, s.dp_dv), (Vec2::new(0.25, 0.5), Vec3::X, Vec3::Y));
}
