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
pub use rectangle::SphericalRectangle;
pub use triangle::{SphericalTriangle, TrianglePoint};

#[cfg(test)]
mod tests;
