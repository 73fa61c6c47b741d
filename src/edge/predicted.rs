//! Footprints whose origin moves: lenses, emission from a patch, chains through mirrors and glass.
//!
//! The rays are duals in N parameters, of first or second order; margins are their expansions, hence predictions. Of a line a-b the
//! margin is the Pluecker product `det[a-o, b-o, d] = d.(a x b) + (o x d).(b-a)`, linear in the ray's six coordinates (d, o x d), so that
//! their derivatives, taken once, serve all lines. An edge counts if its margin can vanish while the foot of the ray on the edge can lie
//! between a and b and in front, all three asked of their ranges over the parameters: `[-1,1]`^N, or the unit disk in the last two
//! (a lens). Whether a mesh edge is a silhouette is asked for the whole range of origins (`may_be_silhouette`). A sphere counts if
//! `|m x d|`, whose vector is expanded, can be as large as R |d|. Rims are polygons of `RIM` sides.
//! With duals of second order what lies beyond the first is a bound first (`Linear::rest`), and for lines that pass it the exact
//! range of the quadratic margin.
//!
//! Polygons that cross swap their depth order at the segment they share, an edge like others. Hidden edges are sorted out afterwards
//! (`confirmed`).
//! Not handled: depth swaps of curved surfaces, and any in chains; silhouettes of cylinders move with the origin to zeroth order only.

use super::Facet;
use super::bundle::Bundle;
use super::feet::feet;
use super::kinds::Kinds;
use super::lens::{Lens, Place};
use super::linear::Linear;
use super::mesh_edge::mesh_edge;
use super::view::{from_dual, to_dual};
use crate::accel::footprint::Visitor;
use crate::math::{DVec3, Vec3 as Vec3f};
use crate::scene::{Geometry, Scene};
use arrayvec::ArrayVec;
use dualux_dual::{
    Cylinder, Expansion, Jet, Ray, bounds, margins,
    num_dual::{Dual2SVec64, DualSVec64},
};
use std::f64::consts::TAU;
use std::marker::PhantomData;
use std::ops::ControlFlow;

/// Numbers of a prediction of first order.
pub type D1<const N: usize> = DualSVec64<N>;
/// Numbers of a prediction of second order.
pub type D2N<const N: usize> = Dual2SVec64<N>;

/// Most edges kept.
const MOST: usize = 48;
/// Polygons that are held against each other, at most.
const MOST_FLATS: usize = 8;
/// Sides of a rim.
const RIM: usize = 32;

/// A predicted edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge<const N: usize> {
    pub kind: Kinds,
    pub shape: u32,
    pub margin: Linear<N>,
    /// Second derivatives of the margin.
    pub bend: [[f64; N]; N],
    /// Where on the edge, 0 at its start and 1 at its end; nothing for spheres.
    pub s: Option<Linear<N>>,
    /// Ray parameter.
    pub t: Linear<N>,
    /// Smallest value of the ray parameter.
    pub near: f64,
}

/// Collects predicted edges.
pub(super) struct Predictor<'a, J, const N: usize> {
    scene: &'a Scene,
    duals: PhantomData<J>,
    pub o: Bundle<N>,
    pub d: Bundle<N>,
    /// Derivatives of o x d, seen from the centre ray's origin.
    q: Bundle<N>,
    pub round: bool,
    /// The rays as those of a lens, if they are.
    pub lens: Option<Lens>,
    pub exclude: Facet,
    /// Square of the distance of origins from the centre ray's, at most.
    start: f64,
    limit: f32,
    /// Of the ray parameter. What a lens's clip planes cut is unknown; segments of chains have no such ends.
    range: [f64; 2],
    pub edges: ArrayVec<Edge<N>, MOST>,
    rectangles: ArrayVec<u32, 8>,
    /// Polygons that may be met, with their shapes.
    flats: ArrayVec<(u32, ArrayVec<DVec3, 4>), MOST_FLATS>,
    /// Whether depth swaps are looked for.
    pub keeps_flats: bool,
    /// Farthest t of surfaces that cover the footprint.
    pub cover: f64,
    pub trouble: Kinds,
}

