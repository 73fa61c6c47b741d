//! Which edges of the gathered surfaces show in the footprint.
//!
//! *Sight* (a pixel, an emission cell): an edge counts where nothing lies in front of it. *Shadow* (a light seen from a point):
//! depth does not matter, an edge counts where nothing else covers the footprint just beyond it, so that two surfaces which close
//! up, or cross, cast one shadow. Both are intervals of the edge's chord ([`Gaps`]); what a family with fixed origin or direction
//! sees of polygons is exact to rounding.
//! Not handled: depth swaps of one mesh with itself where the two triangles share a corner.

use super::chord::{Chord, Gaps, clip, keep, keep_affine};
use super::curved::{Border, Surface, arcs};
use super::gather::{Facet, Surfaces, in_plane};
use super::kinds::{Events, Kinds};
use super::polygon::Polygon;
use super::view::{Affine, Domain, View, at, from_dual, range};
use crate::scene::mesh::EdgeClass;
use crate::scene::{Geometry, Scene};
use dualux_dual::{Expansion, Test, corners_inside};

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Does what is seen change?
    Sight,
    /// Does what reaches the far end change?
    Shadow,
}

/// How far beyond an edge one looks for what closes up with it, half widths.
const BEYOND: f64 = 1e-5;
/// Pieces of a chord that are looked for one by one behind curved surfaces.
const PIECES: usize = 16;

/// A surface by its place in the lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Owner {
    /// Polygon.
    Polygon(usize),
    /// Curved surface.
    Curved(usize),
}

/// The question and what has been found so far.
pub struct Detection<'a> {
    /// Scene.
    pub scene: &'a Scene,
    /// Footprint.
    pub view: &'a View,
    /// Surfaces in it.
    pub surfaces: &'a Surfaces<'a>,
    /// What is asked.
    pub mode: Mode,
    /// Footprint test.
    pub test: Test,
    /// Look for all events, not only for one.
    pub all: bool,
    /// Positive above the receiver's horizon.
    pub horizon: Option<Affine>,
    /// Events.
    pub found: Events,
    /// Edges that enter the footprint and may be seen from its origin, so far; hidden ones count as well.
    pub live: usize,
}

/// No event yet.
pub const NOTHING: Events = Events { kinds: Kinds::NONE, distance: f64::INFINITY, chord: None };

impl<'a> Detection<'a> {
    /// Looks for events; true if it ended at the first.
    pub fn run(&mut self) -> bool {
        self.horizon_edge() || self.polygon_edges() || self.curved_borders() || self.swaps() || self.end_cuts()
    }

    /// Notes an event; true if that is enough.
    fn note(&mut self, kind: Kinds, distance: f64, chord: Option<Chord>) -> bool {
        self.found.kinds |= kind;
        if distance < self.found.distance {
            self.found.distance = distance;
            self.found.chord = chord;
        }
        !self.all
    }

    /// Counts an edge that enters the footprint; true if there are too many to go on.
    pub(super) fn is_busy(&mut self) -> bool {
        self.live += 1;
        let busy = self.live > self.surfaces.detector.settings.busy;
        if busy {
            self.found.kinds |= Kinds::BUSY;
        }
        busy
    }

    /// Notes a chord if some of it shows. `outward`: unit vector in p, away from what the edge bounds.
    pub(super) fn offer(&mut self, kind: Kinds, chord: Chord, outward: [f64; 2], owners: [Option<Owner>; 2]) -> bool {
        self.shows(&chord, outward, owners) && self.note(kind, chord.distance(), Some(chord))
    }

