//! Where a family's rays pass a line: the ray's foot on the line and the line's foot on the ray, with derivatives.
//!
//! With v = a - o and e = b - a the feet of the ray o + t d and the line a + s e are
//!
//! `s = ((e.d)(v.d) - (v.e)(d.d)) / D`, `t = ((e.e)(v.d) - (e.d)(v.e)) / D`, `D = (e.e)(d.d) - (e.d)^2`,
//!
//! and their derivatives follow from those of the five products by the quotient rule. Written out since half a dozen of them are wanted
//! per footprint: as duals they cost more than the walk. Exact to the order of the bundles (of the second, its bound).
//! A line along the rays has no feet: values are not finite, which no comparison takes for a sure answer.
//! Verified against the same formula in duals (test).

use super::bundle::Bundle;
use super::linear::Linear;
use crate::math::DVec3;

/// The five products, or one of their derivatives.
#[derive(Clone, Copy)]
struct Products {
    ed: f64,
    dd: f64,
    ve: f64,
    vd: f64,
}

/// Coordinates of the ray's foot on the line a-b (0 at a, 1 at b), and of the line's foot on the ray (ray parameter). `second`: with
/// the bound of what is of second order.
#[inline(always)]
pub fn feet<const N: usize>(o: &Bundle<N>, d: &Bundle<N>, a: DVec3, b: DVec3, second: bool) -> [Linear<N>; 2] {
    let (e, v) = (b - a, a - o.value);
    let ee = e.length_squared();
    let x = Products { ed: e.dot(d.value), dd: d.value.length_squared(), ve: v.dot(e), vd: v.dot(d.value) };
    let inv = 1.0 / (ee * x.dd - x.ed * x.ed);
    let [s, t] = [(x.ed * x.vd - x.ve * x.dd) * inv, (ee * x.vd - x.ed * x.ve) * inv];
    // By each parameter: of the products, of D, of s and t.
    let by: [Products; N] = std::array::from_fn(|k| Products {
        ed: e.dot(d.by[k]),
        dd: 2.0 * d.value.dot(d.by[k]),
        ve: -o.by[k].dot(e),
        vd: v.dot(d.by[k]) - o.by[k].dot(d.value),
    });
    let det = by.map(|y| ee * y.dd - 2.0 * x.ed * y.ed);
    let s_by: [f64; N] = std::array::from_fn(|k| {
        let y = &by[k];
        (y.ed * x.vd + x.ed * y.vd - y.ve * x.dd - x.ve * y.dd - s * det[k]) * inv
    });
    let t_by: [f64; N] = std::array::from_fn(|k| {
        let y = &by[k];
        (ee * y.vd - y.ed * x.ve - x.ed * y.ve - t * det[k]) * inv
    });
    let mut rest = [0.0; 2];
    if second {
        for i in 0..N {
            // Symmetric: what is off the diagonal counts twice.
            for j in 0..=i {
                let (y, w) = (&by[i], &by[j]);
                let z = Products {
                    ed: e.dot(d.twice[i][j]),
                    dd: 2.0 * (d.by[i].dot(d.by[j]) + d.value.dot(d.twice[i][j])),
                    ve: -o.twice[i][j].dot(e),
                    vd: v.dot(d.twice[i][j]) - o.by[i].dot(d.by[j]) - o.by[j].dot(d.by[i]) - o.twice[i][j].dot(d.value),
                };
                let det_ij = ee * z.dd - 2.0 * (y.ed * w.ed + x.ed * z.ed);
                let on_line = z.ed * x.vd + y.ed * w.vd + w.ed * y.vd + x.ed * z.vd
                    - (z.ve * x.dd + y.ve * w.dd + w.ve * y.dd + x.ve * z.dd);
                let on_ray = ee * z.vd - (z.ed * x.ve + y.ed * w.ve + w.ed * y.ve + x.ed * z.ve);
                let weight = if i == j { 0.5 } else { 1.0 };
                rest[0] += weight * ((on_line - s_by[i] * det[j] - s_by[j] * det[i] - s * det_ij) * inv).abs();
                rest[1] += weight * ((on_ray - t_by[i] * det[j] - t_by[j] * det[i] - t * det_ij) * inv).abs();
            }
        }
    }
    [Linear { value: s, gradient: s_by, rest: rest[0] }, Linear { value: t, gradient: t_by, rest: rest[1] }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edge::tests::Rng;
    use crate::edge::view::to_dual;
    use dualux_dual::num_dual::{Dual2SVec64, DualNum};
    use dualux_dual::{Jet, Vec3};

    type D = Dual2SVec64<4>;

    #[test]
    fn feet_are_those_of_the_duals() {
        let mut rng = Rng(31, 0);
        let close = |ours: f64, dual: f64| assert!((ours - dual).abs() <= 1e-9 * (1.0 + dual.abs()), "{ours} {dual}");
        for _ in 0..500 {
            // Products of jets have second derivatives.
            let mut jet = |size: f64| {
                let mut one = || D::jet(rng.range(-1.0, 1.0), std::array::from_fn(|_| rng.range(-size, size)));
                Vec3::new(one() * one(), one() * one(), one() * one())
            };
            let (o, d) = (jet(0.3), jet(0.3));
            let (a, b) = (rng.cube(3.0), rng.cube(3.0));
            let [e, v] = [Vec3::lift(to_dual(b - a)), Vec3::lift(to_dual(a)) - o];
            let (ee, ed, dd, ve, vd) = (e.norm2(), e.dot(d), d.norm2(), v.dot(e), v.dot(d));
            let inv = (ee * dd - ed * ed).recip();
            let duals = [(ed * vd - ve * dd) * inv, (ee * vd - ed * ve) * inv];
            let ours = feet(&Bundle::new(o, 1.0), &Bundle::new(d, 1.0), a, b, true);
            for (ours, dual) in ours.iter().zip(duals) {
                let dual = Linear::from(dual.expansion());
                close(ours.value, dual.value);
                (0..4).for_each(|k| close(ours.gradient[k], dual.gradient[k]));
                close(ours.rest, dual.rest);
            }
        }
    }
}
