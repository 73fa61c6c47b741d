//! Cells of a light's emission: rectangles on the faces of a cube round a point (hemicube for a one-sided light), where
//! the direction is affine in p and margins are exact.
//!
//! Two parameters: all rays of a cell start at one point of the light ([`Cells::cell`]). Four: they also start anywhere on a
//! rectangle of the light ([`Cells::patch_cell`]), for which margins are predictions.
//! The flux of a cell is the solid angle or form factor of its rectangle (`math::polygon`), known in closed form.

use super::view::{View, to_dual};
use crate::math::{DVec3, Frame};
use dualux_dual::Family;

/// A face of the cube: its middle and half edges, all unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Middle.
    pub middle: DVec3,
    /// Half edges.
    pub half: [DVec3; 2],
    /// Part of the face that belongs to the hemisphere, as the range of the second coordinate.
    pub v: [f64; 2],
}

/// Emission from a point, by directions.
#[derive(Clone, Debug)]
pub struct Cells {
    /// Where rays start.
    pub origin: DVec3,
    /// Faces: five (a hemicube, sides cut in half) or six.
    pub faces: Vec<Face>,
}

impl Cells {
    /// The hemicube round normal `n`: the top, then four sides of which the upper halves count.
    pub fn hemicube(origin: DVec3, n: DVec3) -> Self {
        let frame = Frame::from_normal(n.as_vec3());
        // Orthogonal in f64.
        let s = (frame.s.as_dvec3() - n * n.dot(frame.s.as_dvec3())).normalize();
        let t = n.cross(s);
        let side = |m: DVec3| Face { middle: m, half: [n.cross(m), n], v: [0.0, 1.0] };
        let top = Face { middle: n, half: [s, t], v: [-1.0, 1.0] };
        Cells { origin, faces: vec![top, side(s), side(t), side(-s), side(-t)] }
    }

    /// The whole cube, for a point light.
    pub fn cube(origin: DVec3) -> Self {
        let face = |middle: DVec3, u: DVec3, v: DVec3| Face { middle, half: [u, v], v: [-1.0, 1.0] };
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let faces =
            vec![face(x, y, z), face(-x, -y, z), face(y, z, x), face(-y, -z, x), face(z, x, y), face(-z, -x, y)];
        Cells { origin, faces }
    }

    /// The family of a cell: centre and half widths on a face, in -1..1.
    pub fn family(&self, face: usize, centre: [f64; 2], half: [f64; 2]) -> Family<f64, 2> {
        let Face { middle, half: [u, v], .. } = self.faces[face];
        let d = middle + u * centre[0] + v * centre[1];
        Family::fixed(to_dual(self.origin), to_dual(d), [to_dual(u * half[0]), to_dual(v * half[1])])
    }

    /// The footprint of a cell.
    pub fn cell(&self, face: usize, centre: [f64; 2], half: [f64; 2]) -> Option<View> {
        View::new(self.family(face, centre, half), [0.0, f64::INFINITY])
    }

    /// A cell whose rays start anywhere on the parallelogram with half edges `patch` round the origin.
    pub fn patch_cell(&self, face: usize, centre: [f64; 2], half: [f64; 2], patch: [DVec3; 2]) -> Family<f64, 4> {
        let f = self.family(face, centre, half);
        let zero = dualux_dual::Vec3::zero();
        let [a, b] = patch.map(to_dual);
        Family::new(f.o, [zero, zero, a, b], f.d, [f.d_p[0], f.d_p[1], zero, zero])
    }
}
