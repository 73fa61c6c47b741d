//! Alias table: one of n entries in proportion to its weight, in constant time.
//!
//! Source: Walker 1974 in the construction of Vose 1991, "A Linear Algorithm for Generating Random Numbers with a
//! Given Distribution". Measure: discrete (`pmf`). Construction is O(n), in f64, and a function of the weights only.
//! Not handled: changing a weight without building anew.

/// A table of n entries with probabilities in proportion to their weights.
#[derive(Clone, Debug, Default)]
pub struct AliasTable {
    bins: Vec<Bin>,
    pmf: Vec<f32>,
}

/// One of n equally likely bins: its own entry below `accept`, the other one above.
#[derive(Clone, Copy, Debug)]
struct Bin {
    accept: f32,
    alias: u32,
}

impl AliasTable {
    /// Builds the table. Weights that are negative or not finite count as 0; if none is left, all are equal.
    pub fn new(weights: &[f64]) -> Self {
        let n = weights.len();
        let clean = |w: f64| if w.is_finite() && w > 0.0 { w } else { 0.0 };
        // Scaled by the largest first: the sum of large weights must not overflow.
        let largest = weights.iter().fold(0.0, |m: f64, &w| m.max(clean(w)));
        let sum: f64 = weights.iter().map(|&w| clean(w) / largest).sum();
        let p = |i: usize| {
            if largest > 0.0 { clean(weights[i]) / largest / sum } else { 1.0 / n as f64 }
        };
        // Expected share of the n bins per entry: those below 1 are filled up by those above.
        let mut share: Vec<f64> = (0..n).map(|i| p(i) * n as f64).collect();
        let (mut small, mut large): (Vec<u32>, Vec<u32>) = (0..n as u32).partition(|&i| share[i as usize] < 1.0);
        let mut bins: Vec<Bin> = (0..n as u32).map(|alias| Bin { accept: 1.0, alias }).collect();
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            bins[s as usize] = Bin { accept: share[s as usize] as f32, alias: l };
            share[l as usize] -= 1.0 - share[s as usize];
            if share[l as usize] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // What rounding has left over in either list holds a share of 1 and keeps its bin to itself.
        AliasTable { bins, pmf: (0..n).map(|i| p(i) as f32).collect() }
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.pmf.len()
    }

    /// Whether there is no entry.
    pub fn is_empty(&self) -> bool {
        self.pmf.is_empty()
    }

    /// Probability of entry `i`.
    pub fn pmf(&self, i: usize) -> f32 {
        self.pmf[i]
    }

    /// Draws an entry from `u` in [0, 1); `None` if the table is empty. With n entries a number of b bits resolves
    /// probabilities inside a bin to n / 2^b only, hence f64: give it more bits than an f32 has where n is large.
    pub fn sample(&self, u: f64) -> Option<usize> {
        let scaled = u * self.bins.len() as f64;
        let i = (scaled as usize).min(self.bins.len().checked_sub(1)?);
        let bin = self.bins[i];
        Some(if scaled - (i as f64) < bin.accept as f64 { i } else { bin.alias as usize })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32, unit_f64};

    /// Largest deviation of observed counts from n p, in standard deviations.
    fn worst_deviation(table: &AliasTable, p: impl Fn(usize) -> f64, n: u64) -> f64 {
        let mut counts = vec![0u64; table.len()];
        for i in 0..n {
            counts[table.sample(unit_f64(hash(77, i))).unwrap()] += 1;
        }
        let dev = |i: usize| (counts[i] as f64 - n as f64 * p(i)).abs() / (n as f64 * p(i) * (1.0 - p(i))).sqrt();
        (0..table.len()).filter(|&i| p(i) > 0.0).map(dev).fold(0.0, f64::max)
    }

    #[test]
    fn frequencies_follow_the_weights_and_pmf_says_so() {
        let weights: Vec<f64> = (0..500).map(|i| unit_f32(hash(1, i)).powi(6) as f64 * 1e-3 + 1e-6).collect();
        let table = AliasTable::new(&weights);
        let sum: f64 = weights.iter().sum();
        for (i, w) in weights.iter().enumerate() {
            assert!((table.pmf(i) as f64 / (w / sum) - 1.0).abs() < 1e-6);
        }
        // 500 entries, two-sided: 4.9 standard deviations are exceeded with probability 500 x 1e-6.
        let p = |i: usize| table.pmf(i) as f64;
        assert!(worst_deviation(&table, p, 1_000_000) < 4.9);
        // Companion: a table off by 10 % in every second entry is told apart.
        let wrong = |i: usize| p(i) * if i.is_multiple_of(2) { 1.1 } else { 0.9 };
        assert!(worst_deviation(&table, wrong, 1_000_000) > 4.9);
    }

    #[test]
    fn probabilities_implied_by_the_bins_are_exact() {
        // Sum of bin shares per entry, instead of drawing: exact to f32.
        let n = 100_000;
        let weights: Vec<f64> = (0..n).map(|i| (unit_f32(hash(2, i)) as f64 * 20.0).exp()).collect();
        let table = AliasTable::new(&weights);
        let mut share = vec![0f64; n as usize];
        for (i, b) in table.bins.iter().enumerate() {
            share[i] += b.accept as f64;
            share[b.alias as usize] += 1.0 - b.accept as f64;
        }
        for (i, s) in share.iter().enumerate() {
            // The last entries carry the rounding of all: absolute, in units of one bin.
            assert!((s / n as f64 - table.pmf(i) as f64).abs() < 1e-12 + 1e-6 * table.pmf(i) as f64);
        }
    }

    #[test]
    fn degenerate_weights() {
        assert!(AliasTable::new(&[]).sample(0.5).is_none());
        let one = AliasTable::new(&[3.0]);
        assert_eq!((one.sample(0.0), one.sample(0.999_999_99), one.pmf(0)), (Some(0), Some(0), 1.0));
        let zero = AliasTable::new(&[0.0, 0.0, f64::NAN, -1.0]);
        assert_eq!(zero.pmf(3), 0.25);
        let holes = AliasTable::new(&[0.0, 1e300, 0.0, 1e300, f64::INFINITY]);
        assert!((0..1000).all(|i| [1, 3].contains(&holes.sample(i as f64 / 1000.0).unwrap())));
        assert_eq!(holes.pmf(1), 0.5);
    }
}
