//! Photons as a point cloud: a binary PLY file for viewers of point clouds and for scripts.
//!
//! One vertex per photon: position x y z, normal nx ny nz (of the surface, on the side the photon came from), direction wx wy wz (towards
//! where it came from), flux_r flux_g flux_b (W), the footprint's standard deviations ax ay az and bx by bz (world units, longer axis
//! first, infinite where unknown), light, stratum, segments, class (0 direct, 1 caustic, 2 indirect).

use super::photon::Photon;
use crate::formats::ply::points;
use std::io::{self, Write};

const FLOATS: [&str; 18] = [
    "x", "y", "z", "nx", "ny", "nz", "wx", "wy", "wz", "flux_r", "flux_g", "flux_b", "ax", "ay", "az", "bx", "by", "bz",
];

/// Writes the photons, little-endian.
pub fn write_ply(out: &mut impl Write, photons: &[Photon]) -> io::Result<()> {
    let comment = "photons: flux in W, axes are standard deviations of the footprint";
    let properties: [(&str, &[&str]); 3] =
        [("float", &FLOATS), ("uint", &["light", "stratum", "segments"]), ("uchar", &["class"])];
    out.write_all(&points::header(comment, photons.len(), &properties))?;
    for photon in photons {
        let [a, b] = photon.sigma;
        for v in [photon.p, photon.n, photon.wi, photon.flux, a, b] {
            for c in v.to_array() {
                out.write_all(&c.to_le_bytes())?;
            }
        }
        for number in [photon.light, photon.stratum, photon.segments] {
            out.write_all(&number.to_le_bytes())?;
        }
        out.write_all(&[photon.class as u8])?;
    }
    Ok(())
}
