//! Spheres, disks and cylinders as a footprint sees them.
//!
//! Their borders are circles in space (silhouette of a sphere, rim of a disk or an open cylinder: conics in p) and segments
//! (silhouettes of a cylinder). Whether a circle enters the footprint is asked of its margin of degree 2, a second-order dual, exact:
//! `dualux_dual::margins::{sphere, rim, cylinder}`. Which part of it is seen is asked of [`arcs`], straight pieces refined only where
//! they enter the footprint.

use super::chord::{Chord, clip};
use super::view::{Affine, D2, Point, View, from_dual, to_dual};
use crate::math::DVec3;
use crate::scene::{Geometry, Shape};
use arrayvec::ArrayVec;
use dualux_dual::{Cylinder, Expansion, Guarded, Jet, Ray, Real, Sphere, Test, Vec3, constant, margins, range};
use std::f64::consts::TAU;

use super::kinds::Kinds;

/// An ellipse in space: c + cos(a) u + sin(a) v.
#[derive(Clone, Copy, Debug)]
pub struct Circle {
    /// Centre.
    pub c: DVec3,
    /// Radius vector at angle 0.
    pub u: DVec3,
    /// Radius vector at a quarter turn.
    pub v: DVec3,
}

/// A border of a curved surface that enters the footprint.
#[derive(Clone, Copy, Debug)]
pub enum Border {
    /// An ellipse, with its margin.
    Circle(Circle, Expansion<f64, 2>),
    /// A segment.
    Segment([DVec3; 2]),
}

/// The surface itself.
#[derive(Clone, Copy, Debug)]
pub enum Surface {
    /// Sphere.
    Sphere(Sphere<f64>),
    /// Disk or ellipse.
    Disk(Circle),
    /// Open cylinder.
    Cylinder(Cylinder<f64>),
}

/// A curved surface that may reach the footprint.
#[derive(Clone, Debug)]
pub struct Curved {
    /// The surface.
    pub surface: Surface,
    /// Its borders, with their kinds.
    pub borders: ArrayVec<(Kinds, Border), 4>,
    /// Whether it is convex and covers all of the footprint within the rays' range.
    pub covers: bool,
}

/// Corners of a footprint.
pub const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Hit condition of an ellipse, multiplied out by (n.d)^2: positive inside. Degree 2 in d, exact at order 2.
#[inline(always)]
fn ellipse<T: Real<Primitive = f64>>(ray: &Ray<T>, e: &Circle) -> T {
    let n = e.u.cross(e.v);
    let (gx, gy) = (e.v.cross(n) / n.length_squared(), n.cross(e.u) / n.length_squared());
    let n = Vec3::lift(to_dual(n));
    let m = Vec3::lift(to_dual(e.c)) - ray.o;
    let nd = n.dot(ray.d);
    // tau d - (n.d) m = n x (d x m)
    let q = n.cross(ray.d.cross(m));
    let (x, y) = (q.dot(Vec3::lift(to_dual(gx))), q.dot(Vec3::lift(to_dual(gy))));
    nd * nd - x * x - y * y
}

/// The same for the ray at p.
pub fn ellipse_at(view: &View, e: &Circle, p: [f64; 2]) -> f64 {
    ellipse(&view.ray_at(p), e)
}

