//! The eye path of the photon integrator: from the camera to the diffuse surfaces whose light is known.
//!
//! What counts where. A material is a diffuse part d and a rest r (Dirac and glossy lobes, coats); a path is written from the eye, E.
//!
//!   d, light straight from an emitter          light sampling alone ([`Eye::direct`])
//!   d, light by nearly specular scatterings    the caustic photons: L S+ d
//!   d, all else                                the irradiance cache; without a record there, the path goes on from d (`gap.rs`)
//!   r, light straight from an emitter          light sampling and scattering, by the power heuristic
//!   r, all else                                the path goes on from r
//!
//! So a path that goes on from d counts no emitter it meets before a surface that is not nearly specular (`covered`), and at a
//! nearly specular surface that it meets until then, light is not sampled. Nearly specular: Dirac lobes, and glossy ones of a roughness
//! below a threshold; the lobe that scattered decides ([`nearly_specular`]). Without caustic photons the path itself finds caustics.
//!
//! Where a path has left a diffuse part, or a lobe wider than what gather rays tell apart ([`WIDE`]), the next diffuse part answers with the
//! irradiance of the cache's surfel, if there is one ([`IrradianceCache::at_hit`]): a path without a record is one more gather ray.
//!
//! Residual roulette ([`Indirect::Residual`]): the cache's value q is a prediction. With the probability u = [`CHECK`] the path goes on from d
//! as if there were no record and brings v: the estimate q + (v - q) B / u has the mean of v whatever q is (`math::residual_roulette`). The path itself asks
//! no records: predictions upon predictions would multiply their noise, by albedo^2 / u each. Errors of the cache become noise; kernels of
//! caustic photons keep their bias.
//!
//! Branching: as [`branching`](crate::integrators::branching) says.
//! Verified by tests/furnace.rs and tests/photon.rs: agreement with the path tracer, part by part.

mod gap;
mod glossy;
mod onward;

use super::settings::{Indirect, Parts, PhotonSettings};
use crate::accel::Ray;
use crate::image::film::{Features, Makeup};
use crate::integrators::Counts;
use crate::integrators::branching::{MOST_BRANCHES, State, Way, stage};
use crate::math::{ResidualRoulette, Rgb, Sampler, Vec3};
use crate::scene::camera::CameraRay;
use crate::scene::{Bsdf, LobeKind, SurfacePoint};
use crate::transport::direct::{Direct, Found, Vantage};
use crate::transport::glossy_guide::{Guide, Rest};
use crate::transport::photon_map::{Filter, GlobalMap};
use crate::transport::surfels::Facet;
use crate::transport::{CausticMap, IrradianceCache, MAX_PASSED_SURFACES, World, nearly_specular};
use arrayvec::ArrayVec;
use std::f32::consts::FRAC_1_PI;

/// Probability that a prediction of the cache is checked by a path. The noise of the correction goes with 1 / u, the cost with u.
const CHECK: f32 = 0.25;
/// Number of further bounces up to which one more or less is seen.
const MATTERS: u32 = 5;

/// All that an eye path asks.
pub struct Eye<'a> {
    pub world: World<'a>,
    pub settings: &'a PhotonSettings,
    pub direct: &'a Direct<'a>,
    /// Caustic photons, `None` if paths are to find caustics.
    pub caustics: Option<&'a CausticMap>,
    /// Photons of indirect light, in place of the cache.
    pub global: Option<&'a GlobalMap>,
    /// Records of indirect irradiance.
    pub cache: Option<&'a IrradianceCache<'a>>,
    /// The cache whose records guide glossy lobes.
    pub guides: Option<&'a IrradianceCache<'a>>,
    /// Whether the environment is gathered for diffuse parts, not sampled.
    pub sky: bool,
}

/// How a ray left the surface before.
#[derive(Clone, Copy)]
enum Came {
    /// From the camera or a Dirac lobe: an emitter counts in full.
    Plain,
    /// From a glossy lobe: light sampling could have found the emitter.
    Glossy { from: Vantage, pdf_dir: f32, wide: bool },
    /// From a diffuse part: emitters are counted there, by light samples and caustic photons, all but a sky that is gathered.
    Diffuse,
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
    /// Length of the way so far.
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

    fn way(&self) -> Way {
        let &Branch { throughput, depth, blurred, travelled, .. } = self;
        Way { throughput, depth, blurred, travelled }
    }
}

/// Where a ray ended.
struct End<'s> {
    at: &'s SurfacePoint,
    wo: Vec3,
    /// The diffuse part of the material there.
    diffuse: Option<&'s Bsdf>,
    /// The other part.
    rest: Option<&'s Bsdf>,
    /// What the cache knows of the light that it reflects.
    guide: Option<&'s Guide<'s>>,
    /// Whether the path may not get longer.
    last: bool,
    /// Length of the ray.
    distance: f32,
}

