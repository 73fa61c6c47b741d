//! The detector: events of a footprint, predicted from margins on the centre ray.
//!
//! For each feature of each shape: may it be in the footprint ([`Test`])? Is it in front of `t_max`? Is it hidden? A straight
//! chord is hidden by a convex shape that hides both its ends, since the shadow of a convex body is convex. A curve in a plane is
//! hidden by a convex shape that covers the footprint's four corners in front of that plane, by the same argument. With a moving
//! origin both are predictions.

use super::features::{D2, Edge, Feature, Kind, Surface, View};
use super::scene::Scene;
use crate::footprint::{Expansion, Guarded, Test, corners_inside, range};
use crate::margins::{self, Chord, Projector};
use crate::ray::Ray;
use crate::real::Jet;
use crate::shapes::{Disk, Plane, Rectangle};
use crate::vec3::{Vec3, vec3};

/// A predicted edge in a footprint.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// What it is.
    pub kind: Kind,
    /// Shapes it belongs to: one, or the two that swap.
    pub shapes: [Option<usize>; 2],
    /// The piece inside the footprint, for straight edges.
    pub chord: Option<Chord<f64>>,
    /// First-order distance from the centre, in footprint half widths.
    pub distance: f64,
}

/// Corners of the footprint.
pub(super) const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Fraction by which an occluder must be nearer than an edge: shapes that touch do not hide each other's common edge.
const NEARER: f64 = 1.0 - 1e-9;

/// What lies at `t_max` up to rounding still counts: a shape may pierce the light there.
const FARTHER: f64 = 1.0 + 1e-9;

/// Pieces of a chord that are looked for one by one behind other shapes.
const PIECES: usize = 8;

impl Scene {
    /// Events of one footprint, predicted in first or second order (`order` 1 or 2, anything above counts as 2).
    pub fn detect(&self, view: &View, test: Test, order: usize) -> Vec<Event> {
        let ray = view.family.ray::<D2>();
        let cut = |m: Expansion<f64, 2>| if order < 2 { m.first_order() } else { m };
        let projector = if view.family.has_fixed_origin() { Projector::new(&view.family) } else { None };
        let mut events = Vec::new();
        if let Some(n) = view.horizon {
            let m = cut(margins::facing(ray.d, n).expansion());
            if range(&m).1 <= 0.0 {
                return events;
            }
            if test.flags(&m) {
                events.push(Event { kind: Kind::Horizon, shapes: [None; 2], chord: None, distance: m.distance() });
            }
        }
        for (owners, feature) in self.features(view, test) {
            let event = |chord, m: Expansion<f64, 2>| Event {
                kind: feature.kind,
                shapes: owners,
                chord,
                distance: m.distance(),
            };
            match &feature.edge {
                Edge::Segment([a, b]) => {
                    let m = cut(margins::line(&ray, *a, *b).expansion());
                    let chord = match &projector {
                        Some(projector) => projector.clip(*a, *b),
                        None => margins::predicted_chord(&ray, *a, *b),
                    };
                    if let Some(chord) = chord
                        && (test == Test::Bounds || test.flags(&m))
                        && !self.hides_chord(view, owners, &chord)
                    {
                        events.push(event(Some(chord), m));
                    }
                }
                Edge::Polygon(corners) => {
                    let all: Vec<_> =
                        margins::polygon(&ray, corners).into_iter().flatten().map(|m| cut(m.expansion())).collect();
                    let nearest = all.iter().copied().min_by(|a, b| a.distance().total_cmp(&b.distance()));
                    let plane = Plane::new(corners[0], (corners[1] - corners[0]).cross(corners[2] - corners[0]));
                    if let (Test::Corners(neighbours), Some(m)) = (test, nearest)
                        && corners_inside(&all, neighbours)
                        && !self.hides_plane(view, owners, Some(plane))
                    {
                        events.push(event(None, m));
                    }
                }
                Edge::Margin(f) => {
                    let (margin, guard) = f(&ray);
                    let both = Guarded::new(margin, guard);
                    let both = Guarded { margin: cut(both.margin), guard: cut(both.guard) };
                    if both.flags(test) && !self.hides_plane(view, owners, feature.plane) {
                        events.push(event(None, both.margin));
                    }
                }
            }
        }
        events
    }