impl<'a, J: Jet<N, Primitive = f64>, const N: usize> Predictor<'a, J, N> {
    /// Nothing found yet. `round`: the last two of the parameters fill the unit disk; `grow`: by how much the footprint is enlarged.
    #[inline(always)]
    pub fn new(scene: &'a Scene, ray: &Ray<J>, t: [f64; 2], exclude: Facet, round: bool, grow: f64) -> Self {
        let (o, d) = (Bundle::new(ray.o, grow), Bundle::new(ray.d, grow));
        let q = o.moment(&d, J::NDERIV >= 2);
        let lens = if round { Lens::new(o.value, &o.by, d.value, &d.by) } else { None };
        Predictor {
            scene,
            duals: PhantomData,
            q,
            round,
            lens,
            start: o.by.iter().fold(o.rest, |s, v| s + v.abs()).length_squared(),
            exclude,
            limit: t[1] as f32,
            range: t,
            edges: ArrayVec::new(),
            rectangles: ArrayVec::new(),
            flats: ArrayVec::new(),
            keeps_flats: false,
            cover: f64::INFINITY,
            trouble: Kinds::NONE,
            o,
            d,
        }
    }

    /// The margin of the line a-b.
    #[inline(always)]
    fn line(&self, a: DVec3, b: DVec3) -> Linear<N> {
        let (moment, along) = ((a - self.o.value).cross(b - self.o.value), b - a);
        let gradient = std::array::from_fn(|k| self.d.by[k].dot(moment) + self.q.by[k].dot(along));
        let rest = if J::NDERIV < 2 { 0.0 } else { self.d.rest.dot(moment.abs()) + self.q.rest.dot(along.abs()) };
        Linear { value: self.d.value.dot(moment), gradient, rest }
    }

    /// Second derivatives of the same margin.
    fn bend(&self, a: DVec3, b: DVec3) -> [[f64; N]; N] {
        let (moment, along) = ((a - self.o.value).cross(b - self.o.value), b - a);
        let of = |i: usize, j: usize| self.d.twice[i][j].dot(moment) + self.q.twice[i][j].dot(along);
        std::array::from_fn(|i| std::array::from_fn(|j| of(i, j)))
    }

    /// A straight edge; `kind` says what it is, if it is one.
    fn segment(
        &mut self,
        shape: u32,
        margin: Linear<N>,
        [a, b]: [DVec3; 2],
        kind: impl FnOnce(&Self) -> Option<Kinds>,
    ) {
        if !margin.vanishes(self.round) {
            return;
        }
        let [s, t] = feet(&self.o, &self.d, a, b, J::NDERIV >= 2);
        let (reach, near) = (s.reach(self.round), t.value - t.reach(self.round));
        if s.value + reach < 0.0 || s.value - reach > 1.0 || t.value + t.reach(self.round) <= 0.0 {
            return;
        }
        // Where the mesh that the rays start from ends under their origins, the ray before saw an edge.
        if shape == self.exclude.shape && near <= 0.0 {
            return;
        }
        let Some(kind) = kind(self) else { return };
        let mut bend = [[0.0; N]; N];
        if J::NDERIV >= 2 {
            bend = self.bend(a, b);
            let exact = Expansion { order: 2, value: margin.value, gradient: margin.gradient, hessian: bend };
            if !bounds(&exact) {
                return;
            }
        }
        self.push(Edge { kind, shape, margin, bend, s: Some(s), t, near });
    }

    fn push(&mut self, edge: Edge<N>) {
        if self.edges.try_push(edge).is_err() {
            self.trouble |= Kinds::BUSY;
        }
    }

    /// A convex polygon; `kind` says what its side k is, if it is an edge.
    fn polygon<const K: usize>(
        &mut self,
        shape: u32,
        points: &[DVec3; K],
        kind: impl Fn(&Self, usize) -> Option<Kinds>,
    ) {
        let lens = self.lens.map(|lens| (lens, points.map(|x| lens.project(x))));
        let place = lens.as_ref().map_or(Place::Within, |(lens, p)| lens.place(p, self.range));
        if place == Place::Outside {
            return;
        }
        let margins: [Linear<N>; K] = match &lens {
            Some((lens, p)) => std::array::from_fn(|k| lens.line(p[k], p[(k + 1) % K])),
            None => std::array::from_fn(|k| self.line(points[k], points[(k + 1) % K])),
        };
        let sides = margins.each_ref().map(|m| m.side(self.round));
        let (above, below) = (sides.contains(&1), sides.contains(&-1));
        // Clearly beside one side and within another: no ray meets it.
        if above && below {
            return;
        }
        self.passes(shape);
        if place == Place::Cut {
            self.trouble |= Kinds::UNKNOWN;
        }
        if self.keeps_flats {
            let _ = self.flats.try_push((shape, points.iter().copied().collect()));
        }
        if !sides.contains(&0) {
            let far = match &lens {
                Some((lens, p)) => lens.covered_up_to([p[0], p[1], p[2]]),
                None => self.covered_up_to((points[1] - points[0]).cross(points[2] - points[0]), points[0]),
            };
            if let Some(far) = far.filter(|far| *far < self.cover) {
                self.cover = far;
                self.limit = self.limit.min(far as f32 * 1.000_001);
            }
            return;
        }
        for k in 0..K {
            let ends = [points[k], points[(k + 1) % K]];
            if sides[k] == 0 && !(shape == self.exclude.shape && self.starts_at(ends)) {
                self.segment(shape, margins[k], ends, |this| kind(this, k));
            }
        }
    }

