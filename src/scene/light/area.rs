//! Area lamps seen from a point: directions towards one primitive, and their density.
//!
//! Measure: everything is per solid angle at the shaded point (`pdf_dir`).
//! - Rectangles: uniform in solid angle, Urena et al. 2013 ([`SphericalRectangle`]); other parallelograms as two triangles.
//! - Triangles: uniform in solid angle, Arvo 1995 ([`SphericalTriangle`]).
//! - Spheres from outside: uniform in the cone around them; from inside: uniform by area.
//! - Disks and cylinders, and planar lamps below [`MIN_SOLID_ANGLE`]: uniform by area, pdf_dir = d^2 / (A cos).
//!
//! Which branch is taken follows from the lamp and the shaded point alone, so that the density of a point found by a ray
//! is that of the same point sampled: [`Seen`] is the lamp in view of the point, from which both follow. A point in a lamp's own plane (to rounding) is not lit by it: nothing is sampled,
//! and the density is 0. Bias: none beyond that. Not handled: choosing the visible part of a cylinder.

use crate::math::polygon::{RectangleFrame, SphericalRectangle, SphericalTriangle};
use crate::math::warp::{sample_disk, sample_sphere, sample_triangle};
use crate::math::{DVec3, Frame, Vec2, Vec3};
use crate::scene::shape::{Cylinder, Geometry, Rectangle, Shape, Sphere};
use crate::scene::surface::SurfacePoint;
use std::f64::consts::{PI, TAU};

/// Below this solid angle (sr) planar lamps are sampled by area: there the two agree but for extreme angles, and
/// rounding of the spherical parametrisation of a rectangle seen edge-on grows to 1e-4 of its width.
const MIN_SOLID_ANGLE: f64 = 1e-6;

/// A point lies in a lamp's plane if it is no further from it than this fraction of the coordinates (5 units in the
/// last place of f32).
const IN_PLANE: f64 = 3e-7;

