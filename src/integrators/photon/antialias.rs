//! Samples per pixel of the first pass: several where derivatives predict an edge.
//!
//! The footprint of a pixel is the square that most of its filter's weight comes from; what it sees directly, in mirrors and through glass is
//! asked of the edge detector, not of samples. Later passes follow the noise of the picture (`allocate`).
//! Source      Namae & Makino, section 3.4 (antialiasing): oversample a pixel where predicted neighbours differ
//! Bias        none: every sample of a pixel counts alike, and the number does not depend on their values
//! Not handled textures and shadow edges, which later passes find by their noise; a lens: every pixel is sampled alike
//! Verified by tests/photon.rs

use super::settings::Antialiasing;
use crate::edge::EdgeDetector;
use crate::math::filter::PixelFilter;
use crate::transport::World;
use rayon::prelude::*;

/// Samples of a pixel on an edge.
pub const ON_EDGES: f32 = 8.0;
/// Samples of every pixel where the camera has a lens.
const OUT_OF_FOCUS: f32 = 2.0;
/// Greatest half side of a footprint, in pixels.
const GREATEST: f64 = 1.0;

/// Samples per pixel of `window` (x, y, width, height), row-major; `chains`: there are mirrors or glass.
pub fn samples(world: World, [x0, y0, width, height]: [u32; 4], chains: bool, mode: Antialiasing) -> Vec<f32> {
    let alike = |n: f32| vec![n; width as usize * height as usize];
    match mode {
        Antialiasing::Off => return alike(1.0),
        Antialiasing::Full => return alike(ON_EDGES),
        Antialiasing::Adaptive if world.scene.camera.has_lens() => return alike(OUT_OF_FOCUS),
        Antialiasing::Adaptive => {}
    }
    let detector = EdgeDetector::new(world.scene, world.accel);
    let half = half_side(&world.scene.film.filter);
    let one = |x: u32, y: u32| if detector.needs_samples(x0 + x, y0 + y, half, chains) { ON_EDGES } else { 1.0 };
    (0..height).into_par_iter().flat_map_iter(|y| (0..width).map(|x| one(x, y)).collect::<Vec<_>>()).collect()
}

/// Half the side of the square that matters to a pixel.
fn half_side(filter: &PixelFilter) -> f64 {
    f64::from(filter.radius()).clamp(0.5, GREATEST)
}