/// Kinds of light, as [`Parts`] tells them apart.
#[derive(Clone, Copy)]
enum Kind {
    Direct,
    Caustic,
    Indirect,
}

/// A camera sample on its way.
struct Sample<'r> {
    radiance: Rgb,
    /// The same by [`Kind`].
    kinds: [Rgb; 3],
    features: Features,
    waiting: ArrayVec<Branch, MOST_BRANCHES>,
    rng: &'r mut Sampler,
    counts: &'r mut Counts,
}

impl Sample<'_> {
    /// Adds light of a kind, as it is after the path has left a diffuse part (`indirect`) or before.
    fn add(&mut self, light: Rgb, kind: Kind, indirect: bool) {
        self.radiance += light;
        self.kinds[if indirect { Kind::Indirect } else { kind } as usize] += light;
    }
}

impl Eye<'_> {
    /// Radiance along a camera ray, and the features of the first surface.
    pub fn sample(&self, camera: &CameraRay, rng: &mut Sampler, counts: &mut Counts) -> (Rgb, Features) {
        let mut sample = Sample {
            radiance: Rgb::ZERO,
            kinds: [Rgb::ZERO; 3],
            features: Features::default(),
            waiting: ArrayVec::new(),
            rng,
            counts,
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
        self.follow_waiting(&mut sample, 0);
        let mut features = sample.features;
        [features.makeup.direct, features.makeup.caustic, features.makeup.indirect] = sample.kinds;
        (sample.radiance, features)
    }

    fn parts(&self) -> Parts {
        self.settings.parts
    }

    /// Follows rays that wait, and those that these send on, until so many are `left`.
    fn follow_waiting(&self, sample: &mut Sample, left: usize) {
        while sample.waiting.len() > left {
            let Some(branch) = sample.waiting.pop() else { break };
            self.follow(branch, sample);
        }
    }

    /// Traces one ray and adds what its end reflects; what goes on from there waits.
    fn follow(&self, mut b: Branch, sample: &mut Sample) {
        let scene = self.world.scene;
        sample.counts.rays += 1;
        let emitters_seen = b.depth > 0 || !self.settings.path.hide_emitters;
        let shown = if b.indirect { self.parts().indirect } else { self.parts().direct };
        let Some(hit) = self.world.accel.closest(&b.ray) else {
            if emitters_seen && shown {
                let emitted = scene.lights.environment(scene.textures(), b.ray.d);
                let weight = self.weight(&b, Found::Environment(b.ray.d));
                b.way().note_light(&mut sample.features, emitted);
                sample.add(b.throughput * emitted * weight, Kind::Direct, b.indirect);
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
        if is_emitter && shown {
            let emitted = scene.lights.emitted(&scene.shapes, scene.textures(), &at, wo);
            if emitted != Rgb::ZERO {
                let weight = self.weight(&b, Found::Lamp(&at));
                b.way().note_light(&mut sample.features, emitted);
                sample.add(b.throughput * emitted * weight, Kind::Direct, b.indirect);
            }
        }
        b.travelled += hit.t;
        let bsdf = self.world.bsdf(&at, wo);
        b.way().note(&mut sample.features, &at, &bsdf, wo);
        let last = self.settings.path.max_depth.is_some_and(|max| b.depth + 1 >= max);
        if last && !self.world.passes_light(at.shape) {
            return;
        }
        let (diffuse, rest) = bsdf.split();
        let (diffuse, rest) = (diffuse.as_ref(), rest.as_ref());
        let guide = rest.filter(|_| !last).and_then(|rest| self.guide(&b, &at, (diffuse?, rest), wo));
        let guide = guide.as_ref();
        let end = End { at: &at, wo, diffuse, rest, guide, last, distance: hit.t };
        let unknown = if last { 0.0 } else { self.reflected(&b, &end, sample) };
        self.go_on(b, &end, unknown, sample);
    }

    /// Weight of an emitter that a ray meets.
    fn weight(&self, b: &Branch, found: Found) -> f32 {
        match &b.came {
            Came::Plain => 1.0,
            Came::Glossy { from, pdf_dir, .. } => self.direct.weight_of_scattered(from, *pdf_dir, found),
            Came::Diffuse => f32::from(u8::from(self.sky && matches!(found, Found::Environment(_)))),
            Came::Covered => 0.0,
        }
    }

    /// Whether a glossy lobe counts as a mirror for light that a caustic photon has brought already.
    fn is_covered(&self, came: &Came, rest: &Bsdf) -> bool {
        matches!(came, Came::Diffuse | Came::Covered)
            && self.caustics.is_some()
            && nearly_specular(rest, LobeKind::Glossy)
    }

    /// Adds what the surface reflects of light known there. 0 if that is all the light on the diffuse part; else the path has to go on from
    /// there, and has been chosen to with the probability returned.
    fn reflected(&self, b: &Branch, end: &End, sample: &mut Sample) -> f32 {
        let &End { at, wo, mut diffuse, rest, .. } = end;
        let parts = self.parts();
        if let Some((part, light)) = diffuse.and_then(|d| Some((d, self.at_surfel(b, end)?))) {
            if if b.indirect { parts.indirect } else { parts.direct } {
                sample.add(b.throughput * part.albedo(wo) * light * FRAC_1_PI, Kind::Direct, b.indirect);
            }
            diffuse = None;
        }
        let sampled = rest.filter(|r| !r.is_delta() && !self.is_covered(&b.came, r));
        if (diffuse.is_some() || sampled.is_some()) && (if b.indirect { parts.indirect } else { parts.direct }) {
            let light = self.direct.radiance(
                at,
                diffuse,
                sampled.map(|bsdf| Rest { bsdf, guide: end.guide }),
                wo,
                stage(b.blurred, b.depth),
                sample.rng,
                &mut sample.counts.direct,
            );
            sample.add(b.throughput * light, Kind::Direct, b.indirect);
        }
        let Some(diffuse) = diffuse else { return 0.0 };
        let most = self.settings.path.max_depth.map_or(u32::MAX, |max| max.saturating_sub(b.depth + 1));
        if let Some(map) = self.caustics.filter(|_| if b.indirect { parts.indirect } else { parts.caustic }) {
            let light = map.radiance_within(at, diffuse, wo, most);
            sample.add(b.throughput * light, Kind::Caustic, b.indirect);
        }
        if !parts.indirect {
            return 0.0;
        }
        if most < 2 {
            // One segment is left: to a sky that direct light leaves out.
            return f32::from(u8::from(self.sky));
        }
        if let Some(map) = self.global {
            let light = map.radiance(at, diffuse, wo, Filter::INDIRECT.within(most));
            sample.add(b.throughput * light, Kind::Indirect, true);
            return 0.0;
        }
        if self.has_too_many_bounces(b.depth) || (b.indirect && self.settings.indirect == Indirect::Residual) {
            return 1.0;
        }
        let facet = Facet::seen_from(at, wo);
        let cached = self.cache.and_then(|cache| cache.lookup(facet.p, facet.n_shade, facet.n_geo));
        sample.counts.cache_lookups += u64::from(self.cache.is_some());
        sample.counts.cache_misses += u64::from(self.cache.is_some() && cached.is_none());
        let Some(irradiance) = cached else { return 1.0 };
        if self.settings.inspect {
            self.inspect(&facet, &mut sample.features.makeup);
        }
        let predicted = diffuse.albedo(wo) * irradiance * FRAC_1_PI;
        if self.settings.indirect != Indirect::Residual {
            sample.add(b.throughput * predicted, Kind::Indirect, true);
            return 0.0;
        }
        let checked = sample.rng.next_2d().x < CHECK;
        // What the path brings comes later.
        let without_path = |q: f32| ResidualRoulette { pi: 1.0, q, u: CHECK }.estimate(true, checked, || 0.0);
        let light = Rgb::from_array(predicted.to_array().map(without_path));
        sample.add(b.throughput * light, Kind::Indirect, true);
        if checked { CHECK } else { 0.0 }
    }

    /// Whether the cache, which holds the bounces that are left behind the first surface, has more than are left at this depth, so that it shows.
    fn has_too_many_bounces(&self, depth: u32) -> bool {
        depth > 0 && self.settings.path.max_depth.is_some_and(|max| max < depth + MATTERS)
    }

    /// Whole irradiance at the end of a ray that stands for many directions, if the cache knows it.
    fn at_surfel(&self, b: &Branch, end: &End) -> Option<Rgb> {
        let wide = b.indirect || matches!(b.came, Came::Glossy { wide: true, .. });
        let parts = self.parts();
        let all = parts.direct && parts.caustic && parts.indirect;
        let too_deep = b.depth > 1 && self.has_too_many_bounces(b.depth);
        if !wide || !(b.indirect || all) || too_deep || self.settings.indirect != Indirect::Cache {
            return None;
        }
        self.cache?.at_hit(&Facet::seen_from(end.at, end.wo), end.distance)
    }

    /// Notes what the first look-up in the cache rests on.
    fn inspect(&self, at: &Facet, makeup: &mut Makeup) {
        let support = self.cache.filter(|_| makeup.cached == 0.0).and_then(|c| c.support(at.p, at.n_shade, at.n_geo));
        if let Some(s) = support {
            (makeup.cached, makeup.records, makeup.radius, makeup.error) = (1.0, s.records as f32, s.radius, s.error);
        }
    }
}
