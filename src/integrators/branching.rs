//! How eye paths branch, end and tell what they see: what the integrators have in common.
//!
//! Dirac lobes at the first vertices send on both mirrored and refracted ray, and diffuse parts beside the rest, as long as there is room;
//! else one direction is chosen by chance. Paths end by roulette on their importance (throughput x eta^2).

use crate::image::film::Features;
use crate::math::{Rgb, Vec2, Vec3, luminance};
use crate::scene::{Bsdf, BsdfSample, LobeKind, SurfacePoint, Transport};
use crate::transport::direct::Stage;
use crate::transport::{MAX_PASSED_SURFACES, MAX_SURVIVAL};
use arrayvec::ArrayVec;

/// Most rays of one camera sample that wait at a time; where there is no room, one direction is chosen by chance.
pub const MOST_BRANCHES: usize = 8;
/// Rays that a surface may send on at once, with one to spare.
const ROOM: usize = 4;
/// Scatterings up to which direct light is looked at closely.
const FIRST_DEPTH: u32 = 4;
/// Rays of less importance than this live on by roulette, whatever their depth. Errors of cornell-spheres after 2 and 6 passes, and their time, over
/// those with 0.05: 0.93 and 1.01; with 0.01 0.92 and 1.05.
const DIM: f32 = 0.02;

/// Whether a path goes on in one direction only: `blurred` if a lobe that is no Dirac lobe has scattered it, `waiting` rays there are.
pub fn is_crowded(blurred: bool, waiting: usize) -> bool {
    blurred || MOST_BRANCHES - waiting < ROOM
}

/// How much the end of a ray matters to its direct light, after `depth` scatterings.
pub fn stage(blurred: bool, depth: u32) -> Stage {
    if blurred || depth > FIRST_DEPTH { Stage::Later } else { Stage::First }
}

/// One part of a material by the number `u` in [0, 1), in proportion to albedo: whether it is the rest, with what probability, and what `u`
/// still has to say, in [0, 1) again.
pub fn one_part(diffuse: &Bsdf, rest: &Bsdf, wo: Vec3, u: f32) -> (bool, f32, f32) {
    let [d_share, r_share] = [diffuse, rest].map(|part| luminance(part.albedo(wo)).max(1e-6));
    let p = r_share / (d_share + r_share);
    if u < p { (true, p, u / p) } else { (false, 1.0 - p, (u - p) / (1.0 - p)) }
}

/// Directions in which `rest` sends a path on: all of its branches, or one by chance.
pub fn directions(rest: &Bsdf, wo: Vec3, (u_lobe, u): (f32, Vec2), crowded: bool) -> ArrayVec<BsdfSample, 2> {
    let branches = if crowded { None } else { rest.branches(wo, Transport::Radiance) };
    branches.unwrap_or_else(|| rest.sample(wo, u_lobe, u, Transport::Radiance).into_iter().collect())
}

/// Probability with which a ray of this importance is traced; `roulette` from the depth on at which every path may end, `blurred` as for
/// [`is_crowded`]. What is left of the importance after it is 1 for blurred paths from that depth on, the one way that their sample takes. Of
/// rays that branched there are others in the same sample, of known light: one that was raised from [`DIM`] to 1 would outshine them.
pub fn survival(importance: f32, roulette: bool, blurred: bool) -> f32 {
    let survival = (importance / DIM).min(1.0);
    match (roulette, blurred) {
        (false, _) => survival,
        (true, false) => survival.min(MAX_SURVIVAL),
        (true, true) => survival.min(importance.min(MAX_SURVIVAL)),
    }
}

/// What scattering changes of a path, beside its direction.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// Product of the weights of scatterings.
    pub throughput: Rgb,
    /// Product of squared relative indices crossed.
    pub eta2: f32,
    /// Scatterings.
    pub depth: u32,
    /// Surfaces passed straight through.
    pub passed: u32,
    /// Whether a lobe that is no Dirac lobe has scattered it.
    pub blurred: bool,
}

/// What decides about a scattered ray.
#[derive(Clone, Copy, Debug)]
pub struct Chance {
    /// Probability of having chosen its part of the material, times the number of rays that share it.
    pub share: f32,
    /// What following it is worth; `None`: its own throughput x eta^2.
    pub importance: Option<f32>,
    /// Number in [0, 1).
    pub u: f32,
}

impl State {
    /// The state behind the scattering `s`, if the ray is to be traced; `last` if the path may not get longer, every path may end from `rr_depth` on.
    pub fn scattered(&self, s: &BsdfSample, chance: Chance, last: bool, rr_depth: u32) -> Option<State> {
        let straight = s.lobe == LobeKind::Null;
        if (last && !straight) || (straight && self.passed >= MAX_PASSED_SURFACES) {
            return None;
        }
        let depth = self.depth + u32::from(!straight);
        let eta2 = self.eta2 * s.eta * s.eta;
        let throughput = self.throughput * s.weight / chance.share;
        let importance = chance.importance.unwrap_or_else(|| throughput.max_element() * eta2);
        let blurred = self.blurred || matches!(s.lobe, LobeKind::Diffuse | LobeKind::Glossy);
        let survival = survival(importance, depth >= rr_depth && !straight, blurred);
        let passed = self.passed + u32::from(straight);
        (chance.u < survival).then_some(State { throughput: throughput / survival, eta2, depth, passed, blurred })
    }
}

/// How a camera sample came to what it sees.
pub struct Way {
    /// Product of the weights of scatterings.
    pub throughput: Rgb,
    /// Scatterings.
    pub depth: u32,
    /// Whether one of them was by a lobe that is no Dirac lobe.
    pub blurred: bool,
    /// Length.
    pub travelled: f32,
}

impl Way {
    /// Notes a surface that is seen: the first one of all, and those that are seen sharply, for the guides.
    pub fn note(&self, features: &mut Features, at: &SurfacePoint, bsdf: &Bsdf, wo: Vec3) {
        let is_first = self.depth == 0 && features.shape == 0;
        let guides = !self.blurred && !bsdf.is_delta();
        if !(is_first || guides) {
            return;
        }
        let albedo = bsdf.albedo(wo);
        if is_first {
            (features.albedo, features.normal) = (albedo, at.n_shade);
            (features.depth, features.shape) = (self.travelled, at.shape + 1);
        }
        if guides {
            features.guide.see(self.throughput, albedo, at.n_shade, self.travelled);
        }
    }

    /// Notes a light that is seen itself.
    pub fn note_light(&self, features: &mut Features, emitted: Rgb) {
        if !self.blurred {
            features.guide.see_light(self.throughput, emitted);
        }
    }
}
