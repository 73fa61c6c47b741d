//! A scene with its acceleration structure: the questions that every random walk asks.

use super::light_tree::{LightTree, LitPoint};
use crate::accel::{Accel, Hit, Ray};
use crate::math::{Vec2, Vec3};
use crate::scene::shape::ShapeHit;
use crate::scene::{Bsdf, LightSample, Scene, SurfacePoint};

/// Shadow rays stop this much short of the lamp, relative to the distance, so that the lamp does not shadow itself.
const SHADOW_SHORTENING: f32 = 1e-4;
/// And this much, relative to the coordinates of its end: what rounding moves a lamp that is close.
const SHADOW_ROUNDING: f32 = 8.0 * f32::EPSILON;
/// Most surfaces a ray may pass straight through (masks, null surfaces) before it is given up.
pub const MAX_PASSED_SURFACES: u32 = 256;

/// A scene with its acceleration structure.
#[derive(Clone, Copy, Debug)]
pub struct World<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Ray queries over it.
    pub accel: &'a Accel,
    /// The tree over its lights; without one, lights are drawn by power.
    pub lights: Option<&'a LightTree>,
    any_passes_light: bool,
}

/// What a shadow ray found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Through {
    /// Share of the light that reaches the end: 0 or 1, or what masks and null surfaces let through.
    pub share: f32,
    /// Whether what blocks it scatters by Dirac lobes only (smooth glass, metal). Known only when asked for.
    pub blocked_by_specular: bool,
}

impl<'a> World<'a> {
    /// A scene and the structure that was built over its shapes.
    pub fn new(scene: &'a Scene, accel: &'a Accel) -> Self {
        World { scene, accel, lights: None, any_passes_light: scene.passes_light.iter().any(|&p| p) }
    }

    /// The same with a tree over the scene's lights.
    pub fn with_lights(self, lights: &'a LightTree) -> Self {
        World { lights: Some(lights), ..self }
    }

    /// What a camera ray shows first, behind lamps if these are hidden.
    pub fn first_seen(&self, mut ray: Ray, hide_emitters: bool) -> Option<SurfacePoint> {
        for _ in 0..=MAX_PASSED_SURFACES {
            let hit = self.accel.closest(&ray)?;
            let at = self.surface(&ray, &hit);
            if !hide_emitters || self.scene.shapes[at.shape as usize].emission.is_none() {
                return Some(at);
            }
            ray = Ray { tmax: ray.tmax - hit.t, ..Ray::leaving(&at, ray.d) };
        }
        None
    }

    /// A direction towards a light, weight and density with the probability of the light: by the tree if there is one, else by
    /// power. `None` counts as a sample of value 0.
    pub fn sample_light(&self, at: &LitPoint, u_light: f32, u: Vec2) -> Option<LightSample> {
        match self.lights {
            Some(tree) => tree.sample_light(self.scene, at, u_light, u),
            None => self.scene.lights.sample(&self.scene.shapes, self.scene.textures(), at.p, u_light, u),
        }
    }

    /// Density per solid angle with which [`Self::sample_light`] draws the point `lamp` of a lamp.
    pub fn light_pdf_dir_surface(&self, at: &LitPoint, lamp: &SurfacePoint) -> f32 {
        match self.lights {
            Some(tree) => tree.pdf_dir_surface(self.scene, at, lamp),
            None => self.scene.lights.pdf_dir_surface(&self.scene.shapes, at.p, lamp),
        }
    }

    /// Density per solid angle with which [`Self::sample_light`] draws the unit direction `w` into the environment.
    pub fn light_pdf_dir_environment(&self, at: &LitPoint, w: Vec3) -> f32 {
        match self.lights {
            Some(tree) => tree.pdf_dir_environment(self.scene, at, w),
            None => self.scene.lights.pdf_dir_environment(w),
        }
    }

    /// The surface point of a hit.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let at = ShapeHit { t: hit.t, u: hit.u, v: hit.v };
        self.scene.shapes[hit.shape as usize].surface_point(hit.shape, hit.prim, ray.o, ray.d, at)
    }

    /// The material there, seen from `wo` (away from the surface).
    pub fn bsdf(&self, at: &SurfacePoint, wo: Vec3) -> Bsdf {
        let scene = self.scene;
        Bsdf::new(&scene.materials, scene.shapes[at.shape as usize].material, scene.textures(), at, wo)
    }

    /// Whether rays may pass straight through the shape: a mask or a null surface.
    pub fn passes_light(&self, shape: u32) -> bool {
        self.any_passes_light && self.scene.passes_light[self.scene.shapes[shape as usize].material as usize]
    }

    /// The segment from a surface point along the unit vector `wi` to a light at `distance`, for [`Self::transmittance`].
    ///
    /// It starts a little off the surface and aims at the same point of the light from there: seen from close by, that point lies in another
    /// direction and at another distance. What is closer to that point than rounding of coordinates tells is not seen.
    pub fn shadow_ray(&self, at: &SurfacePoint, wi: Vec3, distance: f32) -> Ray {
        let ray = Ray::leaving(at, wi);
        if distance == f32::INFINITY {
            return ray;
        }
        let end = at.p + wi * distance;
        let to_end = end - ray.o;
        let length = to_end.length();
        let short = SHADOW_SHORTENING * length + SHADOW_ROUNDING * end.abs().max_element();
        if length > short { Ray { d: to_end / length, tmax: length - short, ..ray } } else { Ray { tmax: 0.0, ..ray } }
    }

    /// What of the light reaches the end of a shadow ray. With `probe` it is found out what blocks it, at the price of a
    /// closest-hit query.
    pub fn transmittance(&self, mut ray: Ray, probe: bool) -> Through {
        let through = |share: f32| Through { share, blocked_by_specular: false };
        if !self.any_passes_light && !probe {
            return through(if self.accel.occluded(&ray) { 0.0 } else { 1.0 });
        }
        let mut share = 1.0;
        for _ in 0..MAX_PASSED_SURFACES {
            let Some(hit) = self.accel.closest(&ray) else { return through(share) };
            let passes = self.passes_light(hit.shape);
            if !passes && !probe {
                return through(0.0);
            }
            let at = self.surface(&ray, &hit);
            let bsdf = self.bsdf(&at, -ray.d);
            share *= if passes { bsdf.straight_through() } else { 0.0 };
            if share <= 0.0 {
                return Through { share: 0.0, blocked_by_specular: probe && bsdf.is_delta() };
            }
            ray = Ray { tmax: ray.tmax - hit.t, ..Ray::leaving(&at, ray.d) };
        }
        through(0.0)
    }
}

