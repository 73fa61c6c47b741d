//! What stochastic light culling is told, and the bound of the error that suits a scene.

use crate::transport::light_tree::node::Child;
use crate::transport::light_tree::{LightTree, LitPoint};
use std::f32::consts::TAU;

/// Settings of [`super::LightCulling`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CullingSettings {
    /// Bound of the standard deviation of a light, in units of radiance; `None`: by `lights`.
    pub error: Option<f32>,
    /// Lights that survive on average if `error` says nothing.
    pub lights: f32,
    /// Lights of those met that are kept and get a shadow ray.
    pub kept: u32,
    /// How they are kept.
    pub reservoir: Reservoir,
}

impl Default for CullingSettings {
    fn default() -> Self {
        CullingSettings { error: None, lights: 16.0, kept: 1, reservoir: Reservoir::Weighted }
    }
}

/// Which of the lights that are met are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Reservoir {
    /// In proportion to what they may contribute.
    #[default]
    Weighted,
    /// Any of them alike.
    Uniform,
}

/// Bins of a histogram of positive floats, eight per power of two: exponent and three bits of the mantissa.
const BINS: usize = 1 << 11;

/// The error for which `lights` survive on average at the probes: solves mean over x of sum_i min(1, v_i(x) / (2 pi epsilon)) = lights,
/// v = intensity / squared distance of those lights that can send anything.
pub(super) fn error_for(tree: &LightTree, probes: &[LitPoint], lights: f32) -> f32 {
    let mut histogram = vec![(0u64, 0f64); BINS];
    for at in probes {
        for node in &tree.nodes {
            let (importance, distance2) = node.importance_and_distance2(at);
            for (lane, _) in importance.iter().enumerate().filter(|(_, i)| **i > 0.0) {
                if matches!(node.child(lane), Child::Emitter(_)) {
                    let d2 = distance2[lane].max(node.radius2(lane)).max(f32::MIN_POSITIVE);
                    let v = (node.strength[lane] / d2).min(f32::MAX);
                    let bin = &mut histogram[(v.to_bits() >> 20) as usize];
                    *bin = (bin.0 + 1, bin.1 + f64::from(v));
                }
            }
        }
    }
    let expected = |scale: f64| {
        let survivors = histogram.iter().map(|(n, sum)| (*n as f64).min(scale * sum)).sum::<f64>();
        survivors / probes.len().max(1) as f64
    };
    // In powers of two, down to where everything survives.
    let (mut low, mut high) = (-120.0f64, 120.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if expected(middle.exp2()) < f64::from(lights) { low = middle } else { high = middle }
    }
    (1.0 / (f64::from(TAU) * high.exp2())) as f32
}
