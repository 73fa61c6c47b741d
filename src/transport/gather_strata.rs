//! Stratified gather directions and the derivatives of the irradiance that follow from them.
//!
//! Directions  cell (j, k) of M x N: sin^2 theta = (j + u) / M, phi = 2 pi (k + v) / N; density cos / pi per solid angle
//! Estimates   E = pi / (M N) sum L_jk
//! Rotation    dE/dn = pi / (M N) sum L_jk tau_j (cos phi, sin phi), tau_j = mean of tan theta over the row (bounded, whereas
//!             a sample's own tan theta has no variance)
//! Translation the cells are painted on what the rays hit, and stay there when x moves by d. The border between
//!             two cells, at the depth r, then sweeps over solid angle; with u the direction to a point of the border,
//!             nu the normal of the border from the inner cell or that of lower k, ds its arc (all of unit radius)
//!
//! ```text
//!   grad E = sum over borders (L_beyond - L_before) 1/r   int cos theta nu_t ds                        (1)
//!   Hess E = sum over borders (L_beyond - L_before) 4/r^2 int cos theta sym(nu_t u_t^T) ds             (2)
//! ```
//!
//! (t: tangential part). (1) is Ward and Heckbert's gradient; (2) follows by one more derivative of
//! int (n.r) d.(r x dl) / |r|^4, in which only |r| and n.r depend on x: d.(r x dl) changes by d.(-d x dl) = 0. Steps of
//! depth between borders are radial and add nothing to either. Both integrals are constants of the border: a table.
//! Occlusion   a border between hits of one plane lies at their harmonic mean depth; else it is the outline of the nearer
//!             hit, which covers the farther one: r = min. So depth steps count: this is the occlusion-aware form
//! Source      Ward and Heckbert 1992, "Irradiance Gradients"; Schwarzhaupt, Jensen, Jarosz 2012, "Practical Hessian-Based
//!             Error Control for Irradiance Caching" (the idea of (2), there over a triangulation of the hits)
//! Bias        borders lie half a cell beside true ones: O(1/M). The horizon is taken as a border of equal radiance
//! Verified by the tests below: tables against finite differences of closed forms

use super::gather_cache::GatherHit;
use crate::math::{Rgb, Vec2, Vec3, luminance};
use std::f32::consts::{PI, TAU};

/// Sine of the least angle between a plane and the segment to a hit that does not lie in it.
const COPLANAR: f32 = 0.1;

/// Cells of the hemisphere with the tables of their borders.
#[derive(Clone, Debug)]
pub struct Strata {
    /// Rows, from the normal to the horizon.
    pub rows: usize,
    /// Cells of a row.
    pub columns: usize,
    /// Per row: what its outer border adds to gradient and Hessian, without direction.
    outer: Vec<[f32; 2]>,
    /// Per row: the gradient's factor of borders between its columns.
    between: Vec<f32>,
    /// tau_j.
    rotation: Vec<f32>,
    /// Per column: direction of its middle.
    middle: Vec<Vec2>,
    /// Per column: direction of the border to the column before.
    border: Vec<Vec2>,
}

/// Irradiance at a record with its derivatives, in the record's tangent frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Irradiance.
    pub irradiance: Rgb,
    /// Derivative by translation along s and t.
    pub translation: [Rgb; 2],
    /// Derivative by the components of the normal along s and t.
    pub rotation: [Rgb; 2],
    /// Second derivatives of the luminance by translation: ss, st, tt.
    pub hessian: [f32; 3],
}

impl Strata {
    /// Strata of about `rays` directions: four times as many columns as rows, roughly square cells.
    pub fn new(rays: u32) -> Self {
        let rows = ((rays as f32 / 4.0).sqrt().round() as usize).max(2);
        let columns = (rays as usize / rows).max(4);
        let step = TAU / columns as f32;
        // theta at the border between row j - 1 and row j.
        let theta = |j: usize| (j as f32 / rows as f32).sqrt().min(1.0).asin();
        let outer = (1..rows).map(|j| {
            let (sin, cos) = theta(j).sin_cos();
            let chord = 2.0 * (0.5 * step).sin();
            [cos * cos * sin * chord, 4.0 * cos * cos * sin * sin]
        });
        let between = (0..rows).map(|j| theta(j + 1).sin() - theta(j).sin());
        let area = |t: f32| t - t.sin() * t.cos();
        let rotation = (0..rows).map(|j| rows as f32 * (area(theta(j + 1)) - area(theta(j))));
        let toward = |k: f32| Vec2::from_angle(step * k);
        Strata {
            rows,
            columns,
            outer: outer.collect(),
            between: between.collect(),
            rotation: rotation.collect(),
            middle: (0..columns).map(|k| toward(k as f32 + 0.5)).collect(),
            border: (0..columns).map(|k| toward(k as f32)).collect(),
        }
    }

