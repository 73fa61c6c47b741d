//! Pixel reconstruction filters, used by filter importance sampling.
//!
//! Source: Ernst et al. 2006, "Filter Importance Sampling". A sample belongs to one pixel: its offset is drawn in
//! proportion to |f|, its weight is the sign of f times a constant, so that the pixel's estimate is weight x radiance averaged.
//!
//! Measure: pdf per square pixel, |f(x)| |f(y)| / I^2 with I = integral of |f|; the weight is sign(f(x) f(y)) (I / F)^2 with
//! F = integral of f, whose mean is 1. Bias: none for box and tent; the others are tabulated (|f| linear within cells of 1/256
//! pixel or less), which shifts the filter's shape by about 1e-5 of its peak.

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

impl PixelFilter {
    /// Half width of the support in pixels.
    pub fn radius(&self) -> f32 {
        match *self {
            PixelFilter::Box { radius } | PixelFilter::Tent { radius } => radius,
            PixelFilter::Gaussian { stddev } => 4.0 * stddev,
            PixelFilter::Mitchell { .. } | PixelFilter::CatmullRom => 2.0,
            PixelFilter::Lanczos { lobes } => lobes as f32,
        }
    }

    /// Value at the distance `x` (in pixels) along one axis, not normalised; the filter is the product of both axes.
    pub fn eval_1d(&self, x: f32) -> f32 {
        self.eval_f64(x as f64) as f32
    }

    fn eval_f64(&self, x: f64) -> f64 {
        let x = x.abs();
        if x > self.radius() as f64 {
            return 0.0;
        }
        match *self {
            PixelFilter::Box { .. } => 1.0,
            PixelFilter::Tent { radius } => (1.0 - x / radius as f64).max(0.0),
            PixelFilter::Gaussian { stddev } => {
                let s = x / stddev as f64;
                ((-0.5 * s * s).exp() - (-8f64).exp()).max(0.0)
            }
            PixelFilter::Mitchell { b, c } => mitchell(x, b as f64, c as f64),
            PixelFilter::CatmullRom => mitchell(x, 0.0, 0.5),
            PixelFilter::Lanczos { lobes } => sinc(x) * sinc(x / lobes as f64),
        }
    }
}

/// The cubic of Mitchell and Netravali 1988, eq. (8), at x >= 0.
fn mitchell(x: f64, b: f64, c: f64) -> f64 {
    let cubic = |k3: f64, k2: f64, k1: f64, k0: f64| (((k3 * x + k2) * x + k1) * x + k0) / 6.0;
    if x < 1.0 {
        cubic(12.0 - 9.0 * b - 6.0 * c, -18.0 + 12.0 * b + 6.0 * c, 0.0, 6.0 - 2.0 * b)
    } else if x < 2.0 {
        cubic(-b - 6.0 * c, 6.0 * b + 30.0 * c, -12.0 * b - 48.0 * c, 8.0 * b + 24.0 * c)
    } else {
        0.0
    }
}

fn sinc(x: f64) -> f64 {
    let y = std::f64::consts::PI * x;
    if y.abs() < 1e-6 { 1.0 } else { y.sin() / y }
}

/// A filter tabulated for sampling.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    filter: PixelFilter,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    /// All samples at the centre: filters without extent.
    Point,
    Box {
        radius: f32,
    },
    Tent {
        radius: f32,
    },
    Table(Table),
}

impl FilterSampler {
    /// Tabulates the filter. A filter without extent (radius zero, negative or not finite, no lobes, or an integral
    /// that is not positive) samples the pixel's centre. Lanczos filters are cut at 64 lobes.
    pub fn new(filter: PixelFilter) -> Self {
        let filter = match filter {
            PixelFilter::Lanczos { lobes } => PixelFilter::Lanczos { lobes: lobes.min(64) },
            other => other,
        };
        let radius = filter.radius();
        let kind = match filter {
            _ if !(radius > 0.0 && radius.is_finite()) => Kind::Point,
            PixelFilter::Box { .. } => Kind::Box { radius },
            PixelFilter::Tent { .. } => Kind::Tent { radius },
            _ => Table::new(&filter).map_or(Kind::Point, Kind::Table),
        };
        FilterSampler { filter, kind }
    }

    /// The filter that is sampled.
    pub fn filter(&self) -> PixelFilter {
        self.filter
    }

