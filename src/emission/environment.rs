//! Rays that start on a disk across their own direction: spheres, and lights at infinity.
//!
//! A direction d is drawn first, then a point of the disk round the sphere's centre, c + R (x s + y t) with s, t across d. A sphere that
//! emits outwards is left at c + R (x s + y t + z d), z = sqrt(1 - x^2 - y^2); one that emits inwards is entered at -z; what comes from
//! infinity starts on the plane that stands [`AWAY`] radii of the scene's bounding sphere before its centre, and meets that sphere.

use super::source::{Drawn, Start};
use super::warp::{self, Mapped};
use crate::math::{DVec3, Rgb, Vec2};
use crate::scene::light::Environment;
use crate::scene::shape::{ShapeHit, Sphere};
use crate::scene::{Scene, SurfacePoint};
use std::f64::consts::{PI, TAU};

/// Distance of the starting plane from the centre of the scene, in radii of its bounding sphere.
pub const AWAY: f64 = 1.01;

/// Smallest height over the disk that is divided by: footprints along the ray itself mean nothing.
const GRAZING: f64 = 1e-3;

/// A disk across `d`: offset of the point `u` from its centre, in radii, with derivatives by u0, u1 and the two of the direction.
fn across(d: DVec3, d_v: [DVec3; 2], u: [f64; 2]) -> (DVec3, [DVec3; 4], Mapped<[f64; 2]>) {
    let q = warp::disk(u);
    let [s, t] = warp::frame(d, d_v);
    let [x, y] = q.at;
    let u_k = |k: usize| s.at * q.by[k][0] + t.at * q.by[k][1];
    let v_k = |k: usize| s.by[k] * x + t.by[k] * y;
    (s.at * x + t.at * y, [u_k(0), u_k(1), v_k(0), v_k(1)], q)
}

/// Position numbers of the line through `o` (relative to the centre, in radii) along `d`; `None` off the disk.
fn invert_across(o: DVec3, d: DVec3) -> Option<[f64; 2]> {
    let [s, t] = warp::frame(d, [DVec3::ZERO; 2]);
    let q = [o.dot(s.at), o.dot(t.at)];
    (q[0].hypot(q[1]) <= 1.0 + 1e-5).then(|| warp::invert_disk(q))
}

/// A sphere that emits.
#[derive(Clone, Debug)]
pub struct Ball<'a> {
    scene: &'a Scene,
    /// Index of the shape.
    pub shape: u32,
    /// Centre.
    pub centre: DVec3,
    /// Radius.
    pub radius: f64,
    /// Emits inwards.
    pub inwards: bool,
}

impl<'a> Ball<'a> {
    /// Shape `shape`, whose geometry is `sphere`.
    pub fn new(scene: &'a Scene, shape: u32, sphere: &Sphere) -> Self {
        let (centre, radius) = (sphere.center.as_dvec3(), f64::from(sphere.radius));
        Ball { scene, shape, centre, radius, inwards: sphere.flip }
    }

    /// The surface point in unit direction `out` from the centre.
    fn surface(&self, out: DVec3) -> SurfacePoint {
        let hit = ShapeHit { t: self.radius as f32, u: 0.0, v: 0.0 };
        let shape = &self.scene.shapes[self.shape as usize];
        shape.surface_point(self.shape, 0, self.centre.as_vec3(), out.as_vec3(), hit)
    }

