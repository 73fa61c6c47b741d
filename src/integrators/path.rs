//! Unidirectional path tracing: the oracle that every other integrator is tested against.
//!
//! Estimates   L(x, w) = Le + integral f(w, wi) L(x, wi) |cos| dwi by one path per camera sample
//! Direct      one light sample per vertex, of a light drawn from the light tree (or as [`LightSelection`] is told), combined with the
//!             scattered direction by the power heuristic (beta = 2)
//! Measure     all densities per solid angle at the vertex; light densities include the selection probability
//! Passing     masks and null surfaces that a path goes straight through count neither for the depth nor as a vertex, and
//!             light samples cross them: as Mitsuba's `volpath`, whereas its `path` counts them and lets them block
//! Roulette    from depth `rr_depth`: the path survives with min(0.95, max channel of throughput x eta^2)
//! Source      Kajiya 1986; Veach 1997, chapters 9 (MIS) and 10.2 (roulette)
//! Bias        none but for shadow rays that end 1e-4 of the distance short of the lamp: what blocks closer is not seen
//! Not handled participating media; light through smooth glass is found by chance only (`remarks` says how much of it there is)
//! Verified by tests/furnace.rs and tests/transport.rs (closed forms), tests/references.rs (converged references of another renderer)

use super::branching::Way;
use super::{Counts, Integrator};
use crate::accel::Ray;
use crate::image::film::Features;
use crate::math::{Rgb, Sampler, Vec2, Vec3};
use crate::scene::camera::CameraRay;
use crate::scene::{Bsdf, LobeKind, SurfacePoint, Transport};
use crate::transport::light_selection::{LightSelection, SelectionSettings};
use crate::transport::light_tree::LitPoint;
use crate::transport::{MAX_PASSED_SURFACES, MAX_SURVIVAL, World, power_heuristic};

/// Rows and columns of [`probes`], where there are many lights and where not.
const PROBES: [u32; 2] = [6, 16];
/// Lights from which there are many.
const MANY_LIGHTS: usize = 20_000;

/// Settings of [`Path`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSettings {
    /// Longest path: 1 = emitters seen directly, 2 = direct light; `None` = unbounded.
    pub max_depth: Option<u32>,
    /// Depth at which Russian roulette starts.
    pub rr_depth: u32,
    /// Camera rays go through lamps, whatever their material, and see no light from infinity.
    pub hide_emitters: bool,
    /// Which lights are sampled.
    pub lights: SelectionSettings,
}

impl Default for PathSettings {
    fn default() -> Self {
        PathSettings { max_depth: None, rr_depth: 5, hide_emitters: false, lights: SelectionSettings::default() }
    }
}

/// The path tracer.
#[derive(Debug)]
pub struct Path<'a> {
    world: World<'a>,
    lights: LightSelection<'a>,
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
        let lights = LightSelection::new(world, &settings.lights, || probes(world, settings.hide_emitters));
        Path { world, lights, settings }
    }

    /// Radiance from light samples towards the point `at`, weighted against scattering into the same direction.
    fn direct(
        &self,
        at: &SurfacePoint,
        bsdf: &Bsdf,
        wo: Vec3,
        pass: u64,
        rng: &mut Sampler,
        counts: &mut Counts,
    ) -> Rgb {
        let lit = lit_point(at, bsdf);
        let mut sum = Rgb::ZERO;
        self.lights.sample(&self.world, &lit, rng, |s| {
            let (f, pdf_bsdf) = bsdf.eval_pdf(wo, s.wi, Transport::Radiance);
            if f == Rgb::ZERO {
                return;
            }
            let probe = pass == 0;
            let through = self.world.transmittance(self.world.shadow_ray(at, s.wi, s.distance), probe);
            counts.shadow_rays += 1;
            counts.probed_shadow_rays += u64::from(probe);
            counts.blocked_by_specular += u64::from(through.blocked_by_specular);
            let mis = if s.pdf_dir == 0.0 { 1.0 } else { power_heuristic(s.pdf_dir, pdf_bsdf) };
            sum += f * s.weight * (mis * through.share);
        });
        sum
    }

    /// Weight of emission found by scattering, against the light sample that could have found it.
    fn scattered_weight(&self, previous: &Previous, pdf_light: impl FnOnce(&LitPoint) -> f32) -> f32 {
        previous.from.as_ref().map_or(1.0, |p| power_heuristic(previous.pdf_dir, pdf_light(p)))
    }
}