/// A lamp: a primitive of a shape, or several that make up one.
#[derive(Clone, Copy, Debug)]
pub(super) enum Lamp<'a> {
    /// Primitive of a shape.
    Primitive(&'a Shape, u32),
    /// A parallelogram.
    Parallelogram(&'a Patch),
}

/// A parallelogram: a cache line, as there may be many. (The frame of a rectangle would be three more.)
#[derive(Clone, Debug)]
#[repr(align(64))]
pub(super) struct Patch {
    pub rectangle: Rectangle,
    area: f32,
    /// Whether the edges are orthogonal.
    orthogonal: bool,
}

impl Patch {
    pub fn new(rectangle: Rectangle) -> Self {
        let (x, y) = (rectangle.ex.as_dvec3(), rectangle.ey.as_dvec3());
        let orthogonal = x.dot(y).abs() <= 1e-6 * x.length() * y.length();
        Patch { area: rectangle.area(), rectangle, orthogonal }
    }

    /// Its frame, if it is a rectangle.
    fn frame(&self) -> Option<RectangleFrame> {
        let r = &self.rectangle;
        let [c, x, y] = [r.center, r.ex, r.ey].map(|v| v.as_dvec3());
        self.orthogonal.then(|| RectangleFrame::new(c, x, y)).flatten()
    }
}

/// A sampled point of a lamp.
#[derive(Clone, Copy, Debug)]
pub(super) struct LampPoint {
    /// Unit direction from the shaded point.
    pub wi: Vec3,
    /// Distance to the lamp.
    pub distance: f32,
    /// Density per solid angle.
    pub pdf_dir: f32,
    /// Barycentrics of the second and third vertex, for triangles.
    pub barycentric: Vec2,
}

impl LampPoint {
    /// The point at `to` relative to the shaded point; `None` where the density is 0 or not finite.
    fn new(to: DVec3, pdf_dir: f64, barycentric: Vec2) -> Option<Self> {
        let to = to.as_vec3();
        let distance = to.length();
        let pdf_dir = pdf_dir as f32;
        (pdf_dir > 0.0 && pdf_dir.is_finite() && distance > 0.0).then(|| LampPoint {
            wi: to / distance,
            distance,
            pdf_dir,
            barycentric,
        })
    }
}

/// A lamp in view of a point, ready to be sampled; positions are relative to the point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seen<'a> {
    /// By solid angle.
    Triangle(SphericalTriangle),
    /// By solid angle.
    Rectangle(SphericalRectangle),
    /// By solid angle, as two triangles.
    Parallelogram([SphericalTriangle; 2]),
    /// By area: a + u ab + v ac.
    FlatTriangle { a: DVec3, ab: DVec3, ac: DVec3, plane: Plane },
    /// By area: c + u x + v y, u and v in [-1, 1].
    FlatParallelogram { c: DVec3, x: DVec3, y: DVec3, plane: Plane },
    /// By area.
    Disk { c: DVec3, x: DVec3, y: DVec3, plane: Plane },
    /// A sphere from outside, by solid angle: the cone that holds it, by 1 - cos of its half angle, its centre and distance.
    Cone { sphere: &'a Sphere, center: DVec3, distance: f64, one_minus_cos: f64 },
    /// A sphere from inside, by area.
    Inside { center: DVec3, radius: f64, area: f64 },
    /// By area.
    Cylinder { cylinder: &'a Cylinder, p: Vec3, area: f64 },
}

/// Height of the shaded point above a planar lamp, and its area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    height: f64,
    area: f64,
}

impl Plane {
    /// d^2 / (A cos) for a point of the plane; 0 in the plane.
    fn pdf_dir(&self, to: DVec3) -> f64 {
        let d2 = to.length_squared();
        if self.height > 0.0 { d2 * d2.sqrt() / (self.height * self.area) } else { 0.0 }
    }
}

impl<'a> Seen<'a> {
    /// `None` if the lamp's emitting side cannot be seen from `p` (left to the interpolated normal for meshes that have one).
    pub fn new(lamp: Lamp<'a>, p: Vec3) -> Option<Self> {
        let (shape, prim) = match lamp {
            Lamp::Parallelogram(patch) => return Self::parallelogram(patch, p),
            Lamp::Primitive(shape, prim) => (shape, prim),
        };
        let area = || shape.primitive_area(prim) as f64;
        match &shape.geometry {
            Geometry::Mesh(m) => Self::triangle(m.corners(prim), !m.normals.is_empty(), area, p),
            // Rectangles are patches; this is what they are without one.
            Geometry::Rectangle(r) => Self::flat(r, f64::from(r.area()), p),
            Geometry::Sphere(s) => Self::sphere(s, area, p),
            Geometry::Disk(d) => {
                let height = front_height(d.center, d.n, d.ex.abs() + d.ey.abs(), p)?;
                let plane = Plane { height, area: area() };
                Some(Seen::Disk { c: relative(d.center, p), x: d.ex.as_dvec3(), y: d.ey.as_dvec3(), plane })
            }
            Geometry::Cylinder(cylinder) => Some(Seen::Cylinder { cylinder, p, area: area() }),
        }
    }

    fn triangle(corners: [Vec3; 3], both_sides: bool, area: impl Fn() -> f64, p: Vec3) -> Option<Self> {
        let height = facet_height(corners, p);
        // Not `height <= 0`: triangles without area have none (NaN).
        if !(height > 0.0 || (both_sides && height < 0.0)) {
            return None;
        }
        let [a, b, c] = corners.map(|v| relative(v, p));
        if let Some(t) = SphericalTriangle::new(a, b, c).filter(|t| t.solid_angle() > MIN_SOLID_ANGLE) {
            return Some(Seen::Triangle(t));
        }
        let plane = Plane { height: height.abs(), area: area() };
        Some(Seen::FlatTriangle { a, ab: b - a, ac: c - a, plane })
    }

    fn parallelogram(patch: &Patch, p: Vec3) -> Option<Self> {
        let r = &patch.rectangle;
        let flat = Self::flat(r, f64::from(patch.area), p)?;
        if let Seen::FlatParallelogram { c, plane, .. } = &flat {
            // No part of it is nearer than this, and none seen at a larger cosine than height / near: small for certain.
            let near = c.length() - f64::from(r.ex.length() + r.ey.length());
            if near > 0.0 && plane.area * plane.height < 0.999 * MIN_SOLID_ANGLE * near.powi(3) {
                return Some(flat);
            }
        }
        let seen = if let Some(frame) = patch.frame() {
            Seen::Rectangle(frame.seen_from(p.as_dvec3()))
        } else {
            let (c, x, y) = (relative(r.center, p), r.ex.as_dvec3(), r.ey.as_dvec3());
            let (a, b) = (c - x - y, c + x + y);
            Seen::Parallelogram([SphericalTriangle::new(a, c + x - y, b)?, SphericalTriangle::new(a, b, c - x + y)?])
        };
        Some(if seen.solid_angle()? > MIN_SOLID_ANGLE { seen } else { flat })
    }

    fn flat(r: &Rectangle, area: f64, p: Vec3) -> Option<Self> {
        let height = front_height(r.center, r.n, r.ex.abs() + r.ey.abs(), p)?;
        let plane = Plane { height, area };
        Some(Seen::FlatParallelogram { c: relative(r.center, p), x: r.ex.as_dvec3(), y: r.ey.as_dvec3(), plane })
    }

    fn sphere(s: &'a Sphere, area: impl Fn() -> f64, p: Vec3) -> Option<Self> {
        let radius = s.radius as f64;
        let center = relative(s.center, p);
        let distance = center.length();
        let scale = p.abs().max(s.center.abs()).max_element() as f64 + radius;
        if distance - radius > IN_PLANE * scale {
            // sin^2 / (1 + cos) instead of 1 - cos: all digits for a sphere of any size.
            let sin2 = (radius / distance).powi(2);
            let one_minus_cos = sin2 / (1.0 + (1.0 - sin2).sqrt());
            return Some(Seen::Cone { sphere: s, center, distance, one_minus_cos });
        }
        // The emitting side cannot be seen from inside a sphere that emits outwards.
        s.flip.then(|| Seen::Inside { center, radius, area: area() })
    }

    /// Solid angle, where it is what is sampled.
    pub fn solid_angle(&self) -> Option<f64> {
        match self {
            Seen::Triangle(t) => Some(t.solid_angle()),
            Seen::Rectangle(r) => Some(r.solid_angle()),
            Seen::Parallelogram([a, b]) => Some(a.solid_angle() + b.solid_angle()),
            Seen::Cone { one_minus_cos, .. } => Some(TAU * one_minus_cos),
            _ => None,
        }
    }

    /// Solid angle, roughly: of what is sampled by area as if it were small; infinite inside of a sphere.
    pub fn solid_angle_estimate(&self) -> f64 {
        let small = |to: DVec3, plane: &Plane| 1.0 / plane.pdf_dir(to);
        match self {
            Seen::FlatTriangle { a, ab, ac, plane } => small(*a + (*ab + *ac) / 3.0, plane),
            Seen::FlatParallelogram { c, plane, .. } | Seen::Disk { c, plane, .. } => small(*c, plane),
            Seen::Inside { .. } => f64::INFINITY,
            Seen::Cylinder { cylinder, p, area } => {
                let middle = relative(cylinder.p0, *p) + cylinder.axis.as_dvec3() * 0.5;
                area / PI / middle.length_squared()
            }
            _ => self.solid_angle().unwrap_or(0.0),
        }
    }

    /// Draws a point.
    pub fn sample(&self, u: Vec2) -> Option<LampPoint> {
        let uniform = || 1.0 / self.solid_angle().unwrap_or(0.0);
        let [x, y] = [u.x as f64, u.y as f64];
        match self {
            Seen::Triangle(t) => {
                let q = t.sample([x, y]);
                let barycentric = Vec2::new(q.barycentric.y as f32, q.barycentric.z as f32);
                LampPoint::new(q.position, t.pdf_dir(), barycentric)
            }
            Seen::Rectangle(r) => LampPoint::new(r.sample([x, y]), r.pdf_dir(), Vec2::ZERO),
            Seen::Parallelogram([a, b]) => {
                let first = a.solid_angle() / (a.solid_angle() + b.solid_angle());
                let q = if x < first { a.sample([x / first, y]) } else { b.sample([(x - first) / (1.0 - first), y]) };
                LampPoint::new(q.position, uniform(), Vec2::ZERO)
            }
            Seen::FlatTriangle { a, ab, ac, plane } => {
                let q = sample_triangle(u);
                let to = *a + *ab * q.x as f64 + *ac * q.y as f64;
                LampPoint::new(to, plane.pdf_dir(to), q)
            }
            Seen::FlatParallelogram { c, x: ex, y: ey, plane } => {
                let to = *c + *ex * (x * 2.0 - 1.0) + *ey * (y * 2.0 - 1.0);
                LampPoint::new(to, plane.pdf_dir(to), Vec2::ZERO)
            }
            Seen::Disk { c, x: ex, y: ey, plane } => {
                let q = sample_disk(u);
                let to = *c + *ex * q.x as f64 + *ey * q.y as f64;
                LampPoint::new(to, plane.pdf_dir(to), Vec2::ZERO)
            }
            Seen::Cone { sphere, center, distance, one_minus_cos } => {
                sample_cone(sphere, *center, *distance, *one_minus_cos, u)
            }
            Seen::Inside { center, radius, area } => {
                let n = sample_sphere(u).as_dvec3().normalize();
                let to = *center + n * *radius;
                LampPoint::new(to, curved_pdf(to, n, *area), Vec2::ZERO)
            }
            Seen::Cylinder { cylinder, p, area } => sample_cylinder(cylinder, *area, *p, u),
        }
    }

    /// Density with which [`Self::sample`] draws the point at `to`, where the lamp has the normal `n`.
    pub fn pdf_dir(&self, to: DVec3, n: DVec3) -> f64 {
        match self {
            Seen::FlatTriangle { plane, .. } | Seen::FlatParallelogram { plane, .. } | Seen::Disk { plane, .. } => {
                plane.pdf_dir(to)
            }
            Seen::Inside { area, .. } | Seen::Cylinder { area, .. } => curved_pdf(to, n, *area),
            _ => 1.0 / self.solid_angle().unwrap_or(0.0),
        }
    }
}

/// Draws a point of a lamp towards `p`, see [`Seen`].
#[cfg(test)]
pub(super) fn sample(lamp: Lamp, p: Vec3, u: Vec2) -> Option<LampPoint> {
    Seen::new(lamp, p)?.sample(u)
}

/// Density with which a lamp is sampled from `p` at its point `at`.
pub(super) fn pdf_dir(lamp: Lamp, p: Vec3, at: &SurfacePoint) -> f32 {
    let seen = Seen::new(lamp, p);
    let pdf = seen.map_or(0.0, |s| s.pdf_dir(relative(at.p, p), at.n_geo.as_dvec3()));
    if pdf.is_finite() { pdf as f32 } else { 0.0 }
}

pub(super) fn relative(q: Vec3, p: Vec3) -> DVec3 {
    q.as_dvec3() - p.as_dvec3()
}

/// d^2 / (A cos) for a point at `to` with unit normal `n`.
fn curved_pdf(to: DVec3, n: DVec3, area: f64) -> f64 {
    let d2 = to.length_squared();
    let cos = to.dot(n).abs();
    if cos > 0.0 { d2 * d2.sqrt() / (cos * area) } else { 0.0 }
}

/// Height of `p` above the plane through `center` with normal `n`; `None` if it is below or in the plane.
/// `extent`: the lamp's size, which with the coordinates sets what rounding is.
fn front_height(center: Vec3, n: Vec3, extent: Vec3, p: Vec3) -> Option<f64> {
    let height = -relative(center, p).dot(n.as_dvec3());
    let scale = (p.abs().max(center.abs()) + extent).max_element() as f64;
    (height > IN_PLANE * scale).then_some(height)
}

/// Height of `p` above the triangle's plane, negative behind it; 0 within rounding of the plane.
fn facet_height([a, b, c]: [Vec3; 3], p: Vec3) -> f64 {
    let cross = relative(b, a).cross(relative(c, a));
    let height = -relative(a, p).dot(cross) / cross.length();
    let scale = p.abs().max(a.abs()).max(b.abs()).max(c.abs()).max_element() as f64;
    if height.abs() > IN_PLANE * scale { height } else { 0.0 }
}

fn sample_cone(s: &Sphere, center: DVec3, distance: f64, one_minus_cos: f64, u: Vec2) -> Option<LampPoint> {
    let radius = s.radius as f64;
    let m = u.x as f64 * one_minus_cos;
    let (cos, sin2) = (1.0 - m, m * (2.0 - m));
    let (sin_phi, cos_phi) = (TAU * u.y as f64).sin_cos();
    let axis = center / distance;
    let frame = Frame::from_normal(axis.as_vec3());
    // Tangents orthogonal to the axis in f64: distant spheres are narrower than an f32 angle resolves.
    let sx = frame.s.as_dvec3();
    let sx = (sx - axis * axis.dot(sx)).normalize();
    let dir = axis * cos + (sx * cos_phi + axis.cross(sx) * sin_phi) * sin2.sqrt();
    // Nearest intersection; a sphere that emits inwards shows its far side (through what it is made of).
    let half = (radius * radius - distance * distance * sin2).max(0.0).sqrt();
    let t = distance * cos + if s.flip { half } else { -half };
    LampPoint::new(dir * t, 1.0 / (TAU * one_minus_cos), Vec2::ZERO)
}

fn sample_cylinder(c: &Cylinder, area: f64, p: Vec3, u: Vec2) -> Option<LampPoint> {
    let (sin, cos) = (TAU * u.y as f64).sin_cos();
    let n = c.reference.as_dvec3() * cos + c.binormal.as_dvec3() * sin;
    let to = relative(c.p0, p) + c.axis.as_dvec3() * u.x as f64 + n * c.radius as f64;
    let front = if c.flip { to.dot(n) > 0.0 } else { to.dot(n) < 0.0 };
    front.then(|| LampPoint::new(to, curved_pdf(to, n, area), Vec2::ZERO)).flatten()
}
