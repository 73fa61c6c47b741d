//! Footprints whose origin moves: lenses, emission from a patch, chains through mirrors and glass.
//!
//! The rays are duals in N parameters; margins are their first-order expansions, hence predictions. Of a line a-b the margin is the
//! Pluecker product `det[a-o, b-o, d] = d.(a x b) + (o x d).(b-a)`, linear in the ray's six coordinates (d, o x d), so that their
//! derivatives, taken once, serve all lines. An edge counts if its margin can vanish while the foot of the ray on the edge can lie
//! between a and b and in front, all three asked of their ranges over the parameters: `[-1,1]`^N, or the unit disk in the last two
//! (a lens). Whether a mesh edge is a silhouette is asked for the whole range of origins (`may_be_silhouette`). A sphere counts if
//! `|m x d|`, whose vector is affine to first order, can be as large as R |d|. Rims are polygons of `RIM` sides.
//!
//! Hidden: what lies behind a flat surface that covers the footprint, or behind the surface that the centre ray meets if that has no
//! edge here; what is left is looked at with real rays of the family at points where the margin vanishes, and dropped if
//! all of them meet something nearer.
//! Not handled: depth swaps; silhouettes of cylinders move with the origin to zeroth order only.

use super::kinds::{Events, Kinds, Verdict};
use super::linear::Linear;
use super::view::{from_dual, to_dual};
use super::{EdgeDetector, Facet, NOTHING};
use crate::accel::footprint::{Beam, Visitor};
use crate::accel::{Hit, Ray as PlainRay};
use crate::math::{DVec3, Vec3 as Vec3f};
use crate::scene::mesh::EdgeClass;
use crate::scene::{Geometry, Scene};
use arrayvec::ArrayVec;
use dualux_dual::num_dual::DualNum as _;
use dualux_dual::{Cylinder, Family, Jet, Ray, Vec3, margins, num_dual::DualSVec64};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Numbers of a prediction.
pub type D1<const N: usize> = DualSVec64<N>;

/// Most edges kept.
const MOST: usize = 48;
/// Sides of a rim.
const RIM: usize = 32;
/// Factor of distance by which an edge is clearly behind a curved surface.
const BEHIND: f64 = 1.05;

/// A predicted edge.
#[derive(Clone, Copy, Debug)]
struct Edge<const N: usize> {
    kind: Kinds,
    shape: u32,
    margin: Linear<N>,
    /// Where on the edge, 0 at its start and 1 at its end; nothing for spheres.
    s: Option<Linear<N>>,
    /// Ray parameter.
    t: Linear<N>,
    /// Smallest value of the ray parameter.
    near: f64,
}

/// Collects predicted edges.
struct Predictor<'a, const N: usize> {
    scene: &'a Scene,
    ray: Ray<D1<N>>,
    o: DVec3,
    d: DVec3,
    o_p: [DVec3; N],
    d_p: [DVec3; N],
    /// Derivatives of o x d, seen from the centre ray's origin.
    q_p: [DVec3; N],
    round: bool,
    exclude: Facet,
    limit: f32,
    edges: ArrayVec<Edge<N>, MOST>,
    rectangles: ArrayVec<u32, 8>,
    /// Farthest t of surfaces that cover the footprint.
    cover: f64,
    trouble: Kinds,
}

