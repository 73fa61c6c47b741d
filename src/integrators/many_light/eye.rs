//! The eye path of the many-light integrator: from the camera to diffuse surfaces, which virtual lights light.
//!
//! What counts where. A material is a diffuse part d and a rest r (Dirac and glossy lobes, coats); a path is written from the eye; x and y are
//! neighbouring vertices, r their distance, c(r) the share that virtual lights leave out ([`left_out`]).
//!
//!   d at x, light straight from an emitter           light sampling alone; or virtual lights on it, c(r) by a short path that meets it
//!   d at x, light by nearly specular scatterings     the caustic photons: L S+ d
//!   d at x, light scattered by r at y, all else      photons ([`reflected`](super::reflected)); without them the path goes on from x to y
//!   d at x, light scattered by d at y                virtual lights at y; c(r) of it by a short path from x to y
//!   r at x, light straight from an emitter           light sampling and scattering, by the power heuristic
//!   r at x, all else                                 the path goes on from r
//!
//! So at the end y of a path from d at x emitters do not count, and the diffuse part of y counts with probability c(r): unless paths are to find what r
//! scatters, the ray need not be longer than that can be, r^2 <= A/pi (1/U - 1), and r at y does not count. If they are, emitters do not count
//! behind a nearly specular surface that such a path meets (`Covered`: caustic photons bring them), but diffuse parts do.
//! Branching: Dirac lobes at the first vertices send on both mirrored and refracted ray ([`MOST_BRANCHES`]).
//! Verified by tests/many_light.rs: agreement with the path tracer on every material, furnace.

use super::ManyLightSettings;
use crate::accel::Ray;
use crate::image::film::Features;
use crate::integrators::Counts;
use crate::integrators::branching::{Chance, MOST_BRANCHES, State, Way, directions, is_crowded, one_part, stage};
use crate::math::{Rgb, Sampler, Vec2, Vec3};
use crate::scene::camera::CameraRay;
use crate::scene::{Bsdf, BsdfSample, LobeKind, SurfacePoint, Transport};
use crate::transport::direct::{Direct, Found, Vantage};
use crate::transport::glossy_guide::Rest;
use crate::transport::photon_map::{Filter, GlobalMap};
use crate::transport::strategies::{ManyLights, Receiver, Tally};
use crate::transport::vpl::left_out;
use crate::transport::{CausticMap, MAX_PASSED_SURFACES, World, nearly_specular};
use arrayvec::ArrayVec;

/// All that an eye path asks.
pub struct Eye<'a> {
    pub world: World<'a>,
    pub settings: &'a ManyLightSettings,
    pub direct: &'a Direct<'a>,
    /// Where virtual lights lie on emitters: the others, which diffuse parts get from light sampling.
    pub rest_of_lights: Option<&'a Direct<'a>>,
    /// Caustic photons, `None` if paths are to find caustics.
    pub caustics: Option<&'a CausticMap>,
    /// Virtual lights of this pass.
    pub lights: Option<ManyLights<'a>>,
    /// A / pi of the lights where short paths add what that leaves out; 0 without.
    pub radius2: f32,
    /// Photons of light that diffuse parts get from other parts, `None` if paths are to find it.
    pub reflected: Option<&'a GlobalMap>,
    /// Whether paths go on from diffuse parts to find light of other parts.
    pub seeks_rest: bool,
}

/// How a ray left the surface before.
#[derive(Clone, Copy)]
enum Came {
    /// From the camera or a Dirac lobe: an emitter counts in full.
    Plain,
    /// From a glossy lobe: light sampling could have found the emitter.
    Glossy { from: Vantage, pdf_dir: f32 },
    /// From a diffuse part: emitters and diffuse parts are counted there, but for the share c. `short`: that has been paid by the ray's length;
    /// `shown`: whether light straight from emitters is.
    Diffuse { short: bool, shown: bool },
    /// By nearly specular surfaces from a diffuse part.
    Covered,
}

/// A ray that waits to be traced.
struct Branch {
    ray: Ray,
    throughput: Rgb,
    /// Product of squared relative indices crossed.
    eta2: f32,
    depth: u32,
    passed: u32,
    came: Came,
    /// Distance from the surface before, where a null surface has cut the ray.
    travelled: f32,
    /// Whether the path has left a diffuse part: all that follows is indirect light.
    indirect: bool,
    /// Whether a lobe that is not a Dirac lobe has blurred the view.
    blurred: bool,
}

