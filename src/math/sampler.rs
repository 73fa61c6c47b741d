//! Random numbers keyed by what they are for.
//!
//! Source: Owen-scrambled Sobol sequences, Burley 2020, "Practical Hash-based Owen Scrambling" (crate `sobol_burley`).
//! Every number is a pure function of (seed, stream, index, dimension): for camera paths the stream is the pixel
//! and the index the pass. Over passes the numbers of one stream and dimension fill the unit cube evenly.
//! Not handled: correlation between streams (pixels) is random, not blue noise.

use super::Vec2;

/// Dimensions of the Sobol sequence in use; later ones are hashed (plain Monte Carlo).
const SOBOL_DIMENSIONS: u32 = 64;
/// Length of one sequence; indices beyond continue in a sequence with another scramble.
const SOBOL_LENGTH_LOG2: u32 = 16;

/// Mixes two words into one (a 64-bit finaliser after Stafford, variant 13).
pub fn hash(a: u64, b: u64) -> u64 {
    let mut x = a ^ b.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The upper 24 bits of a word as a float in [0, 1).
pub fn unit_f32(x: u64) -> f32 {
    (x >> 40) as f32 * (1.0 / (1u64 << 24) as f32)
}

/// A stream of numbers in [0, 1): sample `index` of stream `stream`, one dimension after the other.
#[derive(Clone, Debug)]
pub struct Sampler {
    key: u64,
    index: u32,
    scramble: u32,
    dimension: u32,
    cache: [f32; 4],
}

impl Sampler {
    /// Sample number `index` of the stream `stream` under `seed`, at dimension 0.
    pub fn new(seed: u64, stream: u64, index: u64) -> Self {
        let block = hash(hash(seed, stream), index >> SOBOL_LENGTH_LOG2);
        Sampler {
            key: hash(block, index),
            index: (index & ((1 << SOBOL_LENGTH_LOG2) - 1)) as u32,
            scramble: block as u32,
            dimension: 0,
            cache: [0.0; 4],
        }
    }

    /// The next dimension, in [0, 1).
    pub fn next_1d(&mut self) -> f32 {
        let d = self.dimension;
        self.dimension += 1;
        if d >= SOBOL_DIMENSIONS {
            return unit_f32(hash(self.key, d as u64));
        }
        if d.is_multiple_of(4) {
            self.cache = sobol_burley::sample_4d(self.index, d / 4, self.scramble);
        }
        self.cache[(d % 4) as usize]
    }

    /// The next two dimensions; they never straddle a group of four, so that the pair is well distributed.
    pub fn next_2d(&mut self) -> Vec2 {
        if self.dimension % 4 == 3 {
            self.dimension += 1;
        }
        let x = self.next_1d();
        Vec2::new(x, self.next_1d())
    }

    /// Skips to the next group of four dimensions: call at the start of a path vertex, so that the meaning of a
    /// dimension does not depend on how many numbers the vertex before has used.
    pub fn start_group(&mut self) {
        self.dimension = self.dimension.next_multiple_of(4);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn same_key_same_numbers_other_key_other_numbers() {
        let draw = |mut s: Sampler| (0..100).map(|_| s.next_1d()).collect::<Vec<_>>();
        assert_eq!(draw(Sampler::new(1, 2, 3)), draw(Sampler::new(1, 2, 3)));
        for other in [Sampler::new(2, 2, 3), Sampler::new(1, 3, 3), Sampler::new(1, 2, 4), Sampler::new(1, 2, 65539)] {
            assert_ne!(draw(Sampler::new(1, 2, 3)), draw(other));
        }
    }

    #[test]
    fn numbers_lie_in_the_half_open_interval_and_average_one_half() {
        for index in [0u64, 65535, 65536, 1 << 40] {
            let mut s = Sampler::new(9, 8, index);
            assert!((0..200).all(|_| (0.0..1.0).contains(&s.next_1d())));
        }
        let mean = (0..4096).map(|i| Sampler::new(5, 7, i).next_1d() as f64).sum::<f64>() / 4096.0;
        assert!((mean - 0.5).abs() < 1e-3, "{mean}: 4096 points of a (0,1)-sequence average to one half closely");
    }

    #[test]
    fn pairs_are_stratified() {
        let mut seen = [false; 256];
        for i in 0..256 {
            let p = Sampler::new(3, 11, i).next_2d();
            seen[(p.x * 16.0) as usize * 16 + (p.y * 16.0) as usize] = true;
        }
        assert!(seen.iter().filter(|&&s| s).count() == 256, "a (0,2)-sequence fills each of 16 x 16 cells");
    }
}
