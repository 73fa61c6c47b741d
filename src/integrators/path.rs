//! Unidirectional path tracing: the oracle that every other integrator is tested against.
//!
//! Estimates   L(x, w) = Le + integral f(w, wi) L(x, wi) |cos| dwi by one path per camera sample
//! Direct      one light sample per vertex, of a light drawn from the light tree, combined with the scattered direction by the
//!             power heuristic (beta = 2)
//! Measure     all densities per solid angle at the vertex; light densities include the selection probability
//! Passing     masks and null surfaces that a path goes straight through count neither for the depth nor as a vertex, and
//!             light samples cross them: as Mitsuba's `volpath`, whereas its `path` counts them and lets them block
//! Roulette    from depth `rr_depth`: the path survives with min(0.95, max channel of throughput x eta^2)
//! Source      Kajiya 1986; Veach 1997, chapters 9 (MIS) and 10.2 (roulette)
//! Bias        none but for shadow rays that end 1e-4 of the distance short of the lamp: what blocks closer is not seen
//! Not handled participating media; light through smooth glass is found by chance only (`remarks` says how much of it there is)
//! Verified by tests/furnace.rs and tests/transport.rs (closed forms), tests/references.rs (converged references of another renderer)

use super::{Counts, Integrator};
use crate::accel::Ray;
use crate::image::film::Features;
use crate::math::{Rgb, Sampler, Vec2, Vec3};
use crate::scene::camera::CameraRay;
use crate::scene::{Bsdf, LightSample, LobeKind, SurfacePoint, Transport};
use crate::transport::light_tree::{LightTree, LitPoint};
use crate::transport::{MAX_PASSED_SURFACES, MAX_SURVIVAL, World, power_heuristic};
use std::borrow::Cow;

/// Settings of [`Path`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Longest path: 1 = emitters seen directly, 2 = direct light; `None` = unbounded.
    pub max_depth: Option<u32>,
    /// Depth at which Russian roulette starts.
    pub rr_depth: u32,
    /// Camera rays go through lamps, whatever their material, and see no light from infinity.
    pub hide_emitters: bool,
}

impl Default for PathSettings {
    fn default() -> Self {
        PathSettings { max_depth: None, rr_depth: 5, hide_emitters: false }
    }
}

/// The path tracer.
#[derive(Debug)]
pub struct Path<'a> {
    world: World<'a>,
    lights: Cow<'a, LightTree>,
    settings: PathSettings,
}

/// What a path vertex needs to know of the one before: where light sampling could have started instead.
struct Previous {
    /// Where the light sample was taken, `None` if light sampling was not possible there (camera, Dirac lobe).
    from: Option<LitPoint>,
    /// Density per solid angle of the direction that was scattered into.
    pdf_dir: f32,
}

impl<'a> Path<'a> {
    /// A path tracer over `world`.
    pub fn new(world: World<'a>, settings: PathSettings) -> Self {
        let lights = world.lights.map_or_else(|| Cow::Owned(LightTree::new(world.scene)), Cow::Borrowed);
        Path { world, lights, settings }
    }

    /// Radiance from one light sample towards the point `at`, weighted against scattering into the same direction.
    fn direct(
        &self,
        at: &SurfacePoint,
        bsdf: &Bsdf,
        wo: Vec3,
        pass: u64,
        rng: &mut Sampler,
        counts: &mut Counts,
    ) -> Rgb {
        let [ux, uy, u_light, _] = rng.next_4d();
        let lit = LitPoint { p: at.p, n: bsdf.upper_normal() };
        let Some(LightSample { wi, distance, weight, pdf_dir, .. }) =
            self.lights.sample_light(self.world.scene, &lit, u_light, Vec2::new(ux, uy))
        else {
            return Rgb::ZERO;
        };
        let (f, pdf_bsdf) = bsdf.eval_pdf(wo, wi, Transport::Radiance);
        if f == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let probe = pass == 0;
        let through = self.world.transmittance(self.world.shadow_ray(at, wi, distance), probe);
        counts.shadow_rays += 1;
        counts.probed_shadow_rays += u64::from(probe);
        counts.blocked_by_specular += u64::from(through.blocked_by_specular);
        let mis = if pdf_dir == 0.0 { 1.0 } else { power_heuristic(pdf_dir, pdf_bsdf) };
        f * weight * (mis * through.share)
    }

