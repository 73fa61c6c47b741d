//! The kernel for any processor: plain arrays, which compilers turn into whatever vectors the target has.
//!
//! It is also the readable form of the `avx2` kernel, which must give the same bits.

use super::layout::{Child, Node8, Tree, Tri4, View};
use super::traverse::{self, Kernel, Near, Query, TriHits};
use super::{Hit, Ray};

struct Portable;

pub(super) fn closest(tree: &Tree, ray: &Ray) -> Option<Hit> {
    traverse::closest::<Portable>(tree, ray)
}

pub(super) fn occluded(tree: &Tree, ray: &Ray) -> bool {
    traverse::occluded::<Portable>(tree, ray)
}

/// As the x86 instruction: the second operand if one is NaN or both are equal.
#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// As the x86 instruction: the second operand if one is NaN or both are equal.
#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

impl Kernel for Portable {
    #[inline(always)]
    fn boxes(query: &Query, node: &Node8) -> (u32, Near) {
        let mut near = [query.tmin; 8];
        let mut far = [query.tmax_far(); 8];
        for axis in 0..3 {
            let near_planes = &node.bounds[query.near[axis]];
            let far_planes = &node.bounds[query.near[axis] ^ 1];
            for i in 0..8 {
                // A ray in the very plane of a side (0 * inf) gives NaN here: no constraint.
                near[i] = max((near_planes[i] - query.o[axis]) * query.inv[axis], near[i]);
                far[i] = min((far_planes[i] - query.o[axis]) * query.inv_far[axis], far[i]);
            }
        }
        let mask = (0..8).fold(0, |m, i| m | ((near[i] <= far[i]) as u32) << i);
        (mask, Near(near))
    }

    #[inline(always)]
    fn triangles(query: &Query, pack: &Tri4, hits: &mut TriHits) -> u32 {
        let mut mask = 0;
        for i in 0..4 {
            let vertex = |v: usize, axis: usize| pack.vertex(i, v, axis);
            // Vertices in the sheared system with the ray on its third axis.
            let sheared = |v: usize| {
                let [kx, ky, kz] = query.k;
                let z = vertex(v, kz) - query.o[kz];
                let x = (vertex(v, kx) - query.o[kx]) - query.shear[0] * z;
                let y = (vertex(v, ky) - query.o[ky]) - query.shear[1] * z;
                (x, y)
            };
            let ((ax, ay), (bx, by), (cx, cy)) = (sheared(0), sheared(1), sheared(2));
            let a = cx * by - cy * bx;
            let b = ax * cy - ay * cx;
            let c = bx * ay - by * ax;
            let det = (a + b) + c;
            let inside = min(min(a, b), c) >= 0.0 || max(max(a, b), c) <= 0.0;
            if !inside || det == 0.0 || det.is_nan() {
                continue;
            }
            let e1 = [0, 1, 2].map(|k| vertex(1, k) - vertex(0, k));
            let e2 = [0, 1, 2].map(|k| vertex(2, k) - vertex(0, k));
            let n = [e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]];
            let from = [0, 1, 2].map(|k| vertex(0, k) - query.o[k]);
            let dot = |v: [f32; 3]| (n[0] * v[0] + n[1] * v[1]) + n[2] * v[2];
            let t = dot(from) / dot(query.d);
            if query.tmin <= t && t <= query.tmax {
                hits.edge[0][i] = a;
                hits.edge[1][i] = b;
                hits.edge[2][i] = c;
                hits.det[i] = det;
                hits.t[i] = t;
                mask |= 1 << i;
            }
        }
        mask
    }

    #[inline(always)]
    fn prefetch(_: View, _: Child) {}
}
