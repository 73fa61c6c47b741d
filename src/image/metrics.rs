//! Errors of a picture against a reference.
//!
//! With I the picture, R the reference, means over the counted pixels and the three channels:
//! RMSE = sqrt(mean (I-R)^2); relMSE = mean (I-R)^2 / (R^2 + 0.01), and trimmed: without the worst 0.1 % of the pixels
//! (which hides fireflies, so always say which); bias = mean(I) / mean(R) - 1. The block error is relMSE between the means of 8 x 8
//! pixels: it shows bias and splotches and hides noise; incomplete blocks at the right and lower border are left out.
//!
//! Given two independent halves A, B of a reference, R = (A+B)/2 and the *noise-free* form is mean (I-A)(I-B) / (R^2 + 0.01):
//! its expectation holds no variance of the reference, so errors far below the reference's own can be read. It may be negative.
//!
//! Not counted: pixels where the reference is not finite, or its mask says so (in blocks they take the reference's value).
//! Non-finite pixels of the picture are reported, and count as black.

use serde::Serialize;

use super::{Picture, flip};
use crate::math::Rgb;

/// Added to R^2 in relative errors.
pub const RELATIVE_EPSILON: f64 = 0.01;
/// Edge length of the blocks of the block error, in pixels.
const BLOCK: usize = 8;

/// What a picture is compared with: one or two pictures of the same size, and which of their pixels count.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// The best picture: the only one, or the mean of both halves. Zero where it does not count and is not finite.
    pub mean: Vec<Rgb>,
    /// Two independent halves, if given.
    pub halves: Option<[Vec<Rgb>; 2]>,
    /// Whether a pixel counts.
    pub counted: Vec<bool>,
}

/// Errors of a picture; relative ones are fractions, biases per cent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Pixels of the picture.
    pub pixels: usize,
    /// Pixels that do not count, because of the reference.
    pub masked: usize,
    /// Counted pixels of the picture that are not finite.
    pub nonfinite: usize,
    /// Root of the mean squared error.
    pub rmse: f64,
    /// Relative squared error, nothing trimmed.
    pub relmse: f64,
    /// Relative squared error without the worst pixels.
    pub relmse_trimmed: f64,
    /// Share of pixels dropped in `relmse_trimmed`, per cent.
    pub trim_percent: f64,
    /// Relative squared error against two halves, free of the reference's noise; untrimmed.
    pub relmse_noise_free: Option<f64>,
    /// Mean of the picture over mean of the reference, less one, in per cent; all channels together.
    pub bias_percent: f64,
    /// The same for red, green, blue.
    pub bias_rgb_percent: [f64; 3],
    /// Relative squared error of block means.
    pub blocks: f64,
    /// Relative squared error of block means against two halves.
    pub blocks_noise_free: Option<f64>,
    /// Mean LDR FLIP of the pictures clamped to [0, 1], at 67 pixels per degree.
    pub flip: f64,
}

impl Reference {
    /// A reference from one picture or two halves.
    ///
    /// # Errors
    /// If the halves' sizes differ; the text says which.
    pub fn new(a: &Picture, b: Option<&Picture>) -> Result<Reference, String> {
        let (width, height) = (a.width(), a.height());
        if let Some(b) = b.filter(|b| (b.width(), b.height()) != (width, height)) {
            return Err(format!(
                "the halves of the reference differ in size: {width} x {height} and {} x {}",
                b.width(),
                b.height()
            ));
        }
        let mut mean: Vec<Rgb> = match b {
            Some(b) => a.pixels.iter().zip(&b.pixels).map(|(&a, &b)| 0.5 * a + 0.5 * b).collect(),
            None => a.pixels.clone(),
        };
        let unmasked = |p: Option<&Picture>, i: usize| p.and_then(|p| p.mask.as_ref()).is_none_or(|m| m[i]);
        let counted = (0..mean.len()).map(|i| mean[i].is_finite() && unmasked(Some(a), i) && unmasked(b, i));
        let counted: Vec<bool> = counted.collect();
        for m in mean.iter_mut().filter(|m| !m.is_finite()) {
            *m = Rgb::ZERO;
        }
        Ok(Reference { width, height, mean, halves: b.map(|b| [a.pixels.clone(), b.pixels.clone()]), counted })
    }

    /// `image` with black for what is not finite and the reference's values where pixels do not count.
    ///
    /// # Errors
    /// If the sizes differ, or no pixel counts.
    pub fn prepare(&self, image: &Picture) -> Result<Vec<Rgb>, String> {
        if (image.width(), image.height()) != (self.width, self.height) {
            return Err(format!(
                "the picture has {} x {} pixels, the reference {} x {}",
                image.width(),
                image.height(),
                self.width,
                self.height
            ));
        }
        if !self.counted.contains(&true) {
            return Err("no pixel of the reference counts: all are masked or not finite".into());
        }
        let pixel = |i: usize| match (self.counted[i], image.pixels[i]) {
            (false, _) => self.mean[i],
            (true, p) if p.is_finite() => p,
            (true, _) => Rgb::ZERO,
        };
        Ok((0..self.mean.len()).map(pixel).collect())
    }

