//! What a shape's edges look like to the detector.

use num_dual::Dual2SVec64;

use crate::ray::{Family, Ray};
use crate::shapes::{Disk, Plane, Sphere};
use crate::vec3::Vec3;

/// Number type the detector evaluates margins in; first order is the second-order expansion cut short.
pub(super) type D2 = Dual2SVec64<2>;

/// Kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// The end of an open surface: an edge of a polygon, the rim of a disk or open cylinder.
    Boundary,
    /// A curved surface turns away.
    Silhouette,
    /// Two surfaces exchange their depth order.
    Swap,
    /// The horizon of the receiver ([`View::horizon`]).
    Horizon,
    /// Anything else an own shape reports.
    Other,
}

/// A ray family and what is asked of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// The footprint.
    pub family: Family<f64, 2>,
    /// Nothing beyond this ray parameter counts (1 for a light at t = 1).
    pub t_max: f64,
    /// Normal of the surface the rays start from: rays with n.d <= 0 lie below its horizon.
    pub horizon: Option<Vec3<f64>>,
    /// Shape the rays start from, by its index in the scene: neither hit nor counted.
    pub exclude: Option<usize>,
}

impl From<Family<f64, 2>> for View {
    fn from(family: Family<f64, 2>) -> Self {
        Self { family, t_max: f64::INFINITY, horizon: None, exclude: None }
    }
}

impl View {
    /// A light (centre, half edges) seen from a point of a surface: what lies beyond t = 1 does not count, the horizon does.
    pub fn light(x: Vec3<f64>, normal: Vec3<f64>, centre: Vec3<f64>, half_edges: [Vec3<f64>; 2]) -> Self {
        Self { t_max: 1.0, horizon: Some(normal), ..Family::towards(x, centre, half_edges).into() }
    }
}

/// A margin and its guard as functions of the ray.
pub type MarginFn = Box<dyn Fn(&Ray<D2>) -> (D2, D2)>;

/// Where an edge is.
pub enum Edge {
    /// A straight segment.
    Segment([Vec3<f64>; 2]),
    /// All edges of a convex polygon at once (three corners or more, in order): for [`Test::Corners`](crate::Test) only.
    Polygon(Vec<Vec3<f64>>),
    /// The zero set of a margin where its guard is positive.
    Margin(MarginFn),
}

/// A possible event of one shape.
pub struct Feature {
    /// What it would be.
    pub kind: Kind,
    /// Where it is.
    pub edge: Edge,
    /// A plane that contains the edge, if there is one (given the family's fixed origin): needed to tell whether it is hidden.
    pub plane: Option<Plane<f64>>,
}

impl Feature {
    /// A straight edge.
    pub fn segment(kind: Kind, ends: [Vec3<f64>; 2]) -> Self {
        Self { kind, edge: Edge::Segment(ends), plane: None }
    }

    /// A circle in space.
    pub fn circle(kind: Kind, circle: Disk<f64>) -> Self {
        let edge =
            Edge::Margin(Box::new(move |r| (crate::margins::rim(r, &circle), crate::margins::rim_guard(r, &circle))));
        Self { kind, edge, plane: Some(circle.plane()) }
    }

    /// Any margin, with its guard (return the constant 1 if it needs none). It is never taken to be hidden.
    pub fn margin(kind: Kind, f: impl Fn(&Ray<D2>) -> (D2, D2) + 'static) -> Self {
        Self { kind, edge: Edge::Margin(Box::new(f)), plane: None }
    }

    /// States the plane in which the edge lies.
    pub fn in_plane(mut self, plane: Plane<f64>) -> Self {
        self.plane = Some(plane);
        self
    }
}

/// What depth swaps, and corner prediction of polygons, need to know of a shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// Convex and flat, corners (three or more) in order.
    Polygon(Vec<Vec3<f64>>),
    /// A flat disk.
    Disk(Disk<f64>),
    /// A sphere.
    Sphere(Sphere<f64>),
    /// Takes no part in depth swaps.
    Unknown,
}
