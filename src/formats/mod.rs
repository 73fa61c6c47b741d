//! Readers of scene, mesh and picture files.

mod assets;
pub mod bitmap;
mod cie;
pub mod diagnostics;
pub mod mesh_file;
pub mod mitsuba_xml;
pub mod obj;
pub mod ply;
pub mod serialized;
pub mod spectrum;

use crate::scene::Description;
pub use diagnostics::{Diagnostic, Diagnostics, Severity};
use std::path::Path;

/// How to read a scene.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Unknown properties, tags and plugins are errors instead of warnings.
    pub strict: bool,
    /// Values of `$key` in the file (`-D key=value`); they beat the file's own defaults.
    pub defines: Vec<(String, String)>,
}

/// A scene and what was odd about its file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub description: Description,
    /// Warnings in the order of the reading.
    pub warnings: Vec<Diagnostic>,
}

/// Reads a scene file with its meshes and pictures.
///
/// # Errors
/// All problems found that make the file unusable, each with its position, together with the warnings.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, Diagnostics> {
    mitsuba_xml::load(path, options)
}
