//! A family of rays as a projection: points of space in the footprint's own homogeneous coordinates.
//!
//! Families with one origin (pinhole pixels, lights seen from a point, emission cells of a point) and with one direction
//! (orthographic pixels, suns) project space *exactly*: a point x has coordinates (w, x, y, k), linear in x, and is seen at
//! p = (x, y) / w with depth key k / w. One origin: x - o = w d0 + x d1 + y d2, k = -1, so that the key is -1/t. One direction:
//! x - o = t d + p1 o1 + p2 o2, w = 1, k = t. Either way the key grows with t, straight edges are straight in p,
//! planes have keys affine in p, and convex bodies are convex in (p, key). The line through two projected points has the
//! coefficients of the dual margin `dualux_dual::margins::line` (up to a positive factor); a test holds them against each other.

use crate::accel::footprint::{Beam, Sides};
use crate::math::{DVec3, Vec3};
use dualux_dual::{Family, Ray, num_dual::Dual2SVec64};

/// Homogeneous coordinates (w, x, y, k).
pub type Point = [f64; 4];

/// Coefficients of an affine function of p: c0 + c1 p1 + c2 p2.
pub type Affine = [f64; 3];

/// Number type of quadratic margins: exact to second order.
pub type D2 = Dual2SVec64<2>;

/// glam to dual.
#[inline(always)]
pub fn to_dual(v: DVec3) -> dualux_dual::Vec3<f64> {
    dualux_dual::vec3(v.x, v.y, v.z)
}

/// dual to glam.
#[inline(always)]
pub fn from_dual(v: dualux_dual::Vec3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

/// A footprint and the part of its rays that counts.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The rays.
    pub family: Family<f64, 2>,
    /// Range of the ray parameter.
    pub t: [f64; 2],
    /// One origin (else one direction).
    pub perspective: bool,
    /// What of the footprint counts.
    pub domain: Domain,
    /// Depth keys of the range's ends.
    pub keys: [f64; 2],
    /// Depth key of the plane that the rays start from, if they come from a mirror (or through a pane) in it.
    pub near: Option<Affine>,
    rows: [DVec3; 3],
}

/// The part of a footprint that counts, for lights that are no parallelograms: inside of at most two lines.
#[derive(Clone, Copy, Debug)]
pub struct Domain {
    cuts: [Affine; 2],
    len: u8,
    /// A point inside.
    pub middle: [f64; 2],
}

impl Domain {
    /// All of the square.
    pub const WHOLE: Domain = Domain { cuts: [[0.0; 3]; 2], len: 0, middle: [0.0; 2] };

    /// Where at most two functions are positive, as they are at `middle`.
    pub fn cut(by: &[Affine], middle: [f64; 2]) -> Self {
        let mut domain = Domain { len: by.len().min(2) as u8, middle, ..Domain::WHOLE };
        domain.cuts.iter_mut().zip(by).for_each(|(to, from)| *to = *from);
        domain
    }

    /// Positive inside.
    #[inline(always)]
    pub fn cuts(&self) -> &[Affine] {
        &self.cuts[..usize::from(self.len)]
    }
}

/// Largest and smallest value over the square.
#[inline(always)]
pub fn range(a: &Affine) -> (f64, f64) {
    let r = a[1].abs() + a[2].abs();
    (a[0] - r, a[0] + r)
}

/// Value at p.
#[inline(always)]
pub fn at(a: &Affine, p: [f64; 2]) -> f64 {
    a[0] + a[1] * p[0] + a[2] * p[1]
}