    /// Number of directions.
    pub fn len(&self) -> usize {
        self.rows * self.columns
    }

    /// Never: there are eight directions at least.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Direction number `index` (row by row), local, at the numbers `u` within its cell.
    pub fn direction(&self, index: usize, u: Vec2) -> Vec3 {
        let (j, k) = (index / self.columns, index % self.columns);
        let sin2 = (j as f32 + u.x) / self.rows as f32;
        let (sin, cos) = (TAU * (k as f32 + u.y) / self.columns as f32).sin_cos();
        let r = sin2.sqrt();
        Vec3::new(r * cos, r * sin, (1.0 - sin2).max(1e-7).sqrt())
    }

    /// The cell that the local unit vector `d` above the horizon lies in: inverse of [`Self::direction`].
    pub fn cell(&self, d: Vec3) -> usize {
        let j = (self.rows as f32 * d.truncate().length_squared()) as usize;
        let turns = d.y.atan2(d.x) / TAU;
        let k = ((turns - turns.floor()) * self.columns as f32) as usize;
        j.min(self.rows - 1) * self.columns + k.min(self.columns - 1)
    }

    /// 1 / depth of the border between two hits of one record, 0 if both are at infinity.
    pub fn inverse_depth(a: &GatherHit, b: &GatherHit) -> f32 {
        let (ia, ib) = (a.inverse_distance, b.inverse_distance);
        if ia == 0.0 || ib == 0.0 {
            return ia.max(ib);
        }
        let between = (b.direction / ib) - (a.direction / ia);
        let reach = COPLANAR * between.length();
        let (na, nb) = (a.normal(), b.normal());
        let one_plane = between.dot(na).abs() <= reach && between.dot(nb).abs() <= reach;
        if one_plane { 0.5 * (ia + ib) } else { ia.max(ib) }
    }

    /// The cell and those around it, as far as there are any.
    pub fn around(&self, cell: usize, mut visit: impl FnMut(usize)) {
        let (j, k) = (cell / self.columns, cell % self.columns);
        for row in j.saturating_sub(1)..(j + 2).min(self.rows) {
            for dk in 0..3 {
                visit(row * self.columns + (k + self.columns - 1 + dk) % self.columns);
            }
        }
    }

