//! Footprints whose origin moves: lenses, emission from a patch, chains through mirrors and glass.
//!
//! The rays are duals in N parameters; margins are their first-order expansions, hence predictions. An edge a-b counts if its margin
//! (the Pluecker product of ray and edge) can vanish while the foot of the ray on the edge can lie between a and b and in front, all three
//! asked of their ranges over `[-1,1]`^N. Whether a mesh edge is a silhouette is asked for the whole range of origins
//! (`may_be_silhouette`). A sphere counts if its discriminant can vanish. An edge is hidden if all of it lies farther than the surface that
//! the centre ray meets, provided that this covers the footprint: its own margins cannot vanish.
//! Not handled: rims of disks and cylinders but by their discriminants; depth swaps; partial hiding.

use super::kinds::{Events, Kinds, Verdict};
use super::view::{from_dual, to_dual};
use super::{EdgeDetector, Facet, NOTHING};
use crate::accel::footprint::{Beam, Visitor};
use crate::math::DVec3;
use crate::scene::mesh::EdgeClass;
use crate::scene::{Geometry, Scene};
use arrayvec::ArrayVec;
use dualux_dual::num_dual::DualNum as _;
use dualux_dual::{Cylinder, Disk, Expansion, Jet, Ray, Sphere, Vec3, bounds, margins, num_dual::DualSVec64, range};
use std::ops::ControlFlow;

/// Numbers of a prediction.
pub type D1<const N: usize> = DualSVec64<N>;

/// Most edges kept.
const MOST: usize = 96;

/// Factor of distance by which an edge is clearly behind a curved surface.
const BEHIND: f64 = 1.05;

/// A predicted edge: kind, distance, and the range of t at which it lies.
#[derive(Clone, Copy, Debug)]
struct Edge {
    kind: Kinds,
    distance: f64,
    t: (f64, f64),
    shape: u32,
}

/// Collects predicted edges.
struct Predictor<'a, const N: usize> {
    scene: &'a Scene,
    ray: Ray<D1<N>>,
    exclude: Option<Facet>,
    limit: f32,
    edges: ArrayVec<Edge, MOST>,
    /// Farthest t of surfaces that cover the footprint.
    cover: f64,
    trouble: Kinds,
}

impl<const N: usize> Predictor<'_, N> {
    /// Coordinates of the ray's foot on the line a-b (0 at a, 1 at b), and of the edge's foot on the ray.
    fn feet(&self, a: DVec3, b: DVec3) -> [Expansion<f64, N>; 2] {
        let e = Vec3::lift(to_dual(b - a));
        let v = Vec3::lift(to_dual(a)) - self.ray.o;
        let d = self.ray.d;
        let (ee, ed, dd, ve, vd) = (e.norm2(), e.dot(d), d.norm2(), v.dot(e), v.dot(d));
        let inv = (ee * dd - ed * ed).recip();
        [((ed * vd - ve * dd) * inv).expansion(), ((ee * vd - ed * ve) * inv).expansion()]
    }

    fn segment(&mut self, kind: Kinds, shape: u32, a: DVec3, b: DVec3) -> bool {
        let m = margins::line(&self.ray, to_dual(a), to_dual(b)).expansion();
        if !bounds(&m) {
            return false;
        }
        let [s, t] = self.feet(a, b);
        let (s, t) = (range(&s), range(&t));
        if s.1 < 0.0 || s.0 > 1.0 || t.1 <= 0.0 {
            return false;
        }
        self.push(Edge { kind, distance: m.distance(), t, shape });
        true
    }

    fn push(&mut self, edge: Edge) {
        if self.edges.try_push(edge).is_err() {
            self.trouble |= Kinds::BUSY;
        }
    }

    /// Notes a plane polygon without live edges in the footprint that the centre ray meets.
    fn covers(&mut self, points: &[DVec3]) {
        let n = (points[1] - points[0]).cross(points[2] - points[0]);
        let t = dualux_dual::Plane::new(to_dual(points[0]), to_dual(n)).t(&self.ray).expansion();
        let inside = (0..points.len()).map(|k| {
            let (a, b) = (points[k], points[(k + 1) % points.len()]);
            range(&margins::line(&self.ray, to_dual(a), to_dual(b)).expansion())
        });
        let (mut positive, mut negative) = (true, true);
        for (lo, hi) in inside {
            positive &= lo > 0.0;
            negative &= hi < 0.0;
        }
        let (near, far) = range(&t);
        if (positive || negative) && near > 0.0 && far < self.cover {
            self.cover = far;
            self.limit = self.limit.min(far as f32 * 1.000_001);
        }
    }

    fn mesh_edges(&mut self, shape: u32, prim: u32, points: &[DVec3; 3]) {
        let Geometry::Mesh(mesh) = &self.scene.shapes[shape as usize].geometry else { return };
        let normal = |c: &[DVec3; 3]| (c[1] - c[0]).cross(c[2] - c[0]);
        for k in 0..3 {
            let class = mesh.edges[prim as usize][k];
            let neighbour = mesh.neighbors[prim as usize][k];
            let (a, b) = (points[k], points[(k + 1) % 3]);
            let kind = match (class, neighbour) {
                (EdgeClass::Never, _) => continue,
                (_, u32::MAX) => Kinds::BOUNDARY,
                (class, n) => {
                    let other = mesh.corners(n).map(|c| c.as_dvec3());
                    let o_p: [Vec3<f64>; N] = std::array::from_fn(|i| self.ray.o.map(|c| c.gradient()[i]));
                    let o = self.ray.o.re();
                    let (n1, n2) = (to_dual(normal(points)), to_dual(normal(&other)));
                    match (margins::may_be_silhouette(o, &o_p, to_dual(a), n1, n2), class) {
                        (true, _) => Kinds::SILHOUETTE,
                        (false, EdgeClass::Always) => Kinds::CREASE,
                        (false, _) => continue,
                    }
                }
            };
            self.segment(kind, shape, a, b);
        }
    }

    fn curved(&mut self, index: u32) {
        let (ray, scene) = (self.ray, self.scene);
        let mut guarded = |kind: Kinds, m: D1<N>, guard: D1<N>, t: f64| {
            let m = m.expansion();
            if bounds(&m) && range(&guard.expansion()).1 > 0.0 {
                self.push(Edge { kind, distance: m.distance(), t: (t, t), shape: index });
            }
        };
        let one = dualux_dual::constant::<D1<N>>(1.0);
        let t_of = |c: Vec3<f64>| (c - ray.o.re()).dot(ray.d.re()) / ray.d.re().norm2();
        match &scene.shapes[index as usize].geometry {
            Geometry::Sphere(s) => {
                let s = Sphere::new(to_dual(s.center.as_dvec3()), f64::from(s.radius));
                if s.is_outside(ray.o.re()) {
                    guarded(
                        Kinds::SILHOUETTE,
                        margins::sphere(&ray, &s),
                        margins::sphere_guard(&ray, &s),
                        t_of(s.centre),
                    );
                }
            }
            Geometry::Disk(d) => {
                let r = f64::from(d.ex.length().max(d.ey.length()));
                let disk = Disk::new(to_dual(d.center.as_dvec3()), to_dual(d.n.as_dvec3()), r);
                guarded(Kinds::BOUNDARY, margins::rim(&ray, &disk), margins::rim_guard(&ray, &disk), t_of(disk.centre));
            }
            Geometry::Cylinder(c) => {
                let a = c.p0.as_dvec3();
                let c = Cylinder::new(to_dual(a), to_dual(a + c.axis.as_dvec3()), f64::from(c.radius));
                for cap in c.caps() {
                    guarded(
                        Kinds::BOUNDARY,
                        margins::rim(&ray, &cap),
                        margins::rim_guard(&ray, &cap),
                        t_of(cap.centre),
                    );
                }
                if c.is_outside(ray.o.re()) {
                    guarded(Kinds::SILHOUETTE, margins::cylinder(&ray, &c), one, t_of(c.a));
                }
            }
            Geometry::Mesh(_) | Geometry::Rectangle(_) => {}
        }
    }
}

