//! Files that a scene refers to: one place where scene readers meet mesh and picture readers.

use super::{bitmap, obj, ply, serialized};
use crate::scene::mesh::MeshData;
use crate::scene::texture::Bitmap;
use std::path::Path;

/// A mesh in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MeshKind {
    /// Wavefront OBJ; v of the texture coordinates is flipped if true.
    Obj(bool),
    /// PLY; flipped if true.
    Ply(bool),
    /// Mesh number so-and-so of a Mitsuba `serialized` file.
    Serialized(u32),
}

/// Reads a mesh; the error is the text of the reader.
pub fn read_mesh(path: &Path, kind: MeshKind) -> Result<MeshData, String> {
    match kind {
        MeshKind::Obj(flip) => obj::read(path, flip),
        MeshKind::Ply(flip) => ply::read(path, flip),
        MeshKind::Serialized(index) => serialized::read(path, index as usize),
    }
    .map_err(|e| e.to_string())
}

/// Reads a picture; `srgb` asks for 8-bit values to be decoded to linear.
pub fn read_bitmap(path: &Path, srgb: bool) -> Result<Bitmap, String> {
    bitmap::read(path, srgb).map_err(|e| e.to_string())
}
