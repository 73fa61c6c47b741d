//! Mathematics without a scene: vectors, random numbers, warps, densities, pixel filters.
//!
//! Everything here is deterministic: a value depends on its arguments only, and no function uses fused
//! multiply-add, so that results do not depend on the processor.

pub mod distribution;
pub mod filter;
pub mod frame;
pub mod morton;
pub mod polygon;
mod prefetch;
pub mod residual_roulette;
pub mod sampler;
pub mod stats;
pub mod warp;

pub use frame::Frame;
pub use glam::{Affine2, DMat4, DVec3, Mat3, Mat4, Vec2, Vec3, Vec4};
pub use prefetch::prefetch;
pub use residual_roulette::{Prediction, Price, ResidualRoulette};
pub use sampler::Sampler;

/// Linear RGB triple (sRGB primaries): radiance, reflectance or any other per-channel quantity.
pub type Rgb = Vec3;

/// Luminance (Y of CIE XYZ) of a linear sRGB triple.
pub fn luminance(c: Rgb) -> f32 {
    0.212_671 * c.x + 0.715_160 * c.y + 0.072_169 * c.z
}
