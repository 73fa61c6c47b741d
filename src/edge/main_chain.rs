//! The likeliest way of a ray through mirrors and glass, with derivatives or without: to where it meets something else.
//!
//! Mirrors reflect, panes let pass, glass refracts, or reflects all where it must. With duals the end comes with its derivatives by the
//! parameters of the ray, with plain numbers it is that of a real ray: their difference over a footprint is what the first order leaves
//! out. Source: Igehy 1999. Not handled: the fainter branch of glass, rough surfaces (ways end there), bump maps.
//! Verified by the tests of `emission::linearisation` and those of `transport`, which trace the same chains.

use super::chain::{MOST_SEGMENTS, Optics};
use super::view::{from_dual, to_dual};
use super::{EdgeDetector, surface};
use crate::accel::Ray as PlainRay;
use crate::scene::shape::ShapeHit;
use dualux_dual::{Ray, Real, Vec3, face_against, reflect, refract};

/// Where a way ends.
#[derive(Clone, Copy, Debug)]
pub struct End<J> {
    /// Point, with derivatives.
    pub p: Vec3<J>,
    /// The shapes it went by and what they did, as a number: equal for rays of the same kind of way.
    pub way: u64,
}

impl EdgeDetector<'_> {
    /// Follows `ray` from `start`, its ray parameter there, and `None` if it leaves the scene or does not end.
    pub fn follow_main<J: Real<Primitive = f64>>(&self, mut ray: Ray<J>, start: f64) -> Option<End<J>> {
        let [o, d] = [ray.o, ray.d].map(|v| from_dual(v.re()).as_vec3());
        let mut plain = PlainRay { o, d, tmin: start as f32, tmax: f32::INFINITY };
        let mut way = 0u64;
        for _ in 0..=MOST_SEGMENTS {
            let hit = self.accel.closest(&plain)?;
            let (u, v, t) = (hit.u, hit.v, hit.t);
            let shape = &self.scene.shapes[hit.shape as usize];
            let at = shape.surface_point(hit.shape, hit.prim, plain.o, plain.d, ShapeHit { t, u, v });
            let outside = plain.d.dot(at.n_geo) < 0.0;
            let (p, n) = surface::meet(shape, &ray, &at);
            let mut turn = |kind: u64| way = crate::math::sampler::hash(way, u64::from(hit.shape) << 2 | kind);
            let Some(optics) = self.optics(shape.material as usize, outside) else {
                turn(0);
                return Some(End { p, way });
            };
            let n = face_against(n, ray.d);
            let d = match optics {
                Optics::Mirror => {
                    turn(1);
                    reflect(ray.d, n)
                }
                Optics::Pane => {
                    turn(2);
                    ray.d
                }
                Optics::Glass(eta) => match refract(ray.d, n, if outside { 1.0 / eta } else { eta }).direction {
                    Some(d) => {
                        turn(2);
                        d
                    }
                    None => {
                        turn(1);
                        reflect(ray.d, n)
                    }
                },
            };
            ray = Ray::new(p, d);
            plain = PlainRay::leaving(&at, from_dual(d.re()).as_vec3());
        }
        None
    }
}

/// The ray of plain numbers through `o` along `d`.
pub fn plain(o: crate::math::DVec3, d: crate::math::DVec3) -> Ray<f64> {
    Ray::new(to_dual(o), to_dual(d))
}