impl Curved {
    /// `None` if it does not reach the footprint.
    pub fn new(view: &View, shape: &Shape, test: Test, order: usize) -> Option<Self> {
        let ray = view.ray();
        let cut = |m: Expansion<f64, 2>| if order < 2 { m.first_order() } else { m };
        let out = |surface| Curved { surface, borders: ArrayVec::new(), covers: false };
        let rim = |circle: Circle| -> Option<(Kinds, Border)> {
            let d = circle.disk();
            // Parallel rays start on either side of its plane: their range tells what is in front.
            let guard = if view.perspective { margins::rim_guard(&ray, &d) } else { constant(1.0) };
            let both = Guarded::new(ellipse(&ray, &circle), guard);
            let both = Guarded { margin: cut(both.margin), guard: both.guard };
            both.flags(test).then_some((Kinds::BOUNDARY, Border::Circle(circle, both.margin)))
        };
        match &shape.geometry {
            Geometry::Sphere(s) => {
                let sphere = Sphere::new(to_dual(s.center.as_dvec3()), f64::from(s.radius));
                let mut curved = out(Surface::Sphere(sphere));
                match passes(view, &sphere) {
                    Some(true) => {
                        curved.covers = CORNERS.iter().all(|p| curved.hit(view, *p).is_some());
                        return Some(curved);
                    }
                    Some(false) => return None,
                    None => {}
                }
                let Some(circle) = silhouette(view, &sphere) else {
                    return Some(curved);
                };
                let margin = margins::sphere(&ray, &sphere).expansion();
                let guard = if view.perspective {
                    margins::sphere_guard(&ray, &sphere).expansion()
                } else {
                    constant::<D2>(1.0).expansion()
                };
                let (lo, hi) = range(&margin);
                if hi < 0.0 || range(&guard).1 <= 0.0 {
                    return None;
                }
                if lo > 0.0 && range(&guard).0 > 0.0 {
                    curved.covers = CORNERS.iter().all(|p| curved.hit(view, *p).is_some());
                }
                if (Guarded { margin: cut(margin), guard }).flags(test) {
                    curved.borders.push((Kinds::SILHOUETTE, Border::Circle(circle, margin)));
                }
                Some(curved)
            }
            Geometry::Disk(d) => {
                let circle = Circle { c: d.center.as_dvec3(), u: d.ex.as_dvec3(), v: d.ey.as_dvec3() };
                let mut curved = out(Surface::Disk(circle));
                let margin = ellipse(&ray, &circle).expansion();
                let (lo, hi) = range(&margin);
                if hi < 0.0 {
                    return None;
                }
                let all = CORNERS.iter().all(|p| curved.hit(view, *p).is_some());
                curved.covers = lo > 0.0 && all;
                curved.borders.extend(rim(circle));
                Some(curved)
            }
            Geometry::Cylinder(c) => {
                let a = c.p0.as_dvec3();
                let axis = c.axis.as_dvec3();
                let cylinder = Cylinder::new(to_dual(a), to_dual(a + axis), f64::from(c.radius));
                let mut curved = out(Surface::Cylinder(cylinder));
                let unit = axis.normalize();
                let u = unit.any_orthonormal_vector() * f64::from(c.radius);
                let v = unit.cross(u);
                curved.borders.extend([a, a + axis].into_iter().filter_map(|c| rim(Circle { c, u, v })));
                for [p, q] in cylinder_lines(view, &cylinder).into_iter().flatten() {
                    if clip(view, &view.project(p), &view.project(q)).is_some() {
                        curved.borders.push((Kinds::SILHOUETTE, Border::Segment([p, q])));
                    }
                }
                let cut = || curved.meets_end(view) && range(&margins::cylinder(&ray, &cylinder).expansion()).1 >= 0.0;
                (!curved.borders.is_empty() || curved.hit(view, [0.0; 2]).is_some() || cut()).then_some(curved)
            }
            Geometry::Mesh(_) | Geometry::Rectangle(_) => None,
        }
    }

    /// Centre and radius of a ball round it.
    pub fn ball(&self) -> (DVec3, f64) {
        match &self.surface {
            Surface::Sphere(s) => (from_dual(s.centre), s.radius),
            Surface::Disk(e) => (e.c, e.u.length().max(e.v.length())),
            Surface::Cylinder(c) => {
                let half = from_dual(c.axis()) * 0.5;
                (from_dual(c.a) + half, half.length().hypot(c.radius))
            }
        }
    }

    /// Whether an end of the rays' range may cut it.
    fn meets_end(&self, view: &View) -> bool {
        let (c, radius) = self.ball();
        view.t.iter().any(|t| {
            let (x, n) = view.plane_at(*t);
            t.is_finite() && n.dot(c - x).abs() <= radius * n.length()
        })
    }

    /// Ray parameter at which the ray at p meets the surface, within the rays' range.
    pub fn hit(&self, view: &View, p: [f64; 2]) -> Option<f64> {
        let ray = view.ray_at(p);
        let (near, far) = (view.start(p), view.t[1]);
        match &self.surface {
            Surface::Sphere(s) => s.hit(&ray, near, far).map(|(t, _)| t),
            Surface::Disk(e) => {
                let inside = ellipse(&ray, e) >= 0.0;
                inside.then(|| e.disk().t(&ray)).filter(|t| *t > near && *t < far)
            }
            Surface::Cylinder(c) => c.hit(&ray, near, far).map(|(t, _)| t),
        }
    }
}

impl Circle {
    /// A disk in its plane (of the larger radius, for ellipses).
    fn disk(&self) -> dualux_dual::Disk<f64> {
        let r = self.u.length().max(self.v.length());
        dualux_dual::Disk::new(to_dual(self.c), to_dual(self.u.cross(self.v)), r)
    }

    fn at(&self, a: f64) -> DVec3 {
        let (sin, cos) = a.sin_cos();
        self.c + self.u * cos + self.v * sin
    }
}

