//! How many photons each light gets, and how its primary-sample space is cut for them.
//!
//! Lights that can expect a photon or more get a fixed number of them (largest remainders), so that the power of each is exact. The rest,
//! the *tail*, share a fixed number too, and which light each of these photons starts from is drawn (systematically) in proportion to the
//! weights.
//!
//! Position and direction: K strata of the position, each with M = n / K directions. A photon's neighbourhood on what it lights, at a
//! distance D, has the widths sqrt(A / K) from its part of the position (A: area that positions cover) and D sqrt(W / M) from that of the
//! direction (W: measure of all directions); they are equal for
//!
//! ```text
//! K = sqrt(A n / (D^2 W))                                                            (1)
//! ```
//!
//! so that a small lamp has one stratum and a window many. Bias: none, for any K.

use super::area::Lamp;
use super::source::{Kind, Source};
use crate::scene::Scene;

/// Share of the photons that follows power whatever was learned: no light may starve.
const POWER_FLOOR: f64 = 0.1;

/// Least weight of a light whose power is only estimated (textures, maps), relative to the mean.
const ESTIMATED_FLOOR: f64 = 1e-3;

/// Photons per light, and for the tail.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Allocation {
    /// Photons of each light; 0: it belongs to the tail, or has no power.
    pub counts: Vec<usize>,
    /// Photons of the tail.
    pub tail: usize,
    /// Lights of the tail.
    pub tail_lights: Vec<u32>,
    /// Where the lights of the tail end in [0, 1].
    pub tail_cdf: Vec<f64>,
}

/// Powers of the lights, mean of the channels, with a floor for those that are estimates.
pub fn powers(scene: &Scene) -> Vec<f64> {
    let infos = &scene.lights.infos;
    let mut power: Vec<f64> = infos.iter().map(|l| clean(l.power.as_dvec3().element_sum() / 3.0)).collect();
    let mean = power.iter().sum::<f64>() / power.len().max(1) as f64;
    for (light, p) in power.iter_mut().enumerate() {
        if scene.lights.is_estimated(light, &scene.shapes) {
            *p = p.max(ESTIMATED_FLOOR * mean);
        }
    }
    power
}

fn clean(w: f64) -> f64 {
    if w.is_finite() && w > 0.0 { w } else { 0.0 }
}

/// Weights of lights by `power`; by `learned` but for a floor if it is given. They sum to 1.
pub fn light_weights(mut power: Vec<f64>, learned: Option<&[f32]>) -> Vec<f64> {
    normalise(&mut power);
    if let Some(learned) = learned {
        let mut learned: Vec<f64> =
            power.iter().zip(learned).map(|(p, w)| if *p > 0.0 { clean(f64::from(*w)) } else { 0.0 }).collect();
        learned.resize(power.len(), 0.0);
        if learned.iter().sum::<f64>() > 0.0 {
            normalise(&mut learned);
            power.iter_mut().zip(&learned).for_each(|(p, w)| *p = POWER_FLOOR * *p + (1.0 - POWER_FLOOR) * w);
        }
    }
    power
}

fn normalise(weights: &mut [f64]) {
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        weights.iter_mut().for_each(|w| *w /= sum);
    }
}

impl Allocation {
    /// `n` photons for lights of these weights, which sum to 1 (or are all 0: no photons). One more than `n` is possible.
    pub fn new(weights: &[f64], n: usize) -> Self {
        Self::keeping(weights, n, |_| false)
    }

    /// The same, but lights for which `own` holds never belong to the tail: they get a photon at least if they have a weight.
    pub fn keeping(weights: &[f64], n: usize, own: impl Fn(usize) -> bool) -> Self {
        let mut a = Allocation { counts: vec![0; weights.len()], ..Self::default() };
        if n == 0 || !(weights.iter().sum::<f64>() > 0.0) {
            return a;
        }
        // Rounding of weights must not send an even share to the tail.
        let large = |light: usize| weights[light] * n as f64 >= 1.0 - 1e-9 || weights[light] > 0.0 && own(light);
        let faint = || weights.iter().enumerate().filter(|(light, w)| !large(*light) && **w > 0.0);
        let tail: f64 = faint().map(|(_, w)| w).sum();
        if tail > 0.0 {
            a.tail = ((tail * n as f64).round() as usize).max(1);
            let mut run = 0.0;
            for (light, w) in faint() {
                run += w / tail;
                a.tail_lights.push(light as u32);
                a.tail_cdf.push(run);
            }
            if let Some(last) = a.tail_cdf.last_mut() {
                *last = 1.0;
            }
        }
        let lights: Vec<usize> = (0..weights.len()).filter(|&l| large(l)).collect();
        let shares: Vec<f64> = lights.iter().map(|&l| weights[l] / (1.0 - tail).max(1e-300)).collect();
        let most = n.saturating_sub(a.tail).max(lights.len());
        for (&light, count) in lights.iter().zip(apportion(&shares, most)) {
            a.counts[light] = count;
        }
        a
    }

