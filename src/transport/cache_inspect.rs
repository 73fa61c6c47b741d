//! What the irradiance cache looks like from outside: what a look-up rests on, and its records as a point cloud.
//!
//! ```text
//! error bound at x:   sum_i w_i 2 a d_i^2 / sum_i w_i
//! ```
//!
//! The radii of a record are where the second-order error has the mean a over the disc, so it is 2 a d^2 at the elliptical distance d (the mean of
//! d^2 over the unit disc is 1/2). Where something else has made the radius smaller (neighbours, gradient, greatest radius) the error is less than that, where
//! the least radius has made it larger it is more.
//! Bias        of the bound: third order and the surfels are not part of it
//! Verified by tests/outputs.rs

use super::cache_record::{BORDER, Record};
use super::irradiance_cache::IrradianceCache;
use crate::formats::ply::points;
use crate::math::Vec3;
use std::io::{self, Write};

/// What a look-up rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Records used.
    pub records: u32,
    /// Mean of their mean radii by their weights, world units.
    pub radius: f32,
    /// Bound of the relative error of interpolation.
    pub error: f32,
}

impl IrradianceCache<'_> {
    /// What [`Self::lookup`] rests on at a point; `None` where no record may be used.
    pub fn support(&self, p: Vec3, n_shade: Vec3, n_geo: Vec3) -> Option<Support> {
        let mut sum = Support { records: 0, radius: 0.0, error: 0.0 };
        let mut weights = 0.0;
        self.visit(p, n_shade, n_geo, |record, d| {
            let w = 1.0 - d / BORDER;
            sum.records += 1;
            sum.radius += w * record.mean_radius();
            sum.error += w * 2.0 * self.settings().error * d * d;
            weights += w;
        });
        (weights > 0.0).then(|| Support { radius: sum.radius / weights, error: sum.error / weights, ..sum })
    }
}

/// Numbers of a vertex.
const FLOATS: [&str; 17] = [
    "x",
    "y",
    "z",
    "nx",
    "ny",
    "nz",
    "sx",
    "sy",
    "sz",
    "tx",
    "ty",
    "tz",
    "irradiance_r",
    "irradiance_g",
    "irradiance_b",
    "radius_s",
    "radius_t",
];

/// Writes records as a binary PLY file, little-endian: position, normal, half axes s and t of the ellipse (world units), irradiance, and the
/// lengths of the half axes.
pub fn write_ply(out: &mut impl Write, records: &[Record]) -> io::Result<()> {
    let comment = "records of an irradiance cache: half axes s and t, irradiance";
    out.write_all(&points::header(comment, records.len(), &[("float", &FLOATS)]))?;
    for r in records {
        let (s, t) = (r.frame.s * r.radii.x, r.frame.t * r.radii.y);
        let vectors = [r.p, r.frame.n, s, t, r.irradiance].map(|v| v.to_array());
        for v in vectors.as_flattened().iter().chain(&r.radii.to_array()) {
            out.write_all(&v.to_le_bytes())?;
        }
    }
    Ok(())
}
