//! Rays of lights without extent: points, spots, parallel light.
//!
//! A spot's directions follow its profile (linear fall-off in the angle), so that its flux is constant but for a texture. Parallel light
//! starts on a disk across its direction that just covers the scene's bounding sphere.

use super::environment::AWAY;
use super::source::{Drawn, Start};
use super::warp::{self, Mapped, Profile};
use crate::math::DVec3;
use crate::scene::Scene;
use crate::scene::light::DeltaLight;
use std::f64::consts::{PI, TAU};

/// A light without extent.
#[derive(Clone, Debug)]
pub struct Delta<'a> {
    scene: &'a Scene,
    /// The light.
    pub light: &'a DeltaLight,
    /// Of a spot.
    pub profile: Option<Profile>,
    /// Centre of the scene.
    pub centre: DVec3,
    /// Radius of the scene's bounding sphere.
    pub radius: f64,
    /// Distance of the starting plane of parallel light from the centre.
    pub away: f64,
}

impl<'a> Delta<'a> {
    /// A light of a scene.
    pub fn new(scene: &'a Scene, light: &'a DeltaLight) -> Self {
        let (centre, radius) = (scene.bounds.0.as_dvec3(), f64::from(scene.bounds.1));
        let profile = match light {
            DeltaLight::Spot { cutoff, beam, .. } => Some(Profile::new(f64::from(*beam), f64::from(*cutoff))),
            _ => None,
        };
        Delta { scene, light, profile, centre, radius, away: AWAY * radius }
    }

    /// Solid angle, weighted by a spot's profile; 1 for parallel light.
    pub fn solid_angle(&self) -> f64 {
        match (&self.profile, self.light) {
            (Some(profile), _) => profile.solid_angle(),
            (None, DeltaLight::Directional { .. }) => 1.0,
            (None, _) => 2.0 * TAU,
        }
    }

    /// Draws a direction; a spot's in its own frame.
    pub fn direction(&self, v: [f64; 2]) -> Drawn {
        match (&self.profile, self.light) {
            (Some(profile), _) => {
                let w = profile.direction(v);
                let intensity = profile.intensity(w.at.x.hypot(w.at.y).atan2(w.at.z));
                let per_pdf = if intensity > 0.0 { profile.solid_angle() / intensity } else { 0.0 };
                Drawn { w, per_pdf }
            }
            (None, DeltaLight::Directional { direction, .. }) => {
                let at = direction.as_dvec3();
                Drawn { w: Mapped { at, by: [DVec3::ZERO; 2] }, per_pdf: 1.0 }
            }
            (None, _) => Drawn { w: warp::sphere(v), per_pdf: 2.0 * TAU },
        }
    }

    /// The ray of number `u`.
    pub fn start(&self, u: [f64; 2], drawn: &Drawn) -> Start {
        let zero = DVec3::ZERO;
        let Mapped { at: w, by } = drawn.w;
        match self.light {
            DeltaLight::Point { position, intensity } => {
                Start { o: *position, d: w, value: *intensity, o_u: [zero; 4], d_u: [zero, zero, by[0], by[1]] }
            }
            DeltaLight::Spot { position, to_local, intensity, .. } => {
                let to_world = to_local.transpose().as_dmat3();
                let d = to_world * w;
                let value = *intensity * self.light.spot_factor(self.scene.textures(), d.as_vec3());
                let [a, b] = by.map(|w| to_world * w);
                Start { o: *position, d, value, o_u: [zero; 4], d_u: [zero, zero, a, b] }
            }
            DeltaLight::Directional { irradiance, .. } => {
                let q = warp::disk(u);
                let [s, t] = warp::frame(w, [zero; 2]);
                let r = self.radius;
                let offset = |[x, y]: [f64; 2]| (s.at * x + t.at * y) * r;
                Start {
                    o: (self.centre - w * self.away + offset(q.at)).as_vec3(),
                    d: w,
                    value: *irradiance * (PI * r * r) as f32,
                    o_u: [offset(q.by[0]), offset(q.by[1]), zero, zero],
                    d_u: [zero; 4],
                }
            }
        }
    }

    /// The numbers of the ray through `o` along `d`.
    pub fn invert(&self, o: DVec3, d: DVec3) -> Option<[f64; 4]> {
        let half = |[v0, v1]: [f64; 2]| Some([0.5, 0.5, v0, v1]);
        match (self.light, &self.profile) {
            (DeltaLight::Spot { to_local, .. }, Some(profile)) => {
                let w = to_local.as_dmat3() * d;
                let inside = profile.intensity(w.x.hypot(w.y).atan2(w.z)) > 0.0;
                inside.then(|| half(profile.invert(w))).flatten()
            }
            (DeltaLight::Directional { direction, .. }, _) => {
                let [s, t] = warp::frame(direction.as_dvec3(), [DVec3::ZERO; 2]);
                let q = (o - self.centre) / self.radius;
                let q = [q.dot(s.at), q.dot(t.at)];
                let [u0, u1] = (q[0].hypot(q[1]) <= 1.0 + 1e-5).then(|| warp::invert_disk(q))?;
                Some([u0, u1, 0.5, 0.5])
            }
            _ => half(warp::invert_sphere(d)),
        }
    }
}
