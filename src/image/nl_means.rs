//! Non-local means with known variances and guides: weights by which a pixel averages its neighbours.
//!
//! ```text
//! d(p, q) = mean over patches and channels of ((c_p - c_q)^2 - (v_p + min(v_p, v_q))) / (v_p + v_q)       0 on average where p and q differ by noise alone
//! e(p, q) = sum over guides of (g_p - g_q)^2 / tolerance^2
//! w_k     = min(exp(-max(0, d) / k^2), exp(-e)),     F_k(p) = sum_q w_k c_q / sum_q w_k                    k = 2, 1, 1/2
//! ```
//!
//! v: variance of the mean of a pixel. Where that is small, so are the weights of all that is not equal: the filter vanishes with the noise.
//! Source      Buades, Coll, Morel 2005 (non-local means); Rousselle, Knaus, Zwicker 2012 (variances of samples in d);
//!             Rousselle, Manzi, Zwicker 2013 (guides, which they call features)
//! Bias        blurs contrasts up to about k standard deviations of the noise
//! Determinism a function of the picture: tiles are independent, no sum depends on threads
//! Verified by tests of `denoise`

use super::guide::Guide;
use crate::math::Rgb;
use rayon::prelude::*;

/// Pixels to each side whose values are averaged.
const RADIUS: usize = 3;
/// Pixels to each side of a patch that is compared.
const PATCH: usize = 1;
/// Pixels that planes have beyond each border.
const HALO: usize = RADIUS + PATCH;
/// Side of a tile.
const TILE: usize = 32;
/// Side of what a tile compares.
const WIDE: usize = TILE + 2 * PATCH;
/// Number of bandwidths k, of which [`super::denoise`] chooses.
pub const CANDIDATES: usize = 3;
/// Differences of albedo and of what lights that are seen have of the brightness, of unit normals, and relative ones of distances, that count 1 in e.
const ALBEDO: f32 = 0.085;
const NORMAL: f32 = 0.13;
const DISTANCE: f32 = 0.012;
/// Differences of distance over those to the next pixel that count 1 in e.
const SLOPE: f32 = 1.2;
/// Sums of a candidate.
const SUMS: usize = 6;
/// Share of a pixel in the mean over its patch, times the 2 of a square's derivative.
const OF_PATCH: f32 = 2.0 / ((2 * PATCH + 1) * (2 * PATCH + 1)) as f32;
/// 1 / k^2 of the candidates.
const PER_SQUARE: [f32; CANDIDATES] = [0.25, 1.0, 4.0];
/// Relative variance up to which pixels are left as they are, if all of their tile are.
const QUIET: f32 = 1e-5;
/// Share of the mean luminance to which errors are relative in darker places.
pub(super) const DARK: f32 = 0.1;
/// Largest d and e: nothing is left of the weight.
const FAR: f32 = 1e4;

/// A picture in planes, with borders of repeated pixels that have no weight.
pub struct Planes {
    width: usize,
    height: usize,
    stride: usize,
    color: [Vec<f32>; 3],
    variance: [Vec<f32>; 3],
    /// Means of both over the channels.
    level: Vec<f32>,
    noise: Vec<f32>,
    /// Square of what is dark.
    dark2: f32,
    /// Guides over their tolerances: albedo, normal, light.
    guides: [Vec<f32>; 7],
    /// Distance; its squared tolerance; that per pixel along the rows and the columns.
    distance: [Vec<f32>; 4],
    valid: Vec<f32>,
}

/// What a bandwidth makes of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Candidate {
    /// The average.
    pub color: Rgb,
    /// Share of the pixel itself in it.
    pub own: f32,
    /// dF/dc, of grey noise: that share, and how the weights change with the pixel.
    pub derivative: f32,
}

