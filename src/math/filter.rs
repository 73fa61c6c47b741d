//! Pixel reconstruction filters, used by filter importance sampling.
//!
//! Source: Ernst et al. 2006, "Filter Importance Sampling". A sample belongs to one pixel: its offset is drawn in
//! proportion to |f|, its weight is the sign of f times a constant, so that the pixel's estimate is weight x radiance averaged.

use super::Vec2;

/// A separable reconstruction filter; radii in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PixelFilter {
    /// 1 within `radius` (default 0.5).
    Box {
        /// Half width.
        radius: f32,
    },
    /// Linear fall-off (default radius 1).
    Tent {
        /// Half width.
        radius: f32,
    },
    /// exp(-x^2 / 2 s^2) minus its value at the radius 4 s (default s 0.5).
    Gaussian {
        /// Standard deviation.
        stddev: f32,
    },
    /// Mitchell and Netravali 1988, radius 2 (default B = C = 1/3).
    Mitchell {
        /// B.
        b: f32,
        /// C.
        c: f32,
    },
    /// Mitchell with B = 0, C = 1/2.
    CatmullRom,
    /// Windowed sinc (default 3 lobes).
    Lanczos {
        /// Radius in pixels.
        lobes: u32,
    },
}

/// A filter tabulated for sampling.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    _todo: (),
}

impl FilterSampler {
    /// Tabulates the filter.
    pub fn new(filter: PixelFilter) -> Self {
        let _ = filter;
        todo!("helper image")
    }

    /// Offset from the pixel centre, and weight of a sample there (mean 1).
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let _ = u;
        todo!()
    }
}
