//! Piecewise-constant densities over `[0,1]` and `[0,1]^2` by inverse CDF.
//!
//! Measure: `pdf` is per unit length or area of the unit interval or square; `pmf` is the probability of a cell.
//! Both are differences of the table that `sample` inverts, so a cell whose difference has rounded to 0 is never drawn
//! and says so. In two dimensions: first the row from the marginal, then the column from the row's own table.
//! Search: a guide table (Chen & Asau 1974, "On Generating Random Variates from an Empirical Distribution"; Devroye 1986, section
//! III.2.4) holds the cell of each of a few evenly spaced numbers; from there the search goes on cell by cell. It finds what
//! bisection finds, in constant expected time and mostly within one cache line.

use crate::math::Vec2;

/// A piecewise-constant density over [0, 1] with n cells of equal width.
#[derive(Clone, Debug)]
pub struct Piecewise1 {
    cdf: Vec<f32>,
    guide: Vec<u32>,
}

/// Cells for each entry of a guide table.
const CELLS_PER_GUIDE: usize = 4;

/// Entries of the guide table of a CDF over `cells` cells.
fn guide_len(cells: usize) -> usize {
    cells.div_ceil(CELLS_PER_GUIDE)
}

/// Appends the cells of the numbers k / n, k = 0 .. n, n = [`guide_len`].
fn push_guide(cdf: &[f32], guide: &mut Vec<u32>) {
    let n = guide_len(cdf.len() - 1);
    let mut i = 0;
    for k in 0..n {
        let u = k as f32 / n as f32;
        while cdf[i + 1] <= u {
            i += 1;
        }
        guide.push(i as u32);
    }
}

/// Writes the CDF of `values` (negative and non-finite count as 0) to `cdf`; returns the sum.
/// All zero gives the uniform density.
fn fill_cdf(values: &[f32], cdf: &mut [f32]) -> f64 {
    let clean = |v: f32| if v.is_finite() && v > 0.0 { v as f64 } else { 0.0 };
    let sum: f64 = values.iter().map(|&v| clean(v)).sum();
    let mut run = 0.0;
    cdf[0] = 0.0;
    for (i, &v) in values.iter().enumerate() {
        run += if sum > 0.0 { clean(v) / sum } else { 1.0 / values.len() as f64 };
        cdf[i + 1] = (run as f32).min(1.0);
    }
    // From the last cell of any weight on it is 1 exactly: u = 1 - 2^-24 must not land in an empty cell.
    let last = values.iter().rposition(|&v| clean(v) > 0.0).unwrap_or(values.len() - 1);
    cdf[last + 1..].fill(1.0);
    sum
}

/// Cell of `u` in a CDF with its guide table, and the position inside it, in [0, 1).
fn find(cdf: &[f32], guide: &[u32], u: f32) -> (usize, f32) {
    let u = u.clamp(0.0, ONE_BELOW);
    let k = ((u * guide.len() as f32) as usize).min(guide.len() - 1);
    let mut i = guide[k] as usize;
    // The product may have been rounded up to the next entry.
    while cdf[i] > u {
        i -= 1;
    }
    // Ends: the last entry is 1.
    while cdf[i + 1] <= u {
        i += 1;
    }
    (i, ((u - cdf[i]) / (cdf[i + 1] - cdf[i])).min(ONE_BELOW))
}

/// Cell of a position x in [0, 1] among n, and the position inside it.
fn locate(x: f32, n: usize) -> (usize, f32) {
    let s = x.clamp(0.0, 1.0) * n as f32;
    let i = (s as usize).min(n - 1);
    (i, s - i as f32)
}

const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

impl Piecewise1 {
    /// Density in proportion to `values`, which must not be empty.
    pub fn new(values: &[f32]) -> Self {
        assert!(!values.is_empty(), "a density needs a cell");
        let mut cdf = vec![0.0; values.len() + 1];
        fill_cdf(values, &mut cdf);
        let mut guide = Vec::with_capacity(guide_len(values.len()));
        push_guide(&cdf, &mut guide);
        Piecewise1 { cdf, guide }
    }

    /// Number of cells, at least 1.
    pub fn cells(&self) -> usize {
        self.cdf.len() - 1
    }

    /// Probability of cell `i`.
    pub fn pmf(&self, i: usize) -> f32 {
        self.cdf[i + 1] - self.cdf[i]
    }

    /// Cell of `u` in [0, 1) and the position inside it.
    pub fn sample_cell(&self, u: f32) -> (usize, f32) {
        find(&self.cdf, &self.guide, u)
    }

    /// Position in [0, 1) and its density.
    pub fn sample(&self, u: f32) -> (f32, f32) {
        let (i, f) = find(&self.cdf, &self.guide, u);
        let n = self.cells() as f32;
        ((i as f32 + f) / n, self.pmf(i) * n)
    }

