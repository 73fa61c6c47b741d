//! The transfer curve of sRGB (IEC 61966-2-1): 8- and 16-bit files hold it, the renderer works on linear values.

use std::sync::OnceLock;

/// Linear value of an encoded value in [0, 1].
pub fn decode(encoded: f32) -> f32 {
    // In f64: the power's error would otherwise differ between platforms' f32 routines.
    let c = encoded as f64;
    let linear = if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    linear as f32
}

/// Encoded value of a linear value; both are clamped to [0, 1], NaN becomes 0.
pub fn encode(linear: f32) -> f32 {
    let c = if linear > 0.0 { linear.min(1.0) as f64 } else { 0.0 };
    let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    encoded as f32
}

/// [`encode`] rounded to 8 bits.
pub fn encode_u8(linear: f32) -> u8 {
    (encode(linear) * 255.0 + 0.5) as u8
}

/// Linear values of all 8-bit codes: decoded if `srgb`, else code / 255.
pub fn table_u8(srgb: bool) -> &'static [f32; 256] {
    static TABLES: OnceLock<[[f32; 256]; 2]> = OnceLock::new();
    let tables = TABLES
        .get_or_init(|| [std::array::from_fn(|i| i as f32 / 255.0), std::array::from_fn(|i| decode(i as f32 / 255.0))]);
    &tables[srgb as usize]
}

/// Linear values of all 16-bit codes: decoded if `srgb`, else code / 65535.
pub fn table_u16(srgb: bool) -> &'static [f32] {
    static LINEAR: OnceLock<Vec<f32>> = OnceLock::new();
    static DECODED: OnceLock<Vec<f32>> = OnceLock::new();
    let unit = |i: u32| i as f32 / 65535.0;
    if srgb {
        DECODED.get_or_init(|| (0..65536).map(|i| decode(unit(i))).collect())
    } else {
        LINEAR.get_or_init(|| (0..65536).map(unit).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        for (encoded, linear) in [(0.0, 0.0), (1.0, 1.0), (0.5, 0.214_041_14), (0.04, 0.003_095_975)] {
            assert!((decode(encoded) - linear).abs() < 1e-7, "decode {encoded}");
            assert!((encode(linear) - encoded).abs() < 1e-6, "encode {linear}");
        }
    }

    #[test]
    fn every_8_bit_code_survives_the_way_there_and_back() {
        for code in 0..=255u8 {
            assert_eq!(encode_u8(table_u8(true)[code as usize]), code);
        }
        assert!(table_u8(true)[128] < 0.22 && table_u8(false)[128] > 0.5);
    }

    #[test]
    fn encoding_clamps_and_takes_no_offence_at_nan() {
        assert_eq!(encode_u8(f32::NAN), 0);
        assert_eq!(encode_u8(f32::INFINITY), 255);
        assert_eq!(encode_u8(f32::NEG_INFINITY), 0);
        assert_eq!(encode_u8(7.0), 255);
    }
}
