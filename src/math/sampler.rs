//! Random numbers keyed by what they are for.
//!
//! Source: Owen-scrambled Sobol sequences, Burley 2020, "Practical Hash-based Owen Scrambling" (crate `sobol_burley`).
//! Every number is a pure function of (seed, stream, index, dimension): for camera paths the stream is the pixel
//! and the index the pass. Over passes the numbers of one stream and dimension fill the unit cube evenly.
//! Not handled: correlation between streams (pixels) is random, not blue noise.

use super::Vec2;

/// Groups of four dimensions taken from the Sobol sequence; later ones are hashed (plain Monte Carlo). The first groups
/// are the film and lens position and the first two path vertices: further down a path, stratification over passes is
/// lost in the noise of what came before, and a hash costs a tenth.
const SOBOL_GROUPS: u32 = 5;
/// Length of one sequence; indices beyond continue in a sequence with another scramble.
const SOBOL_LENGTH_LOG2: u32 = 16;
/// Groups of four dimensions that the sequence has.
const SOBOL_SETS_LOG2: u32 = 6;

/// Mixes two words into one (a 64-bit finaliser after Stafford, variant 13).
pub fn hash(a: u64, b: u64) -> u64 {
    let mut x = a ^ b.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The upper 53 bits of a word as a float in [0, 1).
pub fn unit_f64(x: u64) -> f64 {
    (x >> 11) as f64 * 2f64.powi(-53)
}

/// The upper 24 bits of a word as a float in [0, 1).
pub fn unit_f32(x: u64) -> f32 {
    two_units(x)[0]
}

/// The upper and the lower 24 of a word's upper 56 bits as floats in [0, 1).
fn two_units(x: u64) -> [f32; 2] {
    const SCALE: f32 = 1.0 / (1u64 << 24) as f32;
    [(x >> 40) as f32 * SCALE, ((x >> 8) & 0xff_ffff) as f32 * SCALE]
}

/// `u` with 24 more bits, hashed from all three numbers: 24 alone would resolve the bins of a table of 100,000 entries to 1
/// in 168 only, a bias of its probabilities.
pub fn refine(u: f32, other: Vec2) -> f64 {
    let key = (other.x.to_bits() as u64) << 32 | other.y.to_bits() as u64;
    let more = (hash(key, u.to_bits() as u64) >> 40) as f64;
    (u as f64 + more * 2f64.powi(-48)).min(1.0 - f64::EPSILON)
}

/// A stream of numbers in [0, 1): sample `index` of stream `stream`, four dimensions after the other.
#[derive(Clone, Debug)]
pub struct Sampler {
    key: u64,
    index: u32,
    scramble: u32,
    group: u32,
}

impl Sampler {
    /// Sample number `index` of the stream `stream` under `seed`, at its first group of dimensions.
    pub fn new(seed: u64, stream: u64, index: u64) -> Self {
        let block = hash(hash(seed, stream), index >> SOBOL_LENGTH_LOG2);
        Sampler {
            key: hash(block, index),
            index: (index & ((1 << SOBOL_LENGTH_LOG2) - 1)) as u32,
            scramble: block as u32,
            group: 0,
        }
    }

    /// The next four dimensions, each in [0, 1). Those of one group are well distributed together, the first two best of
    /// all (a (0,2)-sequence): take one group per decision (a light sample, a scattered direction), the point first.
    pub fn next_4d(&mut self) -> [f32; 4] {
        let group = self.group;
        self.group += 1;
        if group < SOBOL_GROUPS {
            return sobol_burley::sample_4d(self.index, group, self.scramble);
        }
        let [a, b] = two_units(hash(self.key, u64::from(2 * group)));
        let [c, d] = two_units(hash(self.key, u64::from(2 * group + 1)));
        [a, b, c, d]
    }

    /// The next group as a block of `count` points: those of all blocks of one stream and group, one block per index, are
    /// well distributed together, and each block by itself if `count` is a power of two.
    pub fn next_block(&mut self, count: u32) -> Block {
        let group = self.group;
        self.group += 1;
        let first = u64::from(self.index) * u64::from(count);
        // A group beyond the sequence's 64 continues in one with another scramble.
        let scramble = hash(u64::from(self.scramble), u64::from(group >> SOBOL_SETS_LOG2));
        Block { first, group: group & ((1 << SOBOL_SETS_LOG2) - 1), scramble }
    }

    /// The first two numbers of the next group.
    pub fn next_2d(&mut self) -> Vec2 {
        let [x, y, ..] = self.next_4d();
        Vec2::new(x, y)
    }
}

/// Points for one decision that is taken several times: of [`Sampler::next_block`].
#[derive(Clone, Copy, Debug)]
pub struct Block {
    first: u64,
    group: u32,
    scramble: u64,
}

impl Block {
    /// Point `i` of the block, each number in [0, 1).
    pub fn point(&self, i: u32) -> [f32; 4] {
        let index = self.first + u64::from(i);
        let scramble = hash(self.scramble, index >> SOBOL_LENGTH_LOG2) as u32;
        sobol_burley::sample_4d((index & ((1 << SOBOL_LENGTH_LOG2) - 1)) as u32, self.group, scramble)
    }

    /// The first two numbers of point `i`.
    pub fn point_2d(&self, i: u32) -> Vec2 {
        let [x, y, ..] = self.point(i);
        Vec2::new(x, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn same_key_same_numbers_other_key_other_numbers() {
        let draw = |mut s: Sampler| (0..100).map(|_| s.next_4d()).collect::<Vec<_>>();
        assert_eq!(draw(Sampler::new(1, 2, 3)), draw(Sampler::new(1, 2, 3)));
        for other in [Sampler::new(2, 2, 3), Sampler::new(1, 3, 3), Sampler::new(1, 2, 4), Sampler::new(1, 2, 65539)] {
            assert_ne!(draw(Sampler::new(1, 2, 3)), draw(other));
        }
    }

    #[test]
    fn numbers_lie_in_the_half_open_interval_and_average_one_half() {
        for index in [0u64, 65535, 65536, 1 << 40] {
            let mut s = Sampler::new(9, 8, index);
            assert!((0..200).all(|_| s.next_4d().iter().all(|u| (0.0..1.0).contains(u))));
        }
        // A (0,1)-sequence averages closely; the hashed dimensions within 5 standard errors of a uniform variable.
        for (group, tolerance) in [(0, 1e-3), (SOBOL_GROUPS + 2, 5.0 * 0.2887 / 64.0)] {
            let value = |i| {
                let mut s = Sampler::new(5, 7, i);
                (0..group).for_each(|_| _ = s.next_4d());
                s.next_4d()
            };
            let sum = (0..4096).map(value).fold([0.0; 4], |a, b| std::array::from_fn(|k| a[k] + f64::from(b[k])));
            assert!(sum.iter().all(|s| (s / 4096.0 - 0.5).abs() < tolerance), "group {group}: {sum:?}");
        }
    }

    #[test]
    fn blocks_are_nets_alone_and_together() {
        let filled = |points: &mut dyn Iterator<Item = Vec2>, n: usize| {
            let mut seen = vec![false; n * n];
            points.for_each(|p| seen[(p.x * n as f32) as usize * n + (p.y * n as f32) as usize] = true);
            seen.iter().filter(|s| **s).count()
        };
        for group in [0, 2, 70] {
            let block = |index: u64| {
                let mut s = Sampler::new(3, 11, index);
                (0..group).for_each(|_| _ = s.next_4d());
                s.next_block(16)
            };
            // Also where the sequence has been used up and continues in another.
            for index in [0, 5, 4095, 4096, 70_000] {
                assert_eq!(filled(&mut (0..16).map(|k| block(index).point_2d(k)), 4), 16, "{group} {index}");
            }
            // Only the first two dimensions of Sobol's sequence are a net together.
            let together = filled(&mut (0..256).map(|i| block(i / 16).point_2d((i % 16) as u32)), 16);
            assert!(together >= if group == 0 { 256 } else { 100 }, "{group}: {together}");
            assert_ne!(block(0).point(0), block(4096).point(0));
        }
        let points = |mut s: Sampler| (s.next_block(4).point(1), s.next_block(4).point(1));
        assert_ne!(points(Sampler::new(3, 11, 0)).0, points(Sampler::new(3, 11, 0)).1);
    }

    #[test]
    fn the_first_two_dimensions_are_a_net() {
        let mut seen = [false; 256];
        for i in 0..256 {
            let [x, y, ..] = Sampler::new(3, 11, i).next_4d();
            seen[(x * 16.0) as usize * 16 + (y * 16.0) as usize] = true;
        }
        // 256 random points would fill 162 of the 256 cells.
        assert!(seen.iter().all(|&s| s));
    }
}
