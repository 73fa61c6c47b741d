//! Outlines of lights: what a point's rays towards a light fill, as parallelograms with at most two sides cut.
//!
//! A rectangle is itself. A disk, and the circle in which a sphere shows, lie in their circumscribed parallelograms. A triangle is half of
//! a parallelogram. Two coplanar triangles of a mesh that form a convex quadrilateral are one outline: a rectangle that a file holds
//! as a mesh is seen as a rectangle. From a corner a of the quadrilateral a b c d, c = a + U (b - a) + V (d - a); it lies in the
//! parallelogram spanned by max(1, U) (b - a) and max(1, V) (d - a), cut along b c and c d.
//! An open cylinder shows between two of its lines. Its near surface, seen from distance D off the axis, projects on the plane
//! of these lines to heights z0 + s (z - z0), with z0 the point's own height and s from 1 to (D + R) / D.
//! What of a round light's parallelogram lies outside of it errs towards "partial".
//!
//! Not handled: what lies inside a round light (hence `Unknown`, [`Hull`]).

use super::gather::Facet;
use super::view::{Affine, Domain, View, from_dual, line, to_dual};
use crate::math::DVec3;
use crate::scene::mesh::{EdgeClass, Mesh};
use crate::scene::shape::Cylinder;
use arrayvec::ArrayVec;
use dualux_dual::{Family, Sphere, margins};

/// Rays end this much short of the light, so that what touches it does not shade it.
const SHORT: f64 = 1.0 - 1e-6;

/// Relative error of positions held in f32, below which a quadrilateral is a parallelogram.
const ROUNDING: f64 = 1e-6;

/// Most triangles of a light looked at one by one.
pub const MOST_TRIANGLES: usize = 64;

/// A parallelogram c + p1 h1 + p2 h2, or the part of it inside a domain.
#[derive(Clone, Copy, Debug)]
pub struct Outline {
    /// Centre.
    pub centre: DVec3,
    /// Half edges.
    pub half: [DVec3; 2],
    /// What of it counts.
    pub domain: Domain,
}

impl Outline {
    /// All of a parallelogram.
    #[inline(always)]
    pub fn whole(centre: DVec3, half: [DVec3; 2]) -> Self {
        Outline { centre, half, domain: Domain::WHOLE }
    }

    /// The half of the parallelogram a, b, b + c - a, c that is a triangle.
    pub fn triangle([a, b, c]: [DVec3; 3]) -> Self {
        let domain = Domain::cut(&[[0.0, -1.0, -1.0]], [-1.0 / 3.0; 2]);
        Outline { centre: 0.5 * (b + c), half: [0.5 * (b - a), 0.5 * (c - a)], domain }
    }

    /// A quadrilateral, its corners in order; `None` unless it is convex.
    pub fn quadrilateral([a, b, c, d]: [DVec3; 4]) -> Option<Self> {
        let (x, y, z) = (b - a, d - a, c - a);
        let n = x.cross(y);
        let (u, v) = (z.cross(y).dot(n) / n.length_squared(), x.cross(z).dot(n) / n.length_squared());
        if !(u > 0.0 && v > 0.0 && u + v > 1.0 && u.is_finite() && v.is_finite()) {
            return None;
        }
        let (mu, mv) = (u.max(1.0), v.max(1.0));
        let half = [0.5 * mu * x, 0.5 * mv * y];
        let centre = a + half[0] + half[1];
        if (u - 1.0).abs().max((v - 1.0).abs()) <= ROUNDING {
            return Some(Self::whole(centre, half));
        }
        // Corners b, c, d in footprint coordinates.
        let point = |s: f64, t: f64| [1.0, 2.0 * s - 1.0, 2.0 * t - 1.0, 0.0];
        let (b, c, d) = (point(1.0 / mu, 0.0), point(u / mu, v / mv), point(0.0, 1.0 / mv));
        let inside = |l: Affine| if l[0] - l[1] - l[2] < 0.0 { l.map(|x| -x) } else { l };
        let middle = [1, 2].map(|k| (b[k] + d[k] - 1.0) / 3.0);
        Some(Outline { centre, half, domain: Domain::cut(&[inside(line(&b, &c)), inside(line(&c, &d))], middle) })
    }

    /// The circle in which a sphere shows; `None` from inside.
    pub fn sphere(o: DVec3, centre: DVec3, radius: f64) -> Option<Self> {
        let circle = margins::sphere_silhouette(to_dual(o), &Sphere::new(to_dual(centre), radius))?;
        let n = from_dual(circle.normal).normalize();
        let u = n.any_orthonormal_vector() * circle.radius;
        Some(Self::whole(from_dual(circle.centre), [u, n.cross(u)]))
    }

    /// Between the lines in which a cylinder shows; `None` from within its radius, whence its outer side is not seen.
    pub fn cylinder(o: DVec3, c: &Cylinder) -> Option<Self> {
        let (p0, axis, radius) = (c.p0.as_dvec3(), c.axis.as_dvec3(), f64::from(c.radius));
        let length = axis.length();
        let unit = axis / length;
        let m = o - p0;
        let height = unit.dot(m);
        let across = m - unit * height;
        let d2 = across.length_squared();
        if d2 <= radius * radius * (1.0 + ROUNDING) {
            return None;
        }
        // Ends of the near surface, projected.
        let most = 1.0 + radius / d2.sqrt();
        let stretched = |z: f64| height + (z - height) * most;
        let (low, high) = (stretched(0.0).min(0.0), stretched(length).max(length));
        let q = radius * radius / d2;
        let side = unit.cross(across).normalize() * (radius * (1.0 - q).sqrt());
        let centre = p0 + across * q + unit * (0.5 * (low + high));
        Some(Self::whole(centre, [side, unit * (0.5 * (high - low))]))
    }

