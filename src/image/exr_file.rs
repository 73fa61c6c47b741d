//! Writing OpenEXR files with layers.
//!
//! One part holds all channels: R, G, B is the picture, layers lie beside it under dotted names (`albedo.R`). Viewers
//! that know one part only open it, and group the rest by prefix. The data window is the crop, the display window the
//! full film. Compression ZIP16 is lossless; written atomically ([`super::atomic`]).
//! Not handled: the order of the attributes in the file (the `exr` crate keeps them in a hash map), so that equal
//! pictures are equal channel by channel, but not always byte by byte.

use std::io::Cursor;
use std::path::Path;

use exr::image::write::WritableImage as _;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer as Part};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, IntegerBounds, LineOrder, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use exr::prelude::{SmallVec, f16};

use super::{ImageFileError, Window, atomic};
use crate::math::Vec3;

/// How a channel is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 16-bit float: 11 significant bits, up to 65504; larger values become infinite.
    Half,
    /// 32-bit float, exact.
    #[default]
    Float,
}

/// Lossless compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrCompression {
    /// Smallest (about a third), for results.
    #[default]
    Zip,
    /// None: ten times faster, for checkpoints.
    None,
}

/// Something about the picture that is stored with it.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// A text; any characters (stored as UTF-8).
    Text(String),
    /// A number within 32 bits; larger ones are stored as text, so that no digit is lost.
    Int(i64),
    /// A number; stored with 32 bits.
    Float(f64),
}

/// One channel; its values are the rows of the window, top down.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Full name, `R` or `albedo.R`.
    pub name: String,
    /// How it is stored.
    pub precision: Precision,
    /// One value per pixel; any value, finite or not.
    pub values: Vec<f32>,
}

/// What goes into an EXR file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExrImage {
    /// The pixels that were rendered, within the frame.
    pub window: Window,
    /// Width and height of the full film.
    pub frame: (usize, usize),
    /// All channels, in any order.
    pub channels: Vec<Channel>,
    /// Version, command line, seed ...: (name, value), names of 1 to 255 bytes.
    pub attributes: Vec<(String, Attribute)>,
    /// Compression.
    pub compression: ExrCompression,
}

impl ExrImage {
    /// An image without channels whose pixels fill `window` of a film of `frame` (width, height).
    pub fn new(window: Window, frame: (usize, usize)) -> Self {
        ExrImage { window, frame, ..Default::default() }
    }

    /// Adds three channels, named by the letters of `suffixes` (`"RGB"` or `"XYZ"`): `R`, `G`, `B` if `layer` is
    /// empty (the picture itself), else `layer.R` and so on.
    pub fn add_layer(&mut self, layer: &str, suffixes: &str, precision: Precision, values: &[Vec3]) {
        for (axis, letter) in suffixes.chars().take(3).enumerate() {
            let name = dotted(layer, letter.encode_utf8(&mut [0; 4]));
            let values = values.iter().map(|v| v[axis]).collect();
            self.channels.push(Channel { name, precision, values });
        }
    }

    /// Adds one channel, `layer.suffix` (`depth.Z`), or just one of them if the other is empty.
    pub fn add_channel(&mut self, layer: &str, suffix: &str, precision: Precision, values: Vec<f32>) {
        self.channels.push(Channel { name: dotted(layer, suffix), precision, values });
    }

    /// Adds an attribute.
    pub fn add_attribute(&mut self, name: &str, value: Attribute) {
        self.attributes.push((name.to_owned(), value));
    }
}

fn dotted(layer: &str, suffix: &str) -> String {
    match (layer, suffix) {
        ("", s) => s.to_owned(),
        (l, "") => l.to_owned(),
        (l, s) => format!("{l}.{s}"),
    }
}

/// Writes `image` to `path`. On failure the file, if there was one, is unchanged.
///
/// # Errors
/// If a channel's length is not that of the window, names are empty or doubled, or the system refuses.
pub fn write_exr(path: &Path, image: &ExrImage) -> Result<(), ImageFileError> {
    let bytes = encode(image).map_err(|message| ImageFileError::format(path, message))?;
    atomic::write_file(path, &bytes)
}

