//! Number types: plain scalars, and numbers that carry derivatives.
//!
//! Every function of this crate is written once, for a type `T: Real`. Instances in use:
//!
//! | `T` | carries | order |
//! | --- | --- | --- |
//! | `f32`, `f64` | value | 0 |
//! | [`DualSVec<F, N>`](num_dual::DualSVec) | value, gradient in N parameters | 1 |
//! | [`Dual2SVec<F, N>`](num_dual::Dual2SVec) | value, gradient, Hessian | 2 |
//!
//! **Same bits.** The real part of a dual result equals the plain instance's result bit for bit, provided that generic code
//! keeps to `+ - * sqrt recip` and never writes `a / b` (num-dual forms the value of a quotient as `a * (1/b)`, which differs
//! from the plain quotient in the last bit in a quarter of all cases): write `a * b.recip()`. Decisions look at
//! [`re`](num_dual::DualStruct::re) only, so that all instances take the same path.
//!
//! **Not handled.** `sqrt` at zero and `recip` at zero have no finite derivative; callers in this crate test the real part
//! first. `%` panics in num-dual and is never used here.

use nalgebra::{RowSVector, SMatrix, SVector};
use num_dual::{Derivative, Dual2SVec, DualNum, DualNumFloat, DualSVec};

use crate::footprint::Expansion;

/// A plain floating-point number: `f32` or `f64`.
pub trait Scalar: DualNumFloat + DualNum<Primitive = Self, InnerDual = Self> {
    /// Nearest value of this type.
    fn of(x: f64) -> Self;
    /// Same value in double precision.
    fn to_f64(self) -> f64;
}

impl Scalar for f32 {
    #[inline(always)]
    fn of(x: f64) -> f32 {
        x as f32
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Scalar for f64 {
    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}

/// Any number geometry can be computed in: plain, or dual of any order, over `f32` or `f64`.
pub trait Real: DualNum<Primitive: Scalar> + Copy {}
impl<T: DualNum<Primitive: Scalar> + Copy> Real for T {}

/// The plain scalar below `T`.
pub type Prim<T> = <T as DualNum>::Primitive;

/// A constant: all derivatives zero.
#[inline(always)]
pub fn constant<T: Real>(x: Prim<T>) -> T {
    <T as From<Prim<T>>>::from(x)
}

/// Seeding and reading numbers that carry derivatives in `N` parameters.
///
/// Plain numbers implement it for every `N` (they drop what they are seeded with and read as zero derivatives), so that one
/// generic function serves order 0, 1 and 2.
///
/// ```
/// use dualux_dual::{Jet, num_dual::{Dual2SVec64, DualSVec64}};
///
/// /// x y + x^2 at x = 3 + p0, y = 5 + 2 p1
/// fn f<T: Jet<2, Primitive = f64>>() -> T {
///     let (x, y) = (T::jet(3.0, [1.0, 0.0]), T::jet(5.0, [0.0, 2.0]));
///     x * y + x * x
/// }
/// assert_eq!(f::<f64>(), 24.0);
/// assert_eq!(f::<DualSVec64<2>>().gradient(), [11.0, 6.0]);
/// assert_eq!(f::<Dual2SVec64<2>>().hessian(), [[2.0, 2.0], [2.0, 0.0]]);
/// ```
pub trait Jet<const N: usize>: Real {
    /// A number that is affine in the parameters: `value + gradient . p`.
    fn jet(value: Prim<Self>, gradient: [Prim<Self>; N]) -> Self;
    /// First derivatives at p = 0; zeros for a plain number.
    fn gradient(&self) -> [Prim<Self>; N];
    /// Second derivatives at p = 0 (symmetric); zeros below order 2.
    fn hessian(&self) -> [[Prim<Self>; N]; N];

    /// Value, gradient and Hessian in one.
    #[inline(always)]
    fn expansion(&self) -> Expansion<Prim<Self>, N> {
        Expansion { order: Self::NDERIV, value: self.re(), gradient: self.gradient(), hessian: self.hessian() }
    }
}

macro_rules! plain_jet {
    ($float:ty) => {
        impl<const N: usize> Jet<N> for $float {
            #[inline(always)]
            fn jet(value: $float, _: [$float; N]) -> $float {
                value
            }
            #[inline(always)]
            fn gradient(&self) -> [$float; N] {
                [0.0; N]
            }
            #[inline(always)]
            fn hessian(&self) -> [[$float; N]; N] {
                [[0.0; N]; N]
            }
        }
    };
}
plain_jet!(f32);
plain_jet!(f64);

impl<F: Scalar, const N: usize> Jet<N> for DualSVec<F, N> {
    #[inline(always)]
    fn jet(value: F, gradient: [F; N]) -> Self {
        DualSVec::new(value, Derivative::some(SVector::from(gradient)))
    }
    #[inline(always)]
    fn gradient(&self) -> [F; N] {
        self.eps.0.map_or([F::zero(); N], |e| e.data.0[0])
    }
    #[inline(always)]
    fn hessian(&self) -> [[F; N]; N] {
        [[F::zero(); N]; N]
    }
}

impl<F: Scalar, const N: usize> Jet<N> for Dual2SVec<F, N> {
    #[inline(always)]
    fn jet(value: F, gradient: [F; N]) -> Self {
        Dual2SVec::new(value, Derivative::some(RowSVector::from_fn(|_, k| gradient[k])), Derivative::none())
    }
    #[inline(always)]
    fn gradient(&self) -> [F; N] {
        self.v1.0.map_or([F::zero(); N], |e| e.data.0.map(|column| column[0]))
    }
    #[inline(always)]
    fn hessian(&self) -> [[F; N]; N] {
        self.v2.0.map_or([[F::zero(); N]; N], |h: SMatrix<F, N, N>| h.data.0)
    }
}
