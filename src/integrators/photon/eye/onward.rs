//! Rays that surfaces on eye paths send on: which parts of the material scatter, how many, and which live.
//!
//! Branching and roulette: as [`branching`](crate::integrators::branching) says; several rays at once in gaps of the cache (`gap.rs`) and from
//! glossy lobes that it guides (`glossy.rs`).
//! Verified by tests/furnace.rs and tests/photon.rs

use super::{Branch, Came, End, Eye, Sample};
use crate::accel::Ray;
use crate::integrators::branching::{Chance, State, directions, is_crowded, one_part};
use crate::math::Vec2;
use crate::scene::{BsdfSample, LobeKind, Transport};

impl Eye<'_> {
    /// Sends rays on from the surface: from the rest, and from the diffuse part if its light is unknown, which had the probability `chosen`.
    pub(super) fn go_on(&self, b: Branch, end: &End, chosen: f32, sample: &mut Sample) {
        let [ux, uy, mut u_lobe, u_roulette] = sample.rng.next_4d();
        let crowded = is_crowded(b.blurred, sample.waiting.len());
        let mut shares = [chosen, 1.0];
        let (mut unknown, mut rest) = (end.diffuse.filter(|_| chosen > 0.0), end.rest);
        if let (Some(d), Some(r), true) = (unknown, rest, crowded) {
            // No room for both: one by chance.
            let (is_rest, p, u) = one_part(d, r, end.wo, u_lobe);
            u_lobe = u;
            if is_rest { (unknown, shares[1]) = (None, p) } else { (rest, shares[0]) = (None, chosen * p) }
        }
        let u = Vec2::new(ux, uy);
        let chance = |share| Chance { share, importance: None, u: u_roulette };
        if let Some(d) = unknown {
            let rays = self.rays_in_gap(&b, end);
            sample.features.makeup.gathers += 1.0;
            if rays > 1 {
                self.gather_in_gap(&b, end, d, (rays, shares[0]), sample);
            } else if let Some(s) = d.sample(end.wo, u_lobe, u, Transport::Radiance) {
                self.push(&b, end, &s, chance(shares[0]), Came::Diffuse, sample);
            }
        }
        let Some(rest) = rest else { return };
        if let Some(guide) = end.guide {
            self.send_guided(&b, end, (rest, guide), shares[1], sample);
            return;
        }
        for s in &directions(rest, end.wo, (u_lobe, u), crowded) {
            let covered = matches!(b.came, Came::Diffuse | Came::Covered) && self.caustics.is_some();
            let came = match s.lobe {
                LobeKind::Null => b.came,
                LobeKind::Specular if covered => Came::Covered,
                LobeKind::Specular => Came::Plain,
                _ if self.is_covered(&b.came, rest) => Came::Covered,
                _ => self.came_glossy(&b, end, s.pdf_dir, s.pdf_dir),
            };
            self.push(&b, end, s, chance(shares[1]), came, sample);
        }
    }

    /// Lets the scattered ray wait, if it survives.
    pub(super) fn push(&self, b: &Branch, end: &End, s: &BsdfSample, chance: Chance, came: Came, sample: &mut Sample) {
        let state = b.state().scattered(s, chance, end.last, self.settings.path.rr_depth);
        let Some(State { throughput, eta2, depth, passed, blurred }) = state else { return };
        // There is always room for one, and for more where more were sent.
        let _ = sample.waiting.try_push(Branch {
            ray: Ray::leaving(end.at, s.wi),
            throughput,
            eta2,
            depth,
            passed,
            came,
            travelled: b.travelled,
            indirect: b.indirect || s.lobe == LobeKind::Diffuse,
            blurred,
        });
    }
}
