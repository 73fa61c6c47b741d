//! The random walk of photons from lights through the scene.
//!
//! ```text
//! flux' = flux f(wo, wi) |cos| / (pdf_dir P),   f for importance (Veach 1997, section 5.3; no 1/eta^2)       P: part chosen
//! ```
//!
//! At every surface the material is split into its diffuse part and the rest ([`Bsdf::split`]), and one of the two is chosen, in proportion
//! to their albedos: so whether a scattering counts as (nearly) specular is a property of the light's way alone, the same for
//! photons and for paths from the eye ([`nearly_specular`]). Surfaces with a diffuse part store the photon before it is scattered.
//! A walk for caustics follows nearly specular scatterings only.
//! Roulette    behind the first scattering that is not nearly specular, and from depth `rr_depth`: the photon survives with
//!             min(1, max channel of throughput) (0.95 at most from `rr_depth` on), so that photons of one stratum keep like fluxes
//! Measure     densities per solid angle; the photon's flux is in W
//! Source      Jensen 1996, 2001; METHODS 3.B, 6.3
//! Passing     masks and null surfaces that a photon goes straight through count neither as a scattering nor for the depth
//! Bias        none but for limits, which the ledger shows (`truncated`)
//! Not handled participating media
//! Verified by `tests/`: the ledger closes, the same bits for any number of threads, closed forms of what maps show

use super::differential::{Differential, Meeting, parameters};
use super::photon::{Ledger, LightLedger, Photon, PhotonClass};
use super::{MAX_PASSED_SURFACES, MAX_SURVIVAL, World, nearly_specular};
use crate::accel::Ray;
use crate::emission::{EmissionDensity, EmittedRay};
use crate::math::{Rgb, Sampler, Vec2, Vec3, luminance};
use crate::scene::{Bsdf, BsdfSample, LobeKind, SurfacePoint, Transport};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Photons that one task traces: a fixed number, so that results do not depend on threads.
const CHUNK: usize = 4096;
/// Most scatterings of a photon: a bound for those that no surface ever absorbs.
const MOST_SCATTERINGS: u32 = 256;
/// Lowest probability with which a walk for caustics follows the rest of a material that is mostly diffuse.
const MIN_REST: f32 = 0.25;
/// Smallest geometric cosine that divides: bounds the weight of photons that graze a surface.
pub(super) const GRAZING: f32 = 1e-3;
/// Separates the random numbers of walks from those of other users of the seed.
const STREAM: u64 = 0x7068_6f74_6f6e; // "photon"

/// What a walk is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// Caustics: light, nearly specular scatterings, a surface with a diffuse part.
    Caustics,
    /// All light of the given classes, [`PhotonClass::ALL`] in order.
    Classes([bool; 3]),
    /// Light that was scattered last by the part of a material that is not diffuse, but for caustics.
    Reflected,
    /// Virtual lights: all classes, and the diffuse material that each photon meets ([`Traced::materials`]).
    Lights,
}

/// Settings of a walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkSettings {
    /// Seed of the render.
    pub seed: u64,
    /// Most segments of a stored photon's way; `None` = no limit but the built-in one.
    pub most_segments: Option<u32>,
    /// Scatterings from which on every photon may end.
    pub rr_depth: u32,
    /// What is stored.
    pub goal: Goal,
}

/// Photons of one pass in order of their indices, and what became of all.
#[derive(Clone, Debug, Default)]
pub struct Traced {
    /// Stored photons.
    pub photons: Vec<Photon>,
    /// For [`Goal::Lights`], of each stored photon the diffuse part of the material that it meets; else none.
    pub materials: Vec<Bsdf>,
    /// For [`Goal::Caustics`], of each stored photon its index in the pass; else none.
    pub indices: Vec<u32>,
    /// What became of the light.
    pub ledger: Ledger,
    /// Values that were not finite, and ended their walks.
    pub invalid: u64,
}

/// Traces the photons of pass `pass`, on all threads of the current pool.
pub fn trace(world: World, density: &dyn EmissionDensity, settings: &WalkSettings, pass: u64) -> Traced {
    let count = density.count();
    let lights = world.scene.lights.infos.len();
    let chunks = (0..count.div_ceil(CHUNK)).into_par_iter().map(|chunk| {
        let mut walk = Walk { world, settings, count, out: Traced::default() };
        walk.out.ledger = Ledger::new(lights);
        for index in chunk * CHUNK..count.min((chunk + 1) * CHUNK) {
            if let Some(emitted) = density.emit(index, pass) {
                let stream = STREAM ^ crate::math::sampler::hash(STREAM, pass);
                let rng = &mut Sampler::new(settings.seed, stream, index as u64);
                let parameters = parameters(&emitted);
                let stored = walk.out.photons.len();
                match parameters.len() {
                    ..=2 => walk.photon(&emitted, Differential::<2>::new(&emitted, &parameters), rng),
                    _ => walk.photon(&emitted, Differential::<4>::new(&emitted, &parameters), rng),
                }
                if settings.goal == Goal::Caustics {
                    let new = walk.out.photons.len() - stored;
                    walk.out.indices.extend(std::iter::repeat_n(index as u32, new));
                }
            }
        }
        walk.out
    });
    let chunks: Vec<Traced> = chunks.collect();
    let mut all = Traced { ledger: Ledger::new(lights), ..Traced::default() };
    all.photons.reserve_exact(chunks.iter().map(|c| c.photons.len()).sum());
    for mut chunk in chunks {
        all.photons.extend_from_slice(&chunk.photons);
        all.materials.append(&mut chunk.materials);
        all.indices.append(&mut chunk.indices);
        all.ledger += &chunk.ledger;
        all.invalid += chunk.invalid;
    }
    all
}

