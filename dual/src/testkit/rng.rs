//! A small seeded generator for tests (SplitMix64): same seed, same numbers, everywhere. Not for rendering.

use crate::ray::Family;
use crate::vec3::{Vec3, vec3};

/// Deterministic random numbers, directions and families.
#[derive(Clone, Debug)]
pub struct Rng(u64);

impl Rng {
    /// Starts a sequence.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [a, b).
    pub fn range(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    /// Uniform in the cube [-r, r)^3.
    pub fn cube(&mut self, r: f64) -> Vec3<f64> {
        vec3(self.range(-r, r), self.range(-r, r), self.range(-r, r))
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> Vec3<f64> {
        let z = self.range(-1.0, 1.0);
        let phi = self.range(0.0, std::f64::consts::TAU);
        let r = (1.0 - z * z).max(0.0).sqrt();
        vec3(r * phi.cos(), r * phi.sin(), z)
    }

    /// A fixed-origin family about direction `d`: two independent half widths of up to `size` |d|, skewed, not normalised.
    pub fn family(&mut self, o: Vec3<f64>, d: Vec3<f64>, size: f64) -> Family<f64, 2> {
        loop {
            let len = d.norm() * size;
            let (a, b) =
                (self.direction() * (len * self.range(0.2, 1.0)), self.direction() * (len * self.range(0.2, 1.0)));
            // Seen edge-on a footprint has no area; such families have their own test.
            if d.dot(a.cross(b)).abs() > 0.05 * d.norm() * a.norm() * b.norm() {
                return Family::fixed(o, d, [a, b]);
            }
        }
    }
}