/// Whether all rays of a pyramid clearly meet a sphere (true), or all pass it (false), by distances; most are decided here.
fn passes(view: &View, s: &Sphere<f64>) -> Option<bool> {
    if !view.perspective {
        return None;
    }
    let (m, d) = (from_dual(s.centre) - view.origin(), from_dual(view.family.d));
    let d2 = d.length_squared();
    let along = m.dot(d);
    // How far a ray of the footprint is from the centre ray where that is closest, at most; its cosine is near 1.
    let [a, b] = view.family.d_p.map(|v| from_dual(v).length());
    let widest = a + b;
    if widest * widest > 0.01 * d2 || along <= 0.0 || m.length_squared() <= s.radius * s.radius {
        return None;
    }
    let reach = 1.02 * m.length() * widest / d2.sqrt();
    let off = (m.length_squared() - along * along / d2).max(0.0).sqrt();
    if off > s.radius + reach {
        Some(false)
    } else if off + reach < s.radius {
        Some(true)
    } else {
        None
    }
}

/// The circle in which the view's rays touch a sphere; `None` from inside.
fn silhouette(view: &View, s: &Sphere<f64>) -> Option<Circle> {
    let (c, n, r) = if view.perspective {
        let d = margins::sphere_silhouette(view.family.o, s)?;
        (from_dual(d.centre), from_dual(d.normal).normalize(), d.radius)
    } else {
        (from_dual(s.centre), from_dual(view.family.d).normalize(), s.radius)
    };
    let u = n.any_orthonormal_vector() * r;
    Some(Circle { c, u, v: n.cross(u) })
}

/// The two lines in which the view's rays touch a cylinder; `None` from inside.
fn cylinder_lines(view: &View, c: &Cylinder<f64>) -> Option<[[DVec3; 2]; 2]> {
    if view.perspective {
        return Some(margins::cylinder_silhouette(view.family.o, c)?.map(|l| l.map(from_dual)));
    }
    let (axis, a) = (from_dual(c.axis()), from_dual(c.a));
    let side = axis.cross(from_dual(view.family.d)).try_normalize()? * c.radius;
    Some([[a + side, a + axis + side], [a - side, a + axis - side]])
}

/// Straight pieces of an ellipse where it enters the footprint, each with the direction (unit, in p) away from the ellipse's inside.
/// Their distance from the curve stays below 1e-3 half widths. Ends when `each` returns true; returns whether it did, and
/// counts the pieces offered in `offered`.
pub fn arcs(view: &View, e: &Circle, offered: &mut u32, each: &mut impl FnMut(&Chord, [f64; 2]) -> bool) -> bool {
    let centre = view.project(e.c);
    (0..8).any(|k| {
        let (a, b) = (f64::from(k) * TAU / 8.0, f64::from(k + 1) * TAU / 8.0);
        let ends = [view.project(e.at(a)), view.project(e.at(b))];
        Arc { view, e, centre }.refine([a, b], ends, 0, offered, each)
    })
}

struct Arc<'a> {
    view: &'a View,
    e: &'a Circle,
    centre: Point,
}

impl Arc<'_> {
    fn refine(
        &self,
        [a, b]: [f64; 2],
        ends: [Point; 2],
        depth: u32,
        offered: &mut u32,
        each: &mut impl FnMut(&Chord, [f64; 2]) -> bool,
    ) -> bool {
        let mid = 0.5 * (a + b);
        let (on, from) = (self.e.at(mid), self.e.c);
        // Ends and crossing of the tangents hold the arc between them.
        let tip = self.view.project(from + (on - from) / (0.5 * (b - a)).cos());
        let hull = [ends[0], ends[1], tip];
        for axis in [1, 2] {
            if hull.iter().all(|c| c[axis] > c[0]) || hull.iter().all(|c| c[axis] < -c[0]) {
                return false;
            }
        }
        let middle = self.view.project(on);
        if depth < 16 && !is_flat(&ends, &middle) {
            return self.refine([a, mid], [ends[0], middle], depth + 1, offered, each)
                || self.refine([mid, b], [middle, ends[1]], depth + 1, offered, each);
        }
        let Some(chord) = clip(self.view, &ends[0], &ends[1]) else { return false };
        *offered += 1;
        let l: Affine = super::view::line(&ends[0], &ends[1]);
        let inside = l[0] * self.centre[0] + l[1] * self.centre[1] + l[2] * self.centre[2];
        let norm = -l[1].hypot(l[2]) * inside.signum();
        each(&chord, [l[1] / norm, l[2] / norm])
    }
}

/// Whether the middle of an arc is close to the middle of its chord, all in front.
fn is_flat(ends: &[Point; 2], middle: &Point) -> bool {
    if !(ends[0][0] > 0.0 && ends[1][0] > 0.0 && middle[0] > 0.0) {
        return false;
    }
    let l = super::view::line(&ends[0], &ends[1]);
    let off = (l[0] * middle[0] + l[1] * middle[1] + l[2] * middle[2]) / middle[0];
    off.abs() <= 1e-3 * l[1].hypot(l[2])
}
