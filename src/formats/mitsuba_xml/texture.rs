//! Textures, and parameters that may be textured: colours and scalars.
//!
//! Source      parameter rules of Mitsuba 3; colour values as described in [`crate::formats::spectrum`]
//! Not handled procedural textures beyond `checkerboard`, vertex colours

use super::builder::Builder;
use super::files;
use super::props::Props;
use super::report::{Checked, Loc};
use super::tree::{Object, ObjectId, Spectrum, Value};
use super::values;
use crate::formats::diagnostics::suggestion;
use crate::formats::spectrum::{Usage, constant_to_rgb, list_to_rgb, parse_spd, push_sample, to_rgb};
use crate::math::{Affine2, DMat4, DVec3, Rgb, Vec2};
use crate::scene::texture::{Color, Scalar, TexFilter, Texture, Wrap};

const TEXTURES: [&str; 3] = ["bitmap", "checkerboard", "scale"];
const SPECTRA: [&str; 7] = ["uniform", "regular", "irregular", "d65", "rgb", "srgb", "blackbody"];

/// Reads a `<texture>`.
pub fn read(b: &mut Builder, id: ObjectId) -> Checked<Texture> {
    let props = b.props(id);
    let kind = props.object.kind.as_str();
    let texture = match kind {
        "bitmap" => bitmap(b, &props)?,
        "checkerboard" => Texture::Checkerboard {
            color0: color(b, &props, "color0", 0.4, Usage::Reflectance)?,
            color1: color(b, &props, "color1", 0.2, Usage::Reflectance)?,
            to_uv: to_uv(&props)?,
        },
        "scale" => {
            let factor = constant(b, &props, "scale", 1.0, Usage::Constant)?;
            let nested = props.nested_count("texture", 0, 1)?;
            let texture = match nested.first().copied().or(props.named("value")?.map(|(id, _, loc)| (id, loc))) {
                Some((id, loc)) => b.texture(id, loc)?,
                None => {
                    let value = color(b, &props, "value", 0.5, Usage::Constant)?;
                    plain(b, value)
                }
            };
            Texture::Scale { texture, factor }
        }
        _ => {
            let message = format!("unknown texture type \"{kind}\"; using grey 0.5");
            b.report.unknown(props.object.kind_loc, message, suggestion(kind, TEXTURES));
            return Ok(constant_texture(Rgb::splat(0.5)));
        }
    };
    props.finish();
    Ok(texture)
}

/// A colour as a texture: a checkerboard of one colour.
fn constant_texture(value: Rgb) -> Texture {
    Texture::Checkerboard { color0: Color::Constant(value), color1: Color::Constant(value), to_uv: Affine2::IDENTITY }
}

/// A colour as a texture.
fn plain(b: &mut Builder, color: Color) -> u32 {
    match color {
        Color::Texture(id) => id,
        Color::Constant(value) => b.add_texture(constant_texture(value)),
    }
}

fn bitmap(b: &mut Builder, props: &Props) -> Checked<Texture> {
    let filter = match props.choice("filter_type", &["bilinear", "nearest", "trilinear", "ewa", "none"])? {
        "nearest" | "none" => TexFilter::Nearest,
        _ => TexFilter::Bilinear,
    };
    let words = ["repeat", "mirror", "clamp", "zero", "one", "black", "white"];
    let mut wrap = props.choice("wrap_mode", &words)?;
    for name in ["wrap_mode_u", "wrap_mode_v"] {
        if props.has(name) {
            let other = props.choice(name, &words)?;
            if name == "wrap_mode_v" && other != wrap {
                b.report.warn(props.loc(name), "different wrap modes for u and v are not supported; u counts");
                continue;
            }
            wrap = other;
        }
    }
    let wrap = match wrap {
        "mirror" => Wrap::Mirror,
        "clamp" => Wrap::Clamp,
        "repeat" => Wrap::Repeat,
        other => {
            b.report.warn(props.loc("wrap_mode"), format!("wrap mode \"{other}\" is not supported; using \"clamp\""));
            Wrap::Clamp
        }
    };
    let raw = props.boolean_or("raw", false)?;
    let gamma = props.float("gamma")?;
    if gamma.is_some_and(|g| g > 0.0 && g != 1.0 && (g - 2.2).abs() > 0.01) {
        b.report.warn(props.loc("gamma"), "the gamma of a picture is ignored unless it is 1 (linear)");
    }
    if let Some(channel) = props.string("channel")? {
        b.report.warn(props.loc("channel"), format!("channel \"{channel}\" is not supported; using the colour"));
    }
    props.ignore(&["max_anisotropy", "cache", "format", "accel"]);
    let to_uv = to_uv(props)?;
    let image = b.image(props, !raw && gamma != Some(1.0))?;
    Ok(Texture::Bitmap { image, filter, wrap, to_uv })
}

