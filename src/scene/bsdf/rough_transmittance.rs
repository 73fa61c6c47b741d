//! Transmittance of a rough dielectric boundary, tabulated once per distribution.
//!
//!   T(mu, alpha, eta) = E[(1 - F(wo.m)) G1(wt)],   R_int(alpha, eta) = 2 <E[F(wo.m; 1/eta) G1(wi)] mu>
//!
//! with the expectation over the normals m visible under the cosine mu, wi and wt being the reflected and the refracted
//! direction (0 where they leave on the wrong side), and <> the mean over mu. Light scattered more than once is lost.
//! So that plastics agree with Mitsuba's `roughplastic`, <> is its mean over 64 nodes that include both 0 and 1; for
//! smooth glass it gives 0.587 where the integral is 0.596.
//! The tables are pure functions of their grid: trilinear in sqrt(mu), sqrt(alpha) and the signed root of (eta - 1) / (eta + 1), computed
//! at first use by midpoint quadrature over the unit square that drives the sampling of normals.
//! Bias: interpolation (see the tests). Not handled: alpha beyond 1 and indices outside 1/4..4 are clamped.

use super::microfacet::{Microfacet, reflect};
use super::{clamp_or_low, fresnel};
use crate::math::{Vec2, Vec3};
use crate::scene::material::Distribution;
use std::sync::OnceLock;

const COSINES: usize = 40;
const ALPHAS: usize = 16;
/// Odd: the middle node is eta = 1.
const ETAS: usize = 25;
/// (eta - 1) / (eta + 1) at the last node: eta = 4.
const MAX_Q: f32 = 0.6;
/// Quadrature nodes per axis.
const NODES: usize = 16;
/// Cosines in the mean over the inner side.
const INTERNAL_COSINES: usize = 64;

/// The table of one distribution: external transmittance, and diffuse reflectance of the inner side.
#[derive(Debug)]
struct Table {
    /// Index (alpha * ETAS + eta) * COSINES + cosine.
    transmittance: Vec<f32>,
    /// Index alpha * ETAS + eta.
    internal: Vec<f32>,
    /// 2 int T mu dmu from outside, by the same index.
    mean: Vec<f32>,
}

/// The table seen at one roughness and index.
#[derive(Clone, Copy, Debug)]
pub struct Transmittance {
    table: &'static Table,
    cell: u32,
    weight_alpha: f32,
    weight_eta: f32,
}

impl Transmittance {
    /// The transmittance of facets `micro` with the index `eta` (inside over outside).
    pub fn new(micro: &Microfacet, eta: f32) -> Self {
        static BECKMANN: OnceLock<Table> = OnceLock::new();
        static GGX: OnceLock<Table> = OnceLock::new();
        let cache = match micro.distribution() {
            Distribution::Beckmann => &BECKMANN,
            Distribution::Ggx => &GGX,
        };
        let q = (eta - 1.0) / (eta + 1.0);
        let (a, weight_alpha) = cell(micro.mean_alpha().sqrt() * (ALPHAS - 1) as f32, ALPHAS);
        let (e, weight_eta) = cell((1.0 + (q.abs() / MAX_Q).sqrt().copysign(q)) * 0.5 * (ETAS - 1) as f32, ETAS);
        Transmittance {
            table: cache.get_or_init(|| Table::new(micro.distribution())),
            cell: (a * ETAS + e) as u32,
            weight_alpha,
            weight_eta,
        }
    }

    /// Share of light from outside under the cosine `cos` in [0, 1] that gets in.
    pub fn at(&self, cos: f32) -> f32 {
        let (c, w) = cell(cos.max(0.0).sqrt() * (COSINES - 1) as f32, COSINES);
        self.blend(|node| {
            let row = &self.table.transmittance[node * COSINES + c..];
            row[0] + w * (row[1] - row[0])
        })
    }

    /// Share of diffuse light from outside that gets in.
    pub fn mean(&self) -> f32 {
        self.blend(|node| self.table.mean[node])
    }

    /// Share of diffuse light from inside that is reflected back.
    pub fn internal_reflectance(&self) -> f32 {
        self.blend(|node| self.table.internal[node])
    }

    fn blend(&self, value: impl Fn(usize) -> f32) -> f32 {
        let node = self.cell as usize;
        let mix = |n: usize| value(n) + self.weight_eta * (value(n + 1) - value(n));
        let (a, b) = (mix(node), mix(node + ETAS));
        a + self.weight_alpha * (b - a)
    }
}

/// Left node and weight of the right node for a position on an axis of `n` nodes, clamped.
fn cell(x: f32, n: usize) -> (usize, f32) {
    let x = clamp_or_low(x, 0.0, (n - 1) as f32);
    let i = (x as usize).min(n - 2);
    (i, x - i as f32)
}

impl Table {
    fn new(distribution: Distribution) -> Self {
        let eta = |e: usize| {
            let x = 2.0 * e as f32 / (ETAS - 1) as f32 - 1.0;
            let q = MAX_Q * x * x.abs();
            (1.0 + q) / (1.0 - q)
        };
        let etas: [f32; ETAS] = std::array::from_fn(eta);
        let mut transmittance = vec![0.0; ALPHAS * ETAS * COSINES];
        let mut internal = vec![0.0; ALPHAS * ETAS];
        for a in 0..ALPHAS {
            let s = a as f32 / (ALPHAS - 1) as f32;
            let micro = Microfacet::new(distribution, s * s, s * s);
            for c in 0..COSINES {
                let t = c as f32 / (COSINES - 1) as f32;
                let column = expectations(&micro, t * t, &etas, transmitted);
                for (e, &value) in column.iter().enumerate() {
                    transmittance[(a * ETAS + e) * COSINES + c] = value;
                }
            }
            for c in 0..INTERNAL_COSINES {
                let mu = c as f32 / (INTERNAL_COSINES - 1) as f32;
                let column = expectations(&micro, mu, &etas, reflected);
                for e in 0..ETAS {
                    // Seen from inside the index is inverse: the mirrored node.
                    internal[a * ETAS + e] += column[ETAS - 1 - e] * 2.0 * mu / INTERNAL_COSINES as f32;
                }
            }
        }
        let mean = transmittance.chunks_exact(COSINES).map(cosine_mean).collect();
        Table { transmittance, internal, mean }
    }
}

