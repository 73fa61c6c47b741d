//! Reading pictures of any kind; the kind is told by the content, never by the name.
//!
//! PNG (8 and 16 bit, grey, palette), JPEG, BMP hold sRGB codes or linear data, as the caller says; HDR (RGBE),
//! OpenEXR and PFM are linear. Alpha is dropped. Not handled: gamma and colour profiles inside PNG and JPEG files.

use std::io::Cursor;
use std::path::Path;

use image::error::{ImageError, LimitErrorKind};
use image::{ColorType, ImageDecoder as _, ImageFormat, ImageReader, Limits};

use super::error::{MAX_PIXELS, checked_area};
use super::{ImageFileError, Picture, exr_read, pfm, srgb};
use crate::math::Rgb;

/// Reads a picture in linear RGB; codes of PNG, JPEG and BMP are decoded from sRGB.
///
/// # Errors
/// If the file cannot be read, is damaged, of an unknown kind or too large.
pub fn read_image(path: &Path) -> Result<Picture, ImageFileError> {
    read_image_as(path, true)
}

/// Reads a picture; `srgb` says whether codes of PNG, JPEG and BMP are decoded from sRGB or taken as linear.
///
/// # Errors
/// As [`read_image`].
pub fn read_image_as(path: &Path, srgb: bool) -> Result<Picture, ImageFileError> {
    let metadata = std::fs::metadata(path).map_err(|e| ImageFileError::io(path, e))?;
    // Devices may never end.
    if !metadata.is_file() {
        return Err(ImageFileError::format(path, "not a file"));
    }
    let bytes = std::fs::read(path).map_err(|e| ImageFileError::io(path, e))?;
    decode(path, &bytes, srgb)
}

/// Decodes the content of a picture file; `path` is for messages.
///
/// # Errors
/// As [`read_image`].
pub fn decode(path: &Path, bytes: &[u8], srgb: bool) -> Result<Picture, ImageFileError> {
    if bytes.starts_with(&exr_read::MAGIC) {
        return exr_read::decode(path, bytes);
    }
    if pfm::is_pfm(bytes) {
        return pfm::decode(path, bytes);
    }
    let Some(format) = guess(bytes) else {
        let message = if bytes.is_empty() {
            "the file is empty"
        } else {
            "not a picture of a known kind (PNG, JPEG, BMP, HDR, OpenEXR, PFM)"
        };
        return Err(ImageFileError::format(path, message));
    };
    decode_with(path, bytes, format, srgb)
}

fn guess(bytes: &[u8]) -> Option<ImageFormat> {
    let signatures: [(&[u8], ImageFormat); 5] = [
        (b"\x89PNG\r\n\x1a\n", ImageFormat::Png),
        (b"\xff\xd8\xff", ImageFormat::Jpeg),
        (b"#?RADIANCE", ImageFormat::Hdr),
        (b"#?RGBE", ImageFormat::Hdr),
        (b"BM", ImageFormat::Bmp),
    ];
    signatures.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, format)| *format)
}

fn decode_with(path: &Path, bytes: &[u8], format: ImageFormat, srgb: bool) -> Result<Picture, ImageFileError> {
    let fail = |e: ImageError| match &e {
        ImageError::Limits(limit) if limit.kind() == LimitErrorKind::InsufficientMemory => {
            ImageFileError::format(path, "the picture is too large")
        }
        _ => ImageFileError::format(path, format!("cannot read {format:?}: {e}")),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_PIXELS * 16);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(fail)?;
    let (width, height) = decoder.dimensions();
    let area = checked_area(path, width as u64, height as u64)?;
    let color = decoder.color_type();
    let mut raw = Vec::new();
    let size = area * color.bytes_per_pixel() as usize;
    let mut pixels: Vec<Rgb> = Vec::new();
    // A plain allocation would end the process where the memory cannot be had.
    if raw.try_reserve_exact(size).is_err() || pixels.try_reserve_exact(area).is_err() {
        return Err(ImageFileError::TooLarge { path: path.to_owned(), width: width as u64, height: height as u64 });
    }
    raw.resize(size, 0);
    decoder.read_image(&mut raw).map_err(fail)?;
    if !extend_pixels(&mut pixels, &raw, color, srgb) {
        return Err(ImageFileError::format(path, format!("colour type {color:?} is not supported")));
    }
    Ok(Picture::new(width as usize, height as usize, pixels))
}

/// Converts raw samples (native byte order) to linear RGB; `false` if the colour type is unknown.
fn extend_pixels(pixels: &mut Vec<Rgb>, raw: &[u8], color: ColorType, srgb: bool) -> bool {
    let (t8, t16) = (srgb::table_u8(srgb), || srgb::table_u16(srgb));
    let at8 = |b: u8| t8[b as usize];
    let u16_at = |p: &[u8], i: usize| u16::from_ne_bytes([p[2 * i], p[2 * i + 1]]) as usize;
    let f32_at = |p: &[u8], i: usize| f32::from_ne_bytes([p[4 * i], p[4 * i + 1], p[4 * i + 2], p[4 * i + 3]]);
    let stride = color.bytes_per_pixel() as usize;
    let chunks = raw.chunks_exact(stride);
    match color {
        ColorType::L8 => pixels.extend(raw.iter().map(|&v| Rgb::splat(at8(v)))),
        ColorType::La8 => pixels.extend(chunks.map(|p| Rgb::splat(at8(p[0])))),
        // Constant strides: the two usual kinds, decoded without a division per pixel.
        ColorType::Rgb8 => pixels.extend(raw.chunks_exact(3).map(|p| Rgb::new(at8(p[0]), at8(p[1]), at8(p[2])))),
        ColorType::Rgba8 => pixels.extend(raw.chunks_exact(4).map(|p| Rgb::new(at8(p[0]), at8(p[1]), at8(p[2])))),
        ColorType::L16 | ColorType::La16 => {
            let table = t16();
            pixels.extend(chunks.map(|p| Rgb::splat(table[u16_at(p, 0)])));
        }
        ColorType::Rgb16 | ColorType::Rgba16 => {
            let table = t16();
            let at = |p: &[u8], i: usize| table[u16_at(p, i)];
            pixels.extend(chunks.map(|p| Rgb::new(at(p, 0), at(p, 1), at(p, 2))));
        }
        ColorType::Rgb32F | ColorType::Rgba32F => {
            pixels.extend(chunks.map(|p| Rgb::new(f32_at(p, 0), f32_at(p, 1), f32_at(p, 2))));
        }
        _ => return false,
    }
    true
}

#[cfg(test)]
#[path = "read_tests.rs"]
mod tests;
