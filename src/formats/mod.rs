//! Readers of scene, mesh and picture files.
