//! Numbers of eight photons or lights side by side, and the arithmetic on them by the vector units there are.
//!
//! [`Wide`] has two implementations: pairs of four lanes, which any processor runs, and AVX2's eight. Each operation does the same to each
//! lane in both, without fused multiply-add: the results are equal bit for bit. An algorithm is written once, for any `W: Wide`, inlined
//! into one function for each ([`super::photon_lanes`], `strategies::joint`); without closures, which would not be compiled for its vector units.
//! Verified by `tests/lanes.rs`: the same bits by both.

use crate::math::{Mat4, Vec3, Vec4};

/// Lanes.
pub const WIDTH: usize = 8;

/// A number of each of eight.
pub type Eight = [Vec4; 2];

/// Eight times the same.
pub const fn all(x: f32) -> Eight {
    [Vec4::splat(x); 2]
}

/// Eight numbers in registers.
pub trait Wide: Copy {
    /// Of each lane, whether something holds.
    type Mask: Copy;
    /// From memory.
    fn load(v: &Eight) -> Self;
    /// To memory.
    fn store(self) -> Eight;
    /// The same in each lane.
    fn splat(x: f32) -> Self;
    /// Sum.
    fn plus(self, other: Self) -> Self;
    /// Difference.
    fn minus(self, other: Self) -> Self;
    /// Product.
    fn times(self, other: Self) -> Self;
    /// Quotient.
    fn over(self, other: Self) -> Self;
    /// Square root.
    fn root(self) -> Self;
    /// The larger number; where one is NaN, `other`.
    fn larger(self, other: Self) -> Self;
    /// The smaller number; where one is NaN, `other`.
    fn smaller(self, other: Self) -> Self;
    /// Without its sign.
    fn size(self) -> Self;
    /// self <= other; false for NaN.
    fn at_most(self, other: Self) -> Self::Mask;
    /// self < other; false for NaN.
    fn below(self, other: Self) -> Self::Mask;
    /// Whether both hold.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Lanes as bits.
    fn bits(mask: Self::Mask) -> u32;
    /// 0 where the mask does not hold.
    fn kept(self, mask: Self::Mask) -> Self;
}

/// The same vector in each lane.
#[inline(always)]
pub fn splat3<W: Wide>(v: Vec3) -> [W; 3] {
    [W::splat(v.x), W::splat(v.y), W::splat(v.z)]
}

/// Scalar products of vectors in memory with `v`.
#[inline(always)]
pub fn dot<W: Wide>(rows: &[Eight; 3], v: &[W; 3]) -> W {
    W::load(&rows[0]).times(v[0]).plus(W::load(&rows[1]).times(v[1])).plus(W::load(&rows[2]).times(v[2]))
}

/// Eight vectors of four numbers as four times eight numbers.
#[inline(always)]
pub fn transposed(rows: &[Vec4; WIDTH]) -> [Eight; 4] {
    let of = |k: usize| Mat4::from_cols(rows[k], rows[k + 1], rows[k + 2], rows[k + 3]).transpose();
    let [a, b] = [of(0), of(4)];
    [[a.x_axis, b.x_axis], [a.y_axis, b.y_axis], [a.z_axis, b.z_axis], [a.w_axis, b.w_axis]]
}

/// Eight numbers of an array.
#[inline(always)]
pub fn lanes(v: &[f32; WIDTH]) -> Eight {
    [Vec4::new(v[0], v[1], v[2], v[3]), Vec4::new(v[4], v[5], v[6], v[7])]
}

/// Sum of all lanes.
pub fn total([a, b]: Eight) -> f32 {
    (a + b).to_array().iter().sum()
}

impl Wide for Eight {
    type Mask = [glam::BVec4A; 2];

    #[inline(always)]
    fn load(v: &Eight) -> Self {
        *v
    }

    #[inline(always)]
    fn store(self) -> Eight {
        self
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        all(x)
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        [self[0] + other[0], self[1] + other[1]]
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        [self[0] - other[0], self[1] - other[1]]
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        [self[0] * other[0], self[1] * other[1]]
    }

    #[inline(always)]
    fn over(self, other: Self) -> Self {
        [self[0] / other[0], self[1] / other[1]]
    }

    #[inline(always)]
    fn root(self) -> Self {
        [self[0].sqrt(), self[1].sqrt()]
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        let of = |a: Vec4, b: Vec4| Vec4::select(a.cmpgt(b), a, b);
        [of(self[0], other[0]), of(self[1], other[1])]
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        let of = |a: Vec4, b: Vec4| Vec4::select(a.cmplt(b), a, b);
        [of(self[0], other[0]), of(self[1], other[1])]
    }

    #[inline(always)]
    fn size(self) -> Self {
        [self[0].abs(), self[1].abs()]
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Self::Mask {
        [self[0].cmple(other[0]), self[1].cmple(other[1])]
    }

    #[inline(always)]
    fn below(self, other: Self) -> Self::Mask {
        [self[0].cmplt(other[0]), self[1].cmplt(other[1])]
    }

    #[inline(always)]
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        [a[0] & b[0], a[1] & b[1]]
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u32 {
        mask[0].bitmask() | mask[1].bitmask() << 4
    }

    #[inline(always)]
    fn kept(self, mask: Self::Mask) -> Self {
        [Vec4::select(mask[0], self[0], Vec4::ZERO), Vec4::select(mask[1], self[1], Vec4::ZERO)]
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::Avx2;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Eight, Wide};
    use std::arch::x86_64::*;

    /// Eight lanes of AVX2. To be used only in functions that enable it: what is here is always inlined into them.
    #[derive(Clone, Copy, Debug)]
    pub(in crate::transport) struct Avx2(__m256);

    // SAFETY of all that follows: callers have AVX2 enabled, and so run where it was detected. Memory is read and written through
    // references to as many numbers, at any alignment.
    impl Wide for Avx2 {
        type Mask = Avx2;

        #[inline(always)]
        fn load(v: &Eight) -> Self {
            Avx2(unsafe { _mm256_loadu_ps(std::ptr::from_ref(v).cast()) })
        }

        #[inline(always)]
        fn store(self) -> Eight {
            let mut v = super::all(0.0);
            unsafe { _mm256_storeu_ps(std::ptr::from_mut(&mut v).cast(), self.0) };
            v
        }

        #[inline(always)]
        fn splat(x: f32) -> Self {
            Avx2(unsafe { _mm256_set1_ps(x) })
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_add_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_sub_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn times(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_mul_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn over(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_div_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn root(self) -> Self {
            Avx2(unsafe { _mm256_sqrt_ps(self.0) })
        }

        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_max_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn smaller(self, other: Self) -> Self {
            Avx2(unsafe { _mm256_min_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn size(self) -> Self {
            Avx2(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
        }

        #[inline(always)]
        fn at_most(self, other: Self) -> Avx2 {
            Avx2(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
        }

        #[inline(always)]
        fn below(self, other: Self) -> Avx2 {
            Avx2(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
        }

        #[inline(always)]
        fn both(a: Avx2, b: Avx2) -> Avx2 {
            Avx2(unsafe { _mm256_and_ps(a.0, b.0) })
        }

        #[inline(always)]
        fn bits(mask: Avx2) -> u32 {
            (unsafe { _mm256_movemask_ps(mask.0) }) as u32
        }

        #[inline(always)]
        fn kept(self, mask: Avx2) -> Self {
            Avx2(unsafe { _mm256_and_ps(self.0, mask.0) })
        }
    }
}
