//! Neighbour prediction, the source paper's test.
//!
//! The paper expands the hit around the centre and evaluates it at the 4 corners of a square (photons, its section 3.2), at 8
//! points (corners and midpoints of sides, area lights, 3.3) or at 4 to 8 neighbours (pixels). Here the *margin* is what is
//! expanded; the test fires if its predicted sign at any neighbour differs from the sign at the centre.
//!
//! Not handled, by nature: an edge that passes between the neighbours (small spheres: recall 0.6 to 0.9).

use super::Expansion;
use crate::real::Scalar;

/// Where a margin is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Neighbours {
    /// The 2^N corners: 4 in two parameters (photons).
    Corners,
    /// The 2N centres of the sides: 4 in two parameters (a pixel's edge midpoints).
    Sides,
    /// Corners and sides: 8 in two parameters (lights, pixels).
    CornersAndSides,
}

/// True if the margin's predicted sign at some neighbour differs from its sign at the centre, or is not a number.
///
/// The sign of zero counts as positive on both sides.
///
/// ```
/// use dualux_dual::{Expansion, Neighbours, bounds, corners};
/// // A thin strip between the neighbours: m = (p0 - 0.05)^2 - 0.0001 is negative only for 0.04 < p0 < 0.06.
/// let m = Expansion { order: 2, value: 0.0024, gradient: [-0.1, 0.0], hessian: [[2.0, 0.0], [0.0, 0.0]] };
/// assert!(!corners(&m, Neighbours::Corners));
/// assert!(bounds(&m)); // only the bound can see it
/// ```
#[inline]
pub fn corners<F: Scalar, const N: usize>(m: &Expansion<F, N>, neighbours: Neighbours) -> bool {
    corners_inside(std::slice::from_ref(m), neighbours)
}

/// The same for a region bounded by several margins: inside is where all are positive (a polygon hit, a quadric in front).
/// True if some neighbour is predicted inside and the centre is not, or the other way round.
pub fn corners_inside<F: Scalar, const N: usize>(margins: &[Expansion<F, N>], neighbours: Neighbours) -> bool {
    if !margins.iter().all(Expansion::is_finite) {
        return true;
    }
    let centre = margins.iter().all(|m| m.value >= F::zero());
    let differs = |p: [F; N]| margins.iter().all(|m| m.at(p) >= F::zero()) != centre;
    let at_corners = || {
        (0..1usize << N)
            .any(|bits| differs(std::array::from_fn(|k| if bits >> k & 1 == 1 { F::one() } else { -F::one() })))
    };
    let at_sides = || {
        (0..N).any(|k| {
            let mut p = [F::zero(); N];
            p[k] = F::one();
            let plus = differs(p);
            p[k] = -F::one();
            plus || differs(p)
        })
    };
    match neighbours {
        Neighbours::Corners => at_corners(),
        Neighbours::Sides => at_sides(),
        Neighbours::CornersAndSides => at_corners() || at_sides(),
    }
}
