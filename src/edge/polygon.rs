//! Triangles and rectangles as a footprint sees them.
//!
//! A projected convex polygon is the set of p where its side functions (the margins of its edges, degree 1, exact at order 1) are
//! positive; its plane's key is affine in p. Both signs of w are handled: a corner behind the origin keeps its side functions right.

use super::view::{Affine, Point, View, at, line, range};
use crate::math::DVec3;
use crate::scene::shape::Rectangle;
use crate::scene::{Geometry, Scene};
use arrayvec::ArrayVec;

/// Corners of a rectangle, in order.
#[inline(always)]
pub fn corners(r: &Rectangle) -> [DVec3; 4] {
    let (c, x, y) = (r.center.as_dvec3(), r.ex.as_dvec3(), r.ey.as_dvec3());
    [c - x - y, c + x - y, c + x + y, c - x + y]
}

/// Relative difference of depth keys below which a surface lies in a mirror's plane.
const TOUCH: f64 = 2e-6;

/// A polygon that reaches the footprint.
#[derive(Clone, Copy, Debug)]
pub struct Polygon {
    /// Shape.
    pub shape: u32,
    /// Triangle of a mesh, or [`Polygon::RECTANGLE`].
    pub prim: u32,
    /// Whether it covers all of the footprint, within the rays' range.
    pub covers: bool,
    /// Sides that may cross the footprint, as bits.
    pub crossing: u8,
    len: u8,
    corners: [Point; 4],
    sides: [Affine; 4],
    /// Depth key of the plane.
    pub key: Affine,
}

impl Polygon {
    /// `prim` of a whole rectangle.
    pub const RECTANGLE: u32 = u32::MAX;

    /// Of a triangle or parallelogram. `None` if it does not reach the footprint, is seen edge-on, lies outside of the rays' range or
    /// beyond the ray parameter `end`.
    #[inline(always)]
    pub fn new<const N: usize>(view: &View, shape: u32, prim: u32, points: &[DVec3; N], end: f64) -> Option<Self> {
        let mut corners = [[0.0; 4]; 4];
        // Separated by a side of the footprint?
        let (mut outside, mut beyond) = (0b1111, true);
        for k in 0..N {
            let c = view.project(points[k]);
            let [w, x, y, key] = c;
            beyond &= (if view.perspective { w } else { key }) > end;
            outside &= u8::from(x > w) | u8::from(x < -w) << 1 | u8::from(y > w) << 2 | u8::from(y < -w) << 3;
            corners[k] = c;
        }
        if outside != 0 || beyond {
            return None;
        }
        let [a, b, c, d] = &corners;
        let (ab, bc, ca) = (line(a, b), line(b, c), line(c, a));
        let det = ab[0] * c[0] + ab[1] * c[1] + ab[2] * c[2];
        let size = (ab[0] * c[0]).abs() + (ab[1] * c[1]).abs() + (ab[2] * c[2]).abs();
        if det.abs() <= 1e-13 * size || det.is_nan() {
            return None;
        }
        let mut sides = if N == 3 { [ab, bc, ca, [0.0; 3]] } else { [ab, bc, line(c, d), line(d, a)] };
        let (mut covers, mut crossing) = (true, 0);
        for (k, side) in sides[..N].iter_mut().enumerate() {
            if det < 0.0 {
                *side = side.map(|x| -x);
            }
            let (lo, hi) = range(side);
            if hi < 0.0 {
                return None;
            }
            covers &= lo >= 0.0;
            crossing |= u8::from(lo <= 0.0) << k;
        }
        let inv = 1.0 / det;
        let key = [0, 1, 2].map(|k| (a[3] * bc[k] + b[3] * ca[k] + c[3] * ab[k]) * inv);
        let (nearest, farthest) = range(&key);
        if nearest > view.keys[1] || farthest < view.keys[0] {
            return None;
        }
        covers &= nearest >= view.keys[0] && farthest <= view.keys[1];
        if let Some(near) = &view.near {
            let (lo, hi) = range(&[0, 1, 2].map(|k| key[k] - near[k]));
            // What lies in the mirror's plane is not before it.
            if hi <= TOUCH * near[0].abs() {
                return None;
            }
            covers &= lo >= 0.0;
        }
        Some(Polygon { shape, prim, covers, crossing, len: N as u8, corners, sides, key })
    }

    /// Projected corners, in the order of the primitive.
    #[inline(always)]
    pub fn corners(&self) -> &[Point] {
        &self.corners[..usize::from(self.len)]
    }

    /// Side functions: side k runs from corner k to the next; positive inside.
    #[inline(always)]
    pub fn sides(&self) -> &[Affine] {
        &self.sides[..usize::from(self.len)]
    }

    /// Its corners in the world.
    pub fn points(&self, scene: &Scene) -> ArrayVec<DVec3, 4> {
        match &scene.shapes[self.shape as usize].geometry {
            Geometry::Mesh(mesh) => mesh.corners(self.prim).into_iter().map(|c| c.as_dvec3()).collect(),
            Geometry::Rectangle(r) => corners(r).into_iter().collect(),
            _ => ArrayVec::new(),
        }
    }

    /// Whether side k may cross the footprint.
    #[inline(always)]
    pub fn crosses(&self, k: usize) -> bool {
        self.crossing >> k & 1 == 1
    }

    /// Whether the ray at p meets it, at any depth.
    pub fn contains(&self, p: [f64; 2]) -> bool {
        self.sides().iter().all(|l| at(l, p) >= 0.0)
    }

    /// Whether the projected point lies on the inner side of side k (positive), or beyond it.
    pub fn side_of(&self, k: usize, x: &Point) -> f64 {
        let l = &self.sides[k];
        l[0] * x[0] + l[1] * x[1] + l[2] * x[2]
    }

    /// Whether the two have a corner in common.
    pub fn touches(&self, other: &Polygon) -> bool {
        self.corners().iter().any(|a| other.corners().contains(a))
    }
}
