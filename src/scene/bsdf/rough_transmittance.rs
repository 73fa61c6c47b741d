//! Transmittance of a rough dielectric boundary, tabulated once per distribution.
//!
//!   T(mu, alpha, eta) = 1 - int D(m) G1(wo) G1(wi) F(wo.m; eta) / (4 |wo.m|) ... = 1 - E[F(wo.m) G1(wi)]
//!
//! the expectation being over visible normals, and R_int(alpha, eta) = 2 int_0^1 (1 - T(mu, alpha, 1/eta)) mu dmu.
//! What single reflection does not carry counts as transmitted (as in Mitsuba's `roughplastic`).
//! The tables are pure functions of their grid: trilinear in sqrt(mu), sqrt(alpha) and (eta - 1) / (eta + 1), computed
//! at first use by midpoint quadrature over the unit square that drives the sampling of normals.
//! Bias: interpolation, below 0.004 in T for alpha <= 1 and indices between 1.2 and 2 (tests). Not handled: alpha beyond
//! 1 and indices outside 1/4..4 are clamped.

use super::fresnel;
use super::microfacet::{Microfacet, reflect};
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
const NODES: usize = 20;

/// The table of one distribution: external transmittance, and diffuse reflectance of the inner side.
#[derive(Debug)]
struct Table {
    /// Index (alpha * ETAS + eta) * COSINES + cosine.
    transmittance: Vec<f32>,
    /// Index alpha * ETAS + eta.
    internal: Vec<f32>,
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
        let (e, weight_eta) = cell((q / MAX_Q + 1.0) * 0.5 * (ETAS - 1) as f32, ETAS);
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
    let x = x.max(0.0).min((n - 1) as f32);
    let i = (x as usize).min(n - 2);
    (i, x - i as f32)
}

impl Table {
    fn new(distribution: Distribution) -> Self {
        let eta = |e: usize| {
            let q = MAX_Q * (2.0 * e as f32 / (ETAS - 1) as f32 - 1.0);
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
                let column = reflectances(&micro, t * t, &etas);
                for (e, r) in column.iter().enumerate() {
                    transmittance[(a * ETAS + e) * COSINES + c] = 1.0 - r;
                }
            }
            // Total internal reflection has a kink in mu: a finer rule than the nodes of the table.
            for c in 0..2 * COSINES {
                let mu = (c as f32 + 0.5) / (2 * COSINES) as f32;
                let column = reflectances(&micro, mu, &etas);
                for e in 0..ETAS {
                    // Seen from inside the index is inverse: the mirrored node.
                    internal[a * ETAS + e] += column[ETAS - 1 - e] * mu / COSINES as f32;
                }
            }
        }
        Table {
            transmittance,
            internal,
        }
    }
}

/// Share reflected (once) under the cosine `mu`, for each of the indices.
fn reflectances(micro: &Microfacet, mu: f32, etas: &[f32; ETAS]) -> [f32; ETAS] {
    let mu = mu.max(1e-5);
    let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
    let mut sum = [0f32; ETAS];
    for i in 0..NODES * NODES {
        let u = Vec2::new((i % NODES) as f32 + 0.5, (i / NODES) as f32 + 0.5) / NODES as f32;
        let Some(m) = micro.sample(wo, u) else {
            continue;
        };
        let wi = reflect(wo, m);
        if wi.z <= 0.0 {
            continue;
        }
        let weight = micro.g1(wi, m);
        for (s, &eta) in sum.iter_mut().zip(etas) {
            *s += weight * fresnel::dielectric(wo.dot(m).clamp(0.0, 1.0), eta).0;
        }
    }
    sum.map(|s| (s / (NODES * NODES) as f32).clamp(0.0, 1.0))
}
