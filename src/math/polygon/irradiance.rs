//! Closed forms for a polygon of constant radiance: solid angle and irradiance.
//!
//! Irradiance is Lambert's formula (1760; in graphics Baum et al. 1989, "Improving Radiosity Solutions Through the Use
//! of Analytically Determined Form-Factors"):  E = L/2 sum_i theta_i (n . G_i),  theta_i the angle between vertices
//! i and i+1, G_i the unit normal of the plane through them and the origin, after clipping to the horizon.

use super::angle;
use crate::math::DVec3;

/// Angle of two vectors times the unit normal of their plane; zero if they are parallel.
fn edge(a: DVec3, b: DVec3) -> DVec3 {
    let cross = a.cross(b);
    let len = cross.length();
    let dot = a.dot(b);
    if len < 0.03 * dot {
        // The sum over the edges of a distant polygon cancels: all digits, from the series of the arc tangent.
        let t2 = (len / dot) * (len / dot);
        return cross * ((1.0 - t2 * (1.0 / 3.0 - t2 * (0.2 - t2 * (1.0 / 7.0 - t2 / 9.0)))) / dot);
    }
    if len > 0.0 { cross * (angle(len, dot) / len) } else { DVec3::ZERO }
}

/// Irradiance at the origin, on a plane with the unit normal `n`, from a planar polygon of radiance 1 that
/// emits to both sides; vertices in order, relative to the origin. What lies below the horizon does not count.
pub fn irradiance(vertices: &[DVec3], n: DVec3) -> f64 {
    // The clipped outline, an edge at a time.
    let (mut first, mut last) = (None, None);
    let mut sum = 0.0;
    let mut go_to = |v: DVec3| {
        sum += last.map_or(0.0, |from| edge(from, v).dot(n));
        first = first.or(Some(v));
        last = Some(v);
        first
    };
    let mut start = None;
    for (i, &a) in vertices.iter().enumerate() {
        let b = vertices[(i + 1) % vertices.len()];
        let (ha, hb) = (a.dot(n), b.dot(n));
        if ha >= 0.0 {
            start = go_to(a);
        }
        if (ha > 0.0 && hb < 0.0) || (ha < 0.0 && hb > 0.0) {
            start = go_to(a + (b - a) * (ha / (ha - hb)));
        }
    }
    start.map(go_to);
    0.5 * sum.abs()
}

/// Solid angle of a planar convex polygon seen from the origin, in [0, 2 pi]; vertices in order, relative to the origin.
pub fn solid_angle(vertices: &[DVec3]) -> f64 {
    let triangle = |b: DVec3, c: DVec3| {
        let a = vertices[0];
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let det = a.dot((b - a).cross(c - a)).abs();
        2.0 * det.atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    vertices.windows(2).skip(1).map(|w| triangle(w[0], w[1])).sum()
}
