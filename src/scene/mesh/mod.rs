//! Triangle meshes with vertex normals and edge adjacency.
//!
//! Computes the world-space mesh of a file's mesh: positions in f64, stored in f32; which side is the normal side; the
//! class of every edge (DESIGN.md section 1) and the triangle across it.
//!
//! Normal side: as Mitsuba 3.9 has it (measured). Where the mesh has vertex normals, they say which side is outside: they
//! go through the inverse transpose, and triangles wound against them are turned round. Where it has none (or
//! `face_normals` is set) the winding of the *transformed* triangle says it, so a mirroring transform turns such a mesh
//! inside out. `flip_normals` then turns either round.
//!
//! Not handled: repairing meshes (T-junctions, gaps); edges there are boundaries.

mod adjacency;
mod normals;
#[cfg(test)]
mod tests;

use crate::math::{DMat4, DVec3, Vec2, Vec3};
pub use adjacency::CREASE_ANGLE;

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
    /// Vertex normals (unit; zero where the file's is unusable), or none: facets.
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

impl Mesh {
    /// The mesh in the world.
    ///
    /// Triangles without a measurable area (degenerate, collapsed by the transform, or with a vertex that is not finite)
    /// are left out: their number is the difference to `data.triangles.len()`. Errors (texts without location): an
    /// index beyond the vertices, normals or uvs that are not one per vertex, or no triangle left.
    pub fn new(data: MeshData, to_world: &DMat4, flip_normals: bool) -> Result<Mesh, String> {
        check(&data)?;
        let MeshData { positions, normals, uvs, triangles, face_normals, max_smooth_angle } = data;
        let positions: Vec<Vec3> =
            positions.iter().map(|p| to_world.transform_point3(p.as_dvec3()).as_vec3()).collect();
        let total = triangles.len();
        let triangles: Vec<[u32; 3]> =
            triangles.into_iter().filter(|t| has_area(t.map(|i| positions[i as usize]))).collect();
        if triangles.is_empty() {
            return Err(if total == 0 {
                "the mesh has no triangles".into()
            } else {
                format!("none of the {total} triangles of the mesh has an area")
            });
        }
        let mut mesh = Mesh {
            positions,
            normals: Vec::new(),
            uvs: uvs.into_iter().map(|t| if t.is_finite() { t } else { Vec2::ZERO }).collect(),
            triangles,
            edges: Vec::new(),
            neighbors: Vec::new(),
        };
        if !face_normals && max_smooth_angle.is_none() && !normals.is_empty() {
            mesh.normals = normals::transformed(&normals, to_world);
            mesh.wind_along_normals();
        }
        let face_normals_f64 = mesh.face_normals_f64();
        mesh.connect(&face_normals_f64);
        match max_smooth_angle {
            _ if face_normals => {}
            Some(angle) => mesh.compute_split_normals(&face_normals_f64, angle),
            None if mesh.normals.is_empty() => mesh.compute_smooth_normals(&face_normals_f64),
            None => {}
        }
        if flip_normals {
            mesh.flip();
        }
        Ok(mesh)
    }

    /// Corners of triangle `tri`.
    pub fn corners(&self, tri: u32) -> [Vec3; 3] {
        self.triangles[tri as usize].map(|i| self.positions[i as usize])
    }

    /// Unit geometric normal of triangle `tri`, on the normal side.
    pub fn face_normal(&self, tri: u32) -> Vec3 {
        unit_cross(self.corners(tri)).as_vec3()
    }

    /// Unit geometric normal of the triangle across edge `edge` (0: ab, 1: bc, 2: ca) of triangle `tri`, if there is
    /// exactly one.
    pub fn opposite_normal(&self, tri: u32, edge: usize) -> Option<Vec3> {
        match self.neighbors[tri as usize][edge] {
            u32::MAX => None,
            other => Some(self.face_normal(other)),
        }
    }

    /// Area of triangle `tri`, world units squared; above zero for every triangle of a mesh.
    pub fn triangle_area(&self, tri: u32) -> f32 {
        area(self.corners(tri)) as f32
    }

    /// Area of the whole mesh, world units squared.
    pub fn area(&self) -> f32 {
        let triangles = 0..self.triangles.len() as u32;
        triangles.map(|t| area(self.corners(t))).sum::<f64>() as f32
    }

    /// Box (min, max) around the triangles.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        self.triangles.iter().flatten().fold(empty, |(lo, hi), &i| {
            let p = self.positions[i as usize];
            (lo.min(p), hi.max(p))
        })
    }

    /// Turns triangles round whose winding disagrees with their vertex normals.
    fn wind_along_normals(&mut self) {
        for t in &mut self.triangles {
            let [a, b, c] = t.map(|i| i as usize);
            let sum = self.normals[a] + self.normals[b] + self.normals[c];
            let n = cross([self.positions[a], self.positions[b], self.positions[c]]);
            if n.dot(sum.as_dvec3()) < 0.0 {
                t.swap(1, 2);
            }
        }
    }

    /// Turns the normal side round. Edge ab becomes ac, so ab and ca change places.
    fn flip(&mut self) {
        self.normals.iter_mut().for_each(|n| *n = -*n);
        self.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self.edges.iter_mut().for_each(|e| e.swap(0, 2));
        self.neighbors.iter_mut().for_each(|n| n.swap(0, 2));
    }
}

/// Errors of a mesh that make it unusable.
fn check(data: &MeshData) -> Result<(), String> {
    let vertices = data.positions.len();
    for (what, len) in [("normals", data.normals.len()), ("texture coordinates", data.uvs.len())] {
        if len != 0 && len != vertices {
            return Err(format!("the mesh has {vertices} vertices but {len} {what}"));
        }
    }
    // Half-edges are numbered in u32 below.
    if data.triangles.len() > (u32::MAX / 3) as usize || vertices >= u32::MAX as usize {
        return Err(format!("the mesh is too large ({} triangles)", data.triangles.len()));
    }
    let beyond = |t: &[u32; 3]| t.iter().any(|&i| i as usize >= vertices);
    match data.triangles.iter().position(beyond) {
        None => Ok(()),
        Some(t) => Err(format!(
            "triangle {t} refers to vertex {} but the mesh has {vertices} vertices",
            data.triangles[t].iter().max().unwrap_or(&0)
        )),
    }
}

/// (b - a) x (c - a), exact up to rounding in f64.
fn cross([a, b, c]: [Vec3; 3]) -> DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

/// The unit normal of a triangle that has an area.
fn unit_cross(corners: [Vec3; 3]) -> DVec3 {
    cross(corners).normalize()
}

/// Area of a triangle.
fn area(corners: [Vec3; 3]) -> f64 {
    0.5 * cross(corners).length()
}

/// Whether a triangle's area and its reciprocal are finite and not zero in f32; false for NaN.
fn has_area(corners: [Vec3; 3]) -> bool {
    (1e-37..=1e37).contains(&area(corners))
}
