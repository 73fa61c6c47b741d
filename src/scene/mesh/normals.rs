//! Vertex normals: those of the file, or smooth ones, with or without creases.
//!
//! Computes n_v = normalise(sum over the corners at vertex v of angle(corner) * n_face), in world space.
//! Source: Thuermer and Wuethrich 1998, "Computing Vertex Normals from Polygonal Facets" (angle weights, as Mitsuba).
//! A vertex is an *index*: vertices that a file doubles along a uv seam get a normal each, as in Mitsuba 3. With a
//! crease angle (Mitsuba 0.6 `maxSmoothAngle`) corners at one *position* share a normal if a chain of edges that are
//! flatter than the angle connects them, seam or no seam.
//! Not handled: corners that meet in a point only, or over an edge of three or more faces, are not smoothed together.

use super::Mesh;
use crate::math::{DMat4, DVec3, Vec3};
use rayon::prelude::*;

/// File normals in the world: by the inverse transpose, unit, zero where a normal is zero or not finite.
pub(super) fn transformed(normals: &[Vec3], to_world: &DMat4) -> Vec<Vec3> {
    let cofactor = normal_matrix(to_world);
    let unit = |n: &Vec3| {
        let n = cofactor.map(|row| row.dot(n.as_dvec3()));
        DVec3::from_array(n).try_normalize().map_or(Vec3::ZERO, |n| n.as_vec3())
    };
    normals.par_iter().map(unit).collect()
}

/// Rows of a multiple above zero of the inverse transpose of the upper 3x3 of `m`: the cofactors with the determinant's
/// sign, which exist for flattening matrices (determinant 0) as well.
fn normal_matrix(m: &DMat4) -> [DVec3; 3] {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.truncate());
    let columns = [y.cross(z), z.cross(x), x.cross(y)];
    let sign = if x.dot(columns[0]) < 0.0 { -1.0 } else { 1.0 };
    [0, 1, 2].map(|i| sign * DVec3::new(columns[0][i], columns[1][i], columns[2][i]))
}

/// Angles of a triangle at a, b, c, radians.
fn corner_angles([a, b, c]: [Vec3; 3]) -> [f64; 3] {
    let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
    let angle = |u: DVec3, v: DVec3| u.cross(v).length().atan2(u.dot(v));
    [angle(b - a, c - a), angle(c - b, a - b), angle(a - c, b - c)]
}

impl Mesh {
    /// Unit normals of all triangles.
    pub(super) fn face_normals_f64(&self) -> Vec<DVec3> {
        let normal = |t: u32| super::unit_cross(self.corners(t));
        (0..self.triangles.len() as u32).into_par_iter().map(normal).collect()
    }

    /// Angle of each corner.
    fn all_corner_angles(&self) -> Vec<[f64; 3]> {
        let triangles = (0..self.triangles.len() as u32).into_par_iter();
        triangles.map(|t| corner_angles(self.corners(t))).collect()
    }

    /// Smooth normals, one per vertex index.
    pub(super) fn compute_smooth_normals(&mut self, face_normals: &[DVec3]) {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for ((t, n), angles) in self.triangles.iter().zip(face_normals).zip(self.all_corner_angles()) {
            for k in 0..3 {
                sums[t[k] as usize] += angles[k] * *n;
            }
        }
        self.normals = unit_or_zero(&sums);
    }

    /// Smooth normals with creases where the faces' normals differ by more than `max_angle` radians. Vertices on
    /// creases are doubled; neighbours and edge classes stay as they are, since positions do not change.
    pub(super) fn compute_split_normals(&mut self, face_normals: &[DVec3], max_angle: f32) {
        let mut groups = Groups::new(3 * self.triangles.len());
        // NaN smooths nothing. The slack keeps equal angles (a 30 degree prism at 30 degrees) together.
        let cos_max =
            if max_angle.is_nan() { 2.0 } else { (max_angle as f64 + 1e-6).clamp(0.0, std::f64::consts::PI).cos() };
        for (t, neighbors) in self.neighbors.iter().enumerate() {
            for (e, &other) in neighbors.iter().enumerate() {
                if other == u32::MAX || (other as usize) < t {
                    continue;
                }
                let o = other as usize;
                if face_normals[t].dot(face_normals[o]) < cos_max {
                    continue;
                }
                // Corners at the two ends of the edge, matched by position.
                for k in [e, (e + 1) % 3] {
                    let p = self.positions[self.triangles[t][k] as usize];
                    let same = |&j: &usize| self.positions[self.triangles[o][j] as usize] == p;
                    if let Some(j) = (0..3).find(same) {
                        groups.join((3 * t + k) as u32, (3 * o + j) as u32);
                    }
                }
            }
        }
        let mut sums = vec![DVec3::ZERO; 3 * self.triangles.len()];
        for (t, angles) in self.all_corner_angles().iter().enumerate() {
            for k in 0..3 {
                sums[groups.root((3 * t + k) as u32) as usize] += angles[k] * face_normals[t];
            }
        }
        self.split_vertices(&mut groups, &unit_or_zero(&sums));
    }

    /// Gives every pair (vertex index, group of its corner) a vertex of its own, in order of first use.
    fn split_vertices(&mut self, groups: &mut Groups, group_normals: &[Vec3]) {
        // Corners sorted by (vertex, group): equal neighbours share the new vertex.
        let mut corners: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * self.triangles.len());
        for (t, tri) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let corner = (3 * t + k) as u32;
                corners.push((tri[k], groups.root(corner), corner));
            }
        }
        corners.par_sort_unstable();
        let (positions, uvs) = (std::mem::take(&mut self.positions), std::mem::take(&mut self.uvs));
        self.normals = Vec::with_capacity(positions.len());
        let mut last = None;
        for (vertex, group, corner) in corners {
            if last != Some((vertex, group)) {
                last = Some((vertex, group));
                self.positions.push(positions[vertex as usize]);
                self.normals.push(group_normals[group as usize]);
                self.uvs.extend(uvs.get(vertex as usize));
            }
            self.triangles[corner as usize / 3][corner as usize % 3] = self.positions.len() as u32 - 1;
        }
    }
}

/// Unit vectors; zero where the sum cancels out (then the surface point falls back to the face's normal).
fn unit_or_zero(sums: &[DVec3]) -> Vec<Vec3> {
    let unit = |n: &DVec3| n.try_normalize().map_or(Vec3::ZERO, |n| n.as_vec3());
    sums.par_iter().map(unit).collect()
}

/// Disjoint sets of corners (union-find, path halving; the smallest member is the root, so the result does not depend
/// on the order of joins).
struct Groups {
    parent: Vec<u32>,
}

impl Groups {
    fn new(n: usize) -> Self {
        Groups { parent: (0..n as u32).collect() }
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let grand = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = grand;
            i = grand;
        }
        i
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
