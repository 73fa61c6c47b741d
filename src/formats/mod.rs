//! Readers of scene, mesh and picture files.

pub mod bitmap;
pub mod mesh_file;
pub mod obj;
pub mod ply;
pub mod serialized;
