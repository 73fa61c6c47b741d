//! The cube `[-1,1]^3` as a mesh: 24 vertices, so that each face has its own normal and its own uv square.
//!
//! Layout as Mitsuba 3.9's cube (its vertex table, measured): each face starts at uv (0,1) and goes round over
//! (1,1), (1,0) and (0,0), counter-clockwise as seen from outside, so that its normal is dp/dv x dp/du.

use super::super::mesh::MeshData;
use crate::math::{Vec2, Vec3};

/// Per face, in Mitsuba's order (-y, +y, +x, +z, -x, -z): the directions in which u and v grow.
const FACES: [[Vec3; 2]; 6] = [
    [Vec3::Z, Vec3::X],
    [Vec3::NEG_X, Vec3::NEG_Z],
    [Vec3::Y, Vec3::NEG_Z],
    [Vec3::Y, Vec3::X],
    [Vec3::Y, Vec3::Z],
    [Vec3::NEG_Y, Vec3::X],
];

/// Triangles 2f and 2f + 1 are face f.
pub(super) fn mesh_data() -> MeshData {
    let mut data = MeshData::default();
    for [u, v] in FACES {
        let n = v.cross(u);
        let first = data.positions.len() as u32;
        for uv in [Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO] {
            data.positions.push(n + u * (2.0 * uv.x - 1.0) + v * (2.0 * uv.y - 1.0));
            data.normals.push(n);
            data.uvs.push(uv);
        }
        data.triangles.push([first, first + 1, first + 2]);
        data.triangles.push([first + 3, first, first + 2]);
    }
    data
}
