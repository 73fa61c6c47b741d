//! Reading OpenEXR files: any number of parts, any lossless or lossy compression, f16, f32 and u32 samples.
//!
//! The picture is, in this order: R, G, B of the first part that has them; Y (grey); R, G, B of the first layer
//! with a dotted name. The channel `mask` of the same part comes along. Alpha is ignored (colours are taken as they
//! are, that is premultiplied). Not handled: deep data, subsampled (luminance and chroma) channels.

use std::io::Cursor;
use std::path::Path;

use exr::block::reader::Reader;
use exr::image::read::image::ReadLayers as _;
use exr::image::read::layers::ReadChannels as _;
use exr::image::{AnyChannel, AnyChannels, FlatSamples, Layer};
use exr::meta::header::Header;

use super::error::checked_area;
use super::{ImageFileError, Picture, Window};
use crate::math::Rgb;

/// Most bytes of samples in one file: 8 GiB.
const MAX_BYTES: usize = 1 << 33;

/// First bytes of an OpenEXR file.
pub(crate) const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Decodes `bytes`; `path` is for messages.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<Picture, ImageFileError> {
    let fail = |e: exr::error::Error| ImageFileError::format(path, format!("cannot read OpenEXR: {e}"));
    let reader = exr::block::read(Cursor::new(bytes), false).map_err(fail)?;
    check_headers(path, &reader)?;
    let mut image =
        exr::image::read::read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    if bytes.len() < 1 << 20 || rayon::current_num_threads() == 1 {
        image = image.non_parallel();
    }
    let image = image.from_chunks(reader).map_err(fail)?;
    let display = image.attributes.display_window;

    let Some((part, picks)) = find_picture(&image.layer_data) else {
        let names: Vec<String> = image.layer_data.iter().flat_map(channel_names).collect();
        let message = format!("no channels R, G, B or Y; the file has {}", names.join(", "));
        return Err(ImageFileError::format(path, message));
    };
    let at = part.attributes.layer_position;
    let area = part.size.0 * part.size.1;
    let channel = |i: usize| values(&part.channel_data.list[i].sample_data);
    let planes: Vec<Vec<f32>> = picks.iter().map(|&i| channel(i)).collect();
    let plane = |i: usize| &planes[i.min(planes.len() - 1)];
    let (r, g, b) = (plane(0), plane(1), plane(2));
    let mask = part.channel_data.list.iter().find(|c| c.name.eq("mask"));
    Ok(Picture {
        window: Window {
            x: at.0.saturating_sub(display.position.0),
            y: at.1.saturating_sub(display.position.1),
            width: part.size.0,
            height: part.size.1,
        },
        frame: (display.size.0, display.size.1),
        pixels: (0..area).map(|i| Rgb::new(r[i], g[i], b[i])).collect(),
        mask: mask.map(|c| values(&c.sample_data).iter().map(|&v| v > 0.5).collect()),
    })
}

/// Refuses what cannot be decoded or would take too much memory, before any of it is reserved.
fn check_headers(path: &Path, reader: &Reader<Cursor<&[u8]>>) -> Result<(), ImageFileError> {
    let mut total = 0usize;
    for header in reader.headers() {
        let size = header.layer_size;
        checked_area(path, size.0 as u64, size.1 as u64)?;
        if header.deep {
            return Err(ImageFileError::format(path, "deep OpenEXR data is not supported"));
        }
        if header.channels.list.iter().any(|c| c.sampling.0 != 1 || c.sampling.1 != 1) {
            return Err(ImageFileError::format(path, "subsampled OpenEXR channels are not supported"));
        }
        total = total.saturating_add(sample_bytes(header));
        if total > MAX_BYTES {
            return Err(ImageFileError::TooLarge {
                path: path.to_owned(),
                width: size.0 as u64,
                height: size.1 as u64,
            });
        }
    }
    Ok(())
}

fn sample_bytes(header: &Header) -> usize {
    let per_pixel: usize = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample()).sum();
    per_pixel.saturating_mul(header.layer_size.0 * header.layer_size.1)
}

type FlatPart = Layer<AnyChannels<FlatSamples>>;

/// The part that holds the picture, and its channels: three for RGB, one for grey.
fn find_picture(parts: &[FlatPart]) -> Option<(&FlatPart, Vec<usize>)> {
    let index = |part: &FlatPart, name: &str| {
        let list = &part.channel_data.list;
        list.iter().position(|c: &AnyChannel<_>| c.name.as_slice() == name.as_bytes())
    };
    let triple = |part: &FlatPart, prefix: &str| -> Option<Vec<usize>> {
        ["R", "G", "B"].iter().map(|s| index(part, &format!("{prefix}{s}"))).collect()
    };
    let plain = parts.iter().find_map(|p| Some((p, triple(p, "")?)));
    let grey = || parts.iter().find_map(|p| Some((p, vec![index(p, "Y")?])));
    let dotted = || {
        parts.iter().find_map(|p| {
            let prefix = |name: String| name.strip_suffix('R').filter(|s| s.ends_with('.')).map(str::to_owned);
            let mut prefixes = channel_names(p).into_iter().filter_map(prefix);
            prefixes.find_map(|prefix| Some((p, triple(p, &prefix)?)))
        })
    };
    plain.or_else(grey).or_else(dotted)
}

fn channel_names(part: &FlatPart) -> Vec<String> {
    let list = part.channel_data.list.iter();
    list.map(|c| String::from_utf8_lossy(c.name.as_slice()).into_owned()).collect()
}

fn values(samples: &FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F16(v) => v.iter().map(|x| x.to_f32()).collect(),
        FlatSamples::F32(v) => v.clone(),
        FlatSamples::U32(v) => v.iter().map(|&x| x as f32).collect(),
    }
}
