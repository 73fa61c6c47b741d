//! The interval test: can the expansion vanish anywhere in `[-1,1]`^N?
//!
//! First order: the range of `m0 + g . p` is `m0 +- sum |g_k|`, attained at corners; in any N it is exact.
//! Second order, N = 2: minimum and maximum of a quadratic over a square are attained at a corner, at the vertex of the parabola
//! on a side, or at the interior stationary point; all are evaluated, so the range is exact to rounding.
//! Second order, other N: each `g_k p_k + h_kk p_k^2 / 2` takes its exact range, mixed terms their extremes `+-|h_ij|`; the sum
//! contains the range (conservative, exact without mixed terms).
//!
//! Consequence: where the expansion itself is exact, [`bounds`] has no false negative.

use super::Expansion;
use crate::real::Scalar;

/// Smallest and largest value of the expansion over `[-1,1]`^N (see the module docs for where it is tight).
pub fn range<F: Scalar, const N: usize>(m: &Expansion<F, N>) -> (F, F) {
    if m.order < 2 {
        let r = m.gradient.iter().fold(F::zero(), |s, g| s + g.abs());
        return (m.value - r, m.value + r);
    }
    if N == 2 { square(m) } else { separable(m) }
}

/// True if the margin may vanish in the footprint, or if its expansion is not finite (then nothing is known).
///
/// ```
/// use dualux_dual::{Expansion, bounds};
/// let m = Expansion { order: 1, value: 0.5, gradient: [0.3, -0.3], hessian: [[0.0; 2]; 2] };
/// assert!(bounds(&m));                                     // |0.5| <= |0.3| + |0.3|
/// assert!(!bounds(&Expansion { value: -0.7, ..m }));
/// assert!(bounds(&Expansion { value: f64::NAN, ..m }));    // never a silent "no"
/// ```
#[inline]
pub fn bounds<F: Scalar, const N: usize>(m: &Expansion<F, N>) -> bool {
    if !m.is_finite() {
        return true;
    }
    let (lo, hi) = range(m);
    lo <= F::zero() && hi >= F::zero()
}

/// Exact range over the square (N = 2).
fn square<F: Scalar, const N: usize>(m: &Expansion<F, N>) -> (F, F) {
    let (g0, g1) = (m.gradient[0], m.gradient[1]);
    let (h00, h11) = (m.hessian[0][0], m.hessian[1][1]);
    let h01 = F::HALF * (m.hessian[0][1] + m.hessian[1][0]);
    let one = F::one();
    let f = |x: F, y: F| m.value + x * (g0 + F::HALF * h00 * x + h01 * y) + y * (g1 + F::HALF * h11 * y);
    let (mut lo, mut hi) = (F::infinity(), F::neg_infinity());
    let mut take = |x: F, y: F| {
        let v = f(x, y);
        lo = lo.min(v);
        hi = hi.max(v);
    };
    for s in [-one, one] {
        take(s, -one);
        take(s, one);
        // Vertex of the parabola on the sides x = s and y = s; outside the side, or none, if the division says so.
        let y = -(g1 + h01 * s) * h11.recip();
        if y.abs() < one {
            take(s, y);
        }
        let x = -(g0 + h01 * s) * h00.recip();
        if x.abs() < one {
            take(x, s);
        }
    }
    // Interior stationary point: H p = -g by Cramer's rule. A saddle does no harm: its value is in the range anyway.
    let det = (h00 * h11 - h01 * h01).recip();
    let (x, y) = ((h01 * g1 - h11 * g0) * det, (h01 * g0 - h00 * g1) * det);
    if x.abs() < one && y.abs() < one {
        take(x, y);
    }
    (lo, hi)
}

/// Conservative range in any number of parameters.
fn separable<F: Scalar, const N: usize>(m: &Expansion<F, N>) -> (F, F) {
    let (mut lo, mut hi) = (m.value, m.value);
    for k in 0..N {
        let (g, h) = (m.gradient[k], F::HALF * m.hessian[k][k]);
        let (a, b) = (h - g, h + g);
        let (mut l, mut u) = (a.min(b), a.max(b));
        let x = -F::HALF * g * h.recip();
        if x.abs() < F::one() {
            let v = F::HALF * g * x;
            l = l.min(v);
            u = u.max(v);
        }
        let mut mixed = F::zero();
        for j in 0..k {
            mixed += (F::HALF * (m.hessian[k][j] + m.hessian[j][k])).abs();
        }
        lo = lo + l - mixed;
        hi = hi + u + mixed;
    }
    (lo, hi)
}
