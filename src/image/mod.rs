//! Images: the film that integrators write to, picture files, and metrics that compare pictures.
//!
//! - [`film`]: what integrators write to
//! - [`guide`]: what tells pixels from their neighbours
//! - [`mod@denoise`], [`nl_means`]: the filter that averages pixels which differ by noise alone
//! - [`picture`]: a picture in memory, as read from a file
//! - [`read`]: pictures of any kind, told apart by content ([`exr_read`], [`pfm`], PNG, JPEG, BMP, HDR)
//! - [`exr_file`], [`png_file`]: writing, through [`mod@atomic`]
//! - [`metrics`], [`flip`]: errors between pictures
//! - [`diff`]: pictures of those errors
//! - [`srgb`]: the transfer curve of 8-bit files
//! - [`error`]: what can go wrong with a file

pub mod atomic;
mod box_means;
pub mod denoise;
pub mod diff;
pub mod error;
pub mod exr_file;
pub mod exr_read;
pub mod film;
pub mod flip;
pub mod guide;
pub mod metrics;
pub mod nl_means;
pub mod pfm;
pub mod picture;
pub mod png_file;
pub mod read;
mod second_differences;
pub mod srgb;

pub use box_means::box_means;
pub use error::ImageFileError;
pub use picture::{Picture, Window};
pub use read::read_image;
