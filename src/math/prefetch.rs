//! A hint to the processor that something will be read soon, so that several reads from far memory go on at the same time.

/// Bytes of a cache line.
const LINE: usize = 64;

/// Hints that all of `what` will be read.
#[inline(always)]
pub fn prefetch<T>(what: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let start = std::ptr::from_ref(what).cast::<i8>();
        // The last byte: what does not begin with a line ends in one more.
        for line in (0..size_of::<T>()).step_by(LINE).chain([size_of::<T>().saturating_sub(1)]) {
            // SAFETY: a prefetch does not access memory in the sense of the language; any address is allowed.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = what;
}