    /// Density at `x`.
    pub fn pdf(&self, x: f32) -> f32 {
        self.pmf(locate(x, self.cells()).0) * self.cells() as f32
    }

    /// The number that [`Self::sample`] turns into `x`.
    pub fn invert(&self, x: f32) -> f32 {
        let (i, f) = locate(x, self.cells());
        self.cdf[i] + f * self.pmf(i)
    }
}

/// A cell of a [`Piecewise2`] and a position inside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Position inside the cell, [0, 1)^2.
    pub inside: Vec2,
    /// Probability of the cell.
    pub pmf: f32,
}

/// A piecewise-constant density over [0, 1]^2 with `width` x `height` cells of equal size.
#[derive(Clone, Debug)]
pub struct Piecewise2 {
    width: usize,
    rows: Vec<f32>,
    /// Guide tables of all rows.
    guides: Vec<u32>,
    marginal: Piecewise1,
    mean: f64,
}

impl Piecewise2 {
    /// Density in proportion to the row-major `values`, `width` per row; at least one row.
    pub fn new(values: &[f32], width: usize) -> Self {
        assert!(width > 0 && !values.is_empty() && values.len().is_multiple_of(width));
        let height = values.len() / width;
        let mut rows = vec![0.0; (width + 1) * height];
        let sums: Vec<f64> =
            (values.chunks(width).zip(rows.chunks_mut(width + 1))).map(|(row, cdf)| fill_cdf(row, cdf)).collect();
        // Sums relative to the largest: they may exceed f32.
        let largest = sums.iter().fold(f64::MIN_POSITIVE, |m, &s| m.max(s));
        let relative: Vec<f32> = sums.iter().map(|s| (s / largest) as f32).collect();
        let mut guides = Vec::with_capacity(guide_len(width) * height);
        rows.chunks(width + 1).for_each(|cdf| push_guide(cdf, &mut guides));
        Piecewise2 {
            width,
            rows,
            guides,
            marginal: Piecewise1::new(&relative),
            mean: sums.iter().sum::<f64>() / values.len() as f64,
        }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.marginal.cells()
    }