impl Planes {
    /// Of a picture `width` wide: colours, variances of them and guides, row-major. `level`: luminance beside which lights are bright.
    pub fn new(width: usize, color: &[Rgb], variance: &[Rgb], guides: &[Guide], level: f32) -> Self {
        let height = color.len() / width.max(1);
        let (stride, rows) = (width + 2 * HALO, height + 2 * HALO);
        let inside = |i: usize, n: usize| i.saturating_sub(HALO).min(n - 1);
        let source: Vec<usize> =
            (0..stride * rows).map(|i| inside(i / stride, height) * width + inside(i % stride, width)).collect();
        let plane = |of: &(dyn Fn(usize) -> f32 + Sync)| source.par_iter().map(|&i| of(i)).collect::<Vec<f32>>();
        let is_inside =
            |i: usize| (HALO..HALO + width).contains(&(i % stride)) && (HALO..HALO + height).contains(&(i / stride));
        let slope = |i: usize, at: usize, n: usize, step: usize| {
            let t = guides[i].distance;
            let before = if at > 0 { (guides[i - step].distance - t).abs() } else { f32::INFINITY };
            let after = if at + 1 < n { (guides[i + step].distance - t).abs() } else { f32::INFINITY };
            let slope = before.min(after);
            if slope.is_finite() { slope * SLOPE } else { 0.0 }
        };
        Planes {
            width,
            height,
            stride,
            color: [0, 1, 2].map(|c| plane(&|i| color[i][c])),
            variance: [0, 1, 2].map(|c| plane(&|i| variance[i][c])),
            level: plane(&|i| mean(color[i])),
            noise: plane(&|i| mean(variance[i])),
            dark2: (DARK * level).powi(2),
            guides: std::array::from_fn(|k| match k {
                0..3 => plane(&|i| guides[i].albedo[k] / ALBEDO),
                3..6 => plane(&|i| guides[i].normal[k - 3] / NORMAL),
                _ => plane(&|i| guides[i].emitted / (guides[i].emitted + level).max(f32::MIN_POSITIVE) / ALBEDO),
            }),
            distance: [
                plane(&|i| guides[i].distance),
                plane(&|i| (DISTANCE * guides[i].distance).powi(2).max(f32::MIN_POSITIVE)),
                plane(&|i| slope(i, i % width, width, 1)),
                plane(&|i| slope(i, i / width, height, width)),
            ],
            valid: (0..stride * rows).map(|i| f32::from(u8::from(is_inside(i)))).collect(),
        }
    }

    /// What each bandwidth makes of each pixel, row-major.
    pub fn candidates(&self) -> Vec<[Candidate; CANDIDATES]> {
        let across = self.width.div_ceil(TILE);
        let tiles: Vec<Tile> = (0..across * self.height.div_ceil(TILE))
            .into_par_iter()
            .map(|t| self.tile(t % across, t / across))
            .collect();
        let of = |i: usize| {
            let (x, y) = (i % self.width, i / self.width);
            tiles[y / TILE * across + x / TILE].pixel(y % TILE * TILE + x % TILE)
        };
        (0..self.width * self.height).into_par_iter().with_min_len(TILE * TILE).map(of).collect()
    }

    /// Index of the pixel at column `x` and row `y`, both with `HALO` added.
    fn at(&self, x: usize, y: usize) -> usize {
        y.min(self.height + 2 * HALO - 1) * self.stride + x.min(self.width + 2 * HALO - 1)
    }