    /// All errors of `image`, `trim_percent` (0 to 100) of the pixels dropped in the trimmed one.
    ///
    /// # Errors
    /// If the sizes differ, or no pixel counts.
    pub fn errors(&self, image: &Picture, trim_percent: f64) -> Result<Errors, String> {
        let pixels = self.prepare(image)?;
        let reference = &self.mean;
        let counted = || (0..pixels.len()).filter(|&i| self.counted[i]);
        let n = counted().count();

        let squared: f64 = counted().map(|i| channels(pixels[i] - reference[i], |d| d * d)).sum();
        let mut relative: Vec<f64> = counted().map(|i| relative_error(pixels[i], reference[i])).collect();
        let relmse = relative.iter().sum::<f64>() / n as f64;
        let relmse_trimmed = trimmed_mean(&mut relative, trim_percent);
        let (bias_rgb_percent, bias_percent) = self.bias(&pixels);

        let block_mean = |p: &[Rgb]| block_means(p, self.width, self.height);
        let (image_blocks, mean_blocks) = (block_mean(&pixels), block_mean(reference));
        let pairs = image_blocks.iter().zip(&mean_blocks);
        let blocks = mean(pairs.map(|(&i, &r)| relative_product(i, r, r, r)));

        let halves = self.halves.as_ref().map(|[a, b]| {
            let cross =
                counted().map(|i| relative_product(wide(pixels[i]), wide(a[i]), wide(b[i]), wide(reference[i])));
            // Where a pixel does not count, both halves take the mean, like the picture.
            let filled = |half: &[Rgb]| -> Vec<Rgb> {
                (0..half.len()).map(|i| if self.counted[i] { half[i] } else { reference[i] }).collect()
            };
            let (a_blocks, b_blocks) = (block_mean(&filled(a)), block_mean(&filled(b)));
            let block_cross = (0..a_blocks.len()).map(|i| {
                let (a, b) = (a_blocks[i], b_blocks[i]);
                let r = std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
                relative_product(image_blocks[i], a, b, r)
            });
            (mean(cross), mean(block_cross))
        });

        let map = flip::flip(&pixels, reference, self.width, self.height, flip::PIXELS_PER_DEGREE);
        Ok(Errors {
            pixels: pixels.len(),
            masked: pixels.len() - n,
            nonfinite: counted().filter(|&i| !image.pixels[i].is_finite()).count(),
            rmse: (squared / (3 * n) as f64).sqrt(),
            relmse,
            relmse_trimmed,
            trim_percent,
            relmse_noise_free: halves.map(|h| h.0),
            bias_percent,
            bias_rgb_percent,
            blocks,
            blocks_noise_free: halves.map(|h| h.1),
            flip: mean(counted().map(|i| map[i] as f64)),
        })
    }

    /// Untrimmed relative squared error alone: against two halves the form free of their noise.
    ///
    /// # Errors
    /// If the sizes differ, or no pixel counts.
    pub fn relmse(&self, image: &Picture) -> Result<f64, String> {
        let pixels = self.prepare(image)?;
        let one = |i: usize| match &self.halves {
            Some([a, b]) => relative_product(wide(pixels[i]), wide(a[i]), wide(b[i]), wide(self.mean[i])),
            None => relative_error(pixels[i], self.mean[i]),
        };
        Ok(mean((0..pixels.len()).filter(|&i| self.counted[i]).map(one)))
    }

    /// Bias per channel and of all channels together, in per cent.
    fn bias(&self, pixels: &[Rgb]) -> ([f64; 3], f64) {
        let (mut image, mut reference) = ([0.0; 3], [0.0; 3]);
        for i in (0..pixels.len()).filter(|&i| self.counted[i]) {
            for c in 0..3 {
                image[c] += pixels[i][c] as f64;
                reference[c] += self.mean[i][c] as f64;
            }
        }
        let percent = |i: f64, r: f64| if i == r { 0.0 } else { 100.0 * (i / r - 1.0) };
        let each = std::array::from_fn(|c| percent(image[c], reference[c]));
        (each, percent(image.iter().sum(), reference.iter().sum()))
    }
}

/// (I-R)^2 / (R^2 + 0.01), mean of the channels.
pub fn relative_error(image: Rgb, reference: Rgb) -> f64 {
    let r = wide(reference);
    relative_product(wide(image), r, r, r)
}

/// (I-A)(I-B) / (R^2 + 0.01), mean of the channels.
fn relative_product(i: [f64; 3], a: [f64; 3], b: [f64; 3], r: [f64; 3]) -> f64 {
    let one = |c: usize| (i[c] - a[c]) * (i[c] - b[c]) / (r[c] * r[c] + RELATIVE_EPSILON);
    (one(0) + one(1) + one(2)) / 3.0
}

fn wide(p: Rgb) -> [f64; 3] {
    [p.x as f64, p.y as f64, p.z as f64]
}

fn channels(p: Rgb, f: impl Fn(f64) -> f64) -> f64 {
    wide(p).into_iter().map(f).sum()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0usize), |(sum, n), v| (sum + v, n + 1));
    if n == 0 { 0.0 } else { sum / n as f64 }
}

/// Mean without the largest `percent` per cent of the values (rounded down to whole values, at least one is kept).
fn trimmed_mean(values: &mut [f64], percent: f64) -> f64 {
    let drop = (values.len() as f64 * percent.clamp(0.0, 100.0) / 100.0) as usize;
    let keep = (values.len() - drop).max(1);
    values.sort_unstable_by(f64::total_cmp);
    mean(values[..keep].iter().copied())
}

/// Means of the whole blocks, row by row.
fn block_means(pixels: &[Rgb], width: usize, height: usize) -> Vec<[f64; 3]> {
    let (columns, rows) = (width / BLOCK, height / BLOCK);
    let mut sums = vec![[0.0; 3]; columns * rows];
    for y in 0..rows * BLOCK {
        for x in 0..columns * BLOCK {
            let sum = &mut sums[y / BLOCK * columns + x / BLOCK];
            for (s, v) in sum.iter_mut().zip(wide(pixels[y * width + x])) {
                *s += v / (BLOCK * BLOCK) as f64;
            }
        }
    }
    sums
}

#[cfg(test)]
#[path = "metrics_tests.rs"]
mod tests;
