//! Rays and affine ray families.
//!
//! A **family** is r(p) = o(p) + t d(p) with p in the footprint [-1,1]^N and o, d affine in p:
//! `o(p) = o + sum p_k o_k`, `d(p) = d + sum p_k d_k`. |p_k| = 1 is the footprint's border, so `d_k` is *half* the footprint's
//! extent (a pixel of full width h in p has h = 2). Directions stay unnormalised: normalising would spoil the polynomial degree on
//! which the exactness of the margins rests. Any r(p) is a ray one can trace: [`Family::at`].
//!
//! With a fixed origin (all `o_k` zero) margins are polynomials in p of the degree their docs state; with a moving origin they
//! are predictions.

use crate::real::{Jet, Real, Scalar};
use crate::vec3::Vec3;

/// A ray `o + t d`; `d` need not have unit length and t counts in units of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<T> {
    /// Origin.
    pub o: Vec3<T>,
    /// Direction, of any length but zero.
    pub d: Vec3<T>,
}

impl<T: Real> Ray<T> {
    /// A ray from `o` along `d`.
    #[inline]
    pub fn new(o: Vec3<T>, d: Vec3<T>) -> Self {
        Self { o, d }
    }

    /// The point at parameter `t`. With the `t` of an intersection this is the *transfer*: its derivative
    /// P' = o' + t d' + t' d slides along the surface that was hit (Igehy 1999).
    #[inline]
    pub fn at(&self, t: T) -> Vec3<T> {
        self.o + self.d * t
    }

    /// Real parts.
    #[inline]
    pub fn re(&self) -> Ray<T::Primitive> {
        Ray { o: self.o.re(), d: self.d.re() }
    }
}

/// Rays around a centre ray, affine in `N` parameters (2 for pixels, lights and emission cells, 4 where the origin varies
/// on its own).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Family<F, const N: usize> {
    /// Origin at p = 0.
    pub o: Vec3<F>,
    /// Derivative of the origin by each parameter.
    pub o_p: [Vec3<F>; N],
    /// Direction at p = 0.
    pub d: Vec3<F>,
    /// Derivative of the direction by each parameter.
    pub d_p: [Vec3<F>; N],
}

impl<F: Scalar, const N: usize> Family<F, N> {
    /// From origin, direction and their derivatives.
    pub fn new(o: Vec3<F>, o_p: [Vec3<F>; N], d: Vec3<F>, d_p: [Vec3<F>; N]) -> Self {
        Self { o, o_p, d, d_p }
    }

    /// Fixed origin: a pinhole's pixel, a light seen from a point, an emission cell of a point light.
    pub fn fixed(o: Vec3<F>, d: Vec3<F>, d_p: [Vec3<F>; N]) -> Self {
        Self { o, o_p: [Vec3::zero(); N], d, d_p }
    }

    /// Fixed direction: a pixel of an orthographic camera, a cell of a sun's cross-section.
    pub fn parallel(o: Vec3<F>, o_p: [Vec3<F>; N], d: Vec3<F>) -> Self {
        Self { o, o_p, d, d_p: [Vec3::zero(); N] }
    }

    /// True if all rays start from one point, which is where polynomial margins are exact.
    pub fn has_fixed_origin(&self) -> bool {
        self.o_p.iter().all(|v| *v == Vec3::zero())
    }

    /// The centre ray with derivatives, in the number type asked for.
    ///
    /// The origin is seeded only if it moves: constants cost nothing.
    #[inline]
    pub fn ray<T: Jet<N, Primitive = F>>(&self) -> Ray<T> {
        let d = seed(self.d, &self.d_p);
        let o = if self.has_fixed_origin() { Vec3::lift(self.o) } else { seed(self.o, &self.o_p) };
        Ray { o, d }
    }

    /// The plain ray at `p`.
    #[inline]
    pub fn at(&self, p: [F; N]) -> Ray<F> {
        let (mut o, mut d) = (self.o, self.d);
        for k in 0..N {
            o += self.o_p[k] * p[k];
            d += self.d_p[k] * p[k];
        }
        Ray { o, d }
    }

    /// The sub-footprint around `centre` with the given half widths, itself a family on [-1,1]^N.
    ///
    /// ```
    /// use dualux_dual::{Family, vec3};
    /// let whole = Family::fixed(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0), [vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)]);
    /// let quarter = whole.cell([0.5, 0.5], [0.5, 0.5]);
    /// assert_eq!(quarter.at([1.0, -1.0]), whole.at([1.0, 0.0]));
    /// ```
    pub fn cell(&self, centre: [F; N], half: [F; N]) -> Self {
        let Ray { o, d } = self.at(centre);
        let (mut o_p, mut d_p) = (self.o_p, self.d_p);
        for k in 0..N {
            o_p[k] = o_p[k] * half[k];
            d_p[k] = d_p[k] * half[k];
        }
        Self { o, o_p, d, d_p }
    }
}

impl<F: Scalar> Family<F, 2> {
    /// A parallelogram (centre, half edges) seen from `o`; its points are at t = 1.
    ///
    /// A disk or sphere seen as a light takes its circumscribed parallelogram.
    pub fn towards(o: Vec3<F>, centre: Vec3<F>, half_edges: [Vec3<F>; 2]) -> Self {
        Self::fixed(o, centre - o, half_edges)
    }
}

impl<F: Scalar> Family<F, 4> {
    /// Point and direction both vary: parameters 0 and 1 move the origin over a parallelogram, 2 and 3 the point aimed at
    /// (another parallelogram, at t = 1). A thin lens and its plane of focus, or a patch of an area light and what it lights.
    pub fn between(o: Vec3<F>, o_half: [Vec3<F>; 2], target: Vec3<F>, target_half: [Vec3<F>; 2]) -> Self {
        let [a, b] = o_half;
        let [c, e] = target_half;
        Self { o, o_p: [a, b, Vec3::zero(), Vec3::zero()], d: target - o, d_p: [-a, -b, c, e] }
    }
}

/// A vector affine in the parameters.
#[inline]
fn seed<T: Jet<N>, const N: usize>(v: Vec3<T::Primitive>, v_p: &[Vec3<T::Primitive>; N]) -> Vec3<T> {
    Vec3 { x: T::jet(v.x, v_p.map(|g| g.x)), y: T::jet(v.y, v_p.map(|g| g.y)), z: T::jet(v.z, v_p.map(|g| g.z)) }
}
