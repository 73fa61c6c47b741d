//! Morton order: places that are near each other in space get numbers near each other.

use super::Vec3;

/// The bits of the whole parts of the coordinates, each in [0, 2^21), in turn: x lowest.
pub fn morton(v: Vec3) -> u64 {
    let [x, y, z] = v.to_array().map(|c| spread_bits(c as u64));
    x | (y << 1) | (z << 2)
}

/// Bits of `x` with two zeros between each.
fn spread_bits(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_take_turns() {
        for (x, y, z) in [(0u32, 0u32, 0u32), (1, 0, 0), (5, 3, 6), (0x1f_ffff, 0, 0x15_5555), (12_345, 678_901, 2)] {
            let key = morton(Vec3::new(x as f32, y as f32, z as f32));
            for (k, c) in [x, y, z].into_iter().enumerate() {
                let bits = (0..21).map(|b| (key >> (3 * b + k) & 1) << b).sum::<u64>();
                assert_eq!(bits, u64::from(c));
            }
        }
    }
}
