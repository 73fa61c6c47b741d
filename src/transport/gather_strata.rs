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

    /// Irradiance and derivatives from the radiance of each hit. `depths` are the [`Self::inverse_depth`] of each hit to the
    /// column before and to the row beyond.
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