/// `to_uv`, or the legacy offsets and scales (the offset is applied first).
fn to_uv(props: &Props) -> Checked<Affine2> {
    let transform = props.transform("to_uv")?;
    let legacy = ["uoffset", "voffset", "uscale", "vscale"];
    let given = legacy.iter().any(|name| props.has(name));
    let [u0, v0, us, vs] = [0.0, 0.0, 1.0, 1.0];
    let offset = DVec3::new(props.float_or(legacy[0], u0)?, props.float_or(legacy[1], v0)?, 0.0);
    let scale = DVec3::new(props.float_or(legacy[2], us)?, props.float_or(legacy[3], vs)?, 1.0);
    let m = match transform {
        Some(m) => m,
        None if given => DMat4::from_scale(scale) * DMat4::from_translation(offset),
        None => return Ok(Affine2::IDENTITY),
    };
    let column = |c: glam::DVec4| Vec2::new(c.x as f32, c.y as f32);
    Ok(Affine2::from_cols(column(m.x_axis), column(m.y_axis), column(m.w_axis)))
}

/// A colour parameter with a grey default; may be textured.
pub fn color(b: &mut Builder, props: &Props, name: &'static str, default: f64, usage: Usage) -> Checked<Color> {
    if let Some((id, object, loc)) = props.named(name)? {
        return match object.tag.as_str() {
            "texture" => Ok(Color::Texture(b.texture(id, loc)?)),
            "spectrum" => Ok(Color::Constant(spectrum_object(b, id, usage)?)),
            _ => {
                let message = format!("\"{name}\" should be a colour or texture, but is a <{}>", object.tag);
                Err(b.report.error(loc, message))
            }
        };
    }
    let Some(property) = props.get(name) else {
        return Ok(Color::Constant(Rgb::splat(default as f32)));
    };
    let value = match &property.value {
        Value::Float(v) => [*v; 3],
        Value::Integer(v) => [*v as f64; 3],
        Value::Rgb(c) => *c,
        Value::Spectrum(spectrum) => spectrum_value(b, spectrum, property.loc, usage)?,
        _ => return Err(props.mismatch(property, "a colour or texture")),
    };
    Ok(Color::Constant(to_rgb(legal(b, value, property.loc, name, usage))))
}

/// Brings a colour into its legal range, aloud.
fn legal(b: &Builder, value: [f64; 3], loc: Loc, name: &str, usage: Usage) -> [f64; 3] {
    let high = if usage == Usage::Reflectance { 1.0 } else { f64::INFINITY };
    if usage == Usage::Constant || value.iter().all(|v| (0.0..=high).contains(v)) {
        return value;
    }
    let range = if usage == Usage::Reflectance { "between 0 and 1" } else { "0 or more" };
    b.report.warn(loc, format!("{name} should be {range}; clamped"));
    value.map(|v| v.clamp(0.0, high))
}

