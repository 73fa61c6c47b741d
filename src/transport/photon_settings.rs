//! Settings of photon maps: which kernel, and how wide it is in which pass.
//!
//! Source      Knaus & Zwicker 2011, "Progressive Photon Mapping: A Probabilistic Approach" (widths of the passes)

use super::World;
use super::footprint_kernel::{Smallest, Widths};
use super::photon_walk::{Goal, WalkSettings};
use std::f32::consts::FRAC_1_PI;

/// Exponent of the shrinking of kernels (Knaus & Zwicker 2011; 2/3 is optimal for the mean square error, METHODS 3.B).
pub const ALPHA: f64 = 2.0 / 3.0;
/// Standard deviations of footprint kernels over those of footprints of two and of four parameters. With four, the images of a lamp's
/// and of a direction's cells overlap anyhow. Least relMSE of the caustic layer of caustic-ring at 20 k, 100 k and 1 M photons: four: 0.8 to
/// 1.0 (0.0035, 0.0015, 0.0006; best of nearest and fixed kernels at 100 k: 0.0033).
pub const SCALE: [f32; 2] = [2.2, 0.9];
/// Greatest kernels, in radii of the scene's bounding sphere, if nothing is said.
const GREATEST: f32 = 0.1;
/// Smallest kernels, in widths of a pixel, if nothing is said.
const SMALLEST_PIXELS: f32 = 1.0;
/// Photons that a kernel of automatic radius would hold if photons covered the scene's surfaces evenly.
const AUTOMATIC_COUNT: f32 = 20.0;

/// How radiance is estimated from photons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kernel {
    /// Each photon's own footprint, from its derivatives.
    Footprint {
        /// Factor on widths and on the greatest one. 1 suits whole renders: a single pass has its least error where kernels are about
        /// 1.4 times as wide (as n photons do at a width in proportion to n^(-1/6)), but they cost twice as much there and bias the mean
        /// of all passes.
        scale: f32,
    },
    /// The `k` nearest photons within the greatest radius, of which k - 1 count.
    Nearest {
        /// Number of photons asked for, 2 at least.
        k: u32,
    },
    /// One radius, world units; `None`: automatic.
    Fixed {
        /// The radius.
        radius: Option<f32>,
    },
    /// One radius per pass, world units in the first pass; `None`: automatic.
    Progressive {
        /// The radius of the first pass.
        radius: Option<f32>,
    },
}

/// Settings of photon maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonSettings {
    /// Seed of the render.
    pub seed: u64,
    /// The estimator.
    pub kernel: Kernel,
    /// Factor on the widths of footprint kernels in the first pass; 1 is best where that was measured ([`SCALE`]).
    pub scale: f32,
    /// Smallest half axis of footprint kernels, world units; `None`: the width of a pixel.
    pub smallest: Option<f32>,
    /// Greatest half axis of footprint kernels, and farthest of the nearest photons, world units; `None`: a tenth of the scene's radius.
    pub greatest: Option<f32>,
    /// Footprint kernels shrink from pass to pass.
    pub shrink: bool,
    /// What of a kernel lies beyond the border of its surface is folded back ([`super::border`]).
    pub fold: bool,
    /// Longest path from light to eye, counted as integrators do: photons keep one segment for the eye.
    pub max_depth: Option<u32>,
    /// Scatterings from which on every photon may end.
    pub rr_depth: u32,
}

impl Kernel {
    /// Footprints of the usual widths.
    pub const FOOTPRINT: Kernel = Kernel::Footprint { scale: 1.0 };
}

impl Default for PhotonSettings {
    fn default() -> Self {
        PhotonSettings {
            seed: 0,
            kernel: Kernel::FOOTPRINT,
            scale: 1.0,
            smallest: None,
            greatest: None,
            shrink: true,
            fold: true,
            max_depth: None,
            rr_depth: 5,
        }
    }
}

/// Radius of pass `pass` over that of pass 0: the root of the product of (i + alpha) / (i + 1), i = 1 .. pass.
pub fn shrinkage(pass: u64) -> f32 {
    (1..=pass).map(|i| (i as f64 + ALPHA) / (i as f64 + 1.0)).product::<f64>().sqrt() as f32
}

impl PhotonSettings {
    /// The walk of photons for a map.
    pub fn walk(&self, goal: Goal) -> WalkSettings {
        let most_segments = self.max_depth.map(|d| d.saturating_sub(1));
        WalkSettings { seed: self.seed, most_segments, rr_depth: self.rr_depth, goal }
    }

    /// Widths of the kernels of pass `pass` for `stored` photons.
    pub fn widths(&self, world: World, stored: usize, pass: u64) -> Widths {
        let scene = world.scene;
        let greatest = self.greatest.unwrap_or(GREATEST * scene.bounds.1);
        let automatic = || {
            let area: f32 = scene.shapes.iter().map(|s| s.area()).sum();
            (AUTOMATIC_COUNT * area * FRAC_1_PI / stored.max(1) as f32).sqrt().min(greatest)
        };
        match self.kernel {
            Kernel::Fixed { radius } => Widths::fixed(radius.unwrap_or_else(automatic)),
            Kernel::Progressive { radius } => Widths::fixed(radius.unwrap_or_else(automatic) * shrinkage(pass)),
            Kernel::Footprint { .. } | Kernel::Nearest { .. } => {
                let factor = if let Kernel::Footprint { scale } = self.kernel { scale } else { 1.0 };
                let size = [scene.film.width, scene.film.height];
                let pixels = || Smallest::pixels(&scene.camera, size, SMALLEST_PIXELS);
                let min = self.smallest.map_or_else(pixels, Smallest::Fixed);
                let scale = SCALE.map(|s| s * self.scale * factor);
                let widths = Widths { scale, min, max: greatest * factor };
                if self.shrink { widths.shrunk(shrinkage(pass)) } else { widths }
            }
        }
    }
}
