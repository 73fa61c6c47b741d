//! Polygons seen from a point: solid angle, uniform sampling of it, and the irradiance it gives.
//!
//! [`SphericalTriangle`] and [`SphericalRectangle`] draw directions uniform in solid angle (measure: `pdf_dir` =
//! 1 / solid angle) as sample, pdf and invert; [`solid_angle`] and [`irradiance`] are closed forms for any planar
//! polygon. Vertices are given relative to the point, in f64: differences of f32 positions are then exact, and solid
//! angles down to about 1e-9 keep six digits, where f32 would lose them at 1e-3.
//! Not handled: self-intersecting polygons.

mod irradiance;
mod rectangle;
mod triangle;

pub use irradiance::{irradiance, solid_angle};
pub use rectangle::{RectangleFrame, SphericalRectangle};
pub use triangle::{SphericalTriangle, TrianglePoint};

/// atan2 to single precision (relative, also near 0), for a fraction of the time that it takes in f64. What goes in
/// must be f64: it is there that differences cancel.
fn angle(y: f64, x: f64) -> f64 {
    let scale = 1.0 / y.abs().max(x.abs()).max(f64::MIN_POSITIVE);
    ((y * scale) as f32).atan2((x * scale) as f32) as f64
}

#[cfg(test)]
mod tests;
