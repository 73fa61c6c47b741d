//! Which triangles meet in an edge, and whether that edge can be seen.
//!
//! Computes for each edge of each triangle its [`EdgeClass`] and the triangle across. Edges match by the *positions* of
//! their ends, since files double vertices along uv and normal seams. Classes (DESIGN.md section 1, METHODS.md 3.A):
//! one face, three or more, faces wound against each other, or an angle above [`CREASE_ANGLE`]: `Always`; coplanar to
//! within the rounding of the positions: `Never`; else `Silhouette`.
//!
//! Method: vertices of one position get one number (open hashing), half-edges are put in buckets by their lower vertex
//! (counting sort), and each bucket is sorted by the upper one. Linear time, and the same answer for any thread count.
//! Not handled: T-junctions (a vertex inside another triangle's edge): boundaries.

use super::{EdgeClass, Mesh};
use crate::math::sampler::hash;
use crate::math::{DVec3, Vec3};
use rayon::prelude::*;

/// Angle between two faces' normals above which their edge is a feature from everywhere, radians (20 degrees).
pub const CREASE_ANGLE: f32 = 20.0 * std::f32::consts::PI / 180.0;

/// Distance, in units of the largest coordinate, below which a vertex lies in its neighbour's plane: a few roundings.
const COPLANAR: f64 = 4.0 * f32::EPSILON as f64;

/// One directed edge of a triangle: from `corner` to the corner after it. Sorted by `upper`, then `half_edge`.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    /// The higher of the two position numbers.
    upper: u32,
    /// 3 * triangle + edge.
    half_edge: u32,
}

impl Mesh {
    /// Fills `edges` and `neighbors`.
    pub(super) fn connect(&mut self, face_normals: &[DVec3]) {
        let numbers = position_numbers(&self.positions);
        let ends = |h: u32| {
            let t = &self.triangles[h as usize / 3];
            let e = h as usize % 3;
            (numbers[t[e] as usize], numbers[t[(e + 1) % 3] as usize])
        };
        let half_edges = 3 * self.triangles.len() as u32;

        // Counting sort by the lower end.
        let mut starts = vec![0u32; self.positions.len() + 1];
        for h in 0..half_edges {
            let (a, b) = ends(h);
            starts[a.min(b) as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut sorted = vec![HalfEdge::default(); half_edges as usize];
        for h in 0..half_edges {
            let (a, b) = ends(h);
            let slot = &mut next[a.min(b) as usize];
            sorted[*slot as usize] = HalfEdge { upper: a.max(b), half_edge: h };
            *slot += 1;
        }

        let mut edges = vec![[EdgeClass::Always; 3]; self.triangles.len()];
        let mut neighbors = vec![[u32::MAX; 3]; self.triangles.len()];
        for w in starts.windows(2) {
            let bucket = &mut sorted[w[0] as usize..w[1] as usize];
            bucket.sort_unstable();
            for group in bucket.chunk_by(|a, b| a.upper == b.upper) {
                let &[first, second] = group else { continue };
                let (h0, h1) = (first.half_edge, second.half_edge);
                let (t0, e0) = (h0 as usize / 3, h0 as usize % 3);
                let (t1, e1) = (h1 as usize / 3, h1 as usize % 3);
                neighbors[t0][e0] = t1 as u32;
                neighbors[t1][e1] = t0 as u32;
                // Faces of one orientation run through their edge in opposite directions.
                if ends(h0).0 != ends(h1).0 {
                    let class = self.classify(face_normals, (t0, e0), (t1, e1));
                    edges[t0][e0] = class;
                    edges[t1][e1] = class;
                }
            }
        }
        self.edges = edges;
        self.neighbors = neighbors;
    }

    /// Class of the edge between two consistently wound faces, given as (triangle, edge) each.
    fn classify(&self, face_normals: &[DVec3], (t0, e0): (usize, usize), (t1, e1): (usize, usize)) -> EdgeClass {
        let cos = face_normals[t0].dot(face_normals[t1]);
        if cos < (CREASE_ANGLE as f64).cos() {
            return EdgeClass::Always;
        }
        // The far vertex of each face against the plane of the other. A tiny face's plane says nothing about a far
        // vertex, hence the smaller distance of the two.
        let position = |t: usize, k: usize| self.positions[self.triangles[t][k % 3] as usize];
        let (on_edge, far0, far1) = (position(t0, e0), position(t0, e0 + 2), position(t1, e1 + 2));
        let distance = |n: DVec3, far: Vec3| n.dot(far.as_dvec3() - on_edge.as_dvec3()).abs();
        let off = distance(face_normals[t0], far1).min(distance(face_normals[t1], far0));
        let largest = on_edge.abs().max(far0.abs()).max(far1.abs()).max_element() as f64;
        if off <= COPLANAR * largest { EdgeClass::Never } else { EdgeClass::Silhouette }
    }
}

/// For each vertex the index of the first vertex with its position.
fn position_numbers(positions: &[Vec3]) -> Vec<u32> {
    // Adding zero turns -0 into +0, which is the same place.
    let bits = |p: Vec3| (p + Vec3::ZERO).to_array().map(f32::to_bits);
    let hashes: Vec<u64> = positions
        .par_iter()
        .map(|&p| {
            let [x, y, z] = bits(p);
            hash(x as u64 | (y as u64) << 32, z as u64)
        })
        .collect();
    // Open addressing at a load of at most one half.
    let mask = (2 * positions.len().max(1)).next_power_of_two() - 1;
    let mut table = vec![u32::MAX; mask + 1];
    let mut numbers = Vec::with_capacity(positions.len());
    for (i, &p) in positions.iter().enumerate() {
        let mut slot = hashes[i] as usize & mask;
        let number = loop {
            match table[slot] {
                u32::MAX => {
                    table[slot] = i as u32;
                    break i as u32;
                }
                j if bits(positions[j as usize]) == bits(p) => break j,
                _ => slot = (slot + 1) & mask,
            }
        };
        numbers.push(number);
    }
    numbers
}