    fn tile(&self, column: usize, row: usize) -> Tile {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function enables.
            return unsafe { self.tile_avx2(column, row) };
        }
        self.tile_by(column, row)
    }

    /// The same bits by wider lanes.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn tile_avx2(&self, column: usize, row: usize) -> Tile {
        self.tile_by(column, row)
    }

    #[inline(always)]
    fn tile_by(&self, column: usize, row: usize) -> Tile {
        let (x0, y0) = (column * TILE + HALO, row * TILE + HALO);
        // Part of the tile that lies in the picture.
        let (width, height) = (TILE.min(self.width + HALO - x0), TILE.min(self.height + HALO - y0));
        let mut tile = Tile::new();
        for y in 0..height {
            let from = self.at(x0, y0 + y);
            for x in 0..width {
                tile.start(y * TILE + x, [0, 1, 2].map(|c| self.color[c][from + x]));
            }
        }
        if !self.is_noisy(x0, y0, width, height) {
            return tile;
        }
        let side = 2 * RADIUS + 1;
        for shift in (0..side * side).filter(|s| *s != side * side / 2) {
            let (dx, dy) = (shift % side, shift / side);
            let offset = (dy * self.stride + dx) as isize - (RADIUS * self.stride + RADIUS) as isize;
            let patches = self.patches(x0, y0, width, height, offset);
            let steps = [dx.abs_diff(RADIUS) as f32, dy.abs_diff(RADIUS) as f32];
            for y in 0..height {
                self.weigh(&mut tile, self.at(x0, y0 + y), width, y, offset, &patches[y * TILE..], steps);
            }
        }
        tile
    }

    /// Whether a pixel of the tile has noise worth the time.
    fn is_noisy(&self, x0: usize, y0: usize, width: usize, height: usize) -> bool {
        let noisy = |i: usize| self.noise[i] > QUIET * (self.level[i] * self.level[i] + self.dark2);
        (0..height).any(|y| (self.at(x0, y0 + y)..self.at(x0, y0 + y) + width).any(noisy))
    }

    /// d of the pixels of a tile and those `offset` away, rows of `TILE`.
    #[inline(always)]
    fn patches(&self, x0: usize, y0: usize, width: usize, height: usize, offset: isize) -> [f32; TILE * TILE] {
        let mut single = [0.0f32; WIDE * WIDE];
        for y in 0..height + 2 * PATCH {
            let from = self.at(x0 - PATCH, y0 - PATCH + y);
            let to = from.wrapping_add_signed(offset);
            let n = width + 2 * PATCH;
            let row = &mut single[y * WIDE..y * WIDE + n];
            for (color, variance) in self.color.iter().zip(&self.variance) {
                let (a, b) = (&color[from..from + n], &color[to..to + n]);
                let (va, vb) = (&variance[from..from + n], &variance[to..to + n]);
                for x in 0..n {
                    let difference = a[x] - b[x];
                    let noise = va[x] + if va[x] < vb[x] { va[x] } else { vb[x] };
                    let d = (difference * difference - noise) / (va[x] + vb[x] + f32::MIN_POSITIVE);
                    row[x] += if d < FAR { d } else { FAR };
                }
            }
        }
        // Sums along the rows, then the columns.
        let mut rows = [0.0f32; TILE * WIDE];
        const { assert!(PATCH == 1, "sums of three") };
        for y in 0..height + 2 * PATCH {
            let (from, to) = (&single[y * WIDE..(y + 1) * WIDE], &mut rows[y * TILE..(y + 1) * TILE]);
            for x in 0..TILE {
                to[x] = from[x] + from[x + 1] + from[x + 2];
            }
        }
        let mut sums = [0.0f32; TILE * TILE];
        let patch = (2 * PATCH + 1) as f32;
        for y in 0..height {
            for x in 0..TILE {
                let column = rows[y * TILE + x] + rows[(y + 1) * TILE + x] + rows[(y + 2) * TILE + x];
                sums[y * TILE + x] = column * (1.0 / (3.0 * patch * patch));
            }
        }
        sums
    }

    /// Adds the pixels `offset` away from a row of the tile, by their weights.
    #[expect(clippy::too_many_arguments)]
    #[inline(always)]
    fn weigh(&self, tile: &mut Tile, from: usize, n: usize, y: usize, offset: isize, d: &[f32], [dx, dy]: [f32; 2]) {
        let to = from.wrapping_add_signed(offset);
        let mut e = [0.0f32; TILE];
        let e = &mut e[..n];
        for guide in &self.guides {
            let (a, b) = (&guide[from..from + n], &guide[to..to + n]);
            for x in 0..n {
                e[x] += (a[x] - b[x]) * (a[x] - b[x]);
            }
        }
        let [t, tolerance, along, down] = [0, 1, 2, 3].map(|k| &self.distance[k][from..from + n]);
        let other = &self.distance[0][to..to + n];
        let valid = &self.valid[to..to + n];
        for x in 0..n {
            let slope = along[x] * dx + down[x] * dy;
            e[x] += (t[x] - other[x]) * (t[x] - other[x]) / (tolerance[x] + slope * slope);
            // Weights of the guides from here on.
            e[x] = falling(e[x]) * valid[x];
        }
        let mut weights = [[0.0f32; TILE]; CANDIDATES];
        let d = &d[..n];
        let [wide, middle, narrow] = &mut weights;
        let (wide, middle, narrow) = (&mut wide[..n], &mut middle[..n], &mut narrow[..n]);
        for x in 0..n {
            // exp(-d / k^2) for k = 2; 1 is its fourth power, 1/2 that again.
            let w = falling(PER_SQUARE[0] * if d[x] > 0.0 { d[x] } else { 0.0 });
            let w4 = (w * w) * (w * w);
            let w16 = (w4 * w4) * (w4 * w4);
            wide[x] = if w < e[x] { w } else { e[x] };
            middle[x] = if w4 < e[x] { w4 } else { e[x] };
            narrow[x] = if w16 < e[x] { w16 } else { e[x] };
        }
        // dw/dc = -w/k^2 dd/dc where d is above 0 and decides; d has one in (2 PATCH + 1)^2 of the square (c_p - c_q)^2 / (v_p + v_q).
        let (level, other_level) = (&self.level[from..from + n], &self.level[to..to + n]);
        let (noise, other_noise) = (&self.noise[from..from + n], &self.noise[to..to + n]);
        let mut slopes = [0.0f32; TILE];
        let slopes = &mut slopes[..n];
        for x in 0..n {
            let slope = (other_level[x] - level[x]) / (noise[x] + other_noise[x] + f32::MIN_POSITIVE) * OF_PATCH;
            let slope = if slope.abs() < FAR { slope } else { 0.0 };
            slopes[x] = if d[x] > 0.0 { slope } else { 0.0 };
        }
        for ((sums, weights), per_square) in tile.sums.iter_mut().zip(&weights).zip(PER_SQUARE) {
            let (weights, [red, green, blue, all, first, second]) = (&weights[..n], sums);
            for (sum, color) in [red, green, blue].into_iter().zip(&self.color) {
                let (sum, color) = (&mut sum[y * TILE..y * TILE + n], &color[to..to + n]);
                for x in 0..n {
                    sum[x] += weights[x] * color[x];
                }
            }
            let row = y * TILE..y * TILE + n;
            let (all, first, second) = (&mut all[row.clone()], &mut first[row.clone()], &mut second[row]);
            for x in 0..n {
                all[x] += weights[x];
                let change = if weights[x] < e[x] { weights[x] * slopes[x] * per_square } else { 0.0 };
                first[x] += change * other_level[x];
                second[x] += change;
            }
        }
    }
}

