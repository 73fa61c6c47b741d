//! The kernel for x86 processors with AVX2, chosen at run time.
//!
//! Same operations in the same order as `portable`, eight boxes or four triangles at a time. No fused multiply-add: the
//! results are equal bit for bit.

use super::footprint::{self, Beam, Visitor};
use super::layout::Tree;
use super::{Hit, Ray};

#[cfg(target_arch = "x86_64")]
pub(super) use x86::Avx2;

#[cfg(not(target_arch = "x86_64"))]
pub(super) use fallback::Avx2;

#[cfg(not(target_arch = "x86_64"))]
mod fallback {
    use super::super::portable;
    use super::{Beam, Hit, Ray, Tree, Visitor, footprint};

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

        pub fn walk(self, tree: &Tree, beam: &Beam, visitor: &mut impl Visitor) {
            footprint::walk::<footprint::Portable>(tree, beam, visitor);
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::super::layout::{Child, Node8, Tri4, View};
    use super::super::traverse::{self, Kernel, Near, Query, TriHits};
    use super::footprint::{BeamKernel, Sides, Slabs};
    use super::{Beam, Hit, Ray, Tree, Visitor, footprint};
    use crate::math::Vec3;
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

        /// Whatever a beam may meet.
        #[inline(always)]
        pub fn walk(self, tree: &Tree, beam: &Beam, visitor: &mut impl Visitor) {
            // SAFETY: `self` proves that the processor has what the function enables.
            unsafe { walk_avx2(tree, beam, visitor) }
        }
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn walk_avx2(tree: &Tree, beam: &Beam, visitor: &mut impl Visitor) {
        footprint::walk::<Avx2Kernel>(tree, beam, visitor);
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn closest_avx2(tree: &Tree, ray: &Ray) -> Option<Hit> {
        traverse::closest::<Avx2Kernel>(tree, ray)
    }

    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    fn occluded_avx2(tree: &Tree, ray: &Ray) -> bool {
        traverse::occluded::<Avx2Kernel>(tree, ray)
    }

    /// Private to the three functions above. Its methods are always inlined into them, where AVX2 is enabled.
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
        fn prefetch(tree: View, child: Child) {
            let start = if child.is_node() {
                tree.nodes.as_ptr().wrapping_add(child.index()) as *const i8
            } else {
                tree.tris.as_ptr().wrapping_add(child.index()) as *const i8
            };
            // As many lines as a node has. A pack has two; the next one often is wanted as well.
            for line in [0, 64, 128, 192] {
                // SAFETY: a prefetch does not access memory in the sense of the language; any address is allowed.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(line)) };
            }
        }
    }

    impl BeamKernel for Avx2Kernel {
        #[inline(always)]
        fn boxes(slabs: &Slabs, node: &Node8, limit: f32) -> (u32, Near) {
            // SAFETY: reached only through `walk_avx2`, which has AVX2 enabled.
            unsafe { beam_boxes(slabs, node, limit) }
        }

        #[inline(always)]
        fn within(sides: &Sides, node: &Node8) -> u32 {
            // SAFETY: reached only through `walk_avx2`, which has AVX2 enabled.
            unsafe { beam_within(sides, node) }
        }

        #[inline(always)]
        fn lanes(sides: &Sides, pack: &Tri4) -> u32 {
            // SAFETY: reached only through `walk_avx2`, which has AVX2 enabled.
            unsafe { beam_lanes(sides, pack) }
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn beam_boxes(slabs: &Slabs, node: &Node8, limit: f32) -> (u32, Near) {
        let row = |index: usize| {
            debug_assert!(index < 6);
            // SAFETY: 2 axis + (0 or 1) is below 6. Rows are 32-byte aligned: a node is, and they are its first 6 x 32 bytes.
            unsafe { _mm256_load_ps(node.bounds.as_ptr().add(index) as *const f32) }
        };
        let mut near = _mm256_set1_ps(slabs.tmin);
        let mut far = _mm256_set1_ps(limit);
        for axis in 0..3 {
            let [o_max, o_min] = slabs.o[axis];
            let [e0, e1] = slabs.enter[axis];
            let (exit, leave) = slabs.leave[axis];
            let lo = _mm256_sub_ps(row(2 * axis), _mm256_set1_ps(o_max));
            let hi = _mm256_sub_ps(row(2 * axis + 1), _mm256_set1_ps(o_min));
            near = _mm256_max_ps(_mm256_mul_ps(lo, _mm256_set1_ps(e0)), near);
            near = _mm256_max_ps(_mm256_mul_ps(hi, _mm256_set1_ps(e1)), near);
            let face = if exit == 0 { lo } else { hi };
            far = _mm256_min_ps(_mm256_mul_ps(face, _mm256_set1_ps(leave)), far);
        }
        let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far));
        let mut out = Near([0.0; 8]);
        // SAFETY: `Near` is eight floats, aligned to 32 bytes.
        unsafe { _mm256_store_ps(out.0.as_mut_ptr(), near) };
        (mask as u32, out)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn beam_within(sides: &Sides, node: &Node8) -> u32 {
        let row = |index: usize, n: f32, o: f32| {
            debug_assert!(index < 6);
            // SAFETY: 2 axis + (0 or 1) is below 6. Rows are 32-byte aligned: a node is, and they are its first 6 x 32 bytes.
            let face = unsafe { _mm256_load_ps(node.bounds.as_ptr().add(index) as *const f32) };
            _mm256_mul_ps(_mm256_set1_ps(n), _mm256_sub_ps(face, _mm256_set1_ps(o)))
        };
        let o = sides.o;
        let slots = |n: Vec3, slack: f32| {
            let [x, y, z] = [
                row(usize::from(n.x > 0.0), n.x, o.x),
                row(2 + usize::from(n.y > 0.0), n.y, o.y),
                row(4 + usize::from(n.z > 0.0), n.z, o.z),
            ];
            let sum = _mm256_add_ps(_mm256_add_ps(x, y), z);
            _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(sum, _mm256_set1_ps(-slack))) as u32
        };
        let mut kept = 0xff;
        for k in 0..4 {
            let waist = match &sides.waist {
                Some((n, slack)) => slots(n[k], slack[k]),
                None => 0,
            };
            kept &= slots(sides.n[k], sides.slack[k]) | waist;
        }
        kept
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn beam_lanes(sides: &Sides, pack: &Tri4) -> u32 {
        let row = |axis: usize, o: f32| {
            // SAFETY: there are three rows, 32-byte aligned: a pack is, and they are its first 3 x 32 bytes.
            let x = unsafe { _mm256_load_ps(pack.points.as_ptr().add(axis) as *const f32) };
            _mm256_sub_ps(x, _mm256_set1_ps(o))
        };
        let [x, y, z] = [row(0, sides.o.x), row(1, sides.o.y), row(2, sides.o.z)];
        // SAFETY: twelve bytes of corners are followed by four of the shape: 16 bytes of the pack.
        let corners = unsafe { _mm_loadu_si128(pack.corners.as_ptr() as *const __m128i) };
        // Columns as bits; the three vertices of a lane are four bytes apart.
        let bits = _mm_set1_epi64x(0x80_40_20_10_08_04_02_01_u64 as i64);
        let of_vertices = _mm_shuffle_epi8(bits, _mm_and_si128(corners, _mm_set1_epi8(7)));
        let two = _mm_or_si128(of_vertices, _mm_srli_si128::<4>(of_vertices));
        let of_lanes = _mm_or_si128(two, _mm_srli_si128::<8>(of_vertices));
        let along = |n: Vec3| {
            let xy = _mm256_add_ps(_mm256_mul_ps(_mm256_set1_ps(n.x), x), _mm256_mul_ps(_mm256_set1_ps(n.y), y));
            _mm256_add_ps(xy, _mm256_mul_ps(_mm256_set1_ps(n.z), z))
        };
        let at_least =
            |n: Vec3, least: f32| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_GE_OQ>(along(n), _mm256_set1_ps(least)));
        // Lanes without a vertex among the columns inside.
        let without = |inside: i32| {
            let of_side = _mm_and_si128(of_lanes, _mm_set1_epi8(inside as i8));
            _mm_cmpeq_epi8(of_side, _mm_setzero_si128())
        };
        let mut out = _mm_setzero_si128();
        for k in 0..4 {
            let mut inside = at_least(sides.n[k], -sides.slack[k]);
            if let Some((n, slack)) = &sides.waist {
                inside |= at_least(n[k], -slack[k]);
            }
            out = _mm_or_si128(out, without(inside));
        }
        let outside = _mm_movemask_epi8(out) as u32;
        footprint::used_lanes(pack) & !outside
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

    /// Macros in place of closures, and no `target_feature` of its own: so that it is always inlined.
    ///
    /// Vertices are sheared before they are dealt out to the lanes. The upper half of a register works on other edges
    /// than the lower one.
    ///
    /// # Safety
    /// To be inlined into functions with AVX2 only.
    #[inline(always)]
    unsafe fn triangles(query: &Query, pack: &Tri4, hits: &mut TriHits) -> u32 {
        // SAFETY: the processor has AVX2, says the caller. Row loads: an axis (also where it comes from `Query::k`) is 0 to 2, so
        // there is such a row; rows are 32-byte aligned, as a pack is and they are its first 3 x 32 bytes. The two loads
        // of corners read bytes 0 to 7 and 4 to 11 of 12. Stores go to as many floats as they write (edges 0 and 1 are
        // adjacent), without need for alignment. A permutation takes the lowest three bits of an index only.
        unsafe {
            macro_rules! row {
                ($axis:expr) => {{
                    debug_assert!($axis < 3);
                    _mm256_load_ps(pack.points.as_ptr().add($axis) as *const f32)
                }};
            }
            macro_rules! low {
                ($v:expr) => {
                    _mm256_castps256_ps128($v)
                };
            }
            macro_rules! high {
                ($v:expr) => {
                    _mm256_extractf128_ps::<1>($v)
                };
            }
            macro_rules! cross {
                ($px:expr, $qy:expr, $py:expr, $qx:expr) => {
                    _mm_sub_ps(_mm_mul_ps($px, $qy), _mm_mul_ps($py, $qx))
                };
            }
            macro_rules! dot {
                ($a:expr, $x:expr, $y:expr, $z:expr) => {{
                    let xy = _mm_add_ps(_mm_mul_ps($a.0, $x), _mm_mul_ps($a.1, $y));
                    _mm_add_ps(xy, _mm_mul_ps($a.2, $z))
                }};
            }
            let corners = pack.corners.as_ptr() as *const u8;
            let bc = _mm256_cvtepu8_epi32(_mm_loadl_epi64(corners as *const __m128i));
            let ca = _mm256_cvtepu8_epi32(_mm_loadl_epi64(corners.add(4) as *const __m128i));

            let [kx, ky, kz] = query.k;
            let z = _mm256_sub_ps(row!(kz), _mm256_set1_ps(query.o_k[2]));
            let x = _mm256_sub_ps(row!(kx), _mm256_set1_ps(query.o_k[0]));
            let y = _mm256_sub_ps(row!(ky), _mm256_set1_ps(query.o_k[1]));
            let x = _mm256_sub_ps(x, _mm256_mul_ps(_mm256_set1_ps(query.shear[0]), z));
            let y = _mm256_sub_ps(y, _mm256_mul_ps(_mm256_set1_ps(query.shear[1]), z));
            let (bc_x, bc_y) = (_mm256_permutevar8x32_ps(x, bc), _mm256_permutevar8x32_ps(y, bc));
            let (ca_x, ca_y) = (_mm256_permutevar8x32_ps(x, ca), _mm256_permutevar8x32_ps(y, ca));
            let ab = _mm256_sub_ps(_mm256_mul_ps(ca_x, bc_y), _mm256_mul_ps(ca_y, bc_x));
            let (a, b) = (low!(ab), high!(ab));
            let c = cross!(low!(bc_x), high!(ca_y), low!(bc_y), high!(ca_x));
            let zero = _mm_setzero_ps();
            let all_above = _mm_cmp_ps::<_CMP_GE_OQ>(_mm_min_ps(_mm_min_ps(a, b), c), zero);
            let all_below = _mm_cmp_ps::<_CMP_LE_OQ>(_mm_max_ps(_mm_max_ps(a, b), c), zero);
            let det = _mm_add_ps(_mm_add_ps(a, b), c);
            let area = _mm_cmp_ps::<_CMP_NEQ_OQ>(det, zero);
            let inside = _mm_and_ps(_mm_or_ps(all_above, all_below), area);
            if _mm_movemask_ps(inside) == 0 {
                return 0;
            }
            let a_only = _mm256_castsi256_ps(ca);
            let aa = _mm256_castps_si256(_mm256_permute2f128_ps::<0x11>(a_only, a_only));
            // First vertices, and edges from there to the second and third ones.
            macro_rules! edges {
                ($axis:expr) => {{
                    let first = _mm256_permutevar8x32_ps(row!($axis), aa);
                    let edges = _mm256_sub_ps(_mm256_permutevar8x32_ps(row!($axis), bc), first);
                    (low!(first), low!(edges), high!(edges))
                }};
            }
            let ((ax, e1x, e2x), (ay, e1y, e2y), (az, e1z, e2z)) = (edges!(0), edges!(1), edges!(2));
            let n = (cross!(e1y, e2z, e1z, e2y), cross!(e1z, e2x, e1x, e2z), cross!(e1x, e2y, e1y, e2x));
            macro_rules! from {
                ($a:expr, $axis:expr) => {
                    _mm_sub_ps($a, _mm_set1_ps(query.o[$axis]))
                };
            }
            let [dx, dy, dz] = query.d;
            let num = dot!(n, from!(ax, 0), from!(ay, 1), from!(az, 2));
            let den = dot!(n, _mm_set1_ps(dx), _mm_set1_ps(dy), _mm_set1_ps(dz));
            let t = _mm_div_ps(num, den);
            let after = _mm_cmp_ps::<_CMP_LE_OQ>(_mm_set1_ps(query.tmin), t);
            let before = _mm_cmp_ps::<_CMP_LE_OQ>(t, _mm_set1_ps(query.tmax));
            let mask = _mm_movemask_ps(_mm_and_ps(inside, _mm_and_ps(after, before))) as u32;
            if mask != 0 {
                _mm256_storeu_ps(hits.edge.as_mut_ptr() as *mut f32, ab);
                _mm_storeu_ps(hits.edge[2].as_mut_ptr(), c);
                _mm_storeu_ps(hits.det.as_mut_ptr(), det);
                _mm_storeu_ps(hits.t.as_mut_ptr(), t);
            }
            mask
        }
    }
}