impl<const N: usize> Predictor<'_, N> {
    /// The margin of the line a-b.
    #[inline(always)]
    fn line(&self, a: DVec3, b: DVec3) -> Linear<N> {
        let (moment, along) = ((a - self.o).cross(b - self.o), b - a);
        let gradient = std::array::from_fn(|k| self.d_p[k].dot(moment) + self.q_p[k].dot(along));
        Linear { value: self.d.dot(moment), gradient }
    }

    /// Coordinates of the ray's foot on the line a-b (0 at a, 1 at b), and of the edge's foot on the ray.
    fn feet(&self, a: DVec3, b: DVec3) -> [Linear<N>; 2] {
        let e = Vec3::lift(to_dual(b - a));
        let v = Vec3::lift(to_dual(a)) - self.ray.o;
        let d = self.ray.d;
        let (ee, ed, dd, ve, vd) = (e.norm2(), e.dot(d), d.norm2(), v.dot(e), v.dot(d));
        let inv = (ee * dd - ed * ed).recip();
        [((ed * vd - ve * dd) * inv).expansion().into(), ((ee * vd - ed * ve) * inv).expansion().into()]
    }

    fn segment(&mut self, kind: Kinds, shape: u32, margin: Linear<N>, [a, b]: [DVec3; 2]) {
        if !margin.vanishes(self.round) {
            return;
        }
        let [s, t] = self.feet(a, b);
        let (reach, near) = (s.reach(self.round), t.value - t.reach(self.round));
        if s.value + reach < 0.0 || s.value - reach > 1.0 || t.value + t.reach(self.round) <= 0.0 {
            return;
        }
        self.push(Edge { kind, shape, margin, s: Some(s), t, near });
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
        let margins: [Linear<N>; K] = std::array::from_fn(|k| self.line(points[k], points[(k + 1) % K]));
        let (mut above, mut below, mut any) = (0, 0, false);
        for m in &margins {
            let reach = m.reach(self.round);
            above += usize::from(m.value > reach);
            below += usize::from(m.value < -reach);
            any |= m.vanishes(self.round);
        }
        // Clearly beside one side and within another: no ray meets it.
        if above > 0 && below > 0 {
            return;
        }
        self.passes(shape);
        if above == K || below == K {
            let n = (points[1] - points[0]).cross(points[2] - points[0]);
            let t = Linear::from(dualux_dual::Plane::new(to_dual(points[0]), to_dual(n)).t(&self.ray).expansion());
            let (near, far) = (t.value - t.reach(self.round), t.value + t.reach(self.round));
            if near > 0.0 && far < self.cover {
                self.cover = far;
                self.limit = self.limit.min(far as f32 * 1.000_001);
            }
        }
        if any {
            for k in 0..K {
                if margins[k].vanishes(self.round)
                    && let Some(kind) = kind(self, k)
                {
                    self.segment(kind, shape, margins[k], [points[k], points[(k + 1) % K]]);
                }
            }
        }
    }

    /// Notes that a surface which may be met lets rays pass.
    fn passes(&mut self, shape: u32) {
        if self.scene.passes_light[self.scene.shapes[shape as usize].material as usize] {
            self.trouble |= Kinds::UNKNOWN;
        }
    }

    /// What side k of a triangle of a mesh is.
    fn mesh_edge(&self, shape: u32, prim: u32, k: usize, points: &[DVec3; 3]) -> Option<Kinds> {
        let Geometry::Mesh(mesh) = &self.scene.shapes[shape as usize].geometry else { return None };
        let normal = |c: &[DVec3; 3]| to_dual((c[1] - c[0]).cross(c[2] - c[0]));
        match (mesh.edges[prim as usize][k], mesh.neighbors[prim as usize][k]) {
            (EdgeClass::Never, _) => None,
            (_, u32::MAX) => Some(Kinds::BOUNDARY),
            (class, n) => {
                let other = mesh.corners(n).map(|c| c.as_dvec3());
                let o_p = self.o_p.map(to_dual);
                let (n1, n2) = (normal(points), normal(&other));
                match margins::may_be_silhouette(to_dual(self.o), &o_p, to_dual(points[k]), n1, n2) {
                    true => Some(Kinds::SILHOUETTE),
                    false => (class == EdgeClass::Always).then_some(Kinds::CREASE),
                }
            }
        }
    }

    fn rim(&mut self, shape: u32, c: DVec3, u: DVec3, v: DVec3) {
        let at = |k: usize| {
            let (sin, cos) = (k as f64 * TAU / RIM as f64).sin_cos();
            c + u * cos + v * sin
        };
        for k in 0..RIM {
            let ends = [at(k), at(k + 1)];
            self.segment(Kinds::BOUNDARY, shape, self.line(ends[0], ends[1]), ends);
        }
    }

    fn sphere(&mut self, shape: u32, c: DVec3, radius: f64) {
        let m = c - self.o;
        let (dist2, d2) = (m.length_squared(), self.d.length_squared());
        if dist2 <= radius * radius {
            return;
        }
        // m x d with its derivatives.
        let q = m.cross(self.d);
        let q_p: [DVec3; N] = std::array::from_fn(|k| m.cross(self.d_p[k]) - self.o_p[k].cross(self.d));
        let (length, border) = (q.length(), radius * d2.sqrt());
        let towards = q / length.max(1e-300);
        let margin = Linear { value: border - length, gradient: q_p.map(|g| -g.dot(towards)) };
        // The vector's farthest value is at a corner; its nearest, at least what is left along its own direction.
        let corner = |i: usize| (0..N).fold(q, |s, k| if i >> k & 1 == 1 { s + q_p[k] } else { s - q_p[k] });
        let farthest = (0..1 << N).map(|i| corner(i).length_squared()).fold(0.0, f64::max).sqrt();
        let t_p: [f64; N] = std::array::from_fn(|k| (m.dot(self.d_p[k]) - self.o_p[k].dot(self.d)) / d2);
        let t = Linear { value: m.dot(self.d) / d2, gradient: t_p };
        if length - margin.reach(self.round) > border || farthest < border || t.value + t.reach(self.round) <= 0.0 {
            return;
        }
        let near = t.value * (1.0 - radius * radius / dist2) - t.reach(self.round);
        self.push(Edge { kind: Kinds::SILHOUETTE, shape, margin, s: None, t, near });
    }
}