/// Power heuristic with beta = 2 for one sample each (Veach 1997, eq. 9.11), safe for infinite densities.
pub fn power_heuristic(pdf: f32, other: f32) -> f32 {
    let ratio = other / pdf;
    if pdf > 0.0 { 1.0 / (1.0 + ratio * ratio) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DMat4, DVec3, Sampler};
    use crate::scene::description::*;
    use crate::transport::tests::{Room, add, diffuse, empty, square};

    /// A small lamp at a slant beside a wall, a few units of `scale` from the origin; `shade` stands halfway between them.
    fn lamp_beside_a_wall(scale: f64, clearance: f64, shade: bool) -> Room {
        let mut desc = empty();
        let grey = diffuse(&mut desc, 0.5);
        let place = scale * DVec3::new(7.82, 3.13, 5.86);
        add(&mut desc, GeometryDesc::Rectangle, square(place, -DVec3::X, scale), grey);
        let lamp = place - clearance * DVec3::X;
        add(
            &mut desc,
            GeometryDesc::Rectangle,
            square(lamp, DVec3::new(1.0, 0.3, 0.2).normalize(), 0.3 * clearance),
            grey,
        );
        desc.shapes[1].emission = Some(crate::scene::Color::Constant(crate::math::Rgb::ONE));
        if shade {
            let halfway = DMat4::from_translation(0.5 * clearance * DVec3::X);
            add(&mut desc, GeometryDesc::Rectangle, halfway * square(lamp, DVec3::X, clearance), grey);
        }
        Room::new(desc)
    }

    #[test]
    fn a_lamp_does_not_shadow_itself_however_close_it_is() {
        for (scale, part) in [(1.0, 1e-3), (1.0, 1e-2), (1.0, 0.1), (1e-3, 1e-2), (1e4, 1e-2)] {
            let clearance = scale * part;
            for shade in [false, true] {
                let room = lamp_beside_a_wall(scale, clearance, shade);
                let (world, scene) = (room.world(), &room.scene);
                let (mut lit, mut all) = (0, 0);
                for k in 0..500 {
                    let mut rng = Sampler::new(3, 0, k);
                    let spread = (rng.next_2d() * 2.0 - 1.0) * clearance as f32;
                    let place = Vec3::new(7.82, 3.13, 5.86) * scale as f32;
                    let o = place + Vec3::new(-0.2 * clearance as f32, spread.x, spread.y);
                    let ray = Ray { o, d: Vec3::X, tmin: 0.0, tmax: f32::INFINITY };
                    let at = world.surface(&ray, &room.accel.closest(&ray).expect("the wall"));
                    let lights = 0..scene.lights.emitter_count() as u32;
                    let views = lights.filter_map(|e| scene.lights.view(&scene.shapes, scene.textures(), e, at.p));
                    for view in views.filter(|v| !v.is_delta()) {
                        let Some(s) = view.sample(rng.next_2d()) else { continue };
                        all += 1;
                        lit +=
                            u32::from(world.transmittance(world.shadow_ray(&at, s.wi, s.distance), false).share > 0.0);
                    }
                }
                assert_eq!(all, 500);
                assert_eq!(lit, if shade { 0 } else { all }, "scale {scale}, clearance {clearance}");
            }
        }
    }

    #[test]
    fn power_heuristic_is_a_partition_of_unity() {
        for (a, b) in [(1.0, 3.0), (1e-20, 1e20), (1e20, 1e-20), (2.0, 2.0), (5.0, 0.0)] {
            let sum = power_heuristic(a, b) + power_heuristic(b, a);
            assert!((sum - 1.0).abs() < 1e-6, "{a} {b}: {sum}");
        }
        assert_eq!(power_heuristic(1.0, f32::INFINITY), 0.0);
        assert_eq!(power_heuristic(0.0, 1.0), 0.0);
    }
}
