//! One light by samples: m stratified points of a lamp, each with a shadow ray; the environment.
//!
//! Estimates   (1/m) sum_k f(wo, wi_k) L V / pdf_dir_k over points of one scrambled (0,2)-net, uniform in solid angle where the
//!             lamp allows; the rest of the material times its weight against scattering
//! Environment for the diffuse part, m directions in proportion to the environment and m to the cosine, combined by the
//!             power heuristic: one of them is good where the other is not (a small sun, a sky seen through a window)
//! Source      Shirley, Wang and Zimmerman 1996 for area lights; Veach 1997 for the combination
//! Bias        none

use super::{Chosen, Direct, DirectCounts, Point, Unit};
use crate::math::{Rgb, Sampler};
use crate::scene::light::EmitterView;
use crate::scene::{Bsdf, LightSample, Transport};
use crate::transport::power_heuristic;

impl Direct<'_> {
    /// A chosen light by `m` samples.
    pub(super) fn sampled(
        &self,
        point: &Point,
        chosen: Chosen,
        m: u32,
        rng: &mut Sampler,
        counts: &mut DirectCounts,
    ) -> Rgb {
        match chosen.unit {
            Unit::Environment => self.environment(point, &chosen, m, rng, counts),
            Unit::Emitter(e) => {
                let scene = self.world.scene;
                let view = scene.lights.view(&scene.shapes, scene.textures(), e, point.at.p);
                let block = rng.next_block(m);
                let Some(view) = view else { return Rgb::ZERO };
                let m = if view.is_delta() { 1 } else { m };
                let nominal = self.nominal_of(point, &chosen);
                self.sampled_view(point, &view, nominal, m, |k| block.point_2d(k), counts)
            }
        }
    }

    /// The nominal number of samples of a light, where the weights of the rest need it.
    pub(super) fn nominal_of(&self, point: &Point, chosen: &Chosen) -> f32 {
        if point.rest.is_some() { self.nominal(point.vantage.stage, chosen.drawn) } else { 0.0 }
    }

    /// An emitter by the samples for `u(0..m)`.
    pub(super) fn sampled_view(
        &self,
        point: &Point,
        view: &EmitterView,
        nominal: f32,
        m: u32,
        u: impl Fn(u32) -> crate::math::Vec2,
        counts: &mut DirectCounts,
    ) -> Rgb {
        let mut sum = Rgb::ZERO;
        for k in 0..m {
            counts.light_samples += 1;
            let Some(s) = view.sample(u(k)) else { continue };
            let value = point.reflected(&s, nominal);
            if value != Rgb::ZERO {
                sum += value * self.visibility(point, &s, counts);
            }
        }
        sum / m as f32
    }

    /// What of a light sample arrives: 0 or 1, or what masks let through.
    pub(super) fn visibility(&self, point: &Point, s: &LightSample, counts: &mut DirectCounts) -> f32 {
        counts.shadow_rays += 1;
        let ray = self.world.shadow_ray(point.at, s.wi, s.distance);
        self.world.transmittance(ray, false).share
    }

    /// The environment by `m` samples of each kind.
    fn environment(&self, point: &Point, chosen: &Chosen, m: u32, rng: &mut Sampler, counts: &mut DirectCounts) -> Rgb {
        let scene = self.world.scene;
        let (by_light, by_cosine) = (rng.next_block(m), rng.next_block(m));
        let lit = point.diffuse.filter(|_| self.settings.diffuse_environment);
        if lit.is_none() && point.rest.is_none() {
            return Rgb::ZERO;
        }
        let nominal = self.nominal_of(point, chosen);
        let mut sum = Rgb::ZERO;
        for k in 0..m {
            let [x, y, u_light, _] = by_light.point(k);
            counts.light_samples += 1;
            if let Some(s) = scene.lights.sample_environment(scene.textures(), u_light, crate::math::Vec2::new(x, y)) {
                let diffuse = lit.map_or(Rgb::ZERO, |d| {
                    let (f, pdf) = d.eval_pdf(point.wo, s.wi, Transport::Radiance);
                    f * power_heuristic(s.pdf_dir, pdf)
                });
                let value = (diffuse + point.rest_reflected(&s, nominal)) * s.weight;
                if value != Rgb::ZERO {
                    sum += value * self.visibility(point, &s, counts);
                }
            }
            let [x, y, u_lobe, _] = by_cosine.point(k);
            let scatter = |d: &Bsdf| d.sample(point.wo, u_lobe, crate::math::Vec2::new(x, y), Transport::Radiance);
            if let Some(scattered) = lit.and_then(scatter) {
                let radiance = scene.lights.environment(scene.textures(), scattered.wi);
                if radiance != Rgb::ZERO {
                    let pdf = scene.lights.pdf_dir_infinity(scattered.wi);
                    let value = scattered.weight * radiance * power_heuristic(scattered.pdf_dir, pdf);
                    let s = LightSample {
                        wi: scattered.wi,
                        distance: f32::INFINITY,
                        weight: value,
                        pdf_dir: scattered.pdf_dir,
                        light: 0,
                    };
                    sum += value * self.visibility(point, &s, counts);
                }
            }
        }
        sum / m as f32
    }
}

impl Point<'_> {
    /// What a light sample that arrives contributes. `nominal`: number of such samples, for the weights.
    pub(super) fn reflected(&self, s: &LightSample, nominal: f32) -> Rgb {
        let diffuse = self.diffuse.map_or(Rgb::ZERO, |d| d.eval(self.wo, s.wi, Transport::Radiance));
        (diffuse + self.rest_reflected(s, nominal)) * s.weight
    }

    /// f |cos| of the rest times its weight.
    pub(super) fn rest_reflected(&self, s: &LightSample, nominal: f32) -> Rgb {
        let Some(rest) = self.rest else { return Rgb::ZERO };
        let (f, pdf) = rest.eval_pdf(self.wo, s.wi);
        if s.pdf_dir == 0.0 { f } else { f * power_heuristic(nominal * s.pdf_dir, pdf) }
    }
}
