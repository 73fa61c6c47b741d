//! Films and their reconstruction filters.
//!
//! Not handled file formats and tone mapping of the file: the command line chooses them; the properties are read
//! and ignored

use super::props::Props;
use super::report::{Checked, Report};
use super::tree::{ObjectId, Tree};
use crate::formats::diagnostics::suggestion;
use crate::math::filter::PixelFilter;
use crate::scene::description::FilmDesc;

/// Largest width or height, pixels.
const SIDE_LIMIT: i64 = 1 << 16;
/// Largest number of pixels.
const PIXEL_LIMIT: i64 = 1 << 30;
/// Largest radius of a filter, pixels.
const RADIUS_LIMIT: f64 = 64.0;

const FILMS: [&str; 5] = ["hdrfilm", "ldrfilm", "tiledhdrfilm", "mfilm", "specfilm"];
const FILTERS: [&str; 6] = ["gaussian", "box", "tent", "mitchell", "catmullrom", "lanczos"];

/// The film of a scene that says nothing.
pub fn default() -> FilmDesc {
    FilmDesc { width: 768, height: 576, crop: [0, 0, 768, 576], filter: PixelFilter::Gaussian { stddev: 0.5 } }
}

/// Reads a film.
pub fn read(tree: &Tree, id: ObjectId, report: &Report) -> Checked<FilmDesc> {
    let props = Props::new(tree, id, report);
    let kind = props.object.kind.as_str();
    if !FILMS.contains(&kind) {
        let message = format!("unknown film type \"{kind}\"; taking it for \"hdrfilm\"");
        report.unknown(props.object.kind_loc, message, suggestion(kind, FILMS));
    }
    let filter = match props.nested_count("rfilter", 0, 1)?.first() {
        Some(&(filter, _)) => self::filter(tree, filter, report),
        None => Ok(default().filter),
    };
    let width = props.count("width", 1, SIDE_LIMIT)?.unwrap_or(768);
    let height = props.count("height", 1, SIDE_LIMIT)?.unwrap_or(576);
    if width * height > PIXEL_LIMIT {
        return Err(props.error("width", format!("{width} x {height} pixels are too many")));
    }
    let x = props.integer("crop_offset_x")?.unwrap_or(0);
    let y = props.integer("crop_offset_y")?.unwrap_or(0);
    let w = props.count("crop_width", 1, SIDE_LIMIT)?.unwrap_or(width);
    let h = props.count("crop_height", 1, SIDE_LIMIT)?.unwrap_or(height);
    let inside = |offset: i64, size: i64, full: i64| offset >= 0 && offset.saturating_add(size) <= full;
    for (name, fits) in [("crop_offset_x", inside(x, w, width)), ("crop_offset_y", inside(y, h, height))] {
        if !fits {
            let message =
                format!("the crop window {w} x {h} at ({x}, {y}) lies outside of the film {width} x {height}");
            return Err(props.error(name, message));
        }
    }
    // How the picture is stored and shown is up to the command line.
    props.ignore(&["file_format", "pixel_format", "component_format", "sample_border", "banner", "gamma", "exposure"]);
    props.ignore(&["tonemap_method", "key", "burn", "attach_log", "high_quality_edges", "compensate", "filename"]);
    props.ignore(&["digits", "variable", "channel_names", "size_x", "size_y"]);
    props.finish();
    let crop = [x, y, w, h].map(|v| v as u32);
    let (width, height) = (width as u32, height as u32);
    Ok(FilmDesc { width, height, crop, filter: filter? })
}

fn filter(tree: &Tree, id: ObjectId, report: &Report) -> Checked<PixelFilter> {
    let props = Props::new(tree, id, report);
    let kind = props.object.kind.as_str();
    let positive = |name: &'static str, default: f64, limit: f64| {
        let value = props.float_or(name, default)?;
        props.check(value > 1e-6 && value <= limit, name, &format!("must lie between 0 and {limit}"))?;
        Ok(value as f32)
    };
    let filter = match kind {
        "box" => PixelFilter::Box { radius: positive("radius", 0.5, RADIUS_LIMIT)? },
        "tent" => PixelFilter::Tent { radius: positive("radius", 1.0, RADIUS_LIMIT)? },
        "gaussian" => PixelFilter::Gaussian { stddev: positive("stddev", 0.5, RADIUS_LIMIT / 4.0)? },
        "mitchell" => {
            let coefficient = |long: &'static str, short: &'static str| -> Checked<f32> {
                let value = props.float(long)?.or(props.float(short)?).unwrap_or(1.0 / 3.0);
                props.check(value.abs() <= 10.0, long, "must lie between -10 and 10")?;
                Ok(value as f32)
            };
            PixelFilter::Mitchell { b: coefficient("B", "b")?, c: coefficient("C", "c")? }
        }
        "catmullrom" => PixelFilter::CatmullRom,
        "lanczos" => PixelFilter::Lanczos { lobes: props.count("lobes", 1, 16)?.unwrap_or(3) as u32 },
        _ => {
            let message = format!("unknown rfilter type \"{kind}\"; taking \"gaussian\"");
            report.unknown(props.object.kind_loc, message, suggestion(kind, FILTERS));
            return Ok(default().filter);
        }
    };
    props.finish();
    Ok(filter)
}