    /// [`Self::inverse_depth`] of each hit of a record to the column before and to the row beyond.
    pub fn depths<'h>(&self, hits: &'h [GatherHit]) -> impl Iterator<Item = [f32; 2]> + use<'h> {
        let n = self.columns;
        hits.iter().enumerate().map(move |(i, here)| {
            let (j, k) = (i / n, i % n);
            let before = &hits[j * n + (k + n - 1) % n];
            let outward = hits.get(i + n).map_or(0.0, |beyond| Self::inverse_depth(here, beyond));
            [Self::inverse_depth(before, here), outward]
        })
    }

    /// Irradiance and derivatives from the radiance of each hit. `depths` are [`Self::depths`] of the same hits.
    pub fn estimate(&self, radiance: &[Rgb], depths: &[[f32; 2]]) -> Estimate {
        let n = self.columns;
        let step = TAU / n as f32;
        let mut e = Estimate::default();
        for j in 0..self.rows {
            let between = self.between[j];
            for k in 0..n {
                let here = j * n + k;
                let l = radiance[here];
                let turn = self.middle[k] * self.rotation[j];
                e.irradiance += l;
                e.rotation[0] += l * turn.x;
                e.rotation[1] += l * turn.y;

                // The border to the column before: nu = (-sin, cos), u_t = sin theta (cos, sin).
                let [across, outward] = depths[here];
                if across > 0.0 {
                    let step_l = l - radiance[j * n + (k + n - 1) % n];
                    let b = self.border[k];
                    e.translation[0] -= step_l * (across * between * b.y);
                    e.translation[1] += step_l * (across * between * b.x);
                    let h = luminance(step_l) * across * across / self.rows as f32;
                    let (sin2, cos2) = (2.0 * b.x * b.y, b.x * b.x - b.y * b.y);
                    e.hessian[0] -= h * sin2;
                    e.hessian[1] += h * cos2;
                    e.hessian[2] += h * sin2;
                }
                // The outer border: nu_t and u_t both point outwards.
                if j + 1 < self.rows && outward > 0.0 {
                    let step_l = radiance[here + n] - l;
                    let [first, second] = self.outer[j];
                    let m = self.middle[k];
                    e.translation[0] += step_l * (outward * first * m.x);
                    e.translation[1] += step_l * (outward * first * m.y);
                    let h = luminance(step_l) * outward * outward * second;
                    let (sin2, cos2) = (2.0 * m.x * m.y, m.x * m.x - m.y * m.y);
                    let (mean, spread) = (0.5 * step, 0.5 * step.sin());
                    e.hessian[0] += h * (mean + spread * cos2);
                    e.hessian[1] += h * spread * sin2;
                    e.hessian[2] += h * (mean - spread * cos2);
                }
            }
        }
        let scale = PI / self.len() as f32;
        e.irradiance *= scale;
        e.rotation.iter_mut().for_each(|r| *r *= scale);
        e
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;
    use crate::math::polygon;
    use crate::math::sampler::hash;
    use crate::math::sampler::unit_f32;
    use crate::transport::gather_hit::pack_normal;
    use crate::transport::reached::Reached;

    /// Rectangle parallel to the floor at height `h`.
    struct Plate {
        low: [f64; 2],
        high: [f64; 2],
        h: f64,
    }

    impl Plate {
        /// Irradiance that it sends to the floor at (x, y) if its radiance is 1.
        fn irradiance(&self, x: f64, y: f64) -> f64 {
            let ([x0, y0], [x1, y1]) = (self.low, self.high);
            let corners = [[x0, y0], [x0, y1], [x1, y1], [x1, y0]].map(|[a, b]| DVec3::new(a - x, b - y, self.h));
            polygon::irradiance(&corners, DVec3::Z).abs()
        }

        /// Gradient and second derivatives xx, xy, yy at the origin, by central differences.
        fn derivatives(&self) -> [f64; 5] {
            let (e, s) = (|x, y| self.irradiance(x, y), 1e-3);
            [
                (e(s, 0.0) - e(-s, 0.0)) / (2.0 * s),
                (e(0.0, s) - e(0.0, -s)) / (2.0 * s),
                (e(s, 0.0) - 2.0 * e(0.0, 0.0) + e(-s, 0.0)) / (s * s),
                (e(s, s) - e(s, -s) - e(-s, s) + e(-s, -s)) / (4.0 * s * s),
                (e(0.0, s) - 2.0 * e(0.0, 0.0) + e(0.0, -s)) / (s * s),
            ]
        }
    }

    /// Mean over `trials` of the estimates (irradiance, gradient, Hessian) at the origin, where direction `d` meets radiance
    /// and 1 / distance as `scene` says.
    fn mean_estimate(rays: u32, trials: u64, scene: impl Fn(Vec3) -> (f32, f32)) -> [f64; 6] {
        let strata = Strata::new(rays);
        let mut sum = [0.0; 6];
        for trial in 0..trials {
            let hits: Vec<(f32, GatherHit)> = (0..strata.len())
                .map(|i| {
                    let jitter = hash(hash(17, trial), i as u64);
                    let direction = strata.direction(i, Vec2::new(unit_f32(jitter), unit_f32(jitter << 24)));
                    let (l, inverse_distance) = scene(direction);
                    let normal = if inverse_distance > 0.0 { -Vec3::Z } else { -direction };
                    let (weight, reached, packed_normal) = (Rgb::ONE, Reached::NONE, pack_normal(normal));
                    (l, GatherHit { direction, inverse_distance, weight, reached, packed_normal })
                })
                .collect();
            let depths: Vec<[f32; 2]> = strata.depths(&hits.iter().map(|h| h.1).collect::<Vec<_>>()).collect();
            let radiance: Vec<Rgb> = hits.iter().map(|h| Rgb::splat(h.0)).collect();
            let e = strata.estimate(&radiance, &depths);
            let [gx, gy] = e.translation.map(|g| g.x);
            let [xx, xy, yy] = e.hessian;
            for (s, v) in sum.iter_mut().zip([e.irradiance.x, gx, gy, xx, xy, yy]) {
                *s += f64::from(v) / trials as f64;
            }
        }
        sum
    }

    fn compare(estimate: [f64; 6], irradiance: f64, derivatives: [f64; 5], tolerance: [f64; 3]) {
        assert!((estimate[0] - irradiance).abs() < tolerance[0], "irradiance {} not {irradiance}", estimate[0]);
        for (k, (got, want)) in estimate[1..].iter().zip(derivatives).enumerate() {
            let limit = tolerance[if k < 2 { 1 } else { 2 }];
            assert!((got - want).abs() < limit, "derivative {k}: {got}, not {want}");
        }
    }

    #[test]
    fn derivatives_of_a_lit_patch_of_a_wall_are_those_of_the_closed_form() {
        // A bright patch painted on a black ceiling: all hits lie in one plane.
        let patch = Plate { low: [-0.2, 0.1], high: [0.9, 1.3], h: 1.0 };
        let scene = |d: Vec3| {
            let p = d.as_dvec3() / f64::from(d.z);
            let inside = p.x > patch.low[0] && p.x < patch.high[0] && p.y > patch.low[1] && p.y < patch.high[1];
            (f32::from(u8::from(inside)), d.z)
        };
        let expected = patch.derivatives();
        compare(mean_estimate(1024, 400, scene), patch.irradiance(0.0, 0.0), expected, [0.003, 0.02, 0.08]);
        assert!(expected[2].abs() > 0.3 && expected[3].abs() > 0.3, "the test can fail: {expected:?}");
    }

    #[test]
    fn derivatives_see_what_covers_the_light() {
        // A bright sky behind a black plate: the outline of the plate moves, at the depth of the plate.
        let plate = Plate { low: [-0.2, 0.1], high: [0.9, 1.3], h: 1.0 };
        let scene = |d: Vec3| {
            let p = d.as_dvec3() / f64::from(d.z);
            let covered = p.x > plate.low[0] && p.x < plate.high[0] && p.y > plate.low[1] && p.y < plate.high[1];
            if covered { (0.0, d.z) } else { (1.0, 0.0) }
        };
        let expected = plate.derivatives().map(|x| -x);
        let e = std::f64::consts::PI - plate.irradiance(0.0, 0.0);
        compare(mean_estimate(1024, 400, scene), e, expected, [0.003, 0.04, 0.15]);
    }

    #[test]
    fn rotation_is_that_of_a_linear_sky_and_constant_light_has_no_derivatives() {
        // L = 1 + d.x: E(n) = pi + (2 pi / 3) n.x.
        let strata = Strata::new(1024);
        let n = strata.columns;
        let radiance: Vec<Rgb> =
            (0..strata.len()).map(|i| Rgb::splat(1.0 + strata.direction(i, Vec2::splat(0.5)).x)).collect();
        let depths = vec![[1.0; 2]; strata.len()];
        let e = strata.estimate(&radiance, &depths);
        // The patch below the new horizon is not seen by any ray: tan theta weighs 2/3 pi of it exactly.
        assert!((e.rotation[0].x - 2.0 * PI / 3.0).abs() < 0.01, "{}", e.rotation[0]);
        assert!(e.rotation[1].x.abs() < 1e-3);
        let constant = strata.estimate(&vec![Rgb::ONE; strata.len()], &depths);
        assert!((constant.irradiance.x - PI).abs() < 1e-5);
        assert_eq!(constant.hessian, [0.0; 3]);
        assert_eq!(constant.translation, [Rgb::ZERO; 2]);
        assert!(constant.rotation[0].abs().max_element() < 1e-4 * n as f32);
    }
}