    /// Weight of emission found by scattering, against the light sample that could have found it.
    fn scattered_weight(&self, previous: &Previous, pdf_light: impl FnOnce(&LitPoint) -> f32) -> f32 {
        previous.from.as_ref().map_or(1.0, |p| power_heuristic(previous.pdf_dir, pdf_light(p)))
    }

    fn features(&self, at: &SurfacePoint, bsdf: &Bsdf, wo: Vec3, origin: Vec3) -> Features {
        Features { albedo: bsdf.albedo(wo), normal: at.n_shade, depth: (at.p - origin).length(), shape: at.shape + 1 }
    }
}

impl Integrator for Path<'_> {
    fn name(&self) -> &'static str {
        "path"
    }

    fn sample(&self, camera: &CameraRay, pass: u64, rng: &mut Sampler, counts: &mut Counts) -> (Rgb, Features) {
        let World { scene, accel, .. } = self.world;
        let mut ray = Ray { o: camera.o, d: camera.d, tmin: camera.tmin, tmax: camera.tmax };
        let (mut radiance, mut throughput, mut eta) = (Rgb::ZERO, Rgb::ONE, 1.0f32);
        let mut features = Features::default();
        let mut previous = Previous { from: None, pdf_dir: 0.0 };
        let (mut depth, mut passed) = (0u32, 0u32);

        loop {
            counts.rays += 1;
            let emitters_seen = depth > 0 || !self.settings.hide_emitters;
            let Some(hit) = accel.closest(&ray) else {
                if emitters_seen {
                    let weight =
                        self.scattered_weight(&previous, |lit| self.lights.pdf_dir_environment(scene, lit, ray.d));
                    radiance += throughput * scene.lights.environment(scene.textures(), ray.d) * weight;
                }
                break;
            };
            let at = self.world.surface(&ray, &hit);
            let wo = -ray.d;

            if !emitters_seen && scene.shapes[at.shape as usize].emission.is_some() {
                passed += 1;
                if passed > MAX_PASSED_SURFACES {
                    break;
                }
                ray = Ray { tmax: ray.tmax - hit.t, ..Ray::leaving(&at, ray.d) };
                continue;
            }

            // Emission found by the scattered ray.
            if scene.shapes[at.shape as usize].emission.is_some() {
                let emitted = scene.lights.emitted(&scene.shapes, scene.textures(), &at, wo);
                if emitted != Rgb::ZERO {
                    let weight = self.scattered_weight(&previous, |lit| self.lights.pdf_dir_surface(scene, lit, &at));
                    radiance += throughput * emitted * weight;
                }
            }

            let bsdf = self.world.bsdf(&at, wo);
            if depth == 0 && features.shape == 0 {
                features = self.features(&at, &bsdf, wo, camera.o);
            }
            let last = self.settings.max_depth.is_some_and(|max| depth + 1 >= max);
            if last && !self.world.passes_light(at.shape) {
                break;
            }
            if !last && !bsdf.is_delta() {
                radiance += throughput * self.direct(&at, &bsdf, wo, pass, rng, counts);
            }

            let [ux, uy, u_lobe, u_roulette] = rng.next_4d();
            let Some(scattered) = bsdf.sample(wo, u_lobe, Vec2::new(ux, uy), Transport::Radiance) else { break };
            throughput *= scattered.weight;
            eta *= scattered.eta;
            ray = Ray::leaving(&at, scattered.wi);

            // A surface passed straight through is no vertex: depth and the place to compare with stay.
            if scattered.lobe == LobeKind::Null {
                passed += 1;
                if passed > MAX_PASSED_SURFACES {
                    break;
                }
                continue;
            }
            if last {
                break;
            }
            depth += 1;
            let lit = LitPoint { p: at.p, n: bsdf.upper_normal() };
            let from = (scattered.lobe != LobeKind::Specular).then_some(lit);
            previous = Previous { from, pdf_dir: scattered.pdf_dir };

            if depth >= self.settings.rr_depth {
                let survival = (throughput.max_element() * eta * eta).min(MAX_SURVIVAL);
                if u_roulette >= survival {
                    break;
                }
                throughput /= survival;
            }
        }
        (radiance, features)
    }

    fn remarks(&self, counts: &Counts) -> Vec<String> {
        let mut out = Vec::new();
        let share = counts.blocked_by_specular as f64 / counts.probed_shadow_rays.max(1) as f64;
        if share > 0.01 {
            out.push(format!(
                "{:.0} % of the shadow rays end on smooth glass, water or metal: light by way of it is found by \
                 chance only, so caustics converge slowly or are missing; a photon integrator is the tool for them",
                100.0 * share
            ));
        }
        out
    }
}