fn lit_point(at: &SurfacePoint, bsdf: &Bsdf) -> LitPoint {
    LitPoint { p: at.p, n: bsdf.upper_normal(), matte: bsdf.is_matte() }
}

/// What the camera sees through the middle of some pixels: points that are lit.
fn probes(world: World, hide_emitters: bool) -> Vec<LitPoint> {
    let scene = world.scene;
    let [x, y, width, height] = scene.film.crop;
    let side = if scene.lights.emitter_count() > MANY_LIGHTS { PROBES[0] } else { PROBES[1] };
    let middle = |i: u32, n: u32| (i as f32 + 0.5) / side as f32 * n as f32;
    let seen = |i: u32| {
        let pixel = Vec2::new(x as f32 + middle(i % side, width), y as f32 + middle(i / side, height));
        let CameraRay { o, d, tmin, tmax, .. } = scene.camera.ray(pixel, Vec2::splat(0.5));
        let at = world.first_seen(Ray { o, d, tmin, tmax }, hide_emitters)?;
        Some(lit_point(&at, &world.bsdf(&at, -d)))
    };
    (0..side * side).filter_map(seen).collect()
}

impl Integrator for Path<'_> {
    fn name(&self) -> &'static str {
        "path"
    }

    fn prepare(&mut self, pass: u64, _: &(dyn Fn() -> bool + Sync)) {
        self.lights.set_pass(pass);
    }

    fn sample(&self, camera: &CameraRay, pass: u64, rng: &mut Sampler, counts: &mut Counts) -> (Rgb, Features) {
        let World { scene, accel, .. } = self.world;
        let mut ray = Ray { o: camera.o, d: camera.d, tmin: camera.tmin, tmax: camera.tmax };
        let (mut radiance, mut throughput, mut eta) = (Rgb::ZERO, Rgb::ONE, 1.0f32);
        let mut features = Features::default();
        let mut previous = Previous { from: None, pdf_dir: 0.0 };
        let (mut depth, mut passed) = (0u32, 0u32);
        let (mut blurred, mut travelled) = (false, 0.0);

        loop {
            counts.rays += 1;
            let emitters_seen = depth > 0 || !self.settings.hide_emitters;
            let way = |t: f32| Way { throughput, depth, blurred, travelled: travelled + t };
            let Some(hit) = accel.closest(&ray) else {
                if emitters_seen {
                    let weight = self
                        .scattered_weight(&previous, |lit| self.lights.pdf_dir_environment(&self.world, lit, ray.d));
                    let emitted = scene.lights.environment(scene.textures(), ray.d);
                    way(0.0).note_light(&mut features, emitted);
                    radiance += throughput * emitted * weight;
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
                travelled += hit.t;
                ray = Ray { tmax: ray.tmax - hit.t, ..Ray::leaving(&at, ray.d) };
                continue;
            }

            // Emission found by the scattered ray.
            if scene.shapes[at.shape as usize].emission.is_some() {
                let emitted = scene.lights.emitted(&scene.shapes, scene.textures(), &at, wo);
                if emitted != Rgb::ZERO {
                    let weight =
                        self.scattered_weight(&previous, |lit| self.lights.pdf_dir_surface(&self.world, lit, &at));
                    way(hit.t).note_light(&mut features, emitted);
                    radiance += throughput * emitted * weight;
                }
            }

            let bsdf = self.world.bsdf(&at, wo);
            way(hit.t).note(&mut features, &at, &bsdf, wo);
            travelled += hit.t;
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
            blurred |= scattered.lobe != LobeKind::Specular;
            let lit = lit_point(&at, &bsdf);
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