    /// The ray of number `u`.
    pub fn start(&self, u: [f64; 2], drawn: &Drawn) -> Start {
        let (d, d_v) = (drawn.w.at, drawn.w.by);
        let (q, q_u, flat) = across(d, d_v, u);
        let z = warp::height(&flat);
        let side = if self.inwards { -1.0 } else { 1.0 };
        let at = self.surface((q + d * (side * z.at)).normalize());
        let color = self.scene.shapes[self.shape as usize].emission.as_ref();
        let radiance = color.map_or(Rgb::ZERO, |c| self.scene.textures().color(c, at.uv));
        let r = self.radius;
        // z' = -q.q' / z
        let z_u = |k: usize| z.by[k] * z.at / z.at.max(GRAZING);
        let zero = DVec3::ZERO;
        Start {
            o: at.spawn_origin(d.as_vec3()),
            d,
            value: radiance * (PI * r * r) as f32,
            o_u: [
                (q_u[0] + d * (side * z_u(0))) * r,
                (q_u[1] + d * (side * z_u(1))) * r,
                (q_u[2] + d_v[0] * (side * z.at)) * r,
                (q_u[3] + d_v[1] * (side * z.at)) * r,
            ],
            d_u: [zero, zero, d_v[0], d_v[1]],
        }
    }

    /// The numbers of the ray through `o` along `d`.
    pub fn invert(&self, o: DVec3, d: DVec3) -> Option<[f64; 4]> {
        let [u0, u1] = invert_across((o - self.centre) / self.radius, d)?;
        let [v0, v1] = warp::invert_sphere(d);
        Some([u0, u1, v0, v1])
    }
}

/// A light at infinity.
#[derive(Clone, Debug)]
pub struct Infinity<'a> {
    scene: &'a Scene,
    light: &'a Environment,
    /// Centre of the scene.
    pub centre: DVec3,
    /// Radius of its bounding sphere.
    pub radius: f64,
    /// Distance of the starting plane from the centre.
    pub away: f64,
}

impl<'a> Infinity<'a> {
    /// An environment of a scene.
    pub fn new(scene: &'a Scene, light: &'a Environment) -> Self {
        let (centre, radius) = (scene.bounds.0.as_dvec3(), f64::from(scene.bounds.1));
        Infinity { scene, light, centre, radius, away: AWAY * radius }
    }

    /// Whether directions pass through a table.
    pub fn is_tabulated(&self) -> bool {
        matches!(self.light, Environment::Map(_))
    }

    /// Draws a direction.
    pub fn direction(&self, v: [f64; 2]) -> Drawn {
        match self.light {
            Environment::Constant { .. } => Drawn { w: warp::sphere(v), per_pdf: 2.0 * TAU },
            Environment::Map(map) => {
                let drawn = map.drawn(Vec2::new(v[0] as f32, v[1] as f32));
                let per_pdf = if drawn.pdf_dir > 0.0 { 1.0 / drawn.pdf_dir } else { 0.0 };
                Drawn { w: Mapped { at: -drawn.w, by: drawn.w_u.map(|w| -w) }, per_pdf }
            }
        }
    }

    /// The ray of number `u`.
    pub fn start(&self, u: [f64; 2], drawn: &Drawn) -> Start {
        let (d, d_v) = (drawn.w.at, drawn.w.by);
        let (q, q_u, _) = across(d, d_v, u);
        let r = self.radius;
        let radiance = self.light.radiance(&self.scene.images, -d.as_vec3());
        let zero = DVec3::ZERO;
        Start {
            o: (self.centre + q * r - d * self.away).as_vec3(),
            d,
            value: radiance * (PI * r * r) as f32,
            o_u: [q_u[0] * r, q_u[1] * r, q_u[2] * r - d_v[0] * self.away, q_u[3] * r - d_v[1] * self.away],
            d_u: [zero, zero, d_v[0], d_v[1]],
        }
    }

    /// The numbers of the ray through `o` along `d`.
    pub fn invert(&self, o: DVec3, d: DVec3) -> Option<[f64; 4]> {
        let [u0, u1] = invert_across((o - self.centre) / self.radius, d)?;
        let [v0, v1] = match self.light {
            Environment::Constant { .. } => warp::invert_sphere(d),
            Environment::Map(map) => map.invert(-d.as_vec3()).as_dvec2().to_array(),
        };
        Some([u0, u1, v0, v1])
    }
}