    /// Features of all shapes, and the curves in which pairs of them swap depth. For corner prediction a polygon is one feature,
    /// as the source paper predicts hits of objects and not of their edges.
    fn features(&self, view: &View, test: Test) -> Vec<([Option<usize>; 2], Feature)> {
        let mut out = Vec::new();
        let live = |i: &usize| Some(*i) != view.exclude;
        let end = view.t_max.is_finite().then(|| CORNERS.map(|p| view.family.at(p).at(view.t_max)).to_vec());
        for i in (0..self.shapes.len()).filter(live) {
            match (test, self.shapes[i].surface()) {
                (Test::Corners(_), Surface::Polygon(corners)) if corners.len() >= 3 => {
                    let edge = Edge::Polygon(corners);
                    out.push(([Some(i), None], Feature { kind: Kind::Boundary, edge, plane: None }));
                }
                _ => out.extend(self.shapes[i].features(view).into_iter().map(|f| ([Some(i), None], f))),
            }
            // A shape that pierces the far end (the light) swaps depth with it.
            let far = end.clone().and_then(|end| shared(self.shapes[i].surface(), Surface::Polygon(end)));
            out.extend(far.map(|f| ([Some(i), None], f)));
            for j in (0..i).filter(live) {
                if let Some(f) = shared(self.shapes[i].surface(), self.shapes[j].surface()) {
                    out.push(([Some(i), Some(j)], f));
                }
            }
        }
        out
    }

    /// True if all of a chord lies beyond `t_max` or below the horizon, or if each eighth of it is hidden by some convex shape.
    fn hides_chord(&self, view: &View, owners: [Option<usize>; 2], chord: &Chord<f64>) -> bool {
        let ([p, q], [t0, t1]) = (chord.p, chord.t);
        let below = |ray: &Ray<f64>| view.horizon.is_some_and(|n| n.dot(ray.d) < 0.0);
        // 1/t is linear along the chord.
        let end = |k: usize| {
            let u = k as f64 / PIECES as f64;
            let at = |i: usize| p[i] + (q[i] - p[i]) * u;
            (view.family.at([at(0), at(1)]), ((1.0 - u) / t0 + u / t1).recip())
        };
        let ends: [_; PIECES + 1] = std::array::from_fn(end);
        let whole = [&ends[0], &ends[PIECES]];
        whole.iter().all(|(_, t)| *t > view.t_max * FARTHER)
            || whole.iter().all(|(ray, _)| below(ray))
            || ends.windows(2).all(|piece| self.hides(view, owners, piece))
    }

    /// True if one convex shape, not an owner, is hit by all rays before the given parameters.
    fn hides(&self, view: &View, owners: [Option<usize>; 2], ends: &[(Ray<f64>, f64)]) -> bool {
        self.shapes.iter().enumerate().any(|(i, shape)| {
            Some(i) != view.exclude
                && !owners.contains(&Some(i))
                && shape.is_convex()
                && ends.iter().all(|(ray, t)| shape.hit(ray, 0.0, t * NEARER).is_some())
        })
    }

    /// True if whatever lies in `plane` inside the footprint is beyond `t_max` or hidden by one convex shape.
    fn hides_plane(&self, view: &View, owners: [Option<usize>; 2], plane: Option<Plane<f64>>) -> bool {
        let Some(plane) = plane else { return false };
        let ends = CORNERS.map(|p| {
            let ray = view.family.at(p);
            (ray, plane.t(&ray))
        });
        let beyond = |t: f64| t > view.t_max * FARTHER;
        ends.iter().all(|(_, t)| *t > 0.0) && (ends.iter().all(|(_, t)| beyond(*t)) || self.hides(view, owners, &ends))
    }
}

/// The square round a disk.
fn square_round(disk: &Disk<f64>) -> Vec<Vec3<f64>> {
    let n = disk.normal.normalized();
    let least = if n.x.abs() < 0.6 { vec3(1.0, 0.0, 0.0) } else { vec3(0.0, 1.0, 0.0) };
    let u = n.cross(least).normalized() * disk.radius;
    Rectangle::new(disk.centre, u, n.cross(u)).corners().to_vec()
}

/// The curve two surfaces have in common, or one that contains it (disks count with the square round them, polygons with their
/// whole plane against spheres).
fn shared(a: Surface, b: Surface) -> Option<Feature> {
    let flat = |s: Surface| match s {
        Surface::Disk(d) => Surface::Polygon(square_round(&d)),
        other => other,
    };
    match (flat(a), flat(b)) {
        (Surface::Polygon(p), Surface::Polygon(q)) => {
            margins::shared_segment(&p, &q).map(|s| Feature::segment(Kind::Swap, s))
        }
        (Surface::Polygon(p), Surface::Sphere(s)) | (Surface::Sphere(s), Surface::Polygon(p)) => {
            let plane = Plane::new(p[0], (p[1] - p[0]).cross(p[2] - p[0]));
            margins::plane_sphere_circle(&plane, &s).map(|c| Feature::circle(Kind::Swap, c))
        }
        (Surface::Sphere(a), Surface::Sphere(b)) => {
            margins::sphere_sphere_circle(&a, &b).map(|c| Feature::circle(Kind::Swap, c))
        }
        _ => None,
    }
}