impl<const N: usize> Visitor for Predictor<'_, N> {
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
                self.polygon(index, &points, |this, k| this.mesh_edge(index, prim, k, &points));
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
                for line in margins::cylinder_silhouette(to_dual(self.o), &c).into_iter().flatten().filter(|_| !own) {
                    let ends = line.map(from_dual);
                    self.segment(Kinds::SILHOUETTE, index, self.line(ends[0], ends[1]), ends);
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

impl<const N: usize> Predictor<'_, N> {
    /// The boxes of origins and directions, to first order.
    fn beam(&self, t: [f64; 2]) -> Beam {
        let spread = |v: DVec3, v_p: &[DVec3; N]| {
            let reach = v_p.iter().fold(DVec3::ZERO, |r, g| r + g.abs());
            let bound = |x: DVec3, to: fn(f32) -> f32| {
                let x = x.as_vec3();
                Vec3f::new(to(x.x), to(x.y), to(x.z))
            };
            [bound(v - reach, f32::next_down), bound(v + reach, f32::next_up)]
        };
        let (o, d) = (spread(self.o, &self.o_p), spread(self.d, &self.d_p));
        Beam { o, d, tmin: t[0] as f32, tmax: t[1] as f32, sides: None }
    }

    /// Whether real rays see an edge, or nothing can be said.
    fn shows(&self, detector: &EdgeDetector, e: &Edge<N>, t: [f64; 2]) -> bool {
        let mut asked = false;
        let none = [None; N];
        // The nearest root, and those with some parameters at their ends.
        let ends = (0..2 * N).map(|i| {
            let mut fixed = none;
            let (k, at) = (i / 2, if i % 2 == 0 { -0.9 } else { 0.9 });
            fixed[k] = Some(if self.round && k + 2 >= N { 0.7 * at } else { at });
            fixed
        });
        for p in std::iter::once(none).chain(ends).filter_map(|fixed| e.margin.root(&fixed)) {
            if e.s.is_some_and(|s| !(-0.02..=1.02).contains(&s.at(&p))) {
                continue;
            }
            asked = true;
            let (mut o, mut d) = (self.o, self.d);
            for k in 0..N {
                o += self.o_p[k] * p[k];
                d += self.d_p[k] * p[k];
            }
            let at = e.t.at(&p);
            let ray =
                PlainRay { o: o.as_vec3(), d: d.as_vec3(), tmin: (t[0] as f32).max(at as f32 * 1e-4), tmax: at as f32 };
            let nearer = |hit: &Hit| {
                let (own, start) = (hit.shape == e.shape, hit.shape == self.exclude.shape);
                // A curved surface is met before its silhouette; the surface that the rays start from, by rounding.
                let slack = if own { 1.0 / BEHIND } else { 1.0 - 1e-3 };
                let counts = !start && (!own || e.s.is_some());
                counts && f64::from(hit.t) < at * slack
            };
            if !detector.accel.closest(&ray).is_some_and(|hit| nearer(&hit)) {
                return true;
            }
        }
        !asked
    }
}

