//! Chains through mirrors and glass: what a footprint sees by reflection and refraction.
//!
//! The centre ray is traced; at each smooth surface the duals of all N parameters flow through hit point, normal (interpolated, on
//! smooth meshes) and direction, and every new segment gets its own walk with the widened, transported rays
//! ([`EdgeDetector::predict`]). Dielectrics branch; [`MOST_SEGMENTS`] limits the tree. Total internal reflection is an event where its margin
//! may vanish. Source: Igehy 1999; METHODS 3.B.
//! Predictions, since the origin moves: not exact. Not handled: coats of plastics, rough surfaces, bump maps.

use super::kinds::{Events, Kinds, Verdict};
use super::predicted::D1;
use super::view::{from_dual, to_dual};
use super::{EdgeDetector, Facet, NOTHING, surface};
use crate::accel::{Hit, Ray as PlainRay};
use crate::scene::shape::ShapeHit;
use crate::scene::{Geometry, Material, SurfacePoint};
use dualux_dual::{Jet, Ray, Vec3, bounds, face_against, reflect, refract};

/// Segments followed behind a pixel, at most.
pub const MOST_SEGMENTS: usize = 8;

/// By how much footprints are enlarged behind curved surfaces: curvature is not in the first order.
const CURVED: f64 = 1.25;

/// How a smooth surface sends rays on.
pub(super) enum Optics {
    Mirror,
    /// Index inside over outside.
    Glass(f64),
    Pane,
}

/// A segment still to be looked along.
struct Segment<const N: usize> {
    ray: Ray<D1<N>>,
    t: [f64; 2],
    /// How it got there.
    seen: Kinds,
    from: Option<SurfacePoint>,
    /// By how much its footprint is enlarged.
    grow: f64,
}

impl EdgeDetector<'_> {
    /// Whether a surface turns rays of all places alike.
    fn is_flat(&self, at: &SurfacePoint) -> bool {
        match &self.scene.shapes[at.shape as usize].geometry {
            Geometry::Rectangle(_) | Geometry::Disk(_) => true,
            Geometry::Mesh(mesh) => mesh.normals.is_empty(),
            Geometry::Sphere(_) | Geometry::Cylinder(_) => false,
        }
    }

    /// Events seen through specular chains that start with the given rays; their kinds hold `MIRRORED` or `REFRACTED`.
    /// Nothing if the first surface is not smooth.
    pub fn chain<const N: usize>(&self, first: &Ray<D1<N>>, t: [f64; 2]) -> Events {
        let mut found = NOTHING;
        let mut todo = arrayvec::ArrayVec::<Segment<N>, MOST_SEGMENTS>::new();
        todo.push(Segment { ray: *first, t, seen: Kinds::NONE, from: None, grow: 1.0 });
        let mut segments = 0;
        while let Some(Segment { ray, t, seen, from, grow }) = todo.pop() {
            let hit = self.meet(&ray, t, from.as_ref());
            if let Some(at) = &from {
                segments += 1;
                let front = hit.as_ref().map(|(t, at)| (at.shape, *t));
                let facet = Facet { shape: at.shape, prim: at.prim };
                let verdict = self.predict_in(&ray, t, Some(facet), front, false, grow);
                if verdict != Verdict::Clear {
                    found.kinds |= verdict.kinds() | seen;
                    found.distance = found.distance.min(verdict.distance());
                }
            }
            let Some((_, at)) = hit else { continue };
            let Some((optics, p, n)) = self.surface(&ray, &at) else { continue };
            let n = face_against(n, ray.d);
            let outside = from_dual(ray.d.re()).dot(at.n_geo.as_dvec3()) < 0.0;
            let grow = if self.is_flat(&at) { grow } else { CURVED };
            let mut go = |d: Vec3<D1<N>>, kind: Kinds| {
                if segments + todo.len() < MOST_SEGMENTS {
                    let (ray, t) = (Ray::new(p, d), [0.0, f64::INFINITY]);
                    let _ = todo.try_push(Segment { ray, t, seen: seen | kind, from: Some(at), grow });
                }
            };
            match optics {
                Optics::Mirror => go(reflect(ray.d, n), Kinds::MIRRORED),
                Optics::Pane => {
                    go(reflect(ray.d, n), Kinds::MIRRORED);
                    go(ray.d, Kinds::REFRACTED);
                }
                Optics::Glass(eta) => {
                    let bent = refract(ray.d, n, if outside { 1.0 / eta } else { eta });
                    let margin = bent.margin.expansion();
                    if bounds(&margin) {
                        found.kinds |= Kinds::TOTAL_REFLECTION;
                        found.distance = found.distance.min(margin.distance());
                    }
                    go(reflect(ray.d, n), Kinds::MIRRORED);
                    if let Some(d) = bent.direction {
                        go(d, Kinds::REFRACTED);
                    }
                }
            }
        }
        found
    }

    /// What the centre ray meets: parameter and point.
    fn meet<const N: usize>(
        &self,
        ray: &Ray<D1<N>>,
        t: [f64; 2],
        from: Option<&SurfacePoint>,
    ) -> Option<(f64, SurfacePoint)> {
        let (o, d) = (from_dual(ray.o.re()).as_vec3(), from_dual(ray.d.re()).as_vec3());
        let (o, tmin) = from.map_or((o, t[0] as f32), |at| (at.spawn_origin(d), f32::MIN_POSITIVE));
        let Hit { t, u, v, shape, prim } = self.accel.closest(&PlainRay { o, d, tmin, tmax: t[1] as f32 })?;
        let at = self.scene.shapes[shape as usize].surface_point(shape, prim, o, d, ShapeHit { t, u, v });
        Some((f64::from(t), at))
    }

    /// What a real ray sees at the ends of the same tree of segments, for the oracle.
    pub(super) fn follow(&self, first: &PlainRay) -> Vec<Option<SurfacePoint>> {
        let mut seen = Vec::new();
        let mut todo = vec![(*first, false)];
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

    /// Optics, hit point and unit normal of a smooth surface, with derivatives, on the known primitive.
    fn surface<const N: usize>(
        &self,
        ray: &Ray<D1<N>>,
        at: &SurfacePoint,
    ) -> Option<(Optics, Vec3<D1<N>>, Vec3<D1<N>>)> {
        let shape = &self.scene.shapes[at.shape as usize];
        let outside = from_dual(ray.d.re()).dot(at.n_geo.as_dvec3()) < 0.0;
        let optics = self.optics(shape.material as usize, outside)?;
        let (p, n) = surface::meet(shape, ray, at);
        Some((optics, p, n))
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