impl Branch {
    fn state(&self) -> State {
        let &Branch { throughput, eta2, depth, passed, blurred, .. } = self;
        State { throughput, eta2, depth, passed, blurred }
    }

    /// The way so far; `travelled` is its length since the last scattering.
    fn way(&self, travelled: f32) -> Way {
        let &Branch { throughput, depth, blurred, .. } = self;
        Way { throughput, depth, blurred, travelled }
    }
}

/// Where a ray ended.
struct End<'s> {
    at: &'s SurfacePoint,
    wo: Vec3,
    /// The diffuse part of the material there, where it counts.
    diffuse: Option<&'s Bsdf>,
    /// The other part.
    rest: Option<&'s Bsdf>,
    /// Length of the ray.
    t: f32,
    /// Whether the path may not get longer.
    last: bool,
}

/// A camera sample on its way.
struct Sample<'r> {
    radiance: Rgb,
    features: Features,
    waiting: ArrayVec<Branch, MOST_BRANCHES>,
    rng: &'r mut Sampler,
    counts: &'r mut Counts,
    tally: Tally,
}

impl Eye<'_> {
    /// Radiance along a camera ray, the features of the first surface, and what sums over virtual lights have counted.
    pub fn sample(&self, camera: &CameraRay, rng: &mut Sampler, counts: &mut Counts) -> (Rgb, Features, Tally) {
        let mut sample = Sample {
            radiance: Rgb::ZERO,
            features: Features::default(),
            waiting: ArrayVec::new(),
            rng,
            counts,
            tally: Tally::default(),
        };
        sample.waiting.push(Branch {
            ray: Ray { o: camera.o, d: camera.d, tmin: camera.tmin, tmax: camera.tmax },
            throughput: Rgb::ONE,
            eta2: 1.0,
            depth: 0,
            passed: 0,
            came: Came::Plain,
            travelled: 0.0,
            indirect: false,
            blurred: false,
        });
        while let Some(branch) = sample.waiting.pop() {
            self.follow(branch, &mut sample);
        }
        (sample.radiance, sample.features, sample.tally)
    }

    /// Whether light that reaches a surface at the end of this branch straight from an emitter, and its emission, are shown.
    fn shows(&self, b: &Branch) -> bool {
        if b.indirect { self.settings.parts.indirect } else { self.settings.parts.direct }
    }

    /// Traces one ray and adds what its end reflects; what goes on from there waits.
    fn follow(&self, mut b: Branch, sample: &mut Sample) {
        let scene = self.world.scene;
        sample.counts.rays += 1;
        let emitters_seen = b.depth > 0 || !self.settings.path.hide_emitters;
        let Some(hit) = self.world.accel.closest(&b.ray) else {
            if emitters_seen && self.shows(&b) && b.ray.tmax == f32::INFINITY {
                let emitted = scene.lights.environment(scene.textures(), b.ray.d);
                b.way(0.0).note_light(&mut sample.features, emitted);
                sample.radiance += b.throughput * emitted * self.weight(&b, Found::Environment(b.ray.d), f32::INFINITY);
            }
            return;
        };
        let at = self.world.surface(&b.ray, &hit);
        let wo = -b.ray.d;
        let is_emitter = scene.shapes[at.shape as usize].emission.is_some();
        if is_emitter && !emitters_seen {
            b.passed += 1;
            b.travelled += hit.t;
            b.ray = Ray { tmax: b.ray.tmax - hit.t, ..Ray::leaving(&at, b.ray.d) };
            if b.passed <= MAX_PASSED_SURFACES {
                sample.waiting.push(b);
            }
            return;
        }
        let shown = match b.came {
            Came::Diffuse { shown, .. } => shown,
            _ => self.shows(&b),
        };
        if is_emitter && shown {
            let emitted = scene.lights.emitted(&scene.shapes, scene.textures(), &at, wo);
            if emitted != Rgb::ZERO {
                b.way(0.0).note_light(&mut sample.features, emitted);
                sample.radiance += b.throughput * emitted * self.weight(&b, Found::Lamp(&at), b.travelled + hit.t);
            }
        }
        let bsdf = self.world.bsdf(&at, wo);
        b.way(b.travelled + hit.t).note(&mut sample.features, &at, &bsdf, wo);
        let last = self.settings.path.max_depth.is_some_and(|max| b.depth + 1 >= max);
        if last && !self.world.passes_light(at.shape) {
            return;
        }
        b.travelled += hit.t;
        let (diffuse, rest) = bsdf.split();
        let diffuse = diffuse.filter(|_| self.counts_diffuse(&b, sample));
        let rest = rest.filter(|r| !self.brings_rest(&b.came) || r.straight_through() > 0.0);
        let end = End { at: &at, wo, diffuse: diffuse.as_ref(), rest: rest.as_ref(), t: hit.t, last };
        if !last {
            self.reflected(&b, &end, sample);
        }
        self.go_on(b, &end, sample);
    }

    /// Weight of an emitter that a ray meets, `travelled` from the last scattering.
    fn weight(&self, b: &Branch, found: Found, travelled: f32) -> f32 {
        match &b.came {
            Came::Plain => 1.0,
            Came::Glossy { from, pdf_dir } => self.direct.weight_of_scattered(from, *pdf_dir, found),
            Came::Diffuse { short, .. } => match (self.rest_of_lights, found) {
                (Some(_), Found::Lamp(_)) if *short => 1.0,
                (Some(_), Found::Lamp(_)) => left_out(travelled * travelled, self.radius2),
                _ => 0.0,
            },
            Came::Covered => 0.0,
        }
    }

    /// Whether the diffuse part where the ray ended counts: not what virtual lights have brought already.
    fn counts_diffuse(&self, b: &Branch, sample: &mut Sample) -> bool {
        match b.came {
            Came::Diffuse { short: false, .. } => {
                let [u, ..] = sample.rng.next_4d();
                u < left_out(b.travelled * b.travelled, self.radius2)
            }
            _ => true,
        }
    }

    /// Whether photons have brought what a ray that came so would find at the rest of a material.
    fn brings_rest(&self, came: &Came) -> bool {
        matches!(came, Came::Diffuse { .. }) && self.reflected.is_some()
    }

    /// Whether a glossy lobe counts as a mirror for light that a caustic photon has brought already.
    fn is_covered(&self, came: &Came, rest: &Bsdf) -> bool {
        matches!(came, Came::Diffuse { .. } | Came::Covered)
            && self.caustics.is_some()
            && nearly_specular(rest, LobeKind::Glossy)
    }

    /// Adds what the surface reflects of light known there.
    fn reflected(&self, b: &Branch, end: &End, sample: &mut Sample) {
        let &End { at, wo, diffuse, rest, .. } = end;
        let parts = self.settings.parts;
        let sampled = rest.filter(|r| !(r.is_delta() || self.brings_rest(&b.came) || self.is_covered(&b.came, r)));
        if (diffuse.is_some() || sampled.is_some()) && self.shows(b) {
            let stage = stage(b.blurred, b.depth);
            let mut light = |direct: &Direct, diffuse, sampled: Option<&Bsdf>| {
                let sampled = sampled.map(Rest::from);
                direct.radiance(at, diffuse, sampled, wo, stage, sample.rng, &mut sample.counts.direct)
            };
            let light = match self.rest_of_lights {
                Some(rest) => light(rest, diffuse, None) + light(self.direct, None, sampled),
                None => light(self.direct, diffuse, sampled),
            };
            sample.radiance += b.throughput * light;
        }
        let Some(diffuse) = diffuse else { return };
        let most = self.settings.path.max_depth.map_or(u32::MAX, |max| max.saturating_sub(b.depth + 1));
        if let Some(map) = self.caustics.filter(|_| if b.indirect { parts.indirect } else { parts.caustic }) {
            sample.radiance += b.throughput * map.radiance_within(at, diffuse, wo, most);
        }
        if let Some(map) = self.reflected.filter(|_| most > 1) {
            sample.radiance += b.throughput * map.radiance(at, diffuse, wo, Filter::INDIRECT.within(most));
        }
        // Lights on emitters count as direct light here, those of photons as indirect.
        let segments = [u32::from(!self.shows(b)), if parts.indirect { most.saturating_sub(1) } else { 0 }];
        if let Some(lights) = self.lights.as_ref().filter(|_| segments[0] <= segments[1]) {
            let r = Receiver::new(at, diffuse, wo, b.throughput, segments, b.depth + 1 + b.passed);
            sample.radiance += lights.sum(&r, sample.rng, &mut sample.tally);
            let watched = self.settings.watched.filter(|_| !b.indirect);
            if let Some(rule) = watched.and_then(|light| lights.rule(&r, light as usize)) {
                sample.tally.watch(rule);
            }
        }
    }

    /// Sends rays on from the surface: from the diffuse part towards what virtual lights leave out, and from `rest`.
    fn go_on(&self, b: Branch, end: &End, sample: &mut Sample) {
        let [ux, uy, mut u_lobe, u_roulette] = sample.rng.next_4d();
        let lit = self.rest_of_lights.is_some() && self.shows(&b);
        let wanted =
            (self.settings.parts.indirect && (self.seeks_rest || self.radius2 > 0.0)) || (lit && self.radius2 > 0.0);
        let crowded = is_crowded(b.blurred, sample.waiting.len());
        let mut shares = [1.0; 2];
        let (mut diffuse, mut rest) = (end.diffuse.filter(|_| wanted), end.rest);
        if let (Some(d), Some(r), true) = (diffuse, rest, crowded) {
            // No room for both: one by chance.
            let (is_rest, p, u) = one_part(d, r, end.wo, u_lobe);
            u_lobe = u;
            if is_rest { (diffuse, shares[1]) = (None, p) } else { (rest, shares[0]) = (None, p) }
        }
        let u = Vec2::new(ux, uy);
        let chance = |share| Chance { share, importance: None, u: u_roulette };
        if let Some(s) = diffuse.and_then(|d| d.sample(end.wo, u_lobe, u, Transport::Radiance)) {
            let came = Came::Diffuse { short: !self.seeks_rest, shown: lit };
            self.push(&b, end, &s, chance(shares[0]), came, sample);
        }
        let Some(rest) = rest else { return };
        for s in &directions(rest, end.wo, (u_lobe, u), crowded) {
            let covered = matches!(b.came, Came::Diffuse { .. } | Came::Covered) && self.caustics.is_some();
            let came = match s.lobe {
                LobeKind::Null => b.came,
                _ if self.brings_rest(&b.came) => continue,
                LobeKind::Specular if covered => Came::Covered,
                LobeKind::Specular => Came::Plain,
                _ if self.is_covered(&b.came, rest) => Came::Covered,
                _ => {
                    let diffuse = end.diffuse.filter(|_| self.rest_of_lights.is_none());
                    let from = Vantage::new(end.at, diffuse, end.rest, stage(b.blurred, b.depth));
                    Came::Glossy { from, pdf_dir: s.pdf_dir }
                }
            };
            self.push(&b, end, s, chance(shares[1]), came, sample);
        }
    }

    /// Lets the scattered ray wait, if it survives.
    fn push(&self, b: &Branch, end: &End, s: &BsdfSample, chance: Chance, came: Came, sample: &mut Sample) {
        let state = b.state().scattered(s, chance, end.last, self.settings.path.rr_depth);
        let Some(State { throughput, eta2, depth, passed, blurred }) = state else { return };
        let straight = s.lobe == LobeKind::Null;
        let reach = match came {
            // What is left of a short ray behind a surface that it passes.
            _ if straight => b.ray.tmax - end.t,
            Came::Diffuse { short: true, .. } => {
                let [u, ..] = sample.rng.next_4d();
                (self.radius2 * (1.0 / u.max(f32::MIN_POSITIVE) - 1.0)).sqrt()
            }
            _ => f32::INFINITY,
        };
        // There is always room for one, and for more where more were sent.
        let _ = sample.waiting.try_push(Branch {
            ray: Ray { tmax: reach, ..Ray::leaving(end.at, s.wi) },
            throughput,
            eta2,
            depth,
            passed,
            came,
            travelled: if straight { b.travelled } else { 0.0 },
            indirect: b.indirect || s.lobe == LobeKind::Diffuse,
            blurred,
        });
    }
}
