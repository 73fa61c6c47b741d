//! Reading PFM files: a text header, then rows of 32-bit floats, the lowest row first.
//!
//! `PF` is RGB, `Pf` grey; a negative scale means little-endian. The scale's size is not applied (programs disagree).

use std::path::Path;

use super::error::checked_area;
use super::{ImageFileError, Picture};
use crate::math::Rgb;

/// Whether `bytes` start like a PFM file.
pub(crate) fn is_pfm(bytes: &[u8]) -> bool {
    matches!(bytes, [b'P', b'F' | b'f', space, ..] if space.is_ascii_whitespace())
}

/// Decodes `bytes`; `path` is for messages.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Picture, ImageFileError> {
    let bad = |what: &str| ImageFileError::format(path, format!("PFM: {what}"));
    let channels = match bytes.get(1) {
        Some(b'F') => 3,
        Some(b'f') => 1,
        _ => return Err(bad("must start with PF or Pf")),
    };
    let mut at = 2;
    let mut word = || {
        let rest = bytes.get(at..)?;
        let start = at + rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let end = start + bytes[start..].iter().position(u8::is_ascii_whitespace)?;
        at = end + 1; // exactly one blank ends the header
        std::str::from_utf8(&bytes[start..end]).ok()
    };
    let mut size = || word().and_then(|w| w.parse::<u64>().ok()).ok_or_else(|| bad("width or height is missing"));
    let (width, height) = (size()?, size()?);
    let scale: f32 = word().and_then(|w| w.parse().ok()).ok_or_else(|| bad("scale is missing"))?;
    let area = checked_area(path, width, height)?;
    let data = bytes.get(at..).unwrap_or(&[]);
    if data.len() < area * channels * 4 {
        return Err(bad("the file is shorter than its header says"));
    }
    let value = |i: usize| {
        let raw = [data[4 * i], data[4 * i + 1], data[4 * i + 2], data[4 * i + 3]];
        if scale < 0.0 { f32::from_le_bytes(raw) } else { f32::from_be_bytes(raw) }
    };
    let (width, height) = (width as usize, height as usize);
    let mut pixels = Vec::with_capacity(area);
    for y in (0..height).rev() {
        pixels.extend((y * width..(y + 1) * width).map(|i| match channels {
            3 => Rgb::new(value(3 * i), value(3 * i + 1), value(3 * i + 2)),
            _ => Rgb::splat(value(i)),
        }));
    }
    Ok(Picture::new(width, height, pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_byte_orders_and_grey() {
        let path = Path::new("x.pfm");
        let mut little = b"PF\n1 2\n-1.0\n".to_vec();
        let mut big = b"PF 1 2\n1.0\n".to_vec();
        for v in 1..=6 {
            little.extend((v as f32).to_le_bytes());
            big.extend((v as f32).to_be_bytes());
        }
        // The lowest row comes first in the file.
        let expected = [Rgb::new(4.0, 5.0, 6.0), Rgb::new(1.0, 2.0, 3.0)];
        assert_eq!(decode(path, &little).unwrap().pixels, expected);
        assert_eq!(decode(path, &big).unwrap().pixels, expected);
        let mut grey = b"Pf\n1 1\n-1\n".to_vec();
        grey.extend(0.5f32.to_le_bytes());
        assert_eq!(decode(path, &grey).unwrap().pixels, [Rgb::splat(0.5)]);
    }

    #[test]
    fn damage_is_an_error() {
        for text in [
            "PF",
            "PF\n1",
            "PF\n1 1\n",
            "PF\n0 1\n-1\n",
            "PF\n99999999 99999999\n-1\n",
            "PF\n2 2\n-1\nxx",
            "Pf\n-1 1\n1\nxxxx",
        ] {
            assert!(decode(Path::new("x.pfm"), text.as_bytes()).is_err(), "{text:?}");
        }
    }
}