    /// Whether some of a chord shows.
    fn shows(&self, chord: &Chord, outward: [f64; 2], owners: [Option<Owner>; 2]) -> bool {
        let (view, shadow) = (self.view, self.mode == Mode::Shadow);
        let chord = if shadow { chord.shifted(outward.map(|x| x * BEYOND)) } else { *chord };
        let [near, far] = view.keys;
        let tolerance = view.tolerance(chord.key);
        let mut gaps = Gaps::all();
        if let (true, Some(h)) = (shadow, &self.horizon) {
            let mut s = [0.0, 1.0];
            keep_affine(&chord, &h.map(|x| -x), 0.0, &mut s);
            gaps.remove(s);
            if gaps.is_empty() {
                return false;
            }
        }
        for (i, polygon) in self.surfaces.polygons.iter().enumerate() {
            if owners.contains(&Some(Owner::Polygon(i))) {
                continue;
            }
            let mut s = [0.0, 1.0];
            let keys = chord.p.map(|p| at(&polygon.key, p));
            if shadow {
                keep(far - keys[0], far - keys[1], &mut s);
                if near.is_finite() {
                    keep(keys[0] - near, keys[1] - near, &mut s);
                }
            } else {
                let behind = |k: usize| chord.key[k] - tolerance - keys[k];
                keep(behind(0), behind(1), &mut s);
                if let Some(start) = &view.near {
                    let before = |k: usize| keys[k] - at(start, chord.p[k]);
                    keep(before(0), before(1), &mut s);
                } else if near.is_finite() {
                    keep(keys[0] - near, keys[1] - near, &mut s);
                }
            }
            for side in polygon.sides() {
                if s[0] >= s[1] {
                    break;
                }
                keep_affine(&chord, side, 1e-9 * (side[1].abs() + side[2].abs()), &mut s);
            }
            gaps.remove(s);
            if gaps.is_empty() {
                return false;
            }
        }
        for (i, curved) in self.surfaces.curved.iter().enumerate() {
            if owners.contains(&Some(Owner::Curved(i))) {
                continue;
            }
            let hidden = |k: usize| {
                let u = k as f64 / PIECES as f64;
                curved.hit(view, chord.at(u)).is_some_and(|t| shadow || view.key(t) < chord.key_at(u) - tolerance)
            };
            // Convex in (p, key), or nearly so over a piece: what hides both ends hides all.
            let mut before = hidden(0);
            for k in 0..PIECES {
                let after = hidden(k + 1);
                if before && after {
                    gaps.remove([k as f64 / PIECES as f64, (k + 1) as f64 / PIECES as f64]);
                }
                before = after;
            }
            if gaps.is_empty() {
                return false;
            }
        }
        true
    }

    fn horizon_edge(&mut self) -> bool {
        let Some(h) = self.horizon else { return false };
        let (lo, hi) = range(&h);
        if !(lo < 0.0 && hi > 0.0) {
            return false;
        }
        let Some(p) = line_in_square(&h, &self.view.domain) else { return false };
        let norm = length(&h);
        let key = self.view.keys[1];
        let chord = Chord { p, key: [key; 2] };
        self.offer(Kinds::HORIZON, chord, [h[1] / norm, h[2] / norm], [None; 2])
    }

    fn polygon_edges(&mut self) -> bool {
        for i in 0..self.surfaces.polygons.len() {
            let polygon = &self.surfaces.polygons[i];
            if self.test != Test::Bounds && !self.corners_differ(polygon) {
                continue;
            }
            for k in 0..polygon.sides().len() {
                if !polygon.crosses(k) {
                    continue;
                }
                let Some(kind) = self.edge_kind(polygon, k) else { continue };
                let corners = polygon.corners();
                let (a, b) = (&corners[k], &corners[(k + 1) % corners.len()]);
                let Some(chord) = clip(self.view, a, b) else { continue };
                let side = polygon.sides()[k];
                let norm = -length(&side);
                if self.is_busy()
                    || self.offer(kind, chord, [side[1] / norm, side[2] / norm], [Some(Owner::Polygon(i)), None])
                {
                    return true;
                }
            }
        }
        false
    }

    /// The source paper's test of an object: is it predicted to be hit at some neighbours only? (Sides without an edge do not
    /// bound it.)
    fn corners_differ(&self, polygon: &Polygon) -> bool {
        let Test::Corners(neighbours) = self.test else { return true };
        let expansion =
            |l: &Affine| Expansion { order: 1, value: l[0], gradient: [l[1], l[2]], hessian: [[0.0; 2]; 2] };
        let live: arrayvec::ArrayVec<_, 4> = (0..polygon.sides().len())
            .filter(|&k| self.edge_kind(polygon, k).is_some())
            .map(|k| expansion(&polygon.sides()[k]))
            .collect();
        corners_inside(&live, neighbours)
    }

    /// What side k of a polygon is, if it can be seen as an edge from the view's origin.
    fn edge_kind(&self, polygon: &Polygon, k: usize) -> Option<Kinds> {
        let Geometry::Mesh(mesh) = &self.scene.shapes[polygon.shape as usize].geometry else {
            return Some(Kinds::BOUNDARY);
        };
        let class = mesh.edges[polygon.prim as usize][k];
        if class == EdgeClass::Never {
            return None;
        }
        let neighbour = mesh.neighbors[polygon.prim as usize][k];
        if neighbour == u32::MAX {
            return Some(Kinds::BOUNDARY);
        }
        // The facet a point is lit on, and what lies in its plane, is left out and lies in the horizon: what joins it ends there, to
        // rounding.
        if self.mode == Mode::Shadow {
            let plane = |n| in_plane(n, self.view.origin(), &mesh.corners(neighbour).map(|c| c.as_dvec3()));
            let own = Facet { shape: polygon.shape, prim: neighbour };
            if self.surfaces.exclude[0] == own || self.surfaces.ground.is_some_and(plane) {
                return Some(Kinds::SILHOUETTE);
            }
        }
        // The surface folds back if the neighbour's far corner is seen on the same side of the edge.
        let corners = mesh.corners(polygon.prim);
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let far = mesh.corners(neighbour).into_iter().find(|c| *c != a && *c != b)?;
        let x = self.view.project_f32(far);
        let l = &polygon.sides()[k];
        let side = polygon.side_of(k, &x);
        let size = (l[0] * x[0]).abs() + (l[1] * x[1]).abs() + (l[2] * x[2]).abs();
        if side >= -1e-12 * size {
            Some(Kinds::SILHOUETTE)
        } else if class == EdgeClass::Always && self.mode == Mode::Sight {
            Some(Kinds::CREASE)
        } else {
            None
        }
    }