fn encode(image: &ExrImage) -> Result<Vec<u8>, String> {
    let mut attributes =
        LayerAttributes { layer_position: Vec2(image.window.x, image.window.y), ..LayerAttributes::default() };
    for (name, value) in &image.attributes {
        if name.is_empty() || name.len() > 255 {
            return Err(format!("attribute name {name:?}: must have 1 to 255 bytes"));
        }
        attributes.other.insert(text(name), attribute_value(value));
    }
    let part = Part {
        channel_data: AnyChannels::sort(channels(image)?),
        attributes,
        size: Vec2(image.window.width, image.window.height),
        encoding: Encoding {
            compression: match image.compression {
                ExrCompression::Zip => exr::compression::Compression::ZIP16,
                ExrCompression::None => exr::compression::Compression::Uncompressed,
            },
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        },
    };
    let mut file = Image::from_layer(part);
    file.attributes = ImageAttributes::new(IntegerBounds::new((0, 0), image.frame));

    // Room for what is known to come: growing step by step would copy large files several times.
    let values = image.window.area() * image.channels.len();
    let expected = if image.compression == ExrCompression::None { 4 * values + (1 << 16) } else { 0 };
    let mut bytes = Cursor::new(Vec::with_capacity(expected));
    let writer = file.write();
    // The crate starts a pool of its own: not worth it for small pictures, and not wanted with `-t 1`.
    let small = values < 1 << 18;
    let done = if small || image.compression == ExrCompression::None || rayon::current_num_threads() == 1 {
        writer.non_parallel().to_buffered(&mut bytes)
    } else {
        writer.to_buffered(&mut bytes)
    };
    done.map_err(|e| format!("cannot encode as OpenEXR: {e}"))?;
    Ok(bytes.into_inner())
}

fn channels(image: &ExrImage) -> Result<SmallVec<[AnyChannel<FlatSamples>; 4]>, String> {
    let area = image.window.area();
    if area == 0 || image.channels.is_empty() {
        return Err("a picture without pixels cannot be written".into());
    }
    let mut names: Vec<&str> = image.channels.iter().map(|c| c.name.as_str()).collect();
    names.sort_unstable();
    if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(format!("two channels are named {:?}", pair[0]));
    }
    let channel = |c: &Channel| {
        if c.values.len() != area {
            let (w, h) = (image.window.width, image.window.height);
            return Err(format!("channel {:?} has {} values for {w} x {h} pixels", c.name, c.values.len()));
        }
        if c.name.is_empty() || c.name.len() > 255 {
            return Err(format!("channel name {:?}: must have 1 to 255 bytes", c.name));
        }
        let samples = match c.precision {
            Precision::Float => FlatSamples::F32(c.values.clone()),
            Precision::Half => FlatSamples::F16(c.values.iter().map(|&v| f16::from_f32(v)).collect()),
        };
        Ok(AnyChannel::new(text(&c.name), samples))
    };
    image.channels.iter().map(channel).collect()
}

fn attribute_value(value: &Attribute) -> AttributeValue {
    match value {
        Attribute::Text(s) => AttributeValue::Text(text(s)),
        Attribute::Int(i) => match i32::try_from(*i) {
            Ok(small) => AttributeValue::I32(small),
            Err(_) => AttributeValue::Text(text(&i.to_string())),
        },
        Attribute::Float(f) => AttributeValue::F32(*f as f32),
    }
}

/// A text of the file format: bytes that end at the first zero.
fn text(s: &str) -> Text {
    let bytes: Vec<u8> = s.bytes().map(|b| if b == 0 { b' ' } else { b }).collect();
    Text::from_slice_unchecked(&bytes)
}

#[cfg(test)]
#[path = "exr_tests.rs"]
mod tests;
