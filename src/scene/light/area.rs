//! Area lamps seen from a point: directions towards one primitive, and their density.
//!
//! Measure: everything is per solid angle at the shaded point (`pdf_dir`).
//! - Rectangles: uniform in solid angle, Urena et al. 2013 ([`SphericalRectangle`]); other parallelograms as two triangles.
//! - Triangles: uniform in solid angle, Arvo 1995 ([`SphericalTriangle`]).
//! - Spheres from outside: uniform in the cone around them; from inside: uniform by area.
//! - Disks and cylinders, and planar lamps below [`MIN_SOLID_ANGLE`]: uniform by area, pdf_dir = d^2 / (A cos).
//!
//! Which branch is taken follows from the lamp and the shaded point alone, so that the density of a point found by a ray
//! is that of the same point sampled. A point in a lamp's own plane (to rounding) is not lit by it: nothing is sampled,
//! and the density is 0. Bias: none beyond that. Not handled: choosing the visible part of a cylinder.

use crate::math::polygon::{RectangleFrame, SphericalRectangle, SphericalTriangle};
use crate::math::warp::{sample_disk, sample_sphere, sample_triangle};
use crate::math::{DVec3, Frame, Vec2, Vec3};
use crate::scene::shape::{Cylinder, Geometry, Rectangle, Shape, Sphere};
use crate::scene::surface::SurfacePoint;
use std::f64::consts::TAU;

/// Below this solid angle (sr) planar lamps are sampled by area: there the two agree but for extreme angles, and
/// rounding of the spherical parametrisation of a rectangle seen edge-on grows to 1e-4 of its width.
const MIN_SOLID_ANGLE: f64 = 1e-6;

/// A point lies in a lamp's plane if it is no further from it than this fraction of the coordinates (5 units in the
/// last place of f32).
const IN_PLANE: f64 = 3e-7;

/// A lamp and what [`frame`] has prepared for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lamp<'a> {
    pub shape: &'a Shape,
    pub frame: Option<&'a RectangleFrame>,
}

