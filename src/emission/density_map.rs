//! A picture of where a light's photons go: the faces of its cube side by side.
//!
//! Value of a pixel: photons per measure of directions over those of the natural density (1: as many as uniform emission with the same number
//! of photons), all positions together; for parallel light the same per area of its square. Hemicubes: the top, then four sides whose lower
//! halves are empty. Rows from y = 1 down. Verified by `tests/adaptive.rs`: its mean, weighted by the measure, is 1.

use super::EdgeAdaptive;
use crate::math::Vec2;

/// A picture of `width` x `height` values, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct DensityMap {
    /// Pixels across: `height` for each face.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Values.
    pub values: Vec<f32>,
}

impl EdgeAdaptive<'_> {
    /// The density of light `light`, faces of `size` x `size` pixels; `None` if it is not cut.
    pub fn density_map(&self, light: u32, size: usize) -> Option<DensityMap> {
        let cutter = self.cutter(light)?;
        let of_light = || self.strata().iter().filter(|s| s.cell.light == light);
        let photons: usize = of_light().map(|s| s.photons).sum();
        let faces = cutter.face_count();
        let whole = cutter.whole_measure();
        let mut map = DensityMap { width: size * faces, height: size, values: vec![0.0; size * size * faces] };
        let parallel = !cutter.source.has_direction();
        for s in of_light() {
            let k = if parallel { 0 } else { 2 };
            let density = s.photons as f64 / cutter.direction_measure(&s.cell) * whole / photons as f64;
            let pixel = |x: f64| ((0.5 * (x + 1.0) * size as f64 - 0.5).ceil().max(0.0) as usize).min(size);
            // Pixels whose centre lies in the cell.
            for j in pixel(s.cell.lo[k + 1])..pixel(s.cell.hi[k + 1]) {
                for i in pixel(s.cell.lo[k])..pixel(s.cell.hi[k]) {
                    let at = (size - 1 - j) * map.width + usize::from(s.cell.face) * size + i;
                    map.values[at] += density as f32;
                }
            }
        }
        Some(map)
    }
}

impl DensityMap {
    /// Face and coordinates in [-1, 1]^2 of a pixel's centre.
    pub fn place(&self, x: usize, y: usize) -> (usize, Vec2) {
        let size = self.height as f32;
        let at = |i: usize| (2.0 * i as f32 + 1.0) / size - 1.0;
        (x / self.height, Vec2::new(at(x % self.height), -at(y)))
    }
}