    /// Offset from the pixel centre, and weight of a sample there (mean 1).
    ///
    /// Each coordinate of the offset grows with the same coordinate of `u`, so that stratified numbers stay stratified.
    #[inline]
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        match &self.kind {
            Kind::Point => (Vec2::ZERO, 1.0),
            Kind::Box { radius } => ((2.0 * u - Vec2::ONE) * *radius, 1.0),
            Kind::Tent { radius } => (Vec2::new(tent(u.x), tent(u.y)) * *radius, 1.0),
            Kind::Table(table) => {
                let (x, weight_x) = table.sample(u.x);
                let (y, weight_y) = table.sample(u.y);
                (Vec2::new(x, y), weight_x * weight_y)
            }
        }
    }
}

/// Inverse distribution of 1 - |x| on [-1, 1].
fn tent(u: f32) -> f32 {
    let t = 2.0 * u - 1.0;
    (1.0 - (1.0 - t.abs()).max(0.0).sqrt()).copysign(t)
}

/// |f| on [0, radius], linear within each cell.
#[derive(Clone, Debug)]
struct Table {
    cell_width: f32,
    /// |f| at the ends of the cells.
    density: Vec<f32>,
    /// Distribution function at the ends of the cells, from 0 to 1.
    cdf: Vec<f32>,
    /// For k / guide.len(): the last cell that starts at or below it.
    guide: Vec<u16>,
    /// Whether f is negative, by cell, and where in a cell it changes sign (0 to 1) if it does.
    sign: Vec<Sign>,
    /// Integral of |f| over integral of f.
    weight: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Sign {
    before: f32,
    change_at: f32,
}

impl Table {
    const CELLS_PER_PIXEL: f64 = 256.0;
    const MIN_CELLS: f64 = 512.0;
    const MAX_CELLS: f64 = 16384.0;

    fn new(filter: &PixelFilter) -> Option<Table> {
        let radius = filter.radius() as f64;
        let cells = (radius * Self::CELLS_PER_PIXEL).clamp(Self::MIN_CELLS, Self::MAX_CELLS).round() as usize;
        let width = radius / cells as f64;
        let values: Vec<f64> = (0..=cells).map(|i| filter.eval_f64(i as f64 * width)).collect();
        let mut sums = vec![0.0];
        let mut signed = 0.0;
        for pair in values.windows(2) {
            sums.push(sums[sums.len() - 1] + 0.5 * (pair[0].abs() + pair[1].abs()));
            signed += 0.5 * (pair[0] + pair[1]);
        }
        let total = sums[cells];
        if !(signed > 0.0 && total.is_finite()) {
            return None;
        }
        let sign = |pair: &[f64]| Sign {
            before: if pair[0] < 0.0 || (pair[0] == 0.0 && pair[1] < 0.0) { -1.0 } else { 1.0 },
            change_at: if pair[0] * pair[1] < 0.0 { (pair[0] / (pair[0] - pair[1])) as f32 } else { 2.0 },
        };
        let cdf: Vec<f32> = sums.iter().map(|s| (s / total) as f32).collect();
        let mut cell = 0;
        let guide = (0..cells).map(|k| {
            let u = k as f32 / cells as f32;
            while cell + 1 < cells && cdf[cell + 1] <= u {
                cell += 1;
            }
            cell as u16
        });
        Some(Table {
            cell_width: width as f32,
            guide: guide.collect(),
            cdf,
            density: values.iter().map(|v| v.abs() as f32).collect(),
            sign: values.windows(2).map(sign).collect(),
            weight: (total / signed) as f32,
        })
    }

    /// Offset in [-radius, radius], and weight.
    fn sample(&self, u: f32) -> (f32, f32) {
        let t = 2.0 * u - 1.0;
        let target = t.abs().min(1.0);
        let last = self.guide.len() - 1;
        let mut cell = self.guide[((target * self.guide.len() as f32) as usize).min(last)] as usize;
        while cell < last && self.cdf[cell + 1] <= target {
            cell += 1;
        }
        let (start, end) = (self.cdf[cell], self.cdf[cell + 1]);
        let part = if end > start { (target - start) / (end - start) } else { 0.0 };
        let within = linear(part, self.density[cell], self.density[cell + 1]);
        let sign = self.sign[cell];
        let weight = if within > sign.change_at { -sign.before } else { sign.before } * self.weight;
        (((cell as f32 + within) * self.cell_width).copysign(t), weight)
    }
}

/// Inverse distribution of the density that goes from `a` at 0 to `b` at 1.
fn linear(u: f32, a: f32, b: f32) -> f32 {
    let root = (a * a + u * (b * b - a * a)).max(0.0).sqrt();
    if a + root > 0.0 { (u * (a + b) / (a + root)).min(1.0) } else { u }
}

#[cfg(test)]
#[path = "filter_tests.rs"]
mod tests;
