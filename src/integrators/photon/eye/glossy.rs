//! Glossy lobes that the eye sees: several rays at once where gather rays have found bright places.
//!
//! Estimate    (1 / n) sum of n paths whose first directions are an Owen-Sobol sequence, of the density of [`glossy_guide`](crate::transport::glossy_guide)
//!             n goes with the share of the lobe in what is seen
//! Why         a window is found or missed: one ray per camera sample, which traces as many for light samples and looks up a record besides, is
//!             too little
//! Bias        none
//! Verified by tests/sky.rs

use super::{Branch, Came, End, Eye, Sample};
use crate::integrators::branching::{Chance, stage};
use crate::math::{Vec3, luminance};
use crate::scene::{Bsdf, SurfacePoint};
use crate::transport::direct::Vantage;
use crate::transport::glossy_guide::Guide;
use crate::transport::surfels::Facet;

/// Most rays.
const RAYS: f32 = 4.0;

/// Greatest density per solid angle with which a glossy lobe sends rays that may end on surfels: their cells span a hundredth of a
/// steradian (`surfels::CELL_PER_DISTANCE`), and the lobe is to cover several.
const WIDE: f32 = 25.0;

impl Eye<'_> {
    /// What the cache knows of the light that glossy lobes reflect to the eye.
    pub(super) fn guide(
        &self,
        b: &Branch,
        at: &SurfacePoint,
        (diffuse, rest): (&Bsdf, &Bsdf),
        wo: Vec3,
    ) -> Option<Guide<'_>> {
        let asked = !b.blurred && !rest.is_delta() && !self.is_covered(&b.came, rest);
        let mut guide = self.guides.filter(|_| asked)?.guide(&Facet::seen_from(at, wo), rest, wo)?;
        let [glossy, white] = guide.reflected;
        let share = glossy / (glossy + luminance(diffuse.albedo(wo)) * white);
        let rays = (RAYS * share * b.throughput.max_element()).clamp(1.0, RAYS).ceil() as u32;
        guide.rays = rays.next_power_of_two();
        Some(guide)
    }

    /// Follows rays from the lobes of `rest` to the end of their paths; they were chosen with the probability `share`.
    pub(super) fn send_guided(
        &self,
        b: &Branch,
        end: &End,
        (rest, guide): (&Bsdf, &Guide),
        share: f32,
        sample: &mut Sample,
    ) {
        let rays = guide.rays;
        // Rays to bright places have small weights: what is worth following is the lobe.
        let importance = (b.throughput * rest.albedo(end.wo)).max_element() / share * b.eta2;
        let block = sample.rng.next_block(rays);
        let waiting = sample.waiting.len();
        for k in 0..rays {
            let [x, y, u, u_roulette] = block.point(k);
            let Some((s, of_lobe)) = guide.sample(rest, end.wo, Vec3::new(x, y, u)) else { continue };
            let came = self.came_glossy(b, end, rays as f32 * s.pdf_dir, of_lobe);
            let chance = Chance { share: share * rays as f32, importance: Some(importance), u: u_roulette };
            self.push(b, end, &s, chance, came, sample);
            self.follow_waiting(sample, waiting);
        }
    }

    /// How a ray comes that counts `pdf_dir` against light samples, its density times the number of rays, where the lobe's own is `of_lobe`.
    pub(super) fn came_glossy(&self, b: &Branch, end: &End, pdf_dir: f32, of_lobe: f32) -> Came {
        let from = Vantage::new(end.at, end.diffuse, end.rest, stage(b.blurred, b.depth));
        Came::Glossy { from, pdf_dir, wide: of_lobe < WIDE }
    }
}
