//! Footprint tests: may a margin, known by its expansion at the centre, change sign inside the footprint `[-1,1]`^N?
//!
//! * [`corners`]: the source paper's test. Predict the sign at a few neighbours (a photon's 4 corners, a light's 8 points, a
//!   pixel's 4 or 8 neighbours) and compare with the centre. What lies between the neighbours is not seen.
//! * [`bounds`]: can the expansion vanish *anywhere* in the square? No false negative where the expansion is exact.
//!
//! Both work on [`Expansion`], so both exist in first and in second order: the order is that of the number type the
//! margin was evaluated in.
//!
//! Source: Namae & Makino (corner prediction, first or second order); interval test: this project, METHODS 3.B.

mod bounds;
mod corners;

pub use bounds::{bounds, range};
pub use corners::{Neighbours, corners, corners_inside};

use crate::real::{Jet, Scalar};

/// Value, gradient and Hessian of a margin at the centre of a footprint:
/// `m(p) = value + gradient . p + p . hessian p / 2`.
///
/// For a margin that is a polynomial of degree <= `order` in p this is no approximation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion<F, const N: usize> {
    /// Highest derivative carried: 0, 1 or 2.
    pub order: usize,
    /// m(0).
    pub value: F,
    /// First derivatives at p = 0.
    pub gradient: [F; N],
    /// Second derivatives at p = 0; zero below order 2.
    pub hessian: [[F; N]; N],
}

impl<F: Scalar, const N: usize> Expansion<F, N> {
    /// Predicted margin at `p`.
    pub fn at(&self, p: [F; N]) -> F {
        let mut m = self.value;
        for i in 0..N {
            m += self.gradient[i] * p[i];
            for j in 0..N {
                m += F::HALF * self.hessian[i][j] * p[i] * p[j];
            }
        }
        m
    }

    /// The same margin cut to first order.
    pub fn first_order(mut self) -> Self {
        self.order = self.order.min(1);
        self.hessian = [[F::zero(); N]; N];
        self
    }

    /// False if any coefficient is NaN or infinite (a grazing hit, an overflow): such a margin proves nothing.
    pub fn is_finite(&self) -> bool {
        self.value.is_finite()
            && self.gradient.iter().all(|g| g.is_finite())
            && self.hessian.iter().flatten().all(|h| h.is_finite())
    }

    /// Distance from the centre to the predicted zero set, in footprint half widths: |m| / |grad m|, first order.
    ///
    /// Infinite if the gradient vanishes; at the centre of a symmetric margin (a ray through a sphere's centre) that is right
    /// to first order only.
    pub fn distance(&self) -> F {
        let g2 = self.gradient.iter().fold(F::zero(), |s, g| s + *g * *g);
        if g2 > F::zero() { self.value.abs() * g2.sqrt().recip() } else { F::infinity() }
    }
}

/// Which test decides whether a margin vanishes inside the footprint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Test {
    /// [`corners`] with the given neighbours.
    Corners(Neighbours),
    /// [`bounds`].
    Bounds,
}

impl Test {
    /// True if the margin may change sign inside the footprint.
    #[inline]
    pub fn flags<F: Scalar, const N: usize>(self, m: &Expansion<F, N>) -> bool {
        match self {
            Test::Corners(neighbours) => corners(m, neighbours),
            Test::Bounds => bounds(m),
        }
    }
}

/// A margin that counts only where its guard is positive: quadratic margins also vanish on the mirror image of
/// their edge behind the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guarded<F, const N: usize> {
    /// The margin.
    pub margin: Expansion<F, N>,
    /// Positive in front of the origin.
    pub guard: Expansion<F, N>,
}

impl<F: Scalar, const N: usize> Guarded<F, N> {
    /// From a margin and its guard, both evaluated on the centre ray.
    #[inline]
    pub fn new<T: Jet<N, Primitive = F>>(margin: T, guard: T) -> Self {
        Self { margin: margin.expansion(), guard: guard.expansion() }
    }

    /// True if the margin may change sign inside the footprint, somewhere in front.
    ///
    /// For [`Test::Bounds`]: the margin may vanish and the guard may be positive, each somewhere in the footprint, which is
    /// never too few. For [`Test::Corners`]: "inside and in front" differs between the centre and a neighbour.
    pub fn flags(&self, test: Test) -> bool {
        match test {
            Test::Bounds => bounds(&self.margin) && !(range(&self.guard).1 <= F::zero()),
            Test::Corners(neighbours) => corners_inside(&[self.margin, self.guard], neighbours),
        }
    }
}

#[cfg(test)]
mod tests;
