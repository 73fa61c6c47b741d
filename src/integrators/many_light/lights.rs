//! The virtual lights of a pass, and what belongs to them: hierarchy, visibility cache, ranges.
//!
//! Interleaved sampling (Keller & Heidrich 2001): with n x n classes of film positions, (x mod n, y mod n), each class has lights of its own, n^2 times
//! fewer; photons, rays of the caches and memory of a pass stay the same, sums get n^2 times shorter. Every class has the right mean, so
//! that the pattern fades as passes go on.

use super::ManyLightSettings;
use crate::math::{Price, Vec2};
use crate::transport::World;
use crate::transport::emitter_vpls::EmitterVpls;
use crate::transport::strategies::{Strategy, culling};
use crate::transport::visibility::{ShadingClusters, VisibilityCache};
use crate::transport::vpl::{Area, VplSource, Vpls};
use crate::transport::vpl_tree::VplTree;

/// What virtual lights are made from.
#[derive(Debug, Default)]
pub struct Sources<'a> {
    /// Photons.
    pub photons: Option<VplSource<'a>>,
    /// Lamps and point lights.
    pub emitters: Option<EmitterVpls<'a>>,
}

impl<'a> Sources<'a> {
    /// For `wanted` lights from photons in each class of film positions.
    pub fn new(world: World<'a>, wanted: usize, settings: &ManyLightSettings) -> Self {
        let (path, parts) = (settings.path, settings.parts);
        let photons = (parts.indirect)
            .then(|| VplSource::new(world, wanted, path.max_depth, path.rr_depth, settings.seed))
            .flatten();
        let shown = settings.emitter_vpls > 0 && path.max_depth.is_none_or(|d| d > 1);
        let count = settings.emitter_vpls.div_ceil(settings.classes());
        let emitters = shown.then(|| EmitterVpls::new(world.scene, count, settings.seed)).flatten();
        Sources { photons, emitters }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.photons.is_none() && self.emitters.is_none()
    }

    /// An area like those that the lights stand for, the same for every pass.
    pub fn mean_area(&self) -> f32 {
        let of_emitters = || self.emitters.as_ref().map_or(0.0, EmitterVpls::mean_area);
        self.photons.as_ref().map_or_else(of_emitters, VplSource::mean_area)
    }

    fn lights(&self, settings: &ManyLightSettings, run: u64) -> Vpls {
        let area = match settings.area {
            0.0 => Area::One(0.0),
            a if settings.compensate => Area::One(a * self.mean_area()),
            a => Area::Own(a),
        };
        let mut vpls = self.photons.as_ref().map_or_else(Vpls::default, |s| s.lights(area, run));
        vpls.lights.extend(self.emitters.iter().flat_map(|e| e.lights(area, run)));
        vpls
    }
}

/// The lights of one class of film positions.
#[derive(Debug, Default)]
pub struct PassLights {
    pub vpls: Vpls,
    pub tree: VplTree,
    pub cache: Option<VisibilityCache>,
    pub ranges: Vec<f32>,
}

impl PassLights {
    /// Lights by the number `run` of the sources' sequences.
    pub fn new(
        world: World,
        sources: &Sources,
        clusters: &ShadingClusters,
        settings: &ManyLightSettings,
        run: u64,
    ) -> Self {
        let mut vpls = sources.lights(settings, run);
        let mut tree = VplTree::build(&mut vpls);
        let strategy = settings.strategy.strategy;
        let cache = strategy.needs_cache().then(|| VisibilityCache::build(world, clusters, &vpls, settings.seed, run));
        if let (Some(cache), Strategy::Joint) = (&cache, strategy) {
            tree.count_visible(cache);
        }
        PassLights { vpls, tree, cache, ranges: Vec::new() }
    }

    /// Random ranges for `culling` with this price; `key` decides.
    pub fn set_ranges(&mut self, settings: &ManyLightSettings, price: &Price, key: u64) {
        if settings.strategy.strategy == Strategy::Culling {
            let two_epsilon = culling::two_epsilon(settings.strategy.epsilon, price);
            self.ranges = culling::ranges(&self.vpls, two_epsilon, key);
            self.tree.set_ranges(&self.ranges);
        }
    }
}

/// Class of a film position among n x n.
pub fn class(film: Vec2, n: u32) -> usize {
    // Filters reach beyond the film.
    let of = |x: f32| (x.floor() as i64).rem_euclid(i64::from(n)) as usize;
    of(film.x) + n as usize * of(film.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_pixels_have_classes_of_their_own() {
        let of = |x: f32, y: f32| class(Vec2::new(x, y), 3);
        let mut all: Vec<usize> = (0..9).map(|i| of(6.5 + (i % 3) as f32, 4.1 + (i / 3) as f32)).collect();
        all.sort_unstable();
        assert_eq!(all, (0..9).collect::<Vec<_>>());
        assert_eq!(of(-0.5, 0.5), of(2.5, 0.5));
        assert_eq!(class(Vec2::new(17.2, 3.9), 1), 0);
    }
}
