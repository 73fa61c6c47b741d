//! Virtual point lights on emitters: direct light by the same sums as indirect light.
//!
//! ```text
//! point k of N: light i with probability p_i = power_i / sum, where (k + u) / N falls among the running sums;  y uniform on the light
//! I_n = Le(y) A_i / (N p_i)        intensity along the normal there; point lights are lights by themselves, each in every pass
//! ```
//!
//! What is left of (k + u) / N within its light is the first number of the point, the radical inverse of k the second: points of a large lamp are a
//! Hammersley set, shifted from pass to pass. Discs of area A/pi and what they leave out as in [`super::vpl`]: a ray that meets the lamp counts c(r).
//! Textured lamps: drawn by their table, which `value` takes into account.
//! Measure     probabilities of lights; positions per area
//! Source      Keller 1997: lamps are the first virtual lights. Bias: as `vpl`
//! Not handled spots, parallel light and environments: light sampling keeps them ([`EmitterVpls::takes`])
//! Verified by `tests` (flux through a sphere, spread over lamps), tests/many_light.rs: agreement with paths

use super::vpl::{Area, Vpl};
use crate::emission::Source;
use crate::math::Rgb;
use crate::math::sampler::{hash, unit_f64};
use crate::scene::Scene;
use crate::scene::light::{DeltaLight, LightKind};
use std::f64::consts::FRAC_1_PI;

/// Separates shifts of points from other random numbers.
const STREAM: u64 = 0x6c61_6d70_7670_6c73; // "lampvpls"
/// A lamp is drawn as if its power were at least this share of the mean: powers of textured lamps are estimates.
const FLOOR: f64 = 0.1;

/// Makes the lights on emitters of each pass.
#[derive(Debug)]
pub struct EmitterVpls<'a> {
    lamps: Vec<Source<'a>>,
    /// Running sums of the probabilities of lamps, from 0 to 1.
    cdf: Vec<f64>,
    points: Vec<Vpl>,
    /// Points on lamps, a pass.
    count: usize,
    seed: u64,
}

impl<'a> EmitterVpls<'a> {
    /// About `count` points on lamps, and all point lights. `None` if there is neither.
    pub fn new(scene: &'a Scene, count: usize, seed: u64) -> Option<Self> {
        let (mut lamps, mut weights, mut points) = (Vec::new(), Vec::new(), Vec::new());
        for (light, info) in scene.lights.infos.iter().enumerate() {
            match scene.lights.kind(light) {
                LightKind::Lamp(_) => {
                    lamps.push(Source::new(scene, light as u32));
                    weights.push(f64::from(info.power.element_sum()).max(0.0));
                }
                LightKind::Delta(DeltaLight::Point { position, intensity }) => {
                    points.push(Vpl::isotropic(*position, *intensity));
                }
                _ => {}
            }
        }
        let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
        let floored = |w: &f64| if w.is_finite() { w.max(FLOOR * mean) } else { mean };
        let total: f64 = weights.iter().map(floored).sum();
        let mut run = 0.0;
        let cdf: Vec<f64> =
            std::iter::once(0.0).chain(weights.iter().map(|w| (run += floored(w) / total, run).1)).collect();
        let any = !points.is_empty() || (total > 0.0 && count > 0);
        any.then_some(EmitterVpls { lamps, cdf, points, count, seed })
    }

    /// Whether light number `emitter` of the scene's emitters is one of these, so that light sampling must leave it out.
    pub fn takes(scene: &Scene, emitter: u32) -> bool {
        let lights = &scene.lights;
        lights.emitter_surface(emitter).is_some() || lights.is_point(emitter)
    }

    /// Mean area of lamps that a point stands for.
    pub fn mean_area(&self) -> f32 {
        let area: f64 = self.lamps.iter().map(Source::surface_area).sum();
        (area / self.count.max(1) as f64) as f32
    }

