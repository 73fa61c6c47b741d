//! How many caustic photons a pass gets: as many as the rest of the picture is worth.
//!
//! After N passes of s camera samples and n photons each the picture has the squared error and the cost
//!
//! ```text
//! V pixels / (N s) + e(n),  e(n) = e_1 n_1 / n        N (s + n)
//! ```
//!
//! V: relative variance of a camera sample but for that of photon maps; e: relative squared error of a map. Noise of maps falls with the passes as
//! well, their blur hardly does, so that e is held against what N passes leave of the noise of samples. The product is least for
//!
//! ```text
//! n = s sqrt(N e_1 n_1 / (V pixels))                                                 (1)
//! ```
//!
//! A photon is traced, sorted and asked for in the time of a camera sample (cornell-spheres, caustic-ring: 3.5 us each).
//! e_1 is what two maps differ by: the first pass has [`FIRST`] of the most photons, the second one half of that ([`Counts`]), n_1. Noise of both is in it,
//! and of the blur, which doubles from one to the other, half. Few pixels are looked at, by the same random numbers with
//! both maps (`looks.rs`).
//! Source      the allocation among two sources of error (Neyman 1934), with a cost of each; the estimate from two maps is ours
//! Bias        none of its own: other random numbers than the picture's, and photons share their light whatever their number
//! Not handled noise of the irradiance cache: it counts as none, which asks for more photons
//! Verified by `tests`

use super::looks::Found;

/// Photons of the first pass, as a share of the most, but [`LEAST`] at least.
const FIRST: f64 = 0.125;
const LEAST: usize = 1 << 14;

/// Photons of each pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counts {
    most: usize,
    first: usize,
    /// s: camera samples of a pass.
    samples: f64,
    pixels: usize,
    /// What was found out, and n_1.
    found: Option<(Found, usize)>,
}

impl Counts {
    /// At most `most` photons for a picture of so many camera samples in a pass, and so many pixels.
    pub fn new(most: usize, samples: f64, pixels: usize) -> Self {
        let first = ((most as f64 * FIRST) as usize).max(LEAST).min(most);
        Counts { most, first, samples, pixels, found: None }
    }

    /// Photons of the first pass.
    pub fn first(&self) -> usize {
        self.first
    }

    /// Photons of any pass, at most.
    pub fn most(&self) -> usize {
        self.most
    }

    /// Photons from pass `pass` on; `None`: as before. Few passes change the number: sequences of random numbers start anew with it.
    pub fn changed_in(&self, pass: u64) -> Option<usize> {
        match pass {
            1 => Some(self.first / 2),
            _ if pass.is_power_of_two() => Some(self.found.map_or(self.most, |found| self.best(found, pass + 1))),
            _ => None,
        }
    }

    /// Equation 1 for the `passes`-th pass, within bounds.
    fn best(&self, (found, n1): (Found, usize), passes: u64) -> usize {
        let n =
            self.samples * (passes as f64 * found.difference * n1 as f64 / (found.sample * self.pixels as f64)).sqrt();
        // Without noise of samples the quotient is infinite, or no number where maps do not differ either.
        if n.is_nan() { self.first } else { (n as usize).clamp(self.first, self.most) }
    }

    /// Takes note of what was found out by a map of `photons`, n_1.
    pub fn learn(&mut self, found: Found, photons: usize) {
        self.found = Some((found, photons));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(difference: f64, sample: f64) -> Found {
        Found { difference, sample, rays: 3.0 }
    }

    #[test]
    fn the_number_is_where_error_times_cost_is_least() {
        let pixels = f64::from(1 << 18);
        let counts = Counts::new(1 << 18, 1.5 * pixels, 1 << 18);
        let n1 = counts.first / 2;
        for (map, sample) in [(1e-3, 3e-3), (1e-3, 1e-2), (1e-2, 4e-2), (3e-4, 2e-3)] {
            for passes in [3, 9] {
                let s = counts.samples;
                let badness = |n: usize| {
                    let n = n as f64;
                    (sample * pixels / (passes as f64 * s) + map * n1 as f64 / n) * (s + n)
                };
                let n = counts.best((found(map, sample), n1), passes);
                assert!(counts.first < n && n < counts.most, "{map} {sample}: {n} is a bound, and tells nothing");
                let near = [n * 9 / 10, n * 11 / 10].map(badness);
                assert!(badness(n) < near[0] && badness(n) < near[1], "{map} {sample} {passes}: {n}");
            }
        }
    }

    #[test]
    fn what_is_nothing_is_within_bounds() {
        let counts = Counts::new(100_000, 1e5, 100_000);
        let best = |map, sample| counts.best((found(map, sample), 10_000), 4);
        assert_eq!((best(0.0, 1.0), best(0.0, 0.0), best(1.0, 0.0)), (counts.first, counts.first, counts.most));
        assert_eq!((counts.first, Counts::new(1000, 50.0, 50).first), (1 << 14, 1000));
    }

    #[test]
    fn passes_grow_only_as_far_as_the_maps_are_worth() {
        let mut counts = Counts::new(1 << 18, 4e5, 1 << 18);
        assert_eq!((counts.changed_in(1), counts.changed_in(3)), (Some(counts.first / 2), None));
        // Before anything is known there are as many as there may be.
        assert_eq!(counts.changed_in(2), Some(1 << 18));
        counts.learn(found(1e-3, 1e-2), counts.first / 2);
        let [a, b, c] = [2, 4, 8].map(|p| counts.changed_in(p).unwrap());
        assert!(a < b && b < c && c < 1 << 18, "{a} {b} {c}");
        counts.learn(found(1e-8, 1e-2), counts.first / 2);
        assert_eq!([2, 4, 8].map(|p| counts.changed_in(p)), [Some(counts.first); 3]);
    }
}
