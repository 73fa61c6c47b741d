//! Chains through mirrors and glass: what a footprint sees by reflection and refraction.
//!
//! The centre ray is traced; at each smooth surface the duals of all N parameters flow through hit point, normal (interpolated, on
//! smooth meshes) and direction, and every new segment gets its own walk. Dielectrics branch; [`MOST_SEGMENTS`] limits the tree. Total
//! internal reflection is an event where its margin may vanish. Source: Igehy 1999; METHODS 3.B.
//!
//! A plane mirror keeps a family with one origin (or direction) one: its image. So do panes. Behind them the segment is an exact
//! [`View`] that starts at their plane, as long as no curved surface has been met. Other segments are predictions, to the detector's
//! order of expansions: their origins move over the surface ([`EdgeDetector::predict`]). What the order leaves out is allowed for by an
//! enlarged footprint.
//! Not handled: coats of plastics, rough surfaces, bump maps.

use super::confirmed::Question;
use super::kinds::{Events, Kinds, Verdict};
use super::predicted::{D1, D2N};
use super::view::{View, from_dual, to_dual};
use super::{EdgeDetector, Facet, NOTHING, surface};
use crate::accel::{Hit, Ray as PlainRay};
use crate::scene::shape::ShapeHit;
use crate::scene::{Geometry, Material, SurfacePoint};
use arrayvec::ArrayVec;
use dualux_dual::{Family, Jet, Ray, Vec3, bounds, face_against, reflect, refract};

/// Segments followed behind a pixel, at most.
pub const MOST_SEGMENTS: usize = 8;

/// By how much footprints are enlarged behind curved surfaces: with expansions of first order, which know no curvature, and where
/// normals are interpolated, since derivatives jump from facet to facet.
const CURVED: f64 = 1.25;

/// By how much the normals of a sphere or cylinder may turn in a footprint, radians, where first order is to do: what it leaves out
/// is about as large, relative to the footprint, and well below what [`CURVED`] adds.
const TURN: f64 = 0.1;

/// How a smooth surface sends rays on.
pub(super) enum Optics {
    Mirror,
    /// Index inside over outside.
    Glass(f64),
    Pane,
}

/// A segment still to be looked along.
struct Segment<J> {
    ray: Ray<J>,
    /// Ray parameter of its start: 0 unless the origin is an image.
    start: f64,
    /// How it got there.
    seen: Kinds,
    from: SurfacePoint,
    /// By how much its footprint is enlarged.
    grow: f64,
    /// Whether all rays have one origin or one direction.
    exact: bool,
}

/// What is left to do, and what has been found.
struct Tree<J> {
    todo: ArrayVec<Segment<J>, MOST_SEGMENTS>,
    /// Segments looked along so far.
    segments: usize,
    found: Events,
    /// A surface bends too much for duals of first order.
    bends: bool,
}

impl<J> Tree<J> {
    /// Whether no more segments are followed.
    fn is_full(&self) -> bool {
        self.segments + self.todo.len() >= MOST_SEGMENTS
    }
}

/// Whether a surface turns rays of all places alike.
fn is_flat(geometry: &Geometry) -> bool {
    match geometry {
        Geometry::Rectangle(_) | Geometry::Disk(_) => true,
        Geometry::Mesh(mesh) => mesh.normals.is_empty(),
        Geometry::Sphere(_) | Geometry::Cylinder(_) => false,
    }
}

/// Whether normals are interpolated.
fn is_smooth(geometry: &Geometry) -> bool {
    matches!(geometry, Geometry::Mesh(mesh) if !mesh.normals.is_empty())
}

/// What expansions of second order leave out, as a fraction of the first: guessed from the ratio of the first two, as in a geometric
/// series. 0 for duals of first order.
fn third<J: Jet<N, Primitive = f64>, const N: usize>(ray: &Ray<J>) -> f64 {
    if J::NDERIV < 2 {
        return 0.0;
    }
    let ratio = |v: Vec3<J>| {
        let first: f64 = (0..N).map(|k| v.partial(k).norm2().sqrt()).sum();
        let [x, y, z] = v.map(|c| c.hessian()).to_array();
        let twice = |i: usize, j: usize| (x[i][j] * x[i][j] + y[i][j] * y[i][j] + z[i][j] * z[i][j]).sqrt();
        let second: f64 = (0..N).map(|i| (0..N).map(|j| twice(i, j)).sum::<f64>()).sum();
        if second > 0.0 { 0.5 * second / first } else { 0.0 }
    };
    ratio(ray.o).max(ratio(ray.d)).powi(2)
}