/// exp(-x) for x >= 0, to a few hundredths; 0 beyond 64.
#[inline(always)]
fn falling(x: f32) -> f32 {
    let y = 1.0 - x * (1.0 / 64.0);
    let y = if y > 0.0 { y } else { 0.0 };
    let y = (y * y) * (y * y);
    let y = (y * y) * (y * y);
    (y * y) * (y * y)
}

/// Sums of a tile, for each candidate: three channels, weights, changes of weights with the pixel times values, and alone.
struct Tile {
    sums: Box<[[[f32; TILE * TILE]; SUMS]; CANDIDATES]>,
}

impl Tile {
    fn new() -> Self {
        Tile { sums: Box::new([[[0.0; TILE * TILE]; SUMS]; CANDIDATES]) }
    }

    /// A pixel counts 1 itself.
    fn start(&mut self, at: usize, color: [f32; 3]) {
        for sums in self.sums.iter_mut() {
            let [r, g, b] = color;
            for (sum, v) in sums.iter_mut().zip([r, g, b, 1.0]) {
                sum[at] = v;
            }
        }
    }

    fn pixel(&self, at: usize) -> [Candidate; CANDIDATES] {
        std::array::from_fn(|k| {
            let [r, g, b, weight, first, second] = [0, 1, 2, 3, 4, 5].map(|c| self.sums[k][c][at]);
            let color = Rgb::new(r, g, b) / weight;
            let changes = (first - mean(color) * second) / weight;
            Candidate { color, own: 1.0 / weight, derivative: 1.0 / weight + changes }
        })
    }
}

/// Mean over the channels.
pub(super) fn mean(c: Rgb) -> f32 {
    (c.x + c.y + c.z) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32};

    #[test]
    fn both_sets_of_lanes_have_the_same_bits_and_falling_falls() {
        let value = |i: usize, k: u64| unit_f32(hash(i as u64, k));
        let n = 41 * 37;
        let color: Vec<Rgb> = (0..n).map(|i| Rgb::new(value(i, 1), value(i, 2), value(i, 3))).collect();
        let variance: Vec<Rgb> = (0..n).map(|i| Rgb::splat(0.2 * value(i, 4))).collect();
        let guides: Vec<Guide> = (0..n)
            .map(|i| {
                let mut guide = Guide::default();
                guide.see(Rgb::ONE, Rgb::splat(0.1 * value(i, 5)), crate::math::Vec3::Z, 1.0 + 0.01 * value(i, 6));
                guide
            })
            .collect();
        let planes = Planes::new(41, &color, &variance, &guides, 0.5);
        for (column, row) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            assert!(planes.tile(column, row).sums == planes.tile_by(column, row).sums, "{column} {row}");
        }
        for x in [0.0f32, 0.1, 0.5, 1.0, 2.0, 4.0, 100.0] {
            assert!((falling(x) - (-x).exp()).abs() < 0.02, "{x}");
        }
    }
}
