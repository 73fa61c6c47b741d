//! What a gather ray has hit, as the cache stores it: 36 bytes a ray.
//!
//! Normals are packed by the octahedral map (Meyer et al. 2010, "On Floating-Point Normal Vectors").

use super::cache_file::stored;
use super::reached::Reached;
use crate::math::{Rgb, Vec2, Vec3, luminance};

/// What a gather ray of a record has hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherHit {
    /// Direction from the record, world, unit.
    pub direction: Vec3,
    /// 1 / length of the chain of rays up to the first rough glossy surface, if it meets one; 0 at infinity.
    pub inverse_distance: f32,
    /// Factor on the irradiance of the surfel: throughput times albedo.
    pub weight: Rgb,
    /// The surfel, if any.
    pub reached: Reached,
    /// Geometric normal, packed.
    pub packed_normal: u32,
}

stored!(GatherHit { direction, inverse_distance, weight, reached, packed_normal });

impl GatherHit {
    /// Geometric normal at the end, towards the ray.
    pub fn normal(&self) -> Vec3 {
        unpack_normal(self.packed_normal)
    }

    /// What it brings where surfels have this `irradiance`: pi times the luminance of its radiance.
    pub fn brings(&self, irradiance: &[Rgb]) -> f32 {
        irradiance.get(self.reached.surfel()).map_or(0.0, |e| luminance(self.weight * *e))
    }
}

/// Steps of a packed component: an even number, so that 0 is exact.
const STEPS: f32 = 65534.0;

/// Octahedral map of a unit vector to twice 16 bits (error below 1e-4).
pub fn pack_normal(n: Vec3) -> u32 {
    let q = n.truncate() / (n.x.abs() + n.y.abs() + n.z.abs());
    let fold = Vec2::new((1.0 - q.y.abs()).copysign(q.x), (1.0 - q.x.abs()).copysign(q.y));
    let q = if n.z < 0.0 { fold } else { q };
    let [x, y] = [q.x, q.y].map(|c| ((c * 0.5 + 0.5) * STEPS).round() as u32);
    x | y << 16
}

/// Inverse of [`pack_normal`].
pub fn unpack_normal(packed: u32) -> Vec3 {
    let [x, y] = [packed & 0xffff, packed >> 16].map(|c| c as f32 * (2.0 / STEPS) - 1.0);
    let z = 1.0 - x.abs() - y.abs();
    let t = (-z).max(0.0);
    Vec3::new(x - t.copysign(x), y - t.copysign(y), z).normalize()
}