    /// The rays from `o`; `None` if it is seen edge-on.
    #[inline(always)]
    pub fn view(&self, o: DVec3) -> Option<View> {
        let family = Family::towards(to_dual(o), to_dual(self.centre), [to_dual(self.half[0]), to_dual(self.half[1])]);
        let view = View::new(family, [0.0, SHORT])?;
        Some(view.in_domain(self.domain))
    }

    /// Corners of the parallelogram.
    pub fn corners(&self) -> [DVec3; 4] {
        let [x, y] = self.half;
        [self.centre - x - y, self.centre + x - y, self.centre + x + y, self.centre - x + y]
    }
}

/// The solid that a round light encloses.
#[derive(Clone, Copy, Debug)]
pub enum Hull {
    /// Centre and radius.
    Ball(DVec3, f64),
    /// Ends of the axis and radius.
    Tube([DVec3; 2], f64),
}

impl Hull {
    /// How far the light may stand out of its outline.
    pub fn thickness(&self) -> f64 {
        match *self {
            Hull::Ball(_, r) | Hull::Tube(_, r) => r,
        }
    }

    /// Whether a ball may reach into it.
    pub fn meets_ball(&self, centre: DVec3, radius: f64) -> bool {
        match *self {
            Hull::Ball(c, r) => (centre - c).length() < r + radius,
            Hull::Tube([a, b], r) => distance_to_segment(centre, a, b) < r + radius,
        }
    }

    /// Whether a convex polygon may reach into it: by its plane, and by its bounding ball.
    pub fn meets_polygon(&self, points: &[DVec3]) -> bool {
        let n = (points[1] - points[0]).cross(points[2] - points[0]).normalize_or_zero();
        let off = |x: DVec3| n.dot(x - points[0]);
        let beside = match *self {
            Hull::Ball(c, r) => off(c).abs() >= r,
            Hull::Tube([a, b], r) => off(a) * off(b) > 0.0 && off(a).abs().min(off(b).abs()) >= r,
        };
        let middle = points.iter().sum::<DVec3>() / points.len() as f64;
        let reach = points.iter().fold(0.0_f64, |m, x| m.max((*x - middle).length()));
        !beside && self.meets_ball(middle, reach)
    }
}

fn distance_to_segment(x: DVec3, a: DVec3, b: DVec3) -> f64 {
    let e = b - a;
    let s = ((x - a).dot(e) / e.length_squared()).clamp(0.0, 1.0);
    (x - a - e * s).length()
}

/// Which way a part of a light shines.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // made where it is used
pub enum Facing {
    /// Along one normal.
    Flat(DVec3),
    /// By interpolated normals: corners with theirs.
    Smooth(ArrayVec<[DVec3; 2], 6>),
}

/// A flat part of a light.
#[derive(Clone, Debug)]
pub struct Part {
    /// Its outline.
    pub outline: Outline,
    /// Its own facets.
    pub facets: [Facet; 2],
    /// Which way it shines.
    pub facing: Facing,
}

impl Part {
    /// One triangle of a mesh.
    pub fn triangle(mesh: &Mesh, light: u32, prim: u32) -> Self {
        let outline = Outline::triangle(mesh.corners(prim).map(|v| v.as_dvec3()));
        let facet = Facet { shape: light, prim };
        Part { outline, facets: [facet; 2], facing: facing(mesh, &[prim]) }
    }

    /// The part of a mesh that holds a triangle, `None` if it counts with a triangle of lower number.
    pub fn of_mesh(mesh: &Mesh, light: u32, prim: u32) -> Option<Self> {
        match partner(mesh, prim) {
            Some((other, _)) if other < prim => None,
            Some((other, outline)) => {
                let facets = [Facet { shape: light, prim }, Facet { shape: light, prim: other }];
                Some(Part { outline, facets, facing: facing(mesh, &[prim, other]) })
            }
            None => Some(Self::triangle(mesh, light, prim)),
        }
    }
}

fn facing(mesh: &Mesh, prims: &[u32]) -> Facing {
    let [a, b, c] = mesh.corners(prims[0]).map(|v| v.as_dvec3());
    let face = (b - a).cross(c - a).normalize();
    let ids = prims.iter().flat_map(|p| mesh.triangles[*p as usize]);
    let mut corners = ArrayVec::new();
    for i in ids.filter(|_| !mesh.normals.is_empty()) {
        corners.push([mesh.positions[i as usize], mesh.normals[i as usize]].map(|v| v.as_dvec3()));
    }
    match corners.iter().any(|[_, n]| n.dot(face) < 1.0 - ROUNDING) {
        true => Facing::Smooth(corners),
        false => Facing::Flat(face),
    }
}

/// The triangle that forms a convex quadrilateral with this one, if each is the other's first choice: across the longest edge that has one.
fn partner(mesh: &Mesh, prim: u32) -> Option<(u32, Outline)> {
    let (other, outline) = choice(mesh, prim)?;
    (choice(mesh, other)?.0 == prim).then_some((other, outline))
}

fn choice(mesh: &Mesh, prim: u32) -> Option<(u32, Outline)> {
    let corners = mesh.corners(prim);
    let length = |k: usize| corners[k].distance_squared(corners[(k + 1) % 3]);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| length(j).total_cmp(&length(i)));
    order.into_iter().find_map(|k| {
        let other = mesh.neighbors[prim as usize][k];
        if mesh.edges[prim as usize][k] != EdgeClass::Never || other == u32::MAX {
            return None;
        }
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let far = mesh.corners(other).into_iter().find(|c| *c != a && *c != b)?;
        let quad = [a, far, b, corners[(k + 2) % 3]].map(|v| v.as_dvec3());
        Some((other, Outline::quadrilateral(quad)?))
    })
}
