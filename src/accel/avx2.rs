//! The kernel for x86 processors with AVX2, chosen at run time.
//!
//! Same operations in the same order as `portable`, eight boxes or four triangles at a time. No fused multiply-add: the
//! results are equal bit for bit. This is the only file of the crate with `unsafe`.

use super::layout::Tree;
use super::{Hit, Ray};

#[cfg(target_arch = "x86_64")]
pub(super) use x86::Avx2;

#[cfg(not(target_arch = "x86_64"))]
pub(super) use fallback::Avx2;

#[cfg(not(target_arch = "x86_64"))]
mod fallback {
    use super::super::portable;
    use super::{Hit, Ray, Tree};

    /// There is no such processor here.
    #[derive(Clone, Copy, Debug)]
    pub enum Avx2 {}

    impl Avx2 {
        pub fn detect() -> Option<Self> {
            None
        }

        pub fn closest(self, tree: &Tree, ray: &Ray) -> Option<Hit> {
            portable::closest(tree, ray)
        }

        pub fn occluded(self, tree: &Tree, ray: &Ray) -> bool {
            portable::occluded(tree, ray)
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::super::layout::{Child, Node8, Tri4};
    use super::super::traverse::{self, Kernel, Near, Query, TriHits};
    use super::{Hit, Ray, Tree};
    use std::arch::x86_64::*;

    /// Proof that the processor has AVX2 and the bit instructions that came with it.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(());

    impl Avx2 {
        /// The proof, if it can be had.
        pub fn detect() -> Option<Self> {
            let found = is_x86_feature_detected!("avx2")
                && is_x86_feature_detected!("bmi1")
                && is_x86_feature_detected!("bmi2")
                && is_x86_feature_detected!("lzcnt")
                && is_x86_feature_detected!("popcnt");
            found.then_some(Avx2(()))
        }

        /// Nearest hit.
        #[inline(always)]
        pub fn closest(self, tree: &Tree, ray: &Ray) -> Option<Hit> {
            // SAFETY: `self` proves that the processor has what the function enables.
            unsafe { closest_avx2(tree, ray) }
        }

        /// Whether there is a hit.
        #[inline(always)]
        pub fn occluded(self, tree: &Tree, ray: &Ray) -> bool {
            // SAFETY: `self` proves that the processor has what the function enables.
            unsafe { occluded_avx2(tree, ray) }
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn closest_avx2(tree: &Tree, ray: &Ray) -> Option<Hit> {
        traverse::closest::<Avx2Kernel>(tree, ray)
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn occluded_avx2(tree: &Tree, ray: &Ray) -> bool {
        traverse::occluded::<Avx2Kernel>(tree, ray)
    }

    /// Private to the two functions above. Its methods are always inlined into them, where AVX2 is enabled.
    struct Avx2Kernel;

    impl Kernel for Avx2Kernel {
        #[inline(always)]
        fn boxes(query: &Query, node: &Node8) -> (u32, Near) {
            // SAFETY: reached only through `closest_avx2` and `occluded_avx2`, which have AVX2 enabled.
            unsafe { boxes(query, node) }
        }

        #[inline(always)]
        fn triangles(query: &Query, pack: &Tri4, hits: &mut TriHits) -> u32 {
            // SAFETY: reached only through `closest_avx2` and `occluded_avx2`, which have AVX2 enabled.
            unsafe { triangles(query, pack, hits) }
        }

        #[inline(always)]
        fn prefetch(tree: &Tree, child: Child) {
            let (start, lines) = if child.is_node() {
                (tree.nodes.as_ptr().wrapping_add(child.index()) as *const i8, 4)
            } else {
                (tree.tris.as_ptr().wrapping_add(child.index()) as *const i8, 3)
            };
            for line in 0..lines {
                // SAFETY: a prefetch does not access memory in the sense of the language; any address is allowed.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(64 * line)) };
            }
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn boxes(query: &Query, node: &Node8) -> (u32, Near) {
        let row = |index: usize| {
            debug_assert!(index < 6);
            // SAFETY: `Query::near` holds 2 axis + (0 or 1) and so stays below 6 with its last bit flipped as well. Rows
            // are 32-byte aligned: a node is, and they are its first 6 x 32 bytes.
            unsafe { _mm256_load_ps(node.bounds.as_ptr().add(index) as *const f32) }
        };
        let mut near = _mm256_set1_ps(query.tmin);
        let mut far = _mm256_set1_ps(query.tmax_far());
        for axis in 0..3 {
            let o = _mm256_set1_ps(query.o[axis]);
            let to_near = _mm256_sub_ps(row(query.near[axis]), o);
            let to_far = _mm256_sub_ps(row(query.near[axis] ^ 1), o);
            near = _mm256_max_ps(_mm256_mul_ps(to_near, _mm256_set1_ps(query.inv[axis])), near);
            far = _mm256_min_ps(_mm256_mul_ps(to_far, _mm256_set1_ps(query.inv_far[axis])), far);
        }
        let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far));
        let mut out = Near([0.0; 8]);
        // SAFETY: `Near` is eight floats, aligned to 32 bytes.
        unsafe { _mm256_store_ps(out.0.as_mut_ptr(), near) };
        (mask as u32, out)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn triangles(query: &Query, pack: &Tri4, hits: &mut TriHits) -> u32 {
        let vertex = |v: usize, axis: usize| {
            debug_assert!(v < 3 && axis < 3);
            // SAFETY: v and axis (0 to 2, also where it comes from `Query::k`) give a row below 9. Rows are 16-byte
            // aligned: a pack is, and they are its first 9 x 16 bytes.
            unsafe { _mm_load_ps(pack.v.as_ptr().add(3 * v + axis) as *const f32) }
        };
        let [kx, ky, kz] = query.k;
        let [ox, oy, oz] = [kx, ky, kz].map(|k| _mm_set1_ps(query.o[k]));
        let [sx, sy] = query.shear.map(|s| _mm_set1_ps(s));
        let sheared = |v: usize| {
            let z = _mm_sub_ps(vertex(v, kz), oz);
            let x = _mm_sub_ps(_mm_sub_ps(vertex(v, kx), ox), _mm_mul_ps(sx, z));
            let y = _mm_sub_ps(_mm_sub_ps(vertex(v, ky), oy), _mm_mul_ps(sy, z));
            (x, y)
        };
        let ((ax, ay), (bx, by), (cx, cy)) = (sheared(0), sheared(1), sheared(2));
        let cross = |px, qy, py, qx| _mm_sub_ps(_mm_mul_ps(px, qy), _mm_mul_ps(py, qx));
        let a = cross(cx, by, cy, bx);
        let b = cross(ax, cy, ay, cx);
        let c = cross(bx, ay, by, ax);
        let zero = _mm_setzero_ps();
        let all_above = _mm_cmp_ps::<_CMP_GE_OQ>(_mm_min_ps(_mm_min_ps(a, b), c), zero);
        let all_below = _mm_cmp_ps::<_CMP_LE_OQ>(_mm_max_ps(_mm_max_ps(a, b), c), zero);
        let inside = _mm_or_ps(all_above, all_below);
        if _mm_movemask_ps(inside) == 0 {
            return 0;
        }
        let det = _mm_add_ps(_mm_add_ps(a, b), c);
        let inside = _mm_and_ps(inside, _mm_cmp_ps::<_CMP_NEQ_OQ>(det, zero));
        let e1 = [0, 1, 2].map(|k| _mm_sub_ps(vertex(1, k), vertex(0, k)));
        let e2 = [0, 1, 2].map(|k| _mm_sub_ps(vertex(2, k), vertex(0, k)));
        let n = [
            cross(e1[1], e2[2], e1[2], e2[1]),
            cross(e1[2], e2[0], e1[0], e2[2]),
            cross(e1[0], e2[1], e1[1], e2[0]),
        ];
        let from = [0, 1, 2].map(|k| _mm_sub_ps(vertex(0, k), _mm_set1_ps(query.o[k])));
        let dot = |v: [__m128; 3]| {
            let xy = _mm_add_ps(_mm_mul_ps(n[0], v[0]), _mm_mul_ps(n[1], v[1]));
            _mm_add_ps(xy, _mm_mul_ps(n[2], v[2]))
        };
        let t = _mm_div_ps(dot(from), dot(query.d.map(|d| _mm_set1_ps(d))));
        let after = _mm_cmp_ps::<_CMP_LE_OQ>(_mm_set1_ps(query.tmin), t);
        let before = _mm_cmp_ps::<_CMP_LE_OQ>(t, _mm_set1_ps(query.tmax));
        let mask = _mm_movemask_ps(_mm_and_ps(inside, _mm_and_ps(after, before))) as u32;
        if mask != 0 {
            let store = |to: &mut [f32; 4], v: __m128| {
                // SAFETY: four floats, no alignment needed.
                unsafe { _mm_storeu_ps(to.as_mut_ptr(), v) }
            };
            store(&mut hits.edge[0], a);
            store(&mut hits.edge[1], b);
            store(&mut hits.edge[2], c);
            store(&mut hits.det, det);
            store(&mut hits.t, t);
        }
        mask
    }
}
