//! Triangles and rectangles as a footprint sees them.
//!
//! A projected convex polygon is the set of p where its side functions (the margins of its edges, degree 1, exact at order 1) are
//! positive; its plane's key is affine in p. Both signs of w are handled: a corner behind the origin keeps its side functions right.

use super::view::{Affine, Point, View, at, line, range};
use crate::math::DVec3;
use arrayvec::ArrayVec;

/// A polygon that reaches the footprint.
#[derive(Clone, Debug)]
pub struct Polygon {
    /// Shape.
    pub shape: u32,
    /// Triangle of a mesh, or [`Polygon::RECTANGLE`].
    pub prim: u32,
    /// Projected corners, in the order of the primitive.
    pub corners: ArrayVec<Point, 4>,
    /// Side functions: side k runs from corner k to the next; positive inside.
    pub sides: ArrayVec<Affine, 4>,
    /// Depth key of the plane.
    pub key: Affine,
    /// Whether it covers all of the footprint.
    pub covers: bool,
}

impl Polygon {
    /// `prim` of a whole rectangle.
    pub const RECTANGLE: u32 = u32::MAX;

    /// `None` if it does not reach the footprint, is seen edge-on or lies outside of the rays' range.
    #[inline(always)]
    pub fn new<const N: usize>(view: &View, shape: u32, prim: u32, points: &[DVec3; N]) -> Option<Self> {
        let corners: [Point; N] = points.map(|p| view.project(p));
        // Separated by a side of the footprint?
        for axis in [1, 2] {
            if corners.iter().all(|c| c[axis] > c[0]) || corners.iter().all(|c| c[axis] < -c[0]) {
                return None;
            }
        }
        let [a, b, c] = [&corners[0], &corners[1], &corners[2]];
        let (ab, bc, ca) = (line(a, b), line(b, c), line(c, a));
        let det = ab[0] * c[0] + ab[1] * c[1] + ab[2] * c[2];
        let size = (ab[0] * c[0]).abs() + (ab[1] * c[1]).abs() + (ab[2] * c[2]).abs();
        if det.abs() <= 1e-13 * size || det.is_nan() {
            return None;
        }
        let inv = 1.0 / det;
        let key = [0, 1, 2].map(|k| (a[3] * bc[k] + b[3] * ca[k] + c[3] * ab[k]) * inv);
        let (nearest, farthest) = range(&key);
        if nearest > view.key(view.t[1]) || farthest < view.key(view.t[0]) {
            return None;
        }
        let sign = det.signum();
        let sides: [Affine; N] = std::array::from_fn(|k| line(&corners[k], &corners[(k + 1) % N]).map(|x| x * sign));
        let ranges = sides.each_ref().map(range);
        if ranges.iter().any(|(_, hi)| *hi < 0.0) {
            return None;
        }
        let covers = ranges.iter().all(|(lo, _)| *lo >= 0.0);
        let (corners, sides) = (corners.into_iter().collect(), sides.into_iter().collect());
        Some(Polygon { shape, prim, corners, sides, key, covers })
    }

    /// Whether side k may cross the footprint.
    #[inline(always)]
    pub fn crosses(&self, k: usize) -> bool {
        let (lo, hi) = range(&self.sides[k]);
        lo <= 0.0 && hi >= 0.0
    }

    /// Whether the ray at p meets it, at any depth.
    pub fn contains(&self, p: [f64; 2]) -> bool {
        self.sides.iter().all(|l| at(l, p) >= 0.0)
    }

    /// Whether the projected point lies on the inner side of side k (positive), or beyond it.
    pub fn side_of(&self, k: usize, x: &Point) -> f64 {
        let l = &self.sides[k];
        l[0] * x[0] + l[1] * x[1] + l[2] * x[2]
    }

    /// Whether the two have a corner in common.
    pub fn touches(&self, other: &Polygon) -> bool {
        self.corners.iter().any(|a| other.corners.contains(a))
    }
}
