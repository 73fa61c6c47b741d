//! Triangle meshes with edge adjacency.

use crate::math::{Vec2, Vec3};

/// A mesh as a file holds it: object space, nothing derived.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshData {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertex normals: none, or one per vertex. None and not `face_normals` means: smooth ones are computed.
    pub normals: Vec<Vec3>,
    /// Texture coordinates: none, or one per vertex (already flipped as the file type asks).
    pub uvs: Vec<Vec2>,
    /// Vertex indices per triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Facets: normals of the file are ignored and none are computed.
    pub face_normals: bool,
    /// Crease angle, radians, above which computed normals are split (legacy `maxSmoothAngle`).
    pub max_smooth_angle: Option<f32>,
}

/// Whether an edge of a triangle can be a feature edge (a visible boundary for some origin).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeClass {
    /// Coplanar neighbour: never visible.
    Never,
    /// Boundary, crease or material change: from everywhere.
    Always,
    /// Smooth edge: a silhouette where the two faces turn opposite ways.
    Silhouette,
}

/// A world-space mesh.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Vertex normals (unit), or none: facets.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, or none.
    pub uvs: Vec<Vec2>,
    /// Vertex indices per triangle; wound so that (b-a) x (c-a) points to the normal side.
    pub triangles: Vec<[u32; 3]>,
    /// Class of the edges (ab, bc, ca) of each triangle.
    pub edges: Vec<[EdgeClass; 3]>,
    /// Triangle across each edge (ab, bc, ca), or `u32::MAX` (its normal is what silhouettes compare).
    pub neighbors: Vec<[u32; 3]>,
}
