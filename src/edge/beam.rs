//! Beams of families whose origin moves: boxes of origins and directions, and planes that hold the rays more tightly.
//!
//! Seen along the centre ray, n a normal across it: a ray is off by `|n.(x - o)| <= a + t b`, a and b the reaches of n.o and n.d.
//! Depth `s = g.(x - o)` stands for t: `s = t (1 +- D) +- E`. (Rays of a lens meet again in its focus: [`Lens::sides`].)
//! Source: this project. Conservative to rounding, for which the sides have slack. Verified by the recall of lenses and chains.

use super::bundle::Bundle;
use super::lens::Lens;
use crate::accel::footprint::{Beam, Sides};
use crate::math::DVec3;
use dualux_dual::Family;

/// The beam that holds all rays o + t d with t in a range. `reach`: largest coordinate of the scene, which sets what rounding is.
#[inline(always)]
pub fn around<const N: usize>(o: &Bundle<N>, d: &Bundle<N>, lens: Option<&Lens>, t: [f64; 2], reach: f32) -> Beam {
    let sides = match lens {
        Some(lens) => Some(lens.sides()),
        None => spreading(o, d),
    };
    let sides = sides.map(|sides| widened(sides, reach));
    Beam { o: o.spread(), d: d.spread(), tmin: t[0] as f32, tmax: t[1] as f32, sides }
}

/// The same of a lens.
#[inline(always)]
pub fn of_lens(family: &Family<f64, 4>, lens: &Lens, t: [f64; 2], reach: f32) -> Beam {
    Beam { sides: Some(widened(lens.sides(), reach)), ..super::view::beam(family, t) }
}

/// Adds what rounding to f32 may do.
#[inline(always)]
fn widened(mut sides: Sides, reach: f32) -> Sides {
    let rounding = 32.0 * f32::EPSILON * (reach + sides.o.abs().max_element());
    let widen = |n: &[crate::math::Vec3; 4], slack: &mut [f32; 4]| {
        for (n, slack) in n.iter().zip(slack) {
            *slack += rounding * n.abs().element_sum();
        }
    };
    widen(&sides.n, &mut sides.slack);
    if let Some((n, slack)) = &mut sides.waist {
        widen(n, slack);
    }
    sides
}

/// The four planes +-n.(x - o) <= slope g.(x - o) + slack, for two normals.
#[inline(always)]
fn planes(g: DVec3, across: [(DVec3, f64, f64); 2]) -> ([crate::math::Vec3; 4], [f32; 4]) {
    let [(n, by, off), (m, by_m, off_m)] = across;
    let normals = [g * by - n, g * by + n, g * by_m - m, g * by_m + m].map(|n| n.as_vec3());
    (normals, [off, off, off_m, off_m].map(|x| x as f32))
}

/// Any family: planes that spread from the boxes of its origins.
#[inline(always)]
fn spreading<const N: usize>(o: &Bundle<N>, d: &Bundle<N>) -> Option<Sides> {
    let d2 = d.value.length_squared();
    let g = d.value / d2;
    // Along the longest of the derivatives, and across.
    let off = d.by.iter().chain(&o.by).map(|v| *v - d.value * g.dot(*v));
    let longest = off.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let u = longest.try_normalize()?;
    let w = d.value.cross(u) / d2.sqrt();
    let reach = |n: DVec3, b: &Bundle<N>| b.by.iter().map(|v| n.dot(*v).abs()).sum::<f64>() + n.abs().dot(b.rest);
    let (early, slower) = (reach(g, o), reach(g, d));
    if !(slower < 0.9) {
        return None;
    }
    let (n, slack) = planes(
        g,
        [u, w].map(|n| {
            let by = reach(n, d) / (1.0 - slower);
            (n, by, reach(n, o) + by * early)
        }),
    );
    Some(Sides { o: o.value.as_vec3(), n, slack, waist: None })
}