impl EdgeDetector<'_> {
    /// Events seen through specular chains that start with the given rays; their kinds hold `MIRRORED` or `REFRACTED`.
    /// Nothing if the first surface is not smooth. `all`: look for all events, not only for one.
    pub fn chain<const N: usize>(&self, first: &Family<f64, N>, t: [f64; 2], all: bool) -> Events {
        let [o, d] = [first.o, first.d].map(|v| from_dual(v).as_vec3());
        let Some((t, at)) = self.meet(&PlainRay { o, d, tmin: t[0] as f32, tmax: t[1] as f32 }) else {
            return NOTHING;
        };
        let shape = &self.scene.shapes[at.shape as usize];
        let outside = d.dot(at.n_geo) < 0.0;
        if self.optics(shape.material as usize, outside).is_none() {
            return NOTHING;
        }
        let behind = self.behind_surfaces();
        // Most of what chains show is clear to first order, at less than half of the second's cost.
        let (found, bends) = behind.chain_of::<D1<N>, N>(first, t, at, all);
        if self.settings.order < 2 || (found.kinds == Kinds::NONE && !bends) {
            return found;
        }
        behind.chain_of::<D2N<N>, N>(first, t, at, all).0
    }

    /// Events, and whether the chain was given up because it bends too much for duals of first order.
    fn chain_of<J: Jet<N, Primitive = f64>, const N: usize>(
        &self,
        first: &Family<f64, N>,
        t: f64,
        at: SurfacePoint,
        all: bool,
    ) -> (Events, bool) {
        let ray = first.ray::<J>();
        let exact = N == 2 && (first.has_fixed_origin() || first.d_p.iter().all(|v| *v == Vec3::zero()));
        let start = Segment { ray, start: 0.0, seen: Kinds::NONE, from: at, grow: 1.0, exact };
        let mut tree = Tree { todo: ArrayVec::new(), segments: 0, found: NOTHING, bends: false };
        self.branch(&start, &at, t, &mut tree);
        while let Some(segment) = tree.todo.pop() {
            if tree.bends || (!all && tree.found.kinds != Kinds::NONE) {
                break;
            }
            tree.segments += 1;
            let plain = PlainRay::leaving(&segment.from, from_dual(segment.ray.d.re()).as_vec3());
            // The last ones send nothing on: what they meet is asked for only where edges may show.
            let last = tree.is_full();
            let hit = if last { None } else { self.meet(&plain) };
            let front = || match &hit {
                _ if last => self.accel.closest(&plain).map(|hit| (hit.shape, f64::from(hit.t))),
                hit => hit.as_ref().map(|(t, at)| (at.shape, *t)),
            };
            let verdict = self.along(&segment, front, all);
            if verdict != Verdict::Clear {
                tree.found.kinds |= verdict.kinds() | segment.seen;
                tree.found.distance = tree.found.distance.min(verdict.distance());
            }
            if let Some((t, at)) = hit {
                self.branch(&segment, &at, segment.start + t, &mut tree);
            }
        }
        (tree.found, tree.bends)
    }

    /// What a segment sees; `front`: shape and distance of what its centre ray meets.
    fn along<J: Jet<N, Primitive = f64>, const N: usize>(
        &self,
        segment: &Segment<J>,
        front: impl FnOnce() -> Option<(u32, f64)>,
        all: bool,
    ) -> Verdict {
        let (ray, at) = (&segment.ray, &segment.from);
        let exclude = Facet { shape: at.shape, prim: at.prim };
        let t = [0.0, f64::INFINITY];
        if segment.exact {
            let [o_p, d_p] = [ray.o, ray.d].map(|v| [0, 1].map(|k| v.partial(k)));
            let family = Family::new(ray.o.re(), o_p, ray.d.re(), d_p);
            let plane = (at.p.as_dvec3(), at.n_geo.as_dvec3());
            if let Some(view) = View::new(family, t).and_then(|view| view.beyond(plane.0, plane.1)) {
                return if all { self.all(&view, Some(exclude)) } else { self.any(&view, Some(exclude)) };
            }
        }
        // A smooth mesh goes on round the start with facets that the footprint covers, hundreds where they are small. What lies no farther
        // than the origins are apart the ray before has in its own footprint: the walk starts beyond.
        let mut t = t;
        if is_smooth(&self.scene.shapes[at.shape as usize].geometry) {
            let apart: f64 = (0..N).map(|k| ray.o.partial(k).norm2().sqrt()).sum();
            t[0] = segment.grow * apart / ray.d.re().norm2().sqrt();
        }
        // Only rays that come back to where they start: other surfaces may end, or bend, within the footprint.
        let third = third::<J, N>(ray);
        let own = || front().filter(|f| f.0 == at.shape);
        self.predict_in(ray, Question { t, exclude, round: false, grow: segment.grow + third, all, swaps: false }, own)
    }

    /// The segments that a smooth surface sends on, met at `at` and parameter `t`.
    fn branch<J: Jet<N, Primitive = f64>, const N: usize>(
        &self,
        segment: &Segment<J>,
        at: &SurfacePoint,
        t: f64,
        tree: &mut Tree<J>,
    ) {
        let shape = &self.scene.shapes[at.shape as usize];
        let ray = &segment.ray;
        let outside = from_dual(ray.d.re()).dot(at.n_geo.as_dvec3()) < 0.0;
        let Some(optics) = self.optics(shape.material as usize, outside) else { return };
        let (p, n) = surface::meet(shape, ray, at);
        let n = face_against(n, ray.d);
        let flat = is_flat(&shape.geometry);
        let first_order = J::NDERIV < 2 || is_smooth(&shape.geometry);
        let grow = if !flat && first_order { CURVED } else { segment.grow };
        if J::NDERIV < 2 && !flat && !is_smooth(&shape.geometry) && self.settings.order >= 2 {
            let turn: f64 = (0..N).map(|k| n.partial(k).norm2()).sum();
            if turn > TURN * TURN {
                tree.bends = true;
                return;
            }
        }
        let mut go = |o: Vec3<J>, d: Vec3<J>, start: f64, kind: Kinds| {
            if !tree.is_full() {
                let ray = Ray::new(o, d);
                let exact = start > 0.0;
                tree.todo.push(Segment { ray, start, seen: segment.seen | kind, from: *at, grow, exact });
            }
        };
        // The image of the origin, in the plane through the hit point.
        let image = || ray.o - n * (n.dot(ray.o - Vec3::lift(p.re())) * 2.0);
        let straight = flat && segment.exact;
        let mut mirror = || match straight {
            true => go(image(), reflect(ray.d, n), t, Kinds::MIRRORED),
            false => go(p, reflect(ray.d, n), 0.0, Kinds::MIRRORED),
        };
        match optics {
            Optics::Mirror => mirror(),
            Optics::Pane => {
                mirror();
                match straight {
                    true => go(ray.o, ray.d, t, Kinds::REFRACTED),
                    false => go(p, ray.d, 0.0, Kinds::REFRACTED),
                }
            }
            Optics::Glass(eta) => {
                let bent = refract(ray.d, n, if outside { 1.0 / eta } else { eta });
                let mut margin = bent.margin.expansion();
                if first_order {
                    margin.gradient = margin.gradient.map(|g| g * grow);
                }
                let total = bounds(&margin).then(|| margin.distance());
                mirror();
                if let Some(d) = bent.direction {
                    go(p, d, 0.0, Kinds::REFRACTED);
                }
                if let Some(distance) = total {
                    tree.found.kinds |= Kinds::TOTAL_REFLECTION;
                    tree.found.distance = tree.found.distance.min(distance);
                }
            }
        }
    }

    /// What a ray meets: parameter and point.
    fn meet(&self, ray: &PlainRay) -> Option<(f64, SurfacePoint)> {
        let Hit { t, u, v, shape, prim } = self.closest_seen(ray)?;
        let at = self.scene.shapes[shape as usize].surface_point(shape, prim, ray.o, ray.d, ShapeHit { t, u, v });
        Some((f64::from(t), at))
    }

    /// What a real ray sees at the ends of the same tree of segments, for the oracle (and what tracing them costs).
    pub(super) fn follow(&self, first: &PlainRay) -> ArrayVec<Option<SurfacePoint>, MOST_SEGMENTS> {
        let mut seen = ArrayVec::new();
        let mut todo = ArrayVec::<_, { MOST_SEGMENTS + 1 }>::new();
        todo.push((*first, false));
        let mut segments = 0;
        while let Some((ray, counts)) = todo.pop() {
            let hit = self.accel.closest(&ray).map(|Hit { t, u, v, shape, prim }| {
                self.scene.shapes[shape as usize].surface_point(shape, prim, ray.o, ray.d, ShapeHit { t, u, v })
            });
            if counts {
                segments += 1;
                seen.push(hit);
            }
            let Some(at) = hit else { continue };
            let outside = ray.d.dot(at.n_geo) < 0.0;
            let Some(optics) = self.optics(self.scene.shapes[at.shape as usize].material as usize, outside) else {
                continue;
            };
            let d = to_dual(ray.d.as_dvec3());
            let n = face_against(to_dual(at.n_shade.as_dvec3()).normalized(), d);
            let mut go = |d: Vec3<f64>| {
                if segments + todo.len() < MOST_SEGMENTS {
                    let d = from_dual(d).as_vec3();
                    let next = PlainRay::leaving(&at, d);
                    todo.push((next, true));
                }
            };
            match optics {
                Optics::Mirror => go(reflect(d, n)),
                Optics::Pane => {
                    go(reflect(d, n));
                    go(d);
                }
                Optics::Glass(eta) => {
                    go(reflect(d, n));
                    if let Some(d) = refract(d, n, if outside { 1.0 / eta } else { eta }).direction {
                        go(d);
                    }
                }
            }
        }
        seen
    }

    pub(super) fn optics(&self, material: usize, outside: bool) -> Option<Optics> {
        match &self.scene.materials[material] {
            Material::Conductor { .. } if outside => Some(Optics::Mirror),
            Material::Dielectric { eta, .. } => Some(Optics::Glass(f64::from(*eta))),
            Material::ThinDielectric { .. } => Some(Optics::Pane),
            // The back is turned around: its material meets the ray from its own outside.
            Material::TwoSided { front, back } => self.optics(if outside { *front } else { *back } as usize, true),
            _ => None,
        }
    }
}
