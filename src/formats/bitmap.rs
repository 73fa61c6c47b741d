//! Texture pictures: PNG, JPEG, BMP, HDR, OpenEXR or PFM files, told apart by content, as linear bitmaps.
//!
//! The decoders are those of [`mod@crate::image::read`]; here is only the step to the scene's type.

use std::path::Path;

use crate::image::read::read_image_as;
use crate::scene::texture::Bitmap;

/// Why a bitmap could not be read.
pub use crate::image::ImageFileError as BitmapError;

/// Reads a picture in linear RGB, row 0 on top. `srgb`: the codes of PNG, JPEG and BMP files (8 or 16 bit) are decoded
/// from sRGB, else taken as linear values in [0, 1]; HDR, OpenEXR and PFM are linear as they are. Alpha is dropped.
///
/// # Errors
/// If the file cannot be read, is damaged, of an unknown kind, or has more than
/// [`MAX_PIXELS`](crate::image::error::MAX_PIXELS).
pub fn read(path: &Path, srgb: bool) -> Result<Bitmap, BitmapError> {
    let picture = read_image_as(path, srgb)?;
    Ok(Bitmap { width: picture.width(), height: picture.height(), pixels: picture.pixels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::png_file::write_codes;
    use crate::math::Rgb;

    #[test]
    fn codes_are_decoded_or_taken_as_they_are_whatever_the_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wood.JPG");
        write_codes(&path, 1, 2, &[255, 0, 51, 0, 255, 0]).unwrap();
        let raw = read(&path, false).unwrap();
        assert_eq!((raw.width, raw.height), (1, 2));
        assert_eq!(raw.pixels, [Rgb::new(1.0, 0.0, 0.2), Rgb::Y]);
        let decoded = read(&path, true).unwrap();
        assert!((decoded.pixels[0].z - 0.033_104_77).abs() < 1e-6);
        assert!(read(folder.path(), true).is_err(), "a folder is no picture");
    }
}
