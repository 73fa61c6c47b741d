//! Origins and directions of footprints whose origin moves: vectors with their derivatives, as plain arrays.
//!
//! The duals' numbers, taken apart once per footprint, since margins of lines are linear in them. The part of second order has a
//! bound by component, `sum |h_ij| / 2`.

use super::view::from_dual;
use crate::math::{DVec3, Vec3 as Vec3f};
use dualux_dual::{Jet, Vec3};

/// A vector with its derivatives.
pub struct Bundle<const N: usize> {
    /// At the centre.
    pub value: DVec3,
    /// First derivatives.
    pub by: [DVec3; N],
    /// Second derivatives; zero for duals of first order.
    pub twice: [[DVec3; N]; N],
    /// Bound, by component, of the part of second order.
    pub rest: DVec3,
}

impl<const N: usize> Bundle<N> {
    /// `grow`: by how much the footprint is enlarged.
    #[inline(always)]
    pub fn new<J: Jet<N, Primitive = f64>>(v: Vec3<J>, grow: f64) -> Self {
        let by = std::array::from_fn(|k| from_dual(v.partial(k)) * grow);
        let mut twice = [[DVec3::ZERO; N]; N];
        if J::NDERIV >= 2 {
            let [x, y, z] = v.map(|c| c.hessian()).to_array();
            twice =
                std::array::from_fn(|i| std::array::from_fn(|j| DVec3::new(x[i][j], y[i][j], z[i][j]) * (grow * grow)));
        }
        let bundle = Bundle { value: from_dual(v.re()), by, twice, rest: DVec3::ZERO };
        if J::NDERIV >= 2 { bundle.bounded() } else { bundle }
    }

    /// This (an origin, seen from its own value) x `d`.
    #[inline(always)]
    pub fn moment(&self, d: &Self, second: bool) -> Self {
        let mut twice = [[DVec3::ZERO; N]; N];
        if second {
            twice = std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    self.twice[i][j].cross(d.value) + self.by[i].cross(d.by[j]) + self.by[j].cross(d.by[i])
                })
            });
        }
        let bundle = Bundle { value: DVec3::ZERO, by: self.by.map(|g| g.cross(d.value)), twice, rest: DVec3::ZERO };
        if second { bundle.bounded() } else { bundle }
    }

    #[inline(always)]
    fn bounded(mut self) -> Self {
        self.rest = 0.5 * self.twice.iter().flatten().fold(DVec3::ZERO, |s, v| s + v.abs());
        self
    }

    /// At p.
    pub fn at(&self, p: &[f64; N]) -> DVec3 {
        let mut v = self.value;
        for i in 0..N {
            v += self.by[i] * p[i];
            for j in 0..N {
                v += self.twice[i][j] * (0.5 * p[i] * p[j]);
            }
        }
        v
    }

    /// The box of its values, rounded outwards.
    #[inline(always)]
    pub fn spread(&self) -> [Vec3f; 2] {
        let reach = self.by.iter().fold(self.rest, |r, g| r + g.abs());
        let bound = |x: DVec3, to: fn(f32) -> f32| {
            let x = x.as_vec3();
            Vec3f::new(to(x.x), to(x.y), to(x.z))
        };
        [bound(self.value - reach, f32::next_down), bound(self.value + reach, f32::next_up)]
    }
}