/// A colour parameter that may not be textured.
pub fn constant(b: &mut Builder, props: &Props, name: &'static str, default: f64, usage: Usage) -> Checked<Rgb> {
    match color(b, props, name, default, usage)? {
        Color::Constant(value) => Ok(value),
        Color::Texture(_) => {
            Err(props.error(name, format!("a texture is not supported for {name} of {}", props.title())))
        }
    }
}

/// A scalar parameter with a default; may be textured. Colours count by their mean.
pub fn scalar(b: &mut Builder, props: &Props, name: &'static str, default: f64, usage: Usage) -> Checked<Scalar> {
    Ok(match color(b, props, name, default, usage)? {
        Color::Constant(value) if value.x == value.y && value.y == value.z => Scalar::Constant(value.x),
        Color::Constant(value) => Scalar::Constant(value.element_sum() / 3.0),
        Color::Texture(id) => Scalar::Texture(id),
    })
}

fn spectrum_value(b: &Builder, spectrum: &Spectrum, loc: Loc, usage: Usage) -> Checked<[f64; 3]> {
    Ok(match spectrum {
        Spectrum::Uniform(v) => constant_to_rgb(*v, usage),
        Spectrum::List(list) => list_to_rgb(list, usage),
        Spectrum::File(name) => {
            let mut folders = vec![files::folder_of(&b.report.path(loc.source))];
            folders.extend(b.tree.folders.iter().cloned());
            let path = files::find(name, &folders, loc, "spectrum", b.report)?;
            let list = files::read_text(&path).and_then(|text| parse_spd(&text));
            let list = list.map_err(|e| b.report.error(loc, format!("{}: {e}", path.display())))?;
            list_to_rgb(&list, usage)
        }
    })
}

/// A `<spectrum type="...">`.
fn spectrum_object(b: &mut Builder, id: ObjectId, usage: Usage) -> Checked<Rgb> {
    let props = b.props(id);
    let object: &Object = props.object;
    let kind = object.kind.as_str();
    let list = |name: &'static str| -> Checked<Vec<f64>> {
        let text = props.string(name)?.ok_or_else(|| {
            b.report.error(object.loc, format!("spectrum type \"{kind}\" needs the property \"{name}\""))
        })?;
        values::numbers(text).map_err(|m| props.error(name, m))
    };
    let value = match kind {
        // Unlike `<spectrum value="2"/>`, this object is grey as an emission too (measured).
        "uniform" => [props.float_or("value", 1.0)?; 3],
        "rgb" | "srgb" => match props.get("color").or(props.get("value")).map(|p| &p.value) {
            Some(Value::Rgb(c)) => *c,
            _ => {
                return Err(b.report.error(object.loc, format!("spectrum type \"{kind}\" needs a colour \"color\"")));
            }
        },
        // Seen as emission D65 is white; as reflectance it makes little sense, and means grey.
        "d65" => [props.float_or("scale", 1.0)?; 3],
        "regular" | "irregular" => {
            let values = list("values")?;
            let wavelengths = if kind == "irregular" {
                list("wavelengths")?
            } else {
                let low = props.float_or("wavelength_min", 360.0)?;
                let high = props.float_or("wavelength_max", 830.0)?;
                let step = (high - low) / (values.len().max(2) - 1) as f64;
                (0..values.len()).map(|i| low + step * i as f64).collect()
            };
            if values.len() != wavelengths.len() || values.len() < 2 {
                return Err(b.report.error(object.loc, "a spectrum needs as many values as wavelengths, two at least"));
            }
            let mut samples = Vec::new();
            for (nm, value) in wavelengths.into_iter().zip(values) {
                push_sample(&mut samples, nm, value).map_err(|m| b.report.error(object.loc, m))?;
            }
            list_to_rgb(&samples, usage)
        }
        _ => {
            let message = format!("spectrum type \"{kind}\" is not supported; using 1");
            b.report.unknown(object.kind_loc, message, suggestion(kind, SPECTRA));
            return Ok(Rgb::ONE);
        }
    };
    props.finish();
    Ok(to_rgb(legal(b, value, object.loc, "the spectrum", usage)))
}