/// What can be prepared for sampling a lamp: the frame of a rectangle with orthogonal edges.
pub(super) fn frame(shape: &Shape) -> Option<RectangleFrame> {
    let Geometry::Rectangle(r) = &shape.geometry else {
        return None;
    };
    let (x, y) = (r.ex.as_dvec3(), r.ey.as_dvec3());
    let orthogonal = x.dot(y).abs() <= 1e-6 * x.length() * y.length();
    orthogonal.then(|| RectangleFrame::new(r.center.as_dvec3(), x, y)).flatten()
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

/// Draws a point of primitive `prim` of `lamp` towards `p`. `None` if the lamp's emitting side cannot be seen from there (left to the
/// interpolated normal for meshes that have one).
pub(super) fn sample(lamp: Lamp, prim: u32, p: Vec3, u: Vec2) -> Option<LampPoint> {
    let area = || lamp.shape.primitive_area(prim) as f64;
    match &lamp.shape.geometry {
        Geometry::Mesh(m) => {
            let corners = m.triangles[prim as usize].map(|i| m.positions[i as usize]);
            sample_facet(corners, !m.normals.is_empty(), area, p, u)
        }
        Geometry::Rectangle(r) => sample_rectangle(r, lamp.frame, area, p, u),
        Geometry::Sphere(s) => sample_sphere_lamp(s, area(), p, u),
        Geometry::Disk(d) => {
            let height = front_height(d.center, d.n, d.ex.abs() + d.ey.abs(), p)?;
            let q = sample_disk(u);
            let to = relative(d.center, p) + d.ex.as_dvec3() * q.x as f64 + d.ey.as_dvec3() * q.y as f64;
            LampPoint::new(to, planar_pdf(to, height, area()), Vec2::ZERO)
        }
        Geometry::Cylinder(c) => sample_cylinder(c, area(), p, u),
    }
}

/// Density with which [`sample`] at `p` draws the point `at` of primitive `prim`.
pub(super) fn pdf_dir(lamp: Lamp, prim: u32, p: Vec3, at: &SurfacePoint) -> f32 {
    let to = relative(at.p, p);
    let area = || lamp.shape.primitive_area(prim) as f64;
    let pdf = match &lamp.shape.geometry {
        Geometry::Mesh(m) => {
            let corners = m.triangles[prim as usize].map(|i| m.positions[i as usize]);
            let height = facet_height(corners, p).abs();
            match (height > 0.0).then(|| spherical_triangle(corners, p)).flatten() {
                Some(t) => t.pdf_dir(),
                None => planar_pdf(to, height, area()),
            }
        }
        Geometry::Rectangle(r) => match front_height(r.center, r.n, r.ex.abs() + r.ey.abs(), p) {
            Some(height) => match SphericalLamp::new(r, lamp.frame, p) {
                Some(s) => 1.0 / s.solid_angle(),
                None => planar_pdf(to, height, area()),
            },
            None => 0.0,
        },
        Geometry::Sphere(s) => match SphereView::new(s, p) {
            Some(SphereView::Cone { one_minus_cos, .. }) => 1.0 / (TAU * one_minus_cos),
            Some(SphereView::Inside) => curved_pdf(to, at.n_geo.as_dvec3(), area()),
            None => 0.0,
        },
        Geometry::Disk(d) => match front_height(d.center, d.n, d.ex.abs() + d.ey.abs(), p) {
            Some(height) => planar_pdf(to, height, area()),
            None => 0.0,
        },
        Geometry::Cylinder(_) => curved_pdf(to, at.n_geo.as_dvec3(), area()),
    };
    if pdf.is_finite() { pdf as f32 } else { 0.0 }
}

fn relative(q: Vec3, p: Vec3) -> DVec3 {
    q.as_dvec3() - p.as_dvec3()
}

/// d^2 / (A cos) for a point at `to` of a plane at distance `height`; 0 in the plane.
fn planar_pdf(to: DVec3, height: f64, area: f64) -> f64 {
    let d2 = to.length_squared();
    if height > 0.0 { d2 * d2.sqrt() / (height * area) } else { 0.0 }
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

/// The triangle in view of `p`, unless it is too small for that.
fn spherical_triangle([a, b, c]: [Vec3; 3], p: Vec3) -> Option<SphericalTriangle> {
    let t = SphericalTriangle::new(relative(a, p), relative(b, p), relative(c, p))?;
    (t.solid_angle() > MIN_SOLID_ANGLE).then_some(t)
}

fn sample_facet(corners: [Vec3; 3], both_sides: bool, area: impl Fn() -> f64, p: Vec3, u: Vec2) -> Option<LampPoint> {
    let height = facet_height(corners, p);
    // Not `height <= 0`: triangles without area have none (NaN).
    if !(height > 0.0 || (both_sides && height < 0.0)) {
        return None;
    }
    if let Some(t) = spherical_triangle(corners, p) {
        let q = t.sample([u.x as f64, u.y as f64]);
        let barycentric = Vec2::new(q.barycentric.y as f32, q.barycentric.z as f32);
        return LampPoint::new(q.position, t.pdf_dir(), barycentric);
    }
    let [a, b, c] = corners;
    let q = sample_triangle(u);
    let to = relative(a, p) + relative(b, a) * q.x as f64 + relative(c, a) * q.y as f64;
    LampPoint::new(to, planar_pdf(to, height.abs(), area()), q)
}

/// A parallelogram in view of a point.
enum SphericalLamp {
    Rectangle(SphericalRectangle),
    Parallelogram([SphericalTriangle; 2]),
}

impl SphericalLamp {
    /// `None` if it is too small for spherical sampling.
    fn new(r: &Rectangle, frame: Option<&RectangleFrame>, p: Vec3) -> Option<Self> {
        let lamp = if let Some(frame) = frame {
            SphericalLamp::Rectangle(frame.seen_from(p.as_dvec3()))
        } else {
            let (c, x, y) = (relative(r.center, p), r.ex.as_dvec3(), r.ey.as_dvec3());
            let (a, b) = (c - x - y, c + x + y);
            SphericalLamp::Parallelogram([
                SphericalTriangle::new(a, c + x - y, b)?,
                SphericalTriangle::new(a, b, c - x + y)?,
            ])
        };
        (lamp.solid_angle() > MIN_SOLID_ANGLE).then_some(lamp)
    }

    fn solid_angle(&self) -> f64 {
        match self {
            SphericalLamp::Rectangle(r) => r.solid_angle(),
            SphericalLamp::Parallelogram([a, b]) => a.solid_angle() + b.solid_angle(),
        }
    }

    /// Point relative to the shaded point.
    fn sample(&self, u: [f64; 2]) -> DVec3 {
        match self {
            SphericalLamp::Rectangle(r) => r.sample(u),
            SphericalLamp::Parallelogram([a, b]) => {
                let first = a.solid_angle() / self.solid_angle();
                let q = if u[0] < first {
                    a.sample([u[0] / first, u[1]])
                } else {
                    b.sample([(u[0] - first) / (1.0 - first), u[1]])
                };
                q.position
            }
        }
    }
}

fn sample_rectangle(
    r: &Rectangle,
    frame: Option<&RectangleFrame>,
    area: impl Fn() -> f64,
    p: Vec3,
    u: Vec2,
) -> Option<LampPoint> {
    let height = front_height(r.center, r.n, r.ex.abs() + r.ey.abs(), p)?;
    if let Some(lamp) = SphericalLamp::new(r, frame, p) {
        let to = lamp.sample([u.x as f64, u.y as f64]);
        return LampPoint::new(to, 1.0 / lamp.solid_angle(), Vec2::ZERO);
    }
    let q = u.as_dvec2() * 2.0 - 1.0;
    let to = relative(r.center, p) + r.ex.as_dvec3() * q.x + r.ey.as_dvec3() * q.y;
    LampPoint::new(to, planar_pdf(to, height, area()), Vec2::ZERO)
}

/// How a sphere's emitting side is seen.
enum SphereView {
    /// From outside: the cone that holds it, by 1 - cos of its half angle, and the distance of the centre.
    Cone { one_minus_cos: f64, distance: f64 },
    /// From inside, or from the sphere itself.
    Inside,
}

impl SphereView {
    /// `None` if the emitting side cannot be seen: from inside a sphere that emits outwards.
    fn new(s: &Sphere, p: Vec3) -> Option<Self> {
        let radius = s.radius as f64;
        let distance = relative(s.center, p).length();
        let scale = p.abs().max(s.center.abs()).max_element() as f64 + radius;
        if distance - radius > IN_PLANE * scale {
            // sin^2 / (1 + cos) instead of 1 - cos: all digits for a sphere of any size.
            let sin2 = (radius / distance).powi(2);
            let one_minus_cos = sin2 / (1.0 + (1.0 - sin2).sqrt());
            return Some(SphereView::Cone { one_minus_cos, distance });
        }
        s.flip.then_some(SphereView::Inside)
    }
}

fn sample_sphere_lamp(s: &Sphere, area: f64, p: Vec3, u: Vec2) -> Option<LampPoint> {
    let radius = s.radius as f64;
    let center = relative(s.center, p);
    match SphereView::new(s, p)? {
        SphereView::Cone { one_minus_cos, distance } => {
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
        SphereView::Inside => {
            let n = sample_sphere(u).as_dvec3().normalize();
            let to = center + n * radius;
            LampPoint::new(to, curved_pdf(to, n, area), Vec2::ZERO)
        }
    }
}

fn sample_cylinder(c: &Cylinder, area: f64, p: Vec3, u: Vec2) -> Option<LampPoint> {
    let (sin, cos) = (TAU * u.y as f64).sin_cos();
    let n = c.reference.as_dvec3() * cos + c.binormal.as_dvec3() * sin;
    let to = relative(c.p0, p) + c.axis.as_dvec3() * u.x as f64 + n * c.radius as f64;
    let front = if c.flip { to.dot(n) > 0.0 } else { to.dot(n) < 0.0 };
    front.then(|| LampPoint::new(to, curved_pdf(to, n, area), Vec2::ZERO)).flatten()
}
