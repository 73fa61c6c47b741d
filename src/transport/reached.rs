//! What a chain of rays has reached: a surfel, and how many surfaces it met on the way, in 4 bytes.
//!
//! Where paths have a greatest length, a mirror or a pane on the way of a gather ray takes one of its segments, and the light of the surfel at
//! the end has so many less to come by (`surfel_light.rs`).

use super::cache_file::stored;

/// Bits of the number of surfaces.
const BITS: u32 = 4;
const MOST: u32 = (1 << BITS) - 1;

/// A surfel at the end of a chain of rays, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reached {
    packed: u32,
}

stored!(Reached { packed });

impl Reached {
    /// Nothing: the ray was absorbed or left the scene.
    pub const NONE: Reached = Reached { packed: u32::MAX };

    /// Surfel number `surfel` (below 2^28) by a chain of so many segments, one at least; more than 16 count as 16.
    pub fn new(surfel: u32, segments: u32) -> Self {
        Reached { packed: surfel << BITS | (segments.max(1) - 1).min(MOST) }
    }

    /// Index of the surfel; of none, beyond all there can be.
    pub fn surfel(self) -> usize {
        (self.packed >> BITS) as usize
    }

    /// Surfaces met on the way: segments but for one.
    pub fn detour(self) -> usize {
        (self.packed & MOST) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfel_and_way_are_told_apart() {
        for (surfel, segments, detour) in [(0, 1, 0), (7, 3, 2), (123_456_789, 16, 15), (5, 40, 15), (5, 0, 0)] {
            let reached = Reached::new(surfel, segments);
            assert_eq!((reached.surfel(), reached.detour()), (surfel as usize, detour));
        }
        assert!(Reached::NONE.surfel() >= (1 << 28) - 1);
    }
}
