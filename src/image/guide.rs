//! Guides of a pixel: what tells it from its neighbours whatever the noise, for the filter in [`super::denoise`].
//!
//! A camera sample sees surfaces straight from the camera or by mirrors, panes and balls of glass (Dirac lobes), each with the throughput of its
//! way. Its guides are sums over these: a pixel whose mirror shows two walls differs from one that shows one of them.

use crate::math::{Rgb, Vec3, luminance};

/// Sums over what a sample sees, each by the throughput (luminance) with which it is seen; over the samples of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Guide {
    /// Hemispherical albedo, by channel.
    pub albedo: Rgb,
    /// Shading normal, world.
    pub normal: Vec3,
    /// Length of the way.
    pub distance: f32,
    /// Luminance of lights that are seen themselves.
    pub emitted: f32,
}

impl Guide {
    /// Adds a surface that scatters otherwise than a mirror does, at the end of a way of length `distance`.
    pub fn see(&mut self, throughput: Rgb, albedo: Rgb, normal: Vec3, distance: f32) {
        let share = luminance(throughput);
        self.albedo += throughput * albedo;
        self.normal += normal * share;
        self.distance += distance * share;
    }

    /// Adds a light that is seen itself.
    pub fn see_light(&mut self, throughput: Rgb, emitted: Rgb) {
        self.emitted += luminance(throughput * emitted);
    }

    /// Adds up samples.
    pub fn add(&mut self, other: &Guide) {
        self.albedo += other.albedo;
        self.normal += other.normal;
        self.distance += other.distance;
        self.emitted += other.emitted;
    }

    /// The mean of sums over `1 / k` samples.
    pub fn scaled(&self, k: f32) -> Guide {
        Guide {
            albedo: self.albedo * k,
            normal: self.normal * k,
            distance: self.distance * k,
            emitted: self.emitted * k,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_seen_counts_by_its_throughput() {
        let mut guide = Guide::default();
        guide.see(Rgb::splat(0.25), Rgb::new(0.8, 0.4, 0.0), Vec3::Z, 2.0);
        guide.see(Rgb::splat(0.5), Rgb::splat(1.0), Vec3::X, 4.0);
        guide.see_light(Rgb::splat(0.5), Rgb::splat(2.0));
        let near = |a: Vec3, b: Vec3| (a - b).length() < 1e-6;
        assert!(near(guide.albedo, Rgb::new(0.7, 0.6, 0.5)) && near(guide.normal, Vec3::new(0.5, 0.0, 0.25)));
        assert!((guide.distance - 2.5).abs() < 1e-6 && (guide.emitted - 1.0).abs() < 1e-6, "{guide:?}");
        let mut sum = guide;
        sum.add(&guide);
        assert_eq!(sum.scaled(0.5), guide);
    }
}