    /// Mean of the values that the density was built from.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.rows[y * (self.width + 1)..(y + 1) * (self.width + 1)]
    }

    /// Probability of the cell in column `x` and row `y`.
    pub fn pmf(&self, x: usize, y: usize) -> f32 {
        let row = self.row(y);
        self.marginal.pmf(y) * (row[x + 1] - row[x])
    }

    /// Cell of `u` in [0, 1)^2: `u.y` finds the row, `u.x` the column.
    pub fn sample_cell(&self, u: Vec2) -> Cell {
        let (y, fy) = self.marginal.sample_cell(u.y);
        let n = guide_len(self.width);
        let (x, fx) = find(self.row(y), &self.guides[y * n..(y + 1) * n], u.x);
        Cell { x, y, inside: Vec2::new(fx, fy), pmf: self.pmf(x, y) }
    }

    /// The numbers that [`Self::sample_cell`] turns into the position `inside` of the cell (x, y).
    pub fn invert_cell(&self, x: usize, y: usize, inside: Vec2) -> Vec2 {
        let row = self.row(y);
        Vec2::new(row[x] + inside.x * (row[x + 1] - row[x]), self.marginal.cdf[y] + inside.y * self.marginal.pmf(y))
    }

    /// Size of the box of numbers that [`Self::sample_cell`] maps to the cell (x, y): its pmf is the product.
    pub fn cell_size(&self, x: usize, y: usize) -> Vec2 {
        let row = self.row(y);
        Vec2::new(row[x + 1] - row[x], self.marginal.pmf(y))
    }

    /// Position in [0, 1)^2 and its density.
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        let c = self.sample_cell(u);
        let size = Vec2::new(self.width as f32, self.height() as f32);
        ((Vec2::new(c.x as f32, c.y as f32) + c.inside) / size, c.pmf * size.x * size.y)
    }

    /// Density at `p`.
    pub fn pdf(&self, p: Vec2) -> f32 {
        let (x, y) = (locate(p.x, self.width).0, locate(p.y, self.height()).0);
        self.pmf(x, y) * (self.width * self.height()) as f32
    }

    /// The numbers that [`Self::sample`] turns into `p`.
    pub fn invert(&self, p: Vec2) -> Vec2 {
        let ((x, fx), (y, fy)) = (locate(p.x, self.width), locate(p.y, self.height()));
        self.invert_cell(x, y, Vec2::new(fx, fy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{Sampler, hash, unit_f32};

    fn values(n: u64) -> Vec<f32> {
        (0..n).map(|i| if i % 7 == 3 { 0.0 } else { unit_f32(hash(5, i)).powi(3) }).collect()
    }

    #[test]
    fn one_dimension_sample_pdf_invert() {
        let v = values(37);
        let d = Piecewise1::new(&v);
        let sum: f32 = v.iter().sum();
        for (i, v) in v.iter().enumerate() {
            assert!((d.pmf(i) - v / sum).abs() < 2e-7);
        }
        for k in 0..1000 {
            let u = k as f32 / 1000.0;
            let (x, pdf) = d.sample(u);
            assert!(pdf > 0.0 && (d.invert(x) - u).abs() < 2e-6, "{u} {x}");
            assert!((d.pdf(x) - pdf).abs() < 1e-6 || (x * 37.0).fract() > 0.9999 || (x * 37.0).fract() < 1e-4);
        }
    }

    #[test]
    fn the_guided_search_finds_what_bisection_finds() {
        let spiky: Vec<f32> = (0..1000).map(|i| if i % 97 == 5 { 1e3 } else { 1e-4 * unit_f32(hash(8, i)) }).collect();
        for v in [values(1), values(5), values(64), values(1001), spiky] {
            let d = Piecewise1::new(&v);
            let bisected = |u: f32| d.cdf.partition_point(|&c| c <= u) - 1;
            let random = (0..4000).map(|i| unit_f32(hash(9, i)));
            let borders = d.cdf.iter().flat_map(|&c| [c.next_down(), c, c.next_up()]);
            let steps = (0..=d.guide.len()).map(|k| k as f32 / d.guide.len() as f32);
            let steps = steps.flat_map(|u| [u.next_down(), u, u.next_up()]);
            for u in random.chain(borders).chain(steps).filter(|u| (0.0..=ONE_BELOW).contains(u)) {
                assert_eq!(d.sample_cell(u).0, bisected(u), "{u} among {}", v.len());
            }
        }
    }

    #[test]
    fn two_dimensions_cells_are_hit_as_often_as_their_pmf_says() {
        let (w, h) = (9, 6);
        let d = Piecewise2::new(&values(54), w);
        let n = 1 << 16;
        let mut counts = vec![0u32; w * h];
        for i in 0..n {
            let c = d.sample_cell(Sampler::new(4, 4, i).next_2d());
            assert_eq!(c.pmf, d.pmf(c.x, c.y));
            assert!((0.0..1.0).contains(&c.inside.x) && (0.0..1.0).contains(&c.inside.y));
            counts[c.y * w + c.x] += 1;
        }
        let total: f32 = (0..w * h).map(|i| d.pmf(i % w, i / w)).sum();
        assert!((total - 1.0).abs() < 1e-6);
        // Chi-square with at most 53 degrees of freedom: 99.9 % lie below 90 for independent numbers, Sobol points far below.
        let chi = |p: &dyn Fn(usize) -> f64| -> f64 {
            let term = |i: usize| (counts[i] as f64 - n as f64 * p(i)).powi(2) / (n as f64 * p(i));
            (0..w * h).filter(|&i| p(i) > 0.0).map(term).sum()
        };
        let pmf = |i: usize| d.pmf(i % w, i / w) as f64;
        assert!(chi(&pmf) < 90.0);
        assert!(chi(&|i| pmf((i + 1) % 54)) > 90.0, "a shifted density is told apart");
        assert!((0..54).all(|i| pmf(i) > 0.0 || counts[i] == 0));
    }

    #[test]
    fn two_dimensions_invert() {
        let d = Piecewise2::new(&values(54), 9);
        for i in 0..1000 {
            let u = Sampler::new(6, 6, i).next_2d();
            let (p, pdf) = d.sample(u);
            assert!(pdf > 0.0 && (d.invert(p) - u).length() < 1e-5);
        }
        assert!((d.mean() - values(54).iter().sum::<f32>() as f64 / 54.0).abs() < 1e-6);
    }

    #[test]
    fn extremes_never_land_in_an_empty_cell() {
        let d = Piecewise1::new(&[0.0, 1.0, 1e-30, 0.0, 3.0, 0.0]);
        for u in [0.0, f32::MIN_POSITIVE, 0.25, 0.5, ONE_BELOW, 1.0] {
            assert!([1, 4].contains(&d.sample_cell(u).0), "{u}");
        }
        assert_eq!(Piecewise1::new(&[0.0, 0.0]).pdf(0.7), 1.0);
        assert_eq!(Piecewise2::new(&[f32::NAN, -1.0], 2).pmf(1, 0), 0.5);
        let huge = Piecewise2::new(&[f32::MAX, f32::MAX, f32::MAX, f32::MAX], 2);
        assert_eq!(huge.pmf(1, 1), 0.25);
    }
}