impl<const N: usize> Predictor<'_, N> {
    fn excluded(&self, shape: u32, prim: Option<u32>) -> bool {
        self.exclude.is_some_and(|f| f.shape == shape && prim.is_none_or(|p| f.prim == p))
    }

    fn enough(&self) -> ControlFlow<()> {
        if self.trouble == Kinds::NONE { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

impl<const N: usize> Visitor for Predictor<'_, N> {
    fn triangle(&mut self, index: u32, prim: u32, corners: [crate::math::Vec3; 3]) -> ControlFlow<()> {
        match &self.scene.shapes[index as usize].geometry {
            Geometry::Rectangle(r) if !self.excluded(index, None) => {
                let points = super::polygon::corners(r);
                self.covers(&points);
                for k in 0..4 {
                    self.segment(Kinds::BOUNDARY, index, points[k], points[(k + 1) % 4]);
                }
            }
            Geometry::Mesh(_) if !self.excluded(index, Some(prim)) => {
                let points = corners.map(|p| p.as_dvec3());
                self.covers(&points);
                self.mesh_edges(index, prim, &points);
            }
            _ => {}
        }
        self.enough()
    }

    fn quadric(&mut self, index: u32) -> ControlFlow<()> {
        if !self.excluded(index, None) {
            self.curved(index);
        }
        self.enough()
    }

    fn limit(&self) -> f32 {
        self.limit
    }
}

/// The boxes of a dual ray's origins and directions, to first order.
fn beam<const N: usize>(ray: &Ray<D1<N>>, t: [f64; 2]) -> Beam {
    let spread = |v: Vec3<D1<N>>| {
        let bound = |pick: fn((f64, f64)) -> f64| from_dual(v.map(|c| pick(range(&c.expansion())))).as_vec3();
        [bound(|r| r.0).map(f32::next_down), bound(|r| r.1).map(f32::next_up)]
    };
    Beam { o: spread(ray.o), d: spread(ray.d), tmin: t[0] as f32, tmax: t[1] as f32, sides: None }
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
        let mut p = Predictor {
            scene: self.scene,
            ray: *ray,
            exclude,
            limit: t[1] as f32,
            edges: ArrayVec::new(),
            cover: f64::INFINITY,
            trouble: Kinds::NONE,
        };
        self.accel.walk(&beam(ray, t), &mut p);
        let mut found = NOTHING;
        // A closed or smooth front surface without an edge of its own in the footprint hides what is behind.
        let own = |shape: u32| p.edges.iter().any(|e| e.shape == shape && e.t.0 <= front.map_or(0.0, |f| f.1));
        let cover = match front {
            Some((shape, t)) if p.cover == f64::INFINITY && !own(shape) => t * BEHIND,
            _ => p.cover,
        };
        for e in p.edges.iter().filter(|e| e.t.0 <= cover * (1.0 + 1e-6)) {
            found.kinds |= e.kind;
            found.distance = found.distance.min(e.distance);
        }
        let found = Events { kinds: found.kinds | p.trouble, ..found };
        match (p.trouble == Kinds::NONE, found.kinds == Kinds::NONE) {
            (false, _) => Verdict::Unknown(found),
            (true, true) => Verdict::Clear,
            (true, false) => Verdict::Events(found),
        }
    }
}
