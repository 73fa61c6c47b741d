//! Rays and affine ray families.
//!
//! A **family** is r(p) = o(p) + t d(p) with p in the footprint `[-1,1]`^N and o, d affine in p:
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
    #[inline(always)]
    pub fn new(o: Vec3<T>, d: Vec3<T>) -> Self {
        Self { o, d }
    }

    /// The point at parameter `t`. With the `t` of an intersection this is the *transfer*: its derivative
    /// P' = o' + t d' + t' d slides along the surface that was hit (Igehy 1999).
    #[inline(always)]
    pub fn at(&self, t: T) -> Vec3<T> {
        self.o + self.d * t
    }

    /// Real parts.
    #[inline(always)]
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

    /// The centre ray with derivatives, in the number type asked for; origin and direction are both seeded.
    #[inline(always)]
    pub fn ray<T: Jet<N, Primitive = F>>(&self) -> Ray<T> {
        Ray { o: seed(self.o, &self.o_p), d: seed(self.d, &self.d_p) }
    }

    /// The same for a family with a fixed origin, which becomes a constant *at compile time*: half the cost of
    /// [`ray`](Self::ray), since num-dual's constants fold away. The origin's derivatives are ignored.
    #[inline(always)]
    pub fn fixed_ray<T: Jet<N, Primitive = F>>(&self) -> Ray<T> {
        debug_assert!(self.has_fixed_origin(), "the origin moves");
        Ray { o: Vec3::lift(self.o), d: seed(self.d, &self.d_p) }
    }

    /// The plain ray at `p`.
    #[inline(always)]
    pub fn at(&self, p: [F; N]) -> Ray<F> {
        let (mut o, mut d) = (self.o, self.d);
        for k in 0..N {
            o += self.o_p[k] * p[k];
            d += self.d_p[k] * p[k];
        }
        Ray { o, d }
    }

    /// The sub-footprint around `centre` with the given half widths, itself a family on `[-1,1]`^N.
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
#[inline(always)]
fn seed<T: Jet<N>, const N: usize>(v: Vec3<T::Primitive>, v_p: &[Vec3<T::Primitive>; N]) -> Vec3<T> {
    Vec3 { x: T::jet(v.x, v_p.map(|g| g.x)), y: T::jet(v.y, v_p.map(|g| g.y)), z: T::jet(v.z, v_p.map(|g| g.z)) }
}

#[cfg(test)]
mod tests {
    use num_dual::{Dual2SVec64, DualSVec64};

    use super::*;
    use crate::testkit::Rng;

    #[test]
    fn families_are_affine_and_reproduced_by_their_seeds() {
        let mut rng = Rng::new(1);
        for _ in 0..100 {
            let lens = Family::between(
                rng.cube(1.0),
                [rng.cube(0.1), rng.cube(0.1)],
                rng.cube(5.0),
                [rng.cube(1.0), rng.cube(1.0)],
            );
            let p: [f64; 4] = std::array::from_fn(|_| rng.range(-1.0, 1.0));
            let (ray, real) = (lens.ray::<DualSVec64<4>>(), lens.at(p));
            for (dual, want) in [(ray.o, real.o), (ray.d, real.d)] {
                assert!((dual.map(|c| c.expansion().at(p)) - want).norm() < 1e-14);
            }
            // Aimed through the target point that belongs to parameters 2 and 3, whatever 0 and 1 are.
            let other = lens.at([-p[0], p[1], p[2], p[3]]);
            assert!((real.at(1.0) - other.at(1.0)).norm() < 1e-14);
        }
    }

    #[test]
    fn a_fixed_ray_is_the_ray_with_a_constant_origin() {
        let mut rng = Rng::new(2);
        let family = rng.family(Vec3::zero(), Vec3::new(0.0, 0.0, 1.0), 0.1);
        let (a, b) = (family.ray::<Dual2SVec64<2>>(), family.fixed_ray::<Dual2SVec64<2>>());
        for (x, y) in [(a.o, b.o), (a.d, b.d)] {
            assert_eq!(x.map(|c| c.expansion()), y.map(|c| c.expansion()));
        }
        assert!(family.has_fixed_origin());
        assert!(!Family::parallel(family.o, family.d_p, family.d).has_fixed_origin());
    }
}
