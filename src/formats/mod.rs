//! Readers of scene, mesh and picture files.

pub mod bitmap;
