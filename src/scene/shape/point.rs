//! Surface points: position with error bound, normals, texture coordinates and tangents.
//!
//! Computes a point from the surface's own parameters (barycentrics of a triangle, coordinates on a rectangle or disk,
//! direction from a sphere's centre or a cylinder's axis), never from o + t d alone, whose error grows with t.
//! Source: rounding bounds gamma(n) = n e / (1 - n e), e = 2^-24 (Higham 2002; Pharr et al., PBR section 6.8). For
//! triangles the bound is gamma(7) (|b0 a| + |b1 b| + |b2 c|), with `tmin` > 0: the scheme that made no error at any scale
//! from 1e-3 to 1e4 when it was measured. Planes and quadrics get a bound on the whole shape's extent, which covers the
//! rounding of the shape's own f32 fields and of the next ray's test as well.
//! Parametrisations: Mitsuba 3.9's, measured. A mesh without uv has the barycentrics (b, c) as uv.
//! Not handled: shapes far from the origin for their size (beyond some 10^3) lose digits, as all f32 geometry does.

use super::super::mesh::Mesh;
use super::super::surface::SurfacePoint;
use super::{Cylinder, Disk, Geometry, Rectangle, Shape, ShapeHit, Sphere};
use crate::math::{DVec3, Frame, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// Bound on the relative error of `n` roundings in f32.
pub(super) const fn gamma(n: u32) -> f32 {
    let e = n as f32 * (0.5 * f32::EPSILON);
    e / (1.0 - e)
}

impl Shape {
    /// The surface point that the ray (o, d) has found at `hit` on primitive `prim` of this shape, whose index is
    /// `shape`. The point comes from the surface's own parameters, not from o + t d, and carries its error bound.
    pub fn surface_point(&self, shape: u32, prim: u32, o: Vec3, d: Vec3, hit: ShapeHit) -> SurfacePoint {
        let reached = || o.as_dvec3() + d.as_dvec3() * hit.t as f64;
        let point = match &self.geometry {
            Geometry::Mesh(mesh) => mesh_point(mesh, prim, hit.u, hit.v),
            Geometry::Sphere(s) => s.point(reached() - s.center.as_dvec3()),
            Geometry::Rectangle(r) => {
                let [x, y] = affine_coordinates(reached() - r.center.as_dvec3(), r.ex, r.ey);
                r.point(x.clamp(-1.0, 1.0) as f32, y.clamp(-1.0, 1.0) as f32)
            }
            Geometry::Disk(disk) => {
                let [x, y] = affine_coordinates(reached() - disk.center.as_dvec3(), disk.ex, disk.ey);
                let shrink = 1.0 / (x * x + y * y).sqrt().max(1.0);
                disk.point((x * shrink) as f32, (y * shrink) as f32)
            }
            Geometry::Cylinder(c) => {
                let q = reached() - c.p0.as_dvec3();
                let axis = c.axis.as_dvec3();
                let z = q.dot(axis) / axis.length_squared();
                c.point(z.clamp(0.0, 1.0) as f32, q - z * axis)
            }
        };
        SurfacePoint { shape, prim, ..point }
    }
}

/// (x, y) with q = x ex + y ey in the plane of the two (least squares), in f64.
fn affine_coordinates(q: DVec3, ex: Vec3, ey: Vec3) -> [f64; 2] {
    let (ex, ey) = (ex.as_dvec3(), ey.as_dvec3());
    let n = ex.cross(ey);
    let det = n.length_squared();
    [q.cross(ey).dot(n) / det, ex.cross(q).dot(n) / det]
}

/// The point (1 - u - v) a + u b + v c of triangle `prim`.
pub(super) fn mesh_point(mesh: &Mesh, prim: u32, u: f32, v: f32) -> SurfacePoint {
    let indices = mesh.triangles[prim as usize].map(|i| i as usize);
    let [a, b, c] = indices.map(|i| mesh.positions[i]);
    let w = 1.0 - u - v;
    let (pa, pb, pc) = (a * w, b * u, c * v);
    let n_geo = mesh.face_normal(prim);
    let n_shade = if mesh.normals.is_empty() {
        n_geo
    } else {
        let [na, nb, nc] = indices.map(|i| mesh.normals[i]);
        (na * w + nb * u + nc * v).try_normalize().unwrap_or(n_geo)
    };
    let (e1, e2) = (b - a, c - a);
    let (uv, dp_du, dp_dv) = if mesh.uvs.is_empty() {
        (Vec2::new(u, v), e1, e2)
    } else {
        let [ta, tb, tc] = indices.map(|i| mesh.uvs[i]);
        let (t1, t2) = (tb - ta, tc - ta);
        let det = t1.perp_dot(t2);
        let du = (e1 * t2.y - e2 * t1.y) / det;
        let dv = (e2 * t1.x - e1 * t2.x) / det;
        let uv = ta * w + tb * u + tc * v;
        if det != 0.0 && du.is_finite() && dv.is_finite() {
            (uv, du, dv)
        } else {
            let frame = Frame::from_normal(n_shade);
            (uv, frame.s, frame.t)
        }
    };
    SurfacePoint {
        p: pa + pb + pc,
        p_error: gamma(7) * (pa.abs() + pb.abs() + pc.abs()),
        n_geo,
        n_shade,
        uv,
        dp_du,
        dp_dv,
        shape: 0,
        prim,
    }
}

/// A point of an analytic shape: no separate shading normal, primitive 0.
fn analytic(p: Vec3, p_error: Vec3, n: Vec3, uv: Vec2, dp_du: Vec3, dp_dv: Vec3) -> SurfacePoint {
    SurfacePoint { p, p_error, n_geo: n, n_shade: n, uv, dp_du, dp_dv, shape: 0, prim: 0 }
}

/// Angle over 2 pi, in [0, 1).
fn turn(y: f32, x: f32) -> f32 {
    let u = y.atan2(x) / TAU;
    let u = if u < 0.0 { u + 1.0 } else { u };
    if u < 1.0 { u } else { 0.0 }
}

impl Rectangle {
    /// The point center + x ex + y ey.
    pub(super) fn point(&self, x: f32, y: f32) -> SurfacePoint {
        let p = self.center + (self.ex * x + self.ey * y);
        let extent = self.center.abs() + self.ex.abs() + self.ey.abs();
        let uv = Vec2::new(0.5 * (x + 1.0), 0.5 * (y + 1.0));
        analytic(p, gamma(8) * extent, self.n, uv, 2.0 * self.ex, 2.0 * self.ey)
    }
}

impl Disk {
    /// The point center + x ex + y ey; u is the radius, v the angle over 2 pi.
    pub(super) fn point(&self, x: f32, y: f32) -> SurfacePoint {
        let p = self.center + (self.ex * x + self.ey * y);
        let extent = self.center.abs() + self.ex.abs() + self.ey.abs();
        let r = x.hypot(y);
        let (cos, sin) = if r > 0.0 { (x / r, y / r) } else { (1.0, 0.0) };
        let dp_du = self.ex * cos + self.ey * sin;
        let dp_dv = TAU * (self.ey * x - self.ex * y);
        analytic(p, gamma(12) * extent, self.n, Vec2::new(r, turn(y, x)), dp_du, dp_dv)
    }
}

impl Sphere {
    /// The point in direction `q` from the centre (any length above 0); u = phi / 2 pi, v = theta / pi.
    pub(super) fn point(&self, q: DVec3) -> SurfacePoint {
        let out = q.try_normalize().unwrap_or(DVec3::Z);
        let offset = (out * self.radius as f64).as_vec3();
        let p = self.center + offset;
        let error = gamma(8) * offset.abs() + gamma(3) * (self.center.abs() + offset.abs());
        let out = out.as_vec3();
        let [ax, ay, az] = self.axes;
        let local = Vec3::new(out.dot(ax), out.dot(ay), out.dot(az));
        let rho = local.x.hypot(local.y);
        let (cos, sin) = if rho > 0.0 { (local.x / rho, local.y / rho) } else { (1.0, 0.0) };
        let uv = Vec2::new(turn(local.y, local.x), rho.atan2(local.z) / PI);
        let dp_du = (ay * local.x - ax * local.y) * (TAU * self.radius);
        let dp_dv = ((ax * cos + ay * sin) * local.z - az * rho) * (PI * self.radius);
        analytic(p, error, if self.flip { -out } else { out }, uv, dp_du, dp_dv)
    }
}

impl Cylinder {
    /// The point at `z` in `[0,1]` along the axis, in direction `across` from it (any length above 0; the part along the
    /// axis must be rounding only); u is the angle over 2 pi, v is z.
    pub(super) fn point(&self, z: f32, across: DVec3) -> SurfacePoint {
        let out = across.try_normalize().unwrap_or(self.reference.as_dvec3());
        let offset = (out * self.radius as f64).as_vec3();
        let p = self.p0 + (self.axis * z + offset);
        let error = gamma(12) * (offset.abs() + self.axis.abs() + self.p0.abs());
        let out = out.as_vec3();
        let (x, y) = (out.dot(self.reference), out.dot(self.binormal));
        let dp_du = (self.binormal * x - self.reference * y) * (TAU * self.radius);
        let n = if self.flip { -out } else { out };
        analytic(p, error, n, Vec2::new(turn(y, x), z), dp_du, self.axis)
    }
}
