//! The noise of pixels that have one sample each, from their neighbours.
//!
//! ```text
//! s(p)  = least over four directions of (c(p - h) - 2 c(p) + c(p + h))^2 / 6      c: luminance over albedo
//! v(p)  = max(s(p), median of s over a square of pixels / MEDIAN)
//! ```
//!
//! 6 sigma^2 is the variance of a second difference of independent noise. Ramps have none; along an edge, or along a line, there is none either,
//! so the least of four directions sees noise alone, and the median leaves out what has structure in all directions, as long as that is less
//! than half of the square. s(p) itself tells of a pixel that outshines all around it: one bright sample, in all likelihood.
//! Source      after Immerkaer 1996, "Fast Noise Variance Estimation" (second differences)
//! Bias        fine structure that albedo does not tell is taken for noise; noise of long tails for less than it is
//! Verified by tests in this file

use super::guide::Guide;
use crate::math::{Rgb, luminance};
use rayon::prelude::*;

/// Pixels to each side of the square.
const RADIUS: usize = 3;
/// Median of s for normal noise of variance 1.
const MEDIAN: f32 = 0.0547;
/// Least albedo that colours are divided by.
const LEAST_ALBEDO: f32 = 0.02;
/// Steps to one side; the other is opposite.
const DIRECTIONS: [(isize, isize); 4] = [(1, 0), (0, 1), (1, 1), (1, -1)];

/// Variance of each pixel's luminance, row-major, `width` wide.
pub fn variances(colors: &[Rgb], guides: &[Guide], width: usize) -> Vec<f32> {
    let height = colors.len() / width.max(1);
    let albedo: Vec<f32> = guides.iter().map(|g| luminance(g.albedo).max(LEAST_ALBEDO)).collect();
    let light: Vec<f32> = colors.iter().zip(&albedo).map(|(c, a)| luminance(*c) / a).collect();
    let second = |i: usize| {
        let (x, y) = (i % width, i / width);
        if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height {
            return 0.0;
        }
        let along = |&(dx, dy): &(isize, isize)| {
            let step = dy * width as isize + dx;
            let (a, b) = (light[i.wrapping_add_signed(-step)], light[i.wrapping_add_signed(step)]);
            (a - 2.0 * light[i] + b).powi(2) / 6.0
        };
        DIRECTIONS.iter().map(along).fold(f32::INFINITY, f32::min)
    };
    let squares: Vec<f32> = (0..colors.len()).into_par_iter().map(second).collect();
    let median = |i: usize| {
        let (x, y) = (i % width, i / width);
        let rows = y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height);
        let columns = x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width);
        let mut near: arrayvec::ArrayVec<f32, { (2 * RADIUS + 1) * (2 * RADIUS + 1) }> =
            rows.flat_map(|y| squares[y * width + columns.start..y * width + columns.end].iter().copied()).collect();
        let middle = near.len() / 2;
        let (_, median, _) = near.select_nth_unstable_by(middle, f32::total_cmp);
        (*median / MEDIAN).max(squares[i]) * albedo[i] * albedo[i]
    };
    (0..colors.len()).into_par_iter().map(median).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::math::sampler::{hash, unit_f32};

    const SIDE: usize = 64;

    fn of(light: impl Fn(usize, usize) -> f32, albedo: impl Fn(usize) -> f32) -> Vec<f32> {
        let guide = |x: usize| {
            let mut guide = Guide::default();
            guide.see(Rgb::ONE, Rgb::splat(albedo(x)), Vec3::Z, 1.0);
            guide
        };
        let pixel = |i: usize| (i % SIDE, i / SIDE);
        let colors: Vec<Rgb> = (0..SIDE * SIDE).map(pixel).map(|(x, y)| Rgb::splat(light(x, y) * albedo(x))).collect();
        let guides: Vec<Guide> = (0..SIDE * SIDE).map(|i| guide(i % SIDE)).collect();
        variances(&colors, &guides, SIDE)
    }

    /// Normal noise of variance 1, nearly: the sum of twelve uniform numbers.
    fn noise(x: usize, y: usize) -> f32 {
        (0..12).map(|k| unit_f32(hash((y * SIDE + x) as u64, k))).sum::<f32>() - 6.0
    }

    #[test]
    fn normal_noise_is_measured() {
        let v = of(|x, y| 1.0 + 0.01 * x as f32 + 0.2 * noise(x, y), |_| 0.5);
        let mean = v.iter().sum::<f32>() / v.len() as f32;
        // 0.04 times the squared albedo.
        assert!((mean / 0.01 - 1.0).abs() < 0.3, "{mean}");
        // A bright sample is its own noise, and not that of others.
        let v = of(|x, y| if (x, y) == (20, 30) { 7.0 } else { 1.0 }, |_| 0.5);
        assert!((v[30 * SIDE + 20] / 6.0 - 1.0).abs() < 1e-3 && v.iter().filter(|v| **v > 1e-6).count() == 1);
    }

    #[test]
    fn ramps_edges_lines_and_textures_are_no_noise() {
        let ramp = of(|x, y| 1.0 + 0.1 * x as f32 + 0.05 * y as f32, |_| 0.5);
        let edge = of(|x, y| if x + y < 70 { 1.0 } else { 0.2 }, |_| 0.5);
        let line = of(|x, _| if x == 30 { 3.0 } else { 0.2 }, |_| 0.5);
        let texture = of(|_, _| 1.0, |x| 0.2 + 0.6 * unit_f32(hash(1, x as u64)));
        for v in [ramp, edge, line, texture] {
            assert!(v.iter().all(|v| *v < 1e-8), "{:?}", v.iter().copied().fold(0.0, f32::max));
        }
        // The steps of an edge in another direction stand out alone.
        let v = of(|x, y| if 2 * x + y < 90 { 1.0 } else { 0.2 }, |_| 0.5);
        assert!(v.iter().filter(|v| **v > 1e-8).count() <= 2 * SIDE);
    }
}