    fn curved_borders(&mut self) -> bool {
        let alone = self.surfaces.polygons.is_empty() && self.surfaces.curved.len() == 1;
        let endless = (self.view.t[1] == f64::INFINITY || self.mode == Mode::Sight) && self.view.near.is_none();
        for i in 0..self.surfaces.curved.len() {
            for b in 0..self.surfaces.curved[i].borders.len() {
                let (kind, border) = self.surfaces.curved[i].borders[b];
                if self.is_busy() {
                    return true;
                }
                let owner = [Some(Owner::Curved(i)), None];
                match border {
                    Border::Segment([x, y]) => {
                        let Some(chord) = clip(self.view, &self.view.project(x), &self.view.project(y)) else {
                            continue;
                        };
                        let outward = self.away_from(&self.surfaces.curved[i].surface, &chord);
                        if self.offer(kind, chord, outward, owner) {
                            return true;
                        }
                    }
                    Border::Circle(_, margin) if alone && !self.all && endless => {
                        return self.note(kind, margin.distance(), None);
                    }
                    Border::Circle(circle, margin) => {
                        let (mut offered, view) = (0, self.view);
                        if arcs(view, &circle, &mut offered, &mut |c, out| self.offer(kind, *c, out, owner)) {
                            return true;
                        }
                        // It enters by less than the pieces' distance from the curve.
                        if offered == 0 && endless && self.note(kind, margin.distance(), None) {
                            return true;
                        }
                    }
                }
            }
        }
        false
    }

    /// Direction in p away from a cylinder's axis, at its silhouette.
    fn away_from(&self, surface: &Surface, chord: &Chord) -> [f64; 2] {
        let [a, b] = chord.p;
        let (n0, n1) = (b[1] - a[1], a[0] - b[0]);
        let norm = n0.hypot(n1).max(1e-30);
        let n = [n0 / norm, n1 / norm];
        let Surface::Cylinder(c) = surface else { return n };
        let ray = self.view.ray_at(chord.at(0.5));
        // The silhouette's point is at the middle of the chord: which way does the axis pass?
        let x = from_dual(ray.at(self.view.t_of(chord.key_at(0.5))));
        let axis = from_dual(c.axis()).normalize();
        let foot = from_dual(c.a) + axis * axis.dot(x - from_dual(c.a));
        let (f, g) = (self.view.project(foot), self.view.project(x));
        let towards = (f[1] / f[0] - g[1] / g[0]) * n[0] + (f[2] / f[0] - g[2] / g[0]) * n[1];
        if towards > 0.0 { [-n[0], -n[1]] } else { n }
    }

    /// Whether any surface is met by the ray at p.
    pub fn is_met(&self, p: [f64; 2]) -> bool {
        let keys = self.view.keys;
        let in_range = |key: f64| key > keys[0] && key < keys[1];
        self.surfaces.polygons.iter().any(|s| s.contains(p) && in_range(at(&s.key, p)))
            || self.surfaces.curved.iter().any(|s| s.hit(self.view, p).is_some())
    }
}

/// Length of the gradient.
#[inline(always)]
pub(super) fn length(l: &Affine) -> f64 {
    (l[1] * l[1] + l[2] * l[2]).sqrt()
}

/// The part of a line (an affine function's zero set) inside the square and the domain.
pub(super) fn line_in_square(l: &Affine, domain: &Domain) -> Option<[[f64; 2]; 2]> {
    let g2 = l[1] * l[1] + l[2] * l[2];
    let foot = [-l[0] * l[1] / g2, -l[0] * l[2] / g2];
    let scale = 4.0 / g2.sqrt();
    let ends = [-scale, scale].map(|s| [foot[0] - l[2] * s, foot[1] + l[1] * s]);
    if !ends.iter().flatten().all(|x| x.is_finite()) {
        return None;
    }
    let whole = Chord { p: ends, key: [0.0; 2] };
    let mut s = [0.0, 1.0];
    for side in [[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]].iter().chain(domain.cuts()) {
        keep_affine(&whole, side, 0.0, &mut s);
    }
    (s[0] < s[1]).then(|| s.map(|s| whole.at(s)))
}