/// 2 int T mu dmu of a row of the table, which is linear in t = sqrt(mu) between its nodes: 4 int T t^3 dt.
fn cosine_mean(row: &[f32]) -> f32 {
    let step = 1.0 / (row.len() - 1) as f64;
    let piece = |(k, ends): (usize, &[f32])| {
        let (a, b) = (f64::from(ends[0]), f64::from(ends[1]));
        let (t0, t1) = (k as f64 * step, (k + 1) as f64 * step);
        let slope = (b - a) / step;
        (a - slope * t0) * (t1.powi(4) - t0.powi(4)) + slope * 0.8 * (t1.powi(5) - t0.powi(5))
    };
    row.windows(2).enumerate().map(piece).sum::<f64>() as f32
}

/// Share of the light from `wo` that a facet reflects into the open.
fn reflected(micro: &Microfacet, wo: Vec3, m: Vec3, eta: f32) -> f32 {
    let wi = reflect(wo, m);
    if wi.z <= 0.0 {
        return 0.0;
    }
    fresnel::dielectric(wo.dot(m).clamp(0.0, 1.0), eta).0 * micro.g1(wi, m)
}

/// Share of the light from `wo` that a facet refracts into the other side.
fn transmitted(micro: &Microfacet, wo: Vec3, m: Vec3, eta: f32) -> f32 {
    let cos = wo.dot(m).clamp(0.0, 1.0);
    let (f, cos_t) = fresnel::dielectric(cos, eta);
    let wt = m * (cos / eta - cos_t) - wo / eta;
    if f >= 1.0 || wt.z >= 0.0 {
        return 0.0;
    }
    (1.0 - f) * micro.g1(wt, m)
}

/// Mean of `share` over the normals visible under the cosine `mu`, for each of the indices.
fn expectations(
    micro: &Microfacet,
    mu: f32,
    etas: &[f32; ETAS],
    share: impl Fn(&Microfacet, Vec3, Vec3, f32) -> f32,
) -> [f32; ETAS] {
    let mu = mu.max(1e-6);
    let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    let mut sum = [0f32; ETAS];
    for i in 0..NODES * NODES {
        let u = Vec2::new((i % NODES) as f32 + 0.5, (i / NODES) as f32 + 0.5) / NODES as f32;
        if let Some(m) = micro.sample(wo, u) {
            sum.iter_mut().zip(etas).for_each(|(s, &eta)| *s += share(micro, wo, m, eta));
        }
    }
    sum.map(|s| (s / (NODES * NODES) as f32).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest error of interpolation over cosines off the nodes.
    fn worst(distribution: Distribution, alphas: &[f32], etas: &[f32]) -> f32 {
        let mut worst = 0f32;
        for &alpha in alphas {
            let micro = Microfacet::new(distribution, alpha, alpha);
            for &eta in etas {
                let t = Transmittance::new(&micro, eta);
                for i in 0..64 {
                    let mu = (i as f32 + 0.5) / 64.0;
                    let exact = expectations(&micro, mu, &[eta; ETAS], transmitted)[0];
                    worst = worst.max((t.at(mu) - exact).abs());
                }
            }
        }
        worst
    }

    #[test]
    fn interpolation_is_close_to_the_integral() {
        for d in [Distribution::Beckmann, Distribution::Ggx] {
            let usual = worst(d, &[0.05, 0.085, 0.1, 0.15, 0.25, 0.5, 0.8], &[1.3, 1.33, 1.49, 1.6, 1.9]);
            let odd = worst(d, &[0.01, 0.03, 0.1, 0.3, 1.0], &[1.05, 1.1, 2.4]);
            println!("{d:?}: {usual} {odd}");
            assert!(usual < 0.008 && odd < 0.03, "{d:?}: {usual} {odd}");
        }
    }

    #[test]
    fn a_smooth_coat_transmits_as_fresnel_says() {
        let t = Transmittance::new(&Microfacet::new(Distribution::Ggx, 0.0, 0.0), 1.5);
        for i in 1..50 {
            let mu = i as f32 / 50.0;
            let exact = 1.0 - fresnel::dielectric(mu, 1.5).0;
            assert!((t.at(mu) - exact).abs() < 0.006, "{mu}: {} {exact}", t.at(mu));
        }
        assert!((t.internal_reflectance() - 0.587).abs() < 0.003, "{}", t.internal_reflectance());
    }

    #[test]
    fn anything_can_be_looked_up() {
        for alpha in [0.0, 1.0, 1e9, f32::NAN] {
            for eta in [0.01, 0.5, 1.0, 4.0, 100.0] {
                let t = Transmittance::new(&Microfacet::new(Distribution::Ggx, alpha, alpha), eta);
                assert!((0.0..=1.0).contains(&t.internal_reflectance()));
                for cos in [0.0, 1e-9, 0.5, 1.0, 1.000_001] {
                    assert!((0.0..=1.0).contains(&t.at(cos)));
                }
            }
        }
    }
}