    /// The lights of a pass: a pure function of settings and pass.
    pub fn lights(&self, area: Area, pass: u64) -> Vec<Vpl> {
        let mut out = self.points.clone();
        if self.lamps.is_empty() {
            return out;
        }
        let key = hash(hash(self.seed, STREAM), pass);
        let [shift0, shift1] = [1, 2].map(|k| unit_f64(hash(key, k)));
        for k in 0..self.count {
            let x = (k as f64 + shift0) / self.count as f64;
            let lamp = (self.cdf.partition_point(|c| *c <= x)).clamp(1, self.lamps.len()) - 1;
            let (lo, p) = (self.cdf[lamp], self.cdf[lamp + 1] - self.cdf[lamp]);
            let u0 = ((x - lo) / p).clamp(0.0, 1.0 - f64::EPSILON);
            let u1 = ((k as u64).reverse_bits() as f64 * 2f64.powi(-64) + shift1).fract();
            let Some((at, n, intensity)) = self.lamps[lamp].surface_point([u0, u1]) else { continue };
            let share = 1.0 / (self.count as f64 * p);
            let radius2 = match area {
                Area::One(area) => f64::from(area) * FRAC_1_PI,
                Area::Own(factor) => f64::from(factor) * self.lamps[lamp].surface_area() * share * FRAC_1_PI,
            };
            let power = intensity * share as f32;
            if power.is_finite() && power != Rgb::ZERO {
                let mut light = Vpl::lambertian(at, n, power, radius2 as f32);
                light.segments = 0;
                out.push(light);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DMat4, DVec3, Vec3};
    use crate::scene::description::{GeometryDesc, LightDesc};
    use crate::scene::texture::Color;
    use crate::transport::tests::{add, diffuse, empty, square};
    use crate::transport::vpl::Vpls;

    fn scene() -> Scene {
        let mut scene = empty();
        scene.lights.clear();
        let black = diffuse(&mut scene, 0.0);
        let mut add_lamp = |geometry, at, radiance| {
            add(&mut scene, geometry, at, black);
            scene.shapes.last_mut().unwrap().emission = Some(Color::Constant(Rgb::splat(radiance)));
        };
        add_lamp(GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 0.5), 3.0);
        let ball = GeometryDesc::Sphere { center: DVec3::new(4.0, 0.0, 0.0), radius: 0.3 };
        add_lamp(ball, DMat4::IDENTITY, 2.0);
        scene.lights.push(LightDesc::Point { position: DVec3::new(-4.0, 0.0, 0.0), intensity: Rgb::splat(0.7) });
        Scene::new(scene).unwrap()
    }

    /// Flux through a large sphere around everything, from many points of it.
    fn flux(lights: Vec<Vpl>) -> f64 {
        let lights = Vpls::from_lights(lights);
        let n = 20_000;
        let (radius, mut sum) = (1e3f64, 0.0);
        for i in 0..n {
            let u = [1, 2].map(|k| unit_f64(hash(i, k)));
            let (z, phi) = (1.0 - 2.0 * u[0], std::f64::consts::TAU * u[1]);
            let r = (1.0 - z * z).sqrt();
            let p = (DVec3::new(r * phi.cos(), r * phi.sin(), z) * radius).as_vec3();
            for l in &lights.lights {
                let d: Vec3 = p - l.p;
                sum += f64::from(lights.arriving(l, d, d.length_squared()).x);
            }
        }
        sum * 4.0 * std::f64::consts::PI * radius * radius / n as f64
    }

    #[test]
    fn they_emit_what_the_emitters_do() {
        let scene = scene();
        let power: f64 = scene.lights.infos.iter().map(|l| f64::from(l.power.x)).sum();
        for pass in 0..3 {
            let lights = EmitterVpls::new(&scene, 64, 5).unwrap().lights(Area::One(0.0), pass);
            let measured = flux(lights);
            assert!((measured / power - 1.0).abs() < 0.02, "{measured} {power}");
        }
    }

    #[test]
    fn points_lie_evenly_on_the_lamps() {
        let scene = scene();
        let source = EmitterVpls::new(&scene, 400, 5).unwrap();
        let lights = source.lights(Area::One(0.01), 1);
        let on_square: Vec<&Vpl> = lights.iter().filter(|l| l.p.x.abs() < 1.0).collect();
        let share = on_square.len() as f64 / 400.0;
        let powers: Vec<f64> = scene.lights.infos.iter().take(2).map(|l| f64::from(l.power.x)).collect();
        assert!((share - powers[0] / (powers[0] + powers[1])).abs() < 0.01, "{share}");
        assert!(on_square.iter().all(|l| l.n.distance(Vec3::Y) < 1e-5 && l.p.y.abs() < 1e-3));
        let quarter = on_square.iter().filter(|l| l.p.x > 0.0 && l.p.z > 0.0).count() as f64;
        assert!((quarter / on_square.len() as f64 - 0.25).abs() < 0.03, "{quarter}");
        let ball = lights.iter().filter(|l| l.p.x > 3.0);
        assert!(ball.clone().all(|l| ((l.p - Vec3::new(4.0, 0.0, 0.0)).length() - 0.3).abs() < 1e-3));
        assert!(ball.map(|l| l.n).sum::<Vec3>().length() < 0.1 * 400.0 * (1.0 - share as f32));
        assert_eq!(lights.iter().filter(|l| l.p.x < -3.0).count(), 1);
        assert!(EmitterVpls::takes(&scene, 0) && EmitterVpls::takes(&scene, 2));
    }
}