    /// Whether an edge of the mesh that the rays start from lies where they start: the ray before saw it, if it shows.
    fn starts_at(&self, ends: [DVec3; 2]) -> bool {
        let d = self.d.value;
        let farthest = ends.map(|x| d.dot(x - self.o.value)).into_iter().fold(f64::MIN, f64::max);
        farthest * farthest.abs() <= self.start * d.length_squared()
    }

    /// Whether rays meet a facet of the mesh they start from where they start, if at all: they leave its plane, or come to it within
    /// the reach of their origins. Round the start of a footprint no smaller than facets that is what most of them are: they are left
    /// out before any margin is asked for. (Nearly tangent rays may meet what is ahead, and are asked.)
    fn starts_on(&self, points: &[DVec3; 3]) -> bool {
        let n = (points[1] - points[0]).cross(points[2] - points[0]);
        let reach = |b: &Bundle<N>| b.by.iter().fold(b.rest.dot(n.abs()), |r, g| r + n.dot(*g).abs());
        let (height, speed) = (n.dot(points[0] - self.o.value), n.dot(self.d.value));
        let slowest = speed.abs() - reach(&self.d);
        // Farthest ray parameter at which a ray may meet the plane, times the slowest speed.
        let farthest = height * speed.signum() + reach(&self.o);
        slowest > 0.0
            && (farthest <= 0.0
                || farthest * farthest * self.d.value.length_squared() <= self.start * slowest * slowest)
    }

    /// Polygons of different shapes that cross each other: they swap their depth order at the segment they share.
    pub fn swaps(&mut self) {
        for i in 0..self.flats.len() {
            for j in 0..i {
                let ((shape, a), (other, b)) = (&self.flats[i], &self.flats[j]);
                if shape == other {
                    continue;
                }
                let dual = |p: &ArrayVec<DVec3, 4>| p.iter().map(|x| to_dual(*x)).collect::<ArrayVec<_, 4>>();
                if let Some(ends) = margins::shared_segment(&dual(a), &dual(b)) {
                    let (shape, ends) = (*shape, ends.map(from_dual));
                    self.segment(shape, self.line(ends[0], ends[1]), ends, |_| Some(Kinds::SWAP));
                }
            }
        }
    }

    /// A bound of the ray parameters at which the rays meet the plane through x with normal n; `None` unless all of them do.
    fn covered_up_to(&self, n: DVec3, x: DVec3) -> Option<f64> {
        let range = |b: &Bundle<N>| {
            let by = b.by.map(|g| n.dot(g));
            Linear { value: n.dot(b.value), gradient: by, rest: b.rest.dot(n.abs()) }.reach(self.round)
        };
        let (height, speed) = (n.dot(x - self.o.value), n.dot(self.d.value));
        let (height, speed) = (height * speed.signum(), speed.abs());
        let (above, slowest) = (range(&self.o), speed - range(&self.d));
        (height > above && slowest > 0.0).then(|| (height + above) / slowest)
    }

    /// Notes that a surface which may be met lets rays pass.
    fn passes(&mut self, shape: u32) {
        if self.scene.passes_light[self.scene.shapes[shape as usize].material as usize] {
            self.trouble |= Kinds::UNKNOWN;
        }
    }

    fn rim(&mut self, shape: u32, c: DVec3, u: DVec3, v: DVec3) {
        let at = |k: usize| {
            let (sin, cos) = (k as f64 * TAU / RIM as f64).sin_cos();
            c + u * cos + v * sin
        };
        for k in 0..RIM {
            let ends = [at(k), at(k + 1)];
            self.segment(shape, self.line(ends[0], ends[1]), ends, |_| Some(Kinds::BOUNDARY));
        }
    }

