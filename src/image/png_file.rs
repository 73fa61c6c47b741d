//! Writing 8-bit sRGB PNG files, for looking at.

use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

use super::{ImageFileError, atomic, srgb};
use crate::math::Rgb;

/// Writes linear `pixels` (row 0 on top) times 2^`exposure` as sRGB, clamped to [0, 1]; NaN becomes black.
///
/// # Errors
/// If there are not `width * height` pixels, or the system refuses; the file is then as it was.
pub fn write_png(
    path: &Path,
    width: usize,
    height: usize,
    pixels: &[Rgb],
    exposure: f32,
) -> Result<(), ImageFileError> {
    let scale = exposure.exp2();
    let codes = pixels.iter().flat_map(|p| (*p * scale).to_array()).map(srgb::encode_u8);
    write_codes(path, width, height, &codes.collect::<Vec<u8>>())
}

/// Writes 8-bit RGB triples as they are.
///
/// # Errors
/// As [`write_png`].
pub fn write_codes(path: &Path, width: usize, height: usize, codes: &[u8]) -> Result<(), ImageFileError> {
    let bytes = encode_codes(width, height, codes).map_err(|message| ImageFileError::format(path, message))?;
    atomic::write_file(path, &bytes)
}

/// The content of a PNG file of 8-bit RGB triples.
///
/// # Errors
/// If there are not `width * height` triples, or more than PNG can hold; the text says which.
pub fn encode_codes(width: usize, height: usize, codes: &[u8]) -> Result<Vec<u8>, String> {
    let size = (u32::try_from(width), u32::try_from(height));
    let (Ok(w), Ok(h)) = size else {
        return Err("the picture is too large for PNG".into());
    };
    if width.checked_mul(height).and_then(|n| n.checked_mul(3)) != Some(codes.len()) || codes.is_empty() {
        return Err(format!("{} bytes do not make {w} x {h} pixels", codes.len()));
    }
    let mut bytes = Vec::new();
    // A fifth larger than the default makes them, in a twentieth of the time.
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(codes, w, h, ExtendedColorType::Rgb8)
        .map_err(|e| format!("cannot encode as PNG: {e}"))?;
    Ok(bytes)
}
