//! Emitters: `area` on shapes; `point`, `spot`, `directional`, `constant`, `envmap` in the scene.
//!
//! Not handled sun and sky, projectors, IES profiles, textured point and directional lights: skipped with a warning
//! or refused

use super::builder::Builder;
use super::props::Props;
use super::report::Checked;
use super::texture::{color, constant};
use super::tree::ObjectId;
use crate::formats::diagnostics::suggestion;
use crate::formats::spectrum::Usage;
use crate::math::{DMat4, DVec3, Rgb};
use crate::scene::description::LightDesc;
use crate::scene::texture::Color;

const EMITTERS: [&str; 6] = ["area", "point", "spot", "directional", "constant", "envmap"];
/// Known elsewhere, but not here.
const UNSUPPORTED: [&str; 8] =
    ["sunsky", "sun", "sky", "projector", "directionalarea", "ies", "collimated", "timed_sunsky"];

/// Emitted radiance of an emitter that is nested in a shape.
pub fn area(b: &mut Builder, id: ObjectId) -> Checked<Option<Color>> {
    let props = b.props(id);
    let kind = props.object.kind.as_str();
    if kind != "area" {
        if EMITTERS.contains(&kind) {
            let help = Some("only \"area\" belongs into a shape; move this one out of it".into());
            let message = format!("an emitter of type \"{kind}\" cannot be nested in a shape");
            return Err(b.report.error_help(props.object.kind_loc, message, help));
        }
        let message = format!("unknown emitter type \"{kind}\"; skipped");
        b.report.unknown(props.object.kind_loc, message, suggestion(kind, EMITTERS));
        return Ok(None);
    }
    if props.has("to_world") {
        let help = Some("transform the shape instead".into());
        let message = "an area emitter has no to_world of its own";
        return Err(b.report.error_help(props.loc("to_world"), message, help));
    }
    let radiance = color(b, &props, "radiance", 1.0, Usage::Emission)?;
    props.ignore(&["sampling_weight"]);
    props.finish();
    Ok(Some(radiance))
}

/// Reads an emitter of the scene.
pub fn read(b: &mut Builder, id: ObjectId) -> Checked<()> {
    let props = b.props(id);
    let kind = props.object.kind.as_str();
    let light = match kind {
        "point" => point(b, &props)?,
        "spot" => spot(b, &props)?,
        "directional" => directional(b, &props)?,
        "constant" => LightDesc::Constant { radiance: constant(b, &props, "radiance", 1.0, Usage::Emission)? },
        "envmap" => {
            let scale = constant(b, &props, "scale", 1.0, Usage::Emission)?;
            let to_world = invertible(&props)?;
            props.ignore(&["cache", "gamma", "mis_compensation"]);
            let image = b.image(&props, true)?;
            LightDesc::EnvMap { image, scale, to_world }
        }
        "area" => {
            let help = Some("nest it in a <shape>".into());
            return Err(b.report.error_help(props.object.loc, "an area emitter belongs to a shape", help));
        }
        _ => {
            let message = if UNSUPPORTED.contains(&kind) { "is not supported" } else { "is unknown" };
            let message = format!("emitter type \"{kind}\" {message}; skipped");
            b.report.unknown(props.object.kind_loc, message, suggestion(kind, EMITTERS));
            return Ok(());
        }
    };
    props.ignore(&["sampling_weight"]);
    props.finish();
    b.lights.push(light);
    Ok(())
}

/// `to_world`, which must have an inverse.
fn invertible(props: &Props) -> Checked<DMat4> {
    let to_world = props.to_world()?;
    let inverse = to_world.inverse();
    props.check(inverse.is_finite(), "to_world", "cannot be inverted")?;
    Ok(to_world)
}

fn point(b: &mut Builder, props: &Props) -> Checked<LightDesc> {
    let position = props.vector("position")?;
    let transform = props.transform("to_world")?;
    if position.is_some() && transform.is_some() {
        return Err(props.error("position", "give either position or to_world, not both"));
    }
    let moved = transform.map_or(DVec3::ZERO, |m| m.w_axis.truncate());
    Ok(LightDesc::Point { position: position.unwrap_or(moved), intensity: intensity(b, props, "intensity")? })
}

fn intensity(b: &mut Builder, props: &Props, name: &'static str) -> Checked<Rgb> {
    constant(b, props, name, 1.0, Usage::Emission)
}

fn spot(b: &mut Builder, props: &Props) -> Checked<LightDesc> {
    let cutoff = props.float_or("cutoff_angle", 20.0)?;
    let beam = props.float_or("beam_width", cutoff * 0.75)?;
    props.check(cutoff > 0.0 && cutoff <= 180.0, "cutoff_angle", "must lie between 0 and 180 degrees")?;
    props.check((0.0..=cutoff).contains(&beam), "beam_width", "must lie between 0 and cutoff_angle")?;
    let texture = match color(b, props, "texture", 1.0, Usage::Emission)? {
        Color::Texture(id) => {
            props.check(cutoff < 90.0, "cutoff_angle", "of a textured spot must be below 90 degrees")?;
            Some(id)
        }
        Color::Constant(_) => None,
    };
    Ok(LightDesc::Spot {
        to_world: invertible(props)?,
        intensity: intensity(b, props, "intensity")?,
        cutoff_angle: cutoff.to_radians(),
        beam_width: beam.to_radians(),
        texture,
    })
}

fn directional(b: &mut Builder, props: &Props) -> Checked<LightDesc> {
    let given = props.vector("direction")?;
    let transform = props.transform("to_world")?;
    if given.is_some() && transform.is_some() {
        return Err(props.error("direction", "give either direction or to_world, not both"));
    }
    let direction = given.unwrap_or(transform.unwrap_or(DMat4::IDENTITY).z_axis.truncate());
    // Scaled by the largest component first, so that tiny vectors do not vanish.
    let Some(direction) = (direction / direction.abs().max_element()).try_normalize() else {
        return Err(props.error("direction", "the direction of the light is zero"));
    };
    Ok(LightDesc::Directional { direction, irradiance: intensity(b, props, "irradiance")? })
}