struct Walk<'a> {
    world: World<'a>,
    settings: &'a WalkSettings,
    count: usize,
    out: Traced,
}

/// What happens to a photon at a surface.
enum Fate {
    Goes {
        sample: BsdfSample,
        part_pmf: f32,
        rest: bool,
        nearly_specular: bool,
        alpha: f32,
    },
    /// Scattered by the diffuse part, with this albedo over the probability of having chosen it.
    HandedOn(Rgb),
    Absorbed,
}

/// Shading cosine over geometric cosine of the light from `wi`: materials weigh light by the first, photons land in proportion to the second.
fn shading_ratio(at: &SurfacePoint, wi: Vec3) -> f32 {
    let (geo, shade) = (wi.dot(at.n_geo), wi.dot(at.n_shade));
    if geo * shade > 0.0 { shade / geo.abs().max(GRAZING).copysign(geo) } else { 0.0 }
}

impl Walk<'_> {
    fn photon<const N: usize>(&mut self, emitted: &EmittedRay, mut beam: Differential<N>, rng: &mut Sampler) {
        let (scene, settings) = (self.world.scene, self.settings);
        let mut ledger = LightLedger { photons: 1, emitted: emitted.flux.as_dvec3(), ..LightLedger::default() };
        let mut ray = Ray { o: emitted.o, d: emitted.d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
        let (mut flux, mut throughput) = (emitted.flux, Rgb::ONE);
        let (mut scattered, mut passed, mut class) = (0u32, 0u32, PhotonClass::Direct);
        // Whether the last scattering was one by the rest of a material.
        let mut reflected = false;
        loop {
            ledger.rays += 1;
            let Some(hit) = self.world.accel.closest(&ray) else {
                ledger.escaped += flux.as_dvec3();
                break;
            };
            let at = self.world.surface(&ray, &hit);
            let wo = -ray.d;
            beam.advance(hit.t);
            let (diffuse, rest) = self.world.bsdf(&at, wo).split();
            let shares = [&diffuse, &rest].map(|part| part.as_ref().map_or(0.0, |b| luminance(b.albedo(wo))));
            let last =
                settings.most_segments.is_some_and(|most| scattered + 1 >= most) || scattered >= MOST_SCATTERINGS;

            // Where a photon ends unseen its neighbours do not matter.
            let stored = shares[0] > 0.0 && self.wants(class, reflected);
            let ends = last || (shares[1] <= 0.0 && settings.goal == Goal::Caustics);
            let meeting = (stored || !ends).then(|| beam.meet(&scene.shapes[at.shape as usize], &at));
            let sigma = meeting.as_ref().filter(|_| shares[0] > 0.0).map(|m| beam.axes(m, &at, wo));
            if let (true, Some(sigma)) = (stored, sigma) {
                let n = if at.n_geo.dot(wo) < 0.0 { -at.n_geo } else { at.n_geo };
                let SurfacePoint { p, shape, prim, .. } = at;
                let EmittedRay { light, stratum, .. } = *emitted;
                let (segments, shading) = (scattered + 1, shading_ratio(&at, wo));
                let parameters = if class == PhotonClass::Indirect { 4 } else { N as u32 };
                let photon = Photon {
                    p,
                    wi: wo,
                    n,
                    flux,
                    shading,
                    sigma,
                    parameters,
                    shape,
                    prim,
                    light,
                    stratum,
                    segments,
                    class,
                };
                self.out.photons.push(photon);
                if settings.goal == Goal::Lights {
                    self.out.materials.extend(diffuse.clone());
                }
                ledger.stored[class as usize] += 1;
                ledger.stored_flux[class as usize] += flux.as_dvec3();
            }
            if last && !self.world.passes_light(at.shape) {
                ledger.truncated += flux.as_dvec3();
                break;
            }

            let [ux, uy, u_lobe, u_part] = rng.next_4d();
            let before = flux;
            let (sample, part_pmf, from_rest, nearly, alpha) =
                match self.scatter([diffuse, rest], shares, wo, u_part, u_lobe, Vec2::new(ux, uy)) {
                    Fate::Goes { sample, part_pmf, rest, nearly_specular, alpha } => {
                        (sample, part_pmf, rest, nearly_specular, alpha)
                    }
                    Fate::HandedOn(albedo) => {
                        ledger.absorbed += (flux - flux * albedo).as_dvec3();
                        ledger.handed_on += (flux * albedo).as_dvec3();
                        break;
                    }
                    Fate::Absorbed => {
                        ledger.absorbed += flux.as_dvec3();
                        break;
                    }
                };
            let weight = sample.weight / part_pmf;
            flux *= weight;
            throughput *= weight;
            if !(flux.is_finite() && sample.wi.is_finite()) {
                self.out.invalid += 1;
                ledger.truncated += before.as_dvec3();
                break;
            }
            ledger.absorbed += (before - flux).as_dvec3();
            ray = Ray::leaving(&at, sample.wi);

            if sample.lobe == LobeKind::Null {
                beam.thin(part_pmf * sample.pmf);
                passed += 1;
                if passed > MAX_PASSED_SURFACES {
                    ledger.truncated += flux.as_dvec3();
                    break;
                }
                continue;
            }
            if last {
                ledger.truncated += flux.as_dvec3();
                break;
            }
            if settings.goal == Goal::Caustics && !nearly {
                ledger.handed_on += flux.as_dvec3();
                break;
            }
            scattered += 1;
            reflected = from_rest;
            class = if nearly && class != PhotonClass::Indirect { PhotonClass::Caustic } else { PhotonClass::Indirect };
            if let Some(meeting) = &meeting {
                self.go_on(&mut beam, meeting, sigma, &sample, part_pmf * sample.pmf, alpha);
            }

            if class == PhotonClass::Indirect || scattered >= settings.rr_depth {
                let limit = if scattered >= settings.rr_depth { MAX_SURVIVAL } else { 1.0 };
                let survival = throughput.max_element().min(limit);
                let [u, ..] = rng.next_4d();
                if u >= survival {
                    ledger.roulette += flux.as_dvec3();
                    break;
                }
                ledger.roulette -= (flux / survival - flux).as_dvec3();
                flux /= survival;
                throughput /= survival;
                beam.thin(survival);
            }
        }
        self.out.ledger.lights[emitted.light as usize] += &ledger;
    }

    fn wants(&self, class: PhotonClass, reflected: bool) -> bool {
        match self.settings.goal {
            Goal::Caustics => class == PhotonClass::Caustic,
            Goal::Classes(classes) => classes[class as usize],
            Goal::Reflected => reflected && class == PhotonClass::Indirect,
            Goal::Lights => true,
        }
    }

    /// Chooses a part of the material and a direction from it.
    fn scatter(
        &self,
        [diffuse, rest]: [Option<Bsdf>; 2],
        [d, r]: [f32; 2],
        wo: Vec3,
        u_part: f32,
        u_lobe: f32,
        u: Vec2,
    ) -> Fate {
        if d + r <= 0.0 {
            return Fate::Absorbed;
        }
        let caustics = self.settings.goal == Goal::Caustics;
        let p_rest = match (d > 0.0, r > 0.0) {
            (_, false) => 0.0,
            (false, _) => 1.0,
            _ if caustics => (r / (d + r)).max(MIN_REST),
            _ => r / (d + r),
        };
        let chosen_rest = u_part < p_rest;
        let (part, part_pmf) = if chosen_rest { (rest, p_rest) } else { (diffuse, 1.0 - p_rest) };
        let Some(part) = part else { return Fate::Absorbed };
        if caustics && !chosen_rest {
            return Fate::HandedOn(part.albedo(wo) / part_pmf);
        }
        let Some(sample) = part.sample(wo, u_lobe, u, Transport::Importance) else { return Fate::Absorbed };
        let alpha = if sample.lobe == LobeKind::Glossy { part.min_glossy_alpha() } else { 0.0 };
        let nearly_specular = chosen_rest && nearly_specular(&part, sample.lobe);
        Fate::Goes { sample, part_pmf, rest: chosen_rest, nearly_specular, alpha }
    }

    fn go_on<const N: usize>(
        &self,
        beam: &mut Differential<N>,
        meeting: &Meeting<N>,
        sigma: Option<[Vec3; 2]>,
        sample: &BsdfSample,
        pmf: f32,
        alpha: f32,
    ) {
        match (sample.lobe, sigma) {
            (LobeKind::Diffuse, Some(sigma)) => {
                // One photon stands for the fourth root of its share along each of the four parameters of position and direction.
                let share = (self.count as f64).powf(-0.5);
                let widen = if N == 2 { (self.count as f64).powf(0.25) } else { 1.0 };
                beam.diffuse(sigma, widen, (PI * share / 12.0).sqrt());
            }
            _ => beam.scatter(meeting, sample.wi, sample.eta, alpha, pmf),
        }
    }
}