    fn sphere(&mut self, shape: u32, c: DVec3, radius: f64) {
        let (m, d) = (c - self.o.value, self.d.value);
        let (dist2, d2) = (m.length_squared(), d.length_squared());
        if dist2 <= radius * radius {
            return;
        }
        // m x d with its derivatives.
        let q = m.cross(d);
        let q_p: [DVec3; N] = std::array::from_fn(|k| m.cross(self.d.by[k]) - self.o.by[k].cross(d));
        let (length, border) = (q.length(), radius * d2.sqrt());
        let towards = q / length.max(1e-300);
        let (mut bend, mut rest, mut t_rest) = ([[0.0; N]; N], 0.0, 0.0);
        if J::NDERIV >= 2 {
            for i in 0..N {
                for j in 0..N {
                    let q_ij = m.cross(self.d.twice[i][j]) - self.q.twice[i][j];
                    bend[i][j] = -q_ij.dot(towards);
                    rest += 0.5 * q_ij.length();
                }
            }
            t_rest = (self.d.rest.dot(m.abs()) + self.o.rest.dot(d.abs())) / d2;
        }
        let margin = Linear { value: border - length, gradient: q_p.map(|g| -g.dot(towards)), rest };
        // The vector's farthest value is at a corner; its nearest, at least what is left along its own direction.
        let corner = |i: usize| (0..N).fold(q, |s, k| if i >> k & 1 == 1 { s + q_p[k] } else { s - q_p[k] });
        let farthest = (0..1 << N).map(|i| corner(i).length_squared()).fold(0.0, f64::max).sqrt() + rest;
        let t_p: [f64; N] = std::array::from_fn(|k| (m.dot(self.d.by[k]) - self.o.by[k].dot(d)) / d2);
        let t = Linear { value: m.dot(d) / d2, gradient: t_p, rest: t_rest };
        if length - margin.reach(self.round) > border || farthest < border || t.value + t.reach(self.round) <= 0.0 {
            return;
        }
        let near = t.value * (1.0 - radius * radius / dist2) - t.reach(self.round);
        self.push(Edge { kind: Kinds::SILHOUETTE, shape, margin, bend, s: None, t, near });
    }
}

impl<J: Jet<N, Primitive = f64>, const N: usize> Visitor for Predictor<'_, J, N> {
    fn triangle(&mut self, index: u32, prim: u32, corners: [Vec3f; 3]) -> ControlFlow<()> {
        match &self.scene.shapes[index as usize].geometry {
            Geometry::Rectangle(r) => {
                if self.exclude.shape != index && !self.rectangles.contains(&index) {
                    let _ = self.rectangles.try_push(index);
                    self.polygon(index, &super::polygon::corners(r), |_, _| Some(Kinds::BOUNDARY));
                }
            }
            _ if self.exclude == (Facet { shape: index, prim }) => {}
            _ => {
                let points = corners.map(|p| p.as_dvec3());
                let from = self.exclude;
                if index == from.shape && self.starts_on(&points) {
                    return ControlFlow::Continue(());
                }
                self.polygon(index, &points, |this, k| {
                    mesh_edge(this.scene, [index, prim], k, from, this.o.value, &this.o.by)
                });
            }
        }
        if self.trouble == Kinds::NONE { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    fn quadric(&mut self, index: u32) -> ControlFlow<()> {
        let own = self.exclude.shape == index;
        if !own {
            self.passes(index);
        }
        match &self.scene.shapes[index as usize].geometry {
            Geometry::Sphere(s) if !own => self.sphere(index, s.center.as_dvec3(), f64::from(s.radius)),
            Geometry::Disk(d) if !own => self.rim(index, d.center.as_dvec3(), d.ex.as_dvec3(), d.ey.as_dvec3()),
            Geometry::Cylinder(c) => {
                let (a, axis) = (c.p0.as_dvec3(), c.axis.as_dvec3());
                let (u, v) =
                    (c.reference.as_dvec3() * f64::from(c.radius), c.binormal.as_dvec3() * f64::from(c.radius));
                // Its own rims are seen from inside.
                self.rim(index, a, u, v);
                self.rim(index, a + axis, u, v);
                let c = Cylinder::new(to_dual(a), to_dual(a + axis), f64::from(c.radius));
                for line in
                    margins::cylinder_silhouette(to_dual(self.o.value), &c).into_iter().flatten().filter(|_| !own)
                {
                    let ends = line.map(from_dual);
                    self.segment(index, self.line(ends[0], ends[1]), ends, |_| Some(Kinds::SILHOUETTE));
                }
            }
            _ => {}
        }
        if self.trouble == Kinds::NONE { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    fn limit(&self) -> f32 {
        self.limit
    }
}
