//! The kernel of a photon's own footprint.
//!
//! ```text
//! E(x) += flux K(x - P),   K = 2 / (pi r1 r2) (1 - q),   q = (d.e1 / r1)^2 + (d.e2 / r2)^2 + (d.n / h)^2 < 1
//! r_i = clamp(sqrt 6 s sigma_i, r_min, r_max),   h = sqrt(r1 r2)
//! ```
//!
//! Epanechnikov's kernel of covariance s^2 Sigma in the photon's tangent plane (METHODS 3.B), where it integrates to 1, and an ellipsoid around
//! it: off the plane it fades out, so that it neither reaches through walls nor ends in steps on curved surfaces. With r_min = r_max it is
//! the kernel of a fixed radius in chord distance, which on a sphere is exact: a ball of radius r cuts an area of pi r^2 from it.
//! Source: Schjoth et al. 2007; METHODS 3.B, 3.E.
//! Bias: blur of the size of the kernel, which goes to zero with `scale` and the limits; light beyond the border of a surface is lost
//! unless [`super::border`] gives it back.
//! Verified by `tests/kernel.rs`.

use crate::math::{Frame, Vec3};
use crate::scene::Camera;
use std::f32::consts::PI;

use super::photon::Photon;

/// An ellipsoid around a photon: what of its flux arrives where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Centre.
    pub p: Vec3,
    /// Unit vectors of its axes over their half lengths: first, second, normal.
    pub rows: [Vec3; 3],
    /// Half lengths of the axes in the tangent plane, the longer one first.
    pub radii: [f32; 2],
}

impl Ellipsoid {
    /// Value of the kernel at its centre, per area.
    pub fn peak(&self) -> f32 {
        2.0 / (PI * self.radii[0] * self.radii[1])
    }

    /// q: 0 at the centre, 1 on the border.
    pub fn q(&self, x: Vec3) -> f32 {
        let d = x - self.p;
        self.rows.iter().map(|r| r.dot(d)).map(|s| s * s).sum()
    }

    /// Half size of the box around it.
    pub fn half_box(&self) -> Vec3 {
        // A row e / r belongs to the half axis e r = row / |row|^2.
        let squared: Vec3 = self.rows.iter().map(|row| *row / row.length_squared()).map(|axis| axis * axis).sum();
        squared.map(f32::sqrt)
    }
}

/// How wide kernels are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Widths {
    /// Standard deviation of the kernel over that of the footprint, for photons that spread over two and over four parameters.
    pub scale: [f32; 2],
    /// Smallest half axis.
    pub min: Smallest,
    /// Greatest half axis.
    pub max: f32,
}

/// Smallest half axis of kernels, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Smallest {
    /// The same everywhere.
    Fixed(f32),
    /// `per_distance` times the distance from `eye`: a share of the width of a pixel.
    Pixels {
        /// The camera's position.
        eye: Vec3,
        /// Width over distance.
        per_distance: f32,
    },
}

impl Smallest {
    /// `pixels` widths of a pixel, as seen directly by `camera` with a film of `size` pixels.
    pub fn pixels(camera: &Camera, size: [u32; 2], pixels: f32) -> Self {
        let centre = size.map(|s| 0.5 * f64::from(s));
        let patch = camera.patch(centre, [0.5, 0.5]);
        let width = |v: [crate::math::DVec3; 2]| 2.0 * (v[0].length() * v[1].length()).sqrt() as f32;
        match width(patch.d_film) {
            0.0 => Smallest::Fixed(pixels * width(patch.o_film)),
            w => Smallest::Pixels { eye: patch.o.as_vec3(), per_distance: pixels * w / patch.d.length() as f32 },
        }
    }

    fn at(&self, p: Vec3) -> f32 {
        match *self {
            Smallest::Fixed(r) => r,
            Smallest::Pixels { eye, per_distance } => per_distance * (p - eye).length(),
        }
    }
}

impl Widths {
    /// Kernels of one radius.
    pub fn fixed(radius: f32) -> Self {
        Widths { scale: [1.0; 2], min: Smallest::Fixed(radius), max: radius }
    }

    /// All widths times `factor`.
    pub fn shrunk(self, factor: f32) -> Self {
        let min = match self.min {
            Smallest::Fixed(r) => Smallest::Fixed(r * factor),
            Smallest::Pixels { eye, per_distance } => Smallest::Pixels { eye, per_distance: per_distance * factor },
        };
        Widths { scale: self.scale.map(|s| s * factor), min, max: self.max * factor }
    }

    /// The kernel of a photon. The widths must be positive.
    pub fn ellipsoid(&self, photon: &Photon) -> Ellipsoid {
        let [long, short] = photon.sigma;
        let min = self.min.at(photon.p).min(self.max);
        let scale = self.scale[usize::from(photon.parameters > 2)];
        // NaN and infinity: nothing is known of the neighbourhood.
        let radius = |v: Vec3| (scale * 6f32.sqrt() * v.length()).clamp(min, self.max);
        let radius = |v: Vec3| if v.is_finite() { radius(v) } else { self.max };
        let (r1, r2) = (radius(long), radius(short));
        let frame = Frame::from_normal_tangent(photon.n, long);
        Ellipsoid { p: photon.p, rows: [frame.s / r1, frame.t / r2, frame.n / (r1 * r2).sqrt()], radii: [r1, r2] }
    }
}
