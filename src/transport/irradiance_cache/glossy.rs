//! What records tell glossy lobes (`glossy_guide`): made by [`IrradianceCache::finish`], looked up. Between two calls of it they are old, which
//! costs noise alone.

use super::IrradianceCache;
use crate::math::Vec3;
use crate::scene::Bsdf;
use crate::transport::cache_record::BORDER;
use crate::transport::glossy_guide::{GlossyGuides, Guide, is_of_use};
use crate::transport::surfels::Facet;

impl IrradianceCache<'_> {
    /// Makes the guides anew from the records as they are, if the scene has lobes to guide.
    pub(super) fn learn_guides(&mut self) {
        if let Some(light) = self.light.as_ref().filter(|_| is_of_use(&self.world.scene.materials)) {
            self.guides = GlossyGuides::new(&self.world, &self.gather, light);
        }
    }

    /// What the nearest record tells the glossy lobes of `bsdf` at a point, seen from the unit vector `wo`.
    pub fn guide(&self, at: &Facet, bsdf: &Bsdf, wo: Vec3) -> Option<Guide<'_>> {
        if self.guides.is_empty() {
            return None;
        }
        let mut nearest = (BORDER, None);
        self.tree.containing(at.p, |id| {
            let d = self.records[id as usize].distance(at.p, at.n_shade, at.n_geo);
            nearest = d.filter(|d| *d < nearest.0).map_or(nearest, |d| (d, Some(id)));
            true
        });
        self.guides.guide(&self.gather, nearest.1? as usize, bsdf, wo)
    }
}
