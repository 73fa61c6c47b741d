//! Arrays in large pages of memory, read-only once made.
//!
//! A walk over a big tree jumps about in tens of megabytes. With pages of 4 KiB most of its reads also miss the
//! processor's table of pages; with pages of 2 MiB hardly any does (diffuse rays over 1 M triangles: about 10 % faster). Linux gives such pages
//! to those who ask (`madvise`); Embree asks as well. Elsewhere, for small arrays, or where memory cannot be had so,
//! the array stays what it was.

use bytemuck::Pod;
use std::ops::Deref;

#[cfg(target_os = "linux")]
type Map = memmap2::Mmap;

/// Elsewhere there are no such pages.
#[cfg(not(target_os = "linux"))]
type Map = Vec<u8>;

/// A large page.
const PAGE: usize = 2 << 20;
/// Below this size an array is left where it is: bytes.
const SMALLEST: usize = PAGE;

/// A read-only array.
#[derive(Debug)]
pub(crate) struct Pages<T>(Memory<T>);

#[derive(Debug)]
enum Memory<T> {
    Heap(Vec<T>),
    /// The map, and how many of its bytes are elements.
    Large(Map, usize),
}

impl<T> Default for Pages<T> {
    fn default() -> Self {
        Pages(Memory::Heap(Vec::new()))
    }
}

impl<T: Pod> Pages<T> {
    /// Moves an array into large pages, if that pays.
    pub fn new(array: Vec<T>) -> Self {
        let size = size_of_val(array.as_slice());
        let large = if size < SMALLEST { None } else { large(bytemuck::cast_slice(&array)) };
        Pages(large.map_or_else(|| Memory::Heap(array), |map| Memory::Large(map, size)))
    }
}

impl<T: Pod> Deref for Pages<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Memory::Heap(array) => array,
            // The start of a page is aligned for any element.
            Memory::Large(map, size) => bytemuck::cast_slice(&map[..*size]),
        }
    }
}

#[cfg(target_os = "linux")]
fn large(bytes: &[u8]) -> Option<Map> {
    // Whole pages: the system puts such a map at the start of one.
    let mut map = memmap2::MmapMut::map_anon(bytes.len().next_multiple_of(PAGE)).ok()?;
    // Before the first access: pages are made then. If the system does not know the request, they are small.
    map.advise(memmap2::Advice::HugePage).ok();
    map[..bytes.len()].copy_from_slice(bytes);
    map.make_read_only().ok()
}

#[cfg(not(target_os = "linux"))]
fn large(_: &[u8]) -> Option<Map> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_small_and_large_arrays() {
        for count in [0, 1, 1000, SMALLEST / 8, SMALLEST / 4 + 12_345] {
            let array: Vec<u64> = (0..count as u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
            let pages = Pages::new(array.clone());
            assert!(*pages == *array, "{count} elements");
            let large = matches!(pages.0, Memory::Large(..));
            assert_eq!(
                large,
                cfg!(target_os = "linux") && size_of_val(array.as_slice()) >= SMALLEST,
                "{count} elements"
            );
        }
    }
}
