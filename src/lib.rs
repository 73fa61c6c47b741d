//! dualux: a CPU global illumination renderer.
//!
//! The library is built in strict layers; a file imports only from lower layers or from its own folder
//! (`tests/layers.rs` checks it):
//!
//! 1. [`math`]: random numbers, warps, densities, filters
//! 2. [`mod@image`]: film, image files, metrics
//! 3. [`scene`], [`formats`]: what a scene is, and the files that describe one
//! 4. [`accel`]: ray queries over a scene
//! 5. [`edge`]: which edges a footprint of rays sees
//! 6. [`emission`]: where photons start
//! 7. [`transport`]: what light transport is made of
//! 8. [`integrators`]: light transport algorithms
//! 9. [`render`], [`report`], [`cli`]: the main loop, reports of comparisons, the command line

#![warn(missing_docs)]

pub mod accel;
pub mod cli;
pub mod edge;
pub mod emission;
pub mod formats;
pub mod image;
pub mod integrators;
pub mod math;
pub mod render;
pub mod report;
pub mod scene;
pub mod transport;
