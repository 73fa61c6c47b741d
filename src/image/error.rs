//! What can go wrong with a picture file. Every message names the file.

use std::path::{Path, PathBuf};

/// A picture file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageFileError {
    /// The operating system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is damaged, or of a kind that is not supported.
    #[error("{}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The file claims more pixels than [`MAX_PIXELS`], or more memory than there is.
    #[error("{}: a picture of {width} x {height} pixels is too large", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Claimed width.
        width: u64,
        /// Claimed height.
        height: u64,
    },
}

/// Most pixels a picture file may hold: 2^28 (16384 x 16384), 3 GiB in memory.
///
/// A few hostile bytes can claim any size; memory that cannot be had would abort the process.
pub const MAX_PIXELS: u64 = 1 << 28;

impl ImageFileError {
    /// A [`ImageFileError::Format`] for `path`.
    pub(crate) fn format(path: &Path, message: impl Into<String>) -> Self {
        ImageFileError::Format { path: path.to_owned(), message: message.into() }
    }

    /// An [`ImageFileError::Io`] for `path`.
    pub(crate) fn io(path: &Path, source: std::io::Error) -> Self {
        ImageFileError::Io { path: path.to_owned(), source }
    }
}

/// `width * height` as a count of pixels, if that is at least one and at most [`MAX_PIXELS`].
pub(crate) fn checked_area(path: &Path, width: u64, height: u64) -> Result<usize, ImageFileError> {
    if width == 0 || height == 0 {
        return Err(ImageFileError::format(path, "the picture has no pixels"));
    }
    match width.checked_mul(height) {
        Some(n) if n <= MAX_PIXELS => Ok(n as usize),
        _ => Err(ImageFileError::TooLarge { path: path.to_owned(), width, height }),
    }
}