    /// All photons.
    pub fn total(&self) -> usize {
        self.counts.iter().sum::<usize>() + self.tail
    }

    /// The light of the tail at `u` in [0, 1), and its probability.
    pub fn tail_light(&self, u: f64) -> (u32, f64) {
        let k = self.tail_cdf.partition_point(|&c| c <= u).min(self.tail_cdf.len() - 1);
        let before = if k == 0 { 0.0 } else { self.tail_cdf[k - 1] };
        (self.tail_lights[k], self.tail_cdf[k] - before)
    }
}

/// Whole numbers in proportion to `shares` (which sum to 1), one at least each, `n` in all (not fewer than there are shares): largest
/// remainders, ties to the first.
pub fn apportion(shares: &[f64], n: usize) -> Vec<usize> {
    let mut counts: Vec<usize> = shares.iter().map(|s| ((s * n as f64) as usize).max(1)).collect();
    let mut order: Vec<usize> = (0..shares.len()).collect();
    let excess = |i: usize, counts: &[usize]| counts[i] as f64 - shares[i] * n as f64;
    let sum: usize = counts.iter().sum();
    if sum < n {
        order.sort_by(|&i, &j| excess(i, &counts).total_cmp(&excess(j, &counts)).then(i.cmp(&j)));
        for k in 0..n - sum {
            counts[order[k % order.len()]] += 1;
        }
    } else {
        // Those raised to 1 are paid for by the largest.
        let mut over = sum - n;
        while over > 0 {
            let Some(i) = (0..counts.len())
                .filter(|&i| counts[i] > 1)
                .max_by(|&i, &j| excess(i, &counts).total_cmp(&excess(j, &counts)).then(j.cmp(&i)))
            else {
                break;
            };
            counts[i] -= 1;
            over -= 1;
        }
    }
    counts
}

/// A part of a light's positions: the box `lo..hi` of (u0, u1), whose area is its share of the flux.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionStratum {
    /// Lower corner.
    pub lo: [f64; 2],
    /// Upper corner.
    pub hi: [f64; 2],
}

impl PositionStratum {
    /// All positions.
    pub const ALL: PositionStratum = PositionStratum { lo: [0.0; 2], hi: [1.0; 2] };

    /// Its share of the positions.
    pub fn share(&self) -> f64 {
        (self.hi[0] - self.lo[0]) * (self.hi[1] - self.lo[1])
    }

    /// The number at `f` in [0,1)^2 of the box.
    pub fn at(&self, f: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|k| self.lo[k] + f[k] * (self.hi[k] - self.lo[k]))
    }
}

/// Position strata of a light for `n` photons at a typical `distance` (equation 1).
pub fn position_strata(source: &Source, n: usize, distance: f64) -> Vec<PositionStratum> {
    if !source.has_position() {
        return vec![PositionStratum::ALL];
    }
    if !source.has_direction() {
        // The photons' own points are well distributed: no further strata are needed.
        return vec![PositionStratum::ALL];
    }
    let k = (balanced_strata(source, n, distance).round() as usize).clamp(1, n.max(1));
    match &source.kind {
        Kind::Lamp(lamp) => lamp_strata(lamp, k),
        _ => boxes(PositionStratum::ALL, k, 1.0),
    }
}

/// Equation 1, between 1 and `n`.
pub fn balanced_strata(source: &Source, n: usize, distance: f64) -> f64 {
    let k = (source.area() * n as f64 / (distance * distance * source.directions())).sqrt();
    k.clamp(1.0, n.max(1) as f64)
}

