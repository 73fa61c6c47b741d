//! Three-component vectors over any [`Real`].
//!
//! Written out by component: generic matrix libraries lose a factor of five to nine on dual numbers, since their products go
//! through references and clones.
//!
//! `#[inline(always)]` here, in the margins and in the shapes is not decoration: num-dual's constants carry "no derivative" as an
//! `Option`, which folds away only if a whole kernel is inlined. Left to the compiler, first order cost 7 to 20 times the plain
//! kernel instead of 2 to 3, second order 30 to 50 times instead of 2 to 5 (`examples/cost.rs` measures it).

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

use crate::real::{Jet, Prim, Real, Scalar, constant};

/// A point, direction or normal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vec3<T> {
    /// First component.
    pub x: T,
    /// Second component.
    pub y: T,
    /// Third component.
    pub z: T,
}

/// Shorthand for [`Vec3::new`].
#[inline(always)]
pub const fn vec3<T>(x: T, y: T, z: T) -> Vec3<T> {
    Vec3 { x, y, z }
}

impl<T> Vec3<T> {
    /// From components.
    #[inline(always)]
    pub const fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }

    /// Applies `f` to each component.
    #[inline(always)]
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> Vec3<U> {
        vec3(f(self.x), f(self.y), f(self.z))
    }
}

impl<T: Copy> Vec3<T> {
    /// Components in order.
    #[inline(always)]
    pub fn to_array(self) -> [T; 3] {
        [self.x, self.y, self.z]
    }
}

impl<T> From<[T; 3]> for Vec3<T> {
    #[inline(always)]
    fn from([x, y, z]: [T; 3]) -> Self {
        vec3(x, y, z)
    }
}

impl<T: Real> Vec3<T> {
    /// A constant vector: all derivatives zero.
    #[inline(always)]
    pub fn lift(v: Vec3<Prim<T>>) -> Self {
        v.map(constant)
    }

    /// The null vector.
    #[inline(always)]
    pub fn zero() -> Self {
        vec3(T::zero(), T::zero(), T::zero())
    }

    /// Real parts.
    #[inline(always)]
    pub fn re(self) -> Vec3<Prim<T>> {
        self.map(|c| c.re())
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> T {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Vector product. Exchanging the factors flips the sign of each component exactly, to the last bit.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        vec3(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    /// Squared length.
    #[inline(always)]
    pub fn norm2(self) -> T {
        self.dot(self)
    }

    /// Length. Its derivative does not exist at the null vector.
    #[inline(always)]
    pub fn norm(self) -> T {
        self.norm2().sqrt()
    }

    /// Unit vector of the same direction; not finite for the null vector.
    #[inline(always)]
    pub fn normalized(self) -> Self {
        self * self.norm().recip()
    }

    /// Multiplies by a constant.
    #[inline(always)]
    pub fn scale(self, s: Prim<T>) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }

    /// Derivatives by parameter `k`.
    #[inline(always)]
    pub fn partial<const N: usize>(self, k: usize) -> Vec3<Prim<T>>
    where
        T: Jet<N>,
    {
        self.map(|c| c.gradient()[k])
    }
}

impl<F: Scalar> Vec3<F> {
    /// Converts between precisions.
    #[inline(always)]
    pub fn cast<G: Scalar>(self) -> Vec3<G> {
        self.map(|c| G::of(c.to_f64()))
    }
}

impl<T: Add<Output = T>> Add for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        vec3(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<T: Add<Output = T> + Copy> AddAssign for Vec3<T> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<T: Sub<Output = T>> Sub for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        vec3(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl<T: Neg<Output = T>> Neg for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

impl<T: Mul<Output = T> + Copy> Mul<T> for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: T) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }
}