/// The line through two projected points, as an affine function of p that vanishes on it.
#[inline(always)]
pub fn line(a: &Point, b: &Point) -> Affine {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl View {
    /// `None` if the footprint has no area, or if neither its origin nor its direction is fixed.
    #[inline(always)] // a large value, made where it stays
    pub fn new(family: Family<f64, 2>, t: [f64; 2]) -> Option<Self> {
        let perspective = family.has_fixed_origin();
        let d = from_dual(family.d);
        let [a, b] = if perspective { family.d_p } else { family.o_p }.map(from_dual);
        if !perspective && family.d_p.iter().any(|v| *v != dualux_dual::Vec3::zero()) {
            return None;
        }
        let rows = [a.cross(b), b.cross(d), d.cross(a)];
        let inv = 1.0 / d.dot(rows[0]);
        let keys = if perspective { t.map(|t| -1.0 / t) } else { t };
        let rows = [rows[0] * inv, rows[1] * inv, rows[2] * inv];
        inv.is_finite().then_some(View { family, t, perspective, domain: Domain::WHOLE, keys, near: None, rows })
    }

    /// The same rays, of which less counts.
    #[inline(always)]
    pub fn in_domain(self, domain: Domain) -> Self {
        View { domain, ..self }
    }

    /// The same rays with another range.
    pub fn within(self, t: [f64; 2]) -> Self {
        View { t, keys: t.map(|t| self.key(t)), ..self }
    }

    /// The same rays, starting from the plane through `x` with normal `n`: a mirror, behind which their origin is the image of a real one.
    /// `None` if no ray meets it in front of the origin.
    pub fn beyond(self, x: DVec3, n: DVec3) -> Option<Self> {
        let near = self.plane_key(x, n);
        let nearest = range(&near).0;
        let t = [self.t_of(nearest), self.t[1]];
        (near.iter().all(|c| c.is_finite()) && t[0] > 0.0).then(|| View { near: Some(near), ..self.within(t) })
    }

    /// The plane in which all rays have the parameter `t`: a point and its normal.
    pub fn plane_at(&self, t: f64) -> (DVec3, DVec3) {
        (self.origin() + from_dual(self.family.d) * t, self.rows[0])
    }

    /// Depth key of the plane through `x` with normal `n`.
    pub fn plane_key(&self, x: DVec3, n: DVec3) -> Affine {
        let f = &self.family;
        let tau = n.dot(x - self.origin());
        if self.perspective {
            [f.d, f.d_p[0], f.d_p[1]].map(|v| -n.dot(from_dual(v)) / tau)
        } else {
            let speed = n.dot(from_dual(f.d));
            [tau / speed, -n.dot(from_dual(f.o_p[0])) / speed, -n.dot(from_dual(f.o_p[1])) / speed]
        }
    }

    /// Start of the rays' range at p.
    #[inline(always)]
    pub fn start(&self, p: [f64; 2]) -> f64 {
        self.near.map_or(self.t[0], |near| self.t_of(at(&near, p)))
    }

    /// Origin of the centre ray.
    #[inline(always)]
    pub fn origin(&self) -> DVec3 {
        from_dual(self.family.o)
    }

    /// The projected point.
    #[inline(always)]
    pub fn project(&self, x: DVec3) -> Point {
        let v = x - self.origin();
        let [a, b, c] = [self.rows[0].dot(v), self.rows[1].dot(v), self.rows[2].dot(v)];
        if self.perspective { [a, b, c, -1.0] } else { [1.0, b, c, a] }
    }

    /// The same for points of a scene.
    #[inline(always)]
    pub fn project_f32(&self, x: Vec3) -> Point {
        self.project(x.as_dvec3())
    }

    /// Depth key of a ray parameter.
    #[inline(always)]
    pub fn key(&self, t: f64) -> f64 {
        if self.perspective { -1.0 / t } else { t }
    }

    /// Ray parameter of a depth key.
    #[inline(always)]
    pub fn t_of(&self, key: f64) -> f64 {
        if self.perspective { -1.0 / key } else { key }
    }

    /// What a key must be smaller by to be in front: surfaces that touch do not hide each other.
    #[inline(always)]
    pub fn tolerance(&self, keys: [f64; 2]) -> f64 {
        1e-6 * keys[0].abs().max(keys[1].abs())
    }

    /// The centre ray with derivatives.
    #[inline(always)]
    pub fn ray(&self) -> Ray<D2> {
        if self.perspective { self.family.fixed_ray() } else { self.family.ray() }
    }

    /// The plain ray at p.
    #[inline(always)]
    pub fn ray_at(&self, p: [f64; 2]) -> Ray<f64> {
        self.family.at(p)
    }

    /// Which way a plane with normal `n` through `x` faces: positive towards the rays' origin.
    #[inline(always)]
    pub fn facing(&self, n: DVec3, x: DVec3) -> f64 {
        if self.perspective { n.dot(self.origin() - x) } else { -n.dot(from_dual(self.family.d)) }
    }

    /// The beam that holds all rays. `reach`: largest coordinate of the scene, which sets what rounding is.
    #[inline(always)]
    pub fn beam(&self, reach: f32) -> Beam {
        let mut beam = beam(&self.family, self.t);
        let o = self.origin().as_vec3();
        let [_, x, y] = self.rows;
        let planes = if self.perspective {
            [self.rows[0] - x, self.rows[0] + x, self.rows[0] - y, self.rows[0] + y]
        } else {
            [-x, x, -y, y]
        };
        let n = planes.map(|n| n.as_vec3());
        let rounding = 32.0 * f32::EPSILON * (reach + o.abs().max_element());
        // A prism's planes stand off its middle by one half width each, which is 1 in p.
        let width = if self.perspective { 0.0 } else { 1.0 + 1e-6 };
        beam.sides = Some(Sides { o, n, slack: n.map(|n| rounding * n.abs().element_sum() + width), waist: None });
        beam
    }
}

/// The boxes of a family's origins and directions, rounded outwards.
#[inline(always)]
pub fn beam<const N: usize>(family: &Family<f64, N>, t: [f64; 2]) -> Beam {
    let spread = |centre: dualux_dual::Vec3<f64>, by: &[dualux_dual::Vec3<f64>; N]| {
        let reach = by.iter().fold(DVec3::ZERO, |r, v| r + from_dual(*v).abs());
        let centre = from_dual(centre);
        let reach = reach + (centre.abs() + reach) * f64::from(f32::EPSILON);
        [(centre - reach).as_vec3(), (centre + reach).as_vec3()]
    };
    Beam {
        o: spread(family.o, &family.o_p),
        d: spread(family.d, &family.d_p),
        tmin: t[0] as f32,
        tmax: t[1] as f32,
        sides: None,
    }
}