fn lamp_strata(lamp: &Lamp, k: usize) -> Vec<PositionStratum> {
    let primitives = lamp.cdf.len() - 1;
    let whole = |lo: f64, hi: f64| PositionStratum { lo: [lo, 0.0], hi: [hi, 1.0] };
    if k < primitives {
        return (0..k).map(|i| whole(i as f64 / k as f64, (i + 1) as f64 / k as f64)).collect();
    }
    let shares: Vec<f64> = lamp.cdf.windows(2).map(|w| w[1] - w[0]).collect();
    let mut strata = Vec::with_capacity(k);
    for (prim, count) in apportion(&shares, k).into_iter().enumerate() {
        let (lo, hi) = (lamp.cdf[prim], lamp.cdf[prim + 1]);
        let site = lamp.site([0.5 * (lo + hi), 0.5]);
        let aspect = site.p_u[0].length() * (hi - lo) / site.p_u[1].length();
        strata.extend(boxes(whole(lo, hi), count, aspect));
    }
    strata
}

/// `k` boxes of equal area: columns that hold nearly equal numbers; `aspect` is the width of the whole over its height.
fn boxes(all: PositionStratum, k: usize, aspect: f64) -> Vec<PositionStratum> {
    let columns = ((k as f64 * aspect.clamp(1e-3, 1e3)).sqrt().round() as usize).clamp(1, k);
    let mut out = Vec::with_capacity(k);
    let mut before = 0;
    for i in 0..columns {
        let count = (i + 1) * k / columns - i * k / columns;
        let x = [before as f64 / k as f64, (before + count) as f64 / k as f64];
        for j in 0..count {
            let y = [j as f64 / count as f64, (j + 1) as f64 / count as f64];
            out.push(PositionStratum { lo: all.at([x[0], y[0]]), hi: all.at([x[1], y[1]]) });
        }
        before += count;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn apportioned_numbers_add_up_and_leave_nobody_out() {
        for (shares, n) in [(vec![0.5, 0.3, 0.2], 7), (vec![0.98, 0.01, 0.01], 10), (vec![0.25; 4], 4), (vec![1.0], 9)]
        {
            let counts = apportion(&shares, n);
            assert_eq!(counts.iter().sum::<usize>(), n, "{shares:?}");
            assert!(counts.iter().zip(&shares).all(|(&c, s)| c >= 1 && (c as f64 - s * n as f64).abs() <= 2.0));
        }
    }

    #[test]
    fn faint_lights_share_a_tail_with_their_probabilities() {
        let weights: Vec<f64> = std::iter::once(0.5).chain(std::iter::repeat_n(0.5 / 100.0, 100)).collect();
        let a = Allocation::new(&weights, 50);
        assert_eq!((a.counts[0], a.tail, a.tail_lights.len(), a.total()), (25, 25, 100, 50));
        let mut seen = [0; 101];
        for i in 0..1000 {
            let (light, p) = a.tail_light((i as f64 + 0.5) / 1000.0);
            assert!((p - 0.01).abs() < 1e-12);
            seen[light as usize] += 1;
        }
        assert!(seen[1..].iter().all(|&s| s == 10));
        // Those that are kept out of it have one for sure, and are not among those that share.
        let kept = Allocation::keeping(&weights, 150, |light| light % 2 == 1);
        assert_eq!((kept.counts[0], kept.counts[1], kept.counts[2], kept.tail), (62, 1, 0, 38));
        assert!(kept.tail_lights.iter().all(|light| light % 2 == 0) && kept.tail_lights.len() == 50, "{kept:?}");
        // All equal and too few photons: nobody has one for sure.
        let even = Allocation::new(&[0.25; 4], 2);
        assert_eq!((even.total(), even.tail), (2, 2));
        assert_eq!(Allocation::new(&[0.0, 0.0], 10).total(), 0);
        assert_eq!(Allocation::new(&[1.0], 0).total(), 0);
    }

    #[test]
    fn boxes_tile_the_square() {
        for (k, aspect) in [(1, 1.0), (7, 1.0), (12, 3.0), (5, 100.0), (30, 0.1)] {
            let strata = boxes(PositionStratum::ALL, k, aspect);
            assert_eq!(strata.len(), k);
            assert!(strata.iter().all(|s| (s.share() * k as f64 - 1.0).abs() < 1e-12));
        }
    }
}