impl EdgeDetector<'_> {
    /// Predicted events of rays whose origin moves. `front`: shape and distance (in units of the direction) of what the centre ray
    /// meets, if known: where no flat surface covers the footprint but this has no edge in it, it hides what is clearly farther.
    pub fn predict<const N: usize>(
        &self,
        ray: &Ray<D1<N>>,
        t: [f64; 2],
        exclude: Option<Facet>,
        front: Option<(u32, f64)>,
    ) -> Verdict {
        self.predict_in(ray, t, exclude, front, false, 1.0)
    }

    /// The same; `round`: the last two of the parameters fill the unit disk; `grow`: by how much the footprint is enlarged.
    pub(super) fn predict_in<const N: usize>(
        &self,
        ray: &Ray<D1<N>>,
        t: [f64; 2],
        exclude: Option<Facet>,
        front: Option<(u32, f64)>,
        round: bool,
        grow: f64,
    ) -> Verdict {
        let partial = |v: Vec3<D1<N>>| -> [DVec3; N] { std::array::from_fn(|k| from_dual(v.partial(k)) * grow) };
        let (o, d) = (from_dual(ray.o.re()), from_dual(ray.d.re()));
        let (o_p, d_p) = (partial(ray.o), partial(ray.d));
        let mut p = Predictor {
            scene: self.scene,
            ray: Family::new(ray.o.re(), o_p.map(to_dual), ray.d.re(), d_p.map(to_dual)).ray(),
            o,
            d,
            o_p,
            d_p,
            q_p: o_p.map(|g| g.cross(d)),
            round,
            exclude: exclude.unwrap_or(Facet::NONE),
            limit: t[1] as f32,
            edges: ArrayVec::new(),
            rectangles: ArrayVec::new(),
            cover: f64::INFINITY,
            trouble: Kinds::NONE,
        };
        self.accel.walk(&p.beam(t), &mut p);
        let mut found = NOTHING;
        // A surface without an edge of its own in the footprint hides what is behind.
        let cover = match front {
            Some((shape, t)) if !p.edges.iter().any(|e| e.shape == shape) => p.cover.min(t * BEHIND),
            _ => p.cover,
        };
        let mut live = 0;
        for e in p.edges.iter().filter(|e| e.near <= cover * (1.0 + 1e-6)) {
            live += 1;
            if live > self.settings.busy {
                p.trouble |= Kinds::BUSY;
                break;
            }
            if p.shows(self, e, t) {
                found.kinds |= e.kind;
                found.distance = found.distance.min(e.margin.distance());
            }
        }
        let found = Events { kinds: found.kinds | p.trouble, ..found };
        match (p.trouble == Kinds::NONE, found.kinds == Kinds::NONE) {
            (false, _) => Verdict::Unknown(found),
            (true, true) => Verdict::Clear,
            (true, false) => Verdict::Events(found),
        }
    }
}
