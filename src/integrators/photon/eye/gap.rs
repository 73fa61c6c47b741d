//! Gaps of the irradiance cache: several gather rays at once where no record covers what is seen.
//!
//! Estimate    (1 / n) sum of n paths that begin with the diffuse part's density, their first directions points of one Owen-Sobol sequence
//! Why         a few per cent of all look-ups find no record, in creases mostly, beside surfaces whose records are free of noise: one gather
//!             ray to a bright spot is a speck there, which pixels next to it do not have. Samples are worth the standard deviation of what
//!             they estimate (Neyman 1934), and that is next to nothing where a record answers
//! Bias        none
//! Verified by `tests`

use super::super::settings::Indirect;
use super::{Branch, Came, End, Eye, Sample};
use crate::integrators::branching::Chance;
use crate::math::Vec2;
use crate::scene::{Bsdf, Transport};
use crate::transport::IrradianceCache;

/// Most rays. Error times cost of living-room over that of one ray: 4: 0.71, 8: 0.67, 16: 0.77; of a room with 9 in 100 look-ups in gaps, where
/// other noise rules, 8: 1.06, 16: 1.19.
const RAYS: f32 = 8.0;

impl Eye<'_> {
    /// Number of gather rays for the diffuse part at the end of a ray without a record: a power of two, less for what counts little. One on shapes
    /// whose records have been given up, so that all of their pixels gather; where records are not asked, few bounces being left; and where
    /// the view is blurred, so that other rays of the pixel gather elsewhere.
    pub(super) fn rays_in_gap(&self, b: &Branch, end: &End) -> u32 {
        let is_gap = |cache: &IrradianceCache| !cache.gives_up(end.at.shape);
        let asked = self.settings.indirect == Indirect::Cache && !self.has_too_many_bounces(b.depth);
        if b.blurred || !asked || !self.cache.is_some_and(is_gap) {
            return 1;
        }
        ((RAYS * b.throughput.max_element()).clamp(1.0, RAYS).ceil() as u32).next_power_of_two()
    }

    /// Follows so many gather rays from the diffuse part to the end of their paths; it was chosen with the probability `share`.
    pub(super) fn gather_in_gap(
        &self,
        b: &Branch,
        end: &End,
        diffuse: &Bsdf,
        (rays, share): (u32, f32),
        sample: &mut Sample,
    ) {
        let block = sample.rng.next_block(rays);
        let waiting = sample.waiting.len();
        for i in 0..rays {
            let [x, y, u_lobe, u] = block.point(i);
            let Some(s) = diffuse.sample(end.wo, u_lobe, Vec2::new(x, y), Transport::Radiance) else { continue };
            let chance = Chance { share: share * rays as f32, importance: None, u };
            self.push(b, end, &s, chance, Came::Diffuse, sample);
            // What they see has left a diffuse part: there are no gaps for it.
            self.follow_waiting(sample, waiting);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::Counts;
    use crate::integrators::photon::{Parts, PhotonSettings};
    use crate::math::{DVec3, Sampler, luminance};
    use crate::scene::description::GeometryDesc;
    use crate::transport::CacheSettings;
    use crate::transport::direct::Direct;
    use crate::transport::tests::{Room, add, diffuse, empty, moments, square};

    #[test]
    fn several_rays_in_gaps_keep_the_mean_and_lower_the_noise() {
        // A floor that is seen from above, and a wall beside it: its light comes by a part of the gather rays.
        let mut scene = empty();
        let white = diffuse(&mut scene, 0.8);
        add(&mut scene, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 2.0), white);
        add(&mut scene, GeometryDesc::Rectangle, square(DVec3::new(1.0, 0.5, 0.0), -DVec3::X, 1.0), white);
        let room = Room::new(scene);
        let world = room.world();
        let settings = PhotonSettings {
            parts: Parts { direct: false, caustic: false, indirect: true },
            ..PhotonSettings::default()
        };
        let direct = Direct::new(world, settings.direct);
        // All of it is a gap.
        let cache = IrradianceCache::new(world, CacheSettings::default());
        let (samples, ray) = (20_000, world.scene.camera.ray(Vec2::splat(32.0), Vec2::splat(0.5)));
        let sampled = |cache, stream| {
            let eye = Eye {
                world,
                settings: &settings,
                direct: &direct,
                caustics: None,
                global: None,
                cache,
                guides: cache,
                sky: false,
            };
            let mut counts = Counts::default();
            let mut sample = |k| {
                let light = eye.sample(&ray, &mut Sampler::new(1, stream, k), &mut counts).0;
                f64::from(luminance(light))
            };
            let light: Vec<f64> = (0..samples).map(&mut sample).collect();
            (moments(&light), counts)
        };
        let ([one, one_rms, one_sigma], _) = sampled(None, 1);
        let ([several, rms, sigma], counts) = sampled(Some(&cache), 2);
        assert!(counts.cache_misses == counts.cache_lookups && counts.cache_lookups >= samples, "{counts:?}");
        assert!(
            (several - one).abs() < 4.0 * sigma.hypot(one_sigma),
            "{several} +- {sigma}, one ray {one} +- {one_sigma}"
        );
        assert!(one_sigma < 0.03 * one, "the test has no power: {one} +- {one_sigma}");
        // An eighth of the variance; less by the order of the directions.
        let quotient = (rms * rms - several * several) / (one_rms * one_rms - one * one);
        assert!((0.02..0.17).contains(&quotient), "{quotient} of the variance");
    }
}
