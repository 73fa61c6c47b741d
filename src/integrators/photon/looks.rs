//! Looks at a few pixels of the picture by which settings are found out ([`super::pilot`], [`super::caustic_count`]).
//!
//! Errors are relative, as [`crate::image::metric`] counts them.

use super::eye::Eye;
use crate::math::{Sampler, Vec2};
use crate::scene::camera::CameraRay;

/// Share of the mean luminance to which errors are relative in darker places.
const DARK: f64 = 0.1;
/// Most that one look counts: outliers must not decide.
pub(super) const OUTLIER: f64 = 1.0;

/// A pixel of `window` (x, y, width, height).
pub(super) fn any_pixel(window: [u32; 4], rng: &mut Sampler) -> Vec2 {
    let [x, y, width, height] = window.map(|v| v as f32);
    (Vec2::new(x, y) + rng.next_2d() * Vec2::new(width, height)).floor()
}

/// A camera ray of a pixel.
pub(super) fn ray(eye: &Eye, pixel: Vec2, rng: &mut Sampler) -> CameraRay {
    let (at, lens) = (rng.next_2d(), rng.next_2d());
    eye.world.scene.camera.ray(pixel + at, lens)
}

/// Square of a difference, relative to `of` in a picture of luminance `mean`.
pub(super) fn relative_square(difference: f64, of: f64, mean: f64) -> f64 {
    let square = of * of + (DARK * mean) * (DARK * mean);
    if square > 0.0 { difference * difference / square } else { 0.0 }
}
