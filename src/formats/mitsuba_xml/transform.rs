//! `<transform>`: a list of elementary transforms, each multiplied from the left, so that the first written is the
//! first applied to points.
//!
//! Source      mitsuba-xml rules of Mitsuba 3 (`look_at`: z towards the target, x = up x z, which points to the left)
//! Not handled animation

use super::attrs::{Attr, Attrs};
use super::params::Params;
use super::report::{Checked, Loc, Report};
use super::values;
use crate::formats::diagnostics::suggestion;
use crate::math::{DMat4, DVec3};

/// Tags inside of a transform.
const TAGS: [&str; 5] = ["translate", "scale", "rotate", "matrix", "lookat"];

/// Largest entry of a transform.
const LARGEST: f64 = 1e30;

/// Multiplies the elementary transforms below a `<transform>` element.
pub fn parse(node: roxmltree::Node, source: u32, params: &mut Params, report: &Report) -> Checked<DMat4> {
    let mut result = DMat4::IDENTITY;
    for child in node.children().filter(|c| c.is_element()) {
        let tag = child.tag_name().name();
        let attrs = Attrs::new(child, source, params, report)?;
        let step = match tag {
            "translate" => DMat4::from_translation(vector(&attrs, DVec3::ZERO, report)?),
            "scale" => DMat4::from_scale(vector(&attrs, DVec3::ONE, report)?),
            "rotate" => rotate(&attrs, report)?,
            "matrix" => matrix(attrs.need("value", report)?, report)?,
            "lookat" | "lookAt" | "look_at" => lookat(&attrs, report)?,
            _ => {
                let message = format!("unknown transform <{tag}>");
                report.unknown(attrs.loc, message, suggestion(tag, TAGS));
                continue;
            }
        };
        attrs.finish(&["value", "x", "y", "z", "angle", "origin", "target", "up"], report);
        result = step * result;
        if !result.to_cols_array().iter().all(|v| v.abs() < LARGEST) {
            return Err(report.error(attrs.loc, "the transform becomes too large"));
        }
    }
    Ok(result)
}

/// The value of a point, vector, translation or scale: `value="x,y,z"`, or `x=`, `y=`, `z=` with a default.
pub fn vector(attrs: &Attrs, default: DVec3, report: &Report) -> Checked<DVec3> {
    let components = ["x", "y", "z"].map(|name| attrs.get(name));
    if let Some(value) = attrs.get("value") {
        if components.iter().any(|c| c.is_some()) {
            return Err(report.error(attrs.loc, "give either \"value\" or \"x\", \"y\", \"z\", not both"));
        }
        return Attrs::parse(value, values::vector, report);
    }
    let mut result = default;
    for (i, component) in components.iter().enumerate() {
        if let Some(attr) = component {
            result[i] = Attrs::parse(attr, values::number, report)?;
        }
    }
    Ok(result)
}

/// Counter-clockwise rotation about an axis, degrees.
fn rotate(attrs: &Attrs, report: &Report) -> Checked<DMat4> {
    let axis = vector(attrs, DVec3::ZERO, report)?;
    let angle = match attrs.get("angle") {
        Some(angle) => Attrs::parse(angle, values::number, report)?,
        None => return Err(report.error(attrs.loc, "<rotate> needs the attribute \"angle\"")),
    };
    // Scaled by the largest component first: the square of a tiny axis would underflow.
    let Some(axis) = (axis / axis.abs().max_element()).try_normalize() else {
        return Err(report.error(attrs.loc, "the axis of the rotation is zero"));
    };
    Ok(DMat4::from_axis_angle(axis, angle.to_radians()))
}

/// 16 numbers row by row, or 9 for the upper left part.
fn matrix(attr: &Attr, report: &Report) -> Checked<DMat4> {
    let m = Attrs::parse(attr, values::numbers, report)?;
    match m.len() {
        16 => {
            let m = DMat4::from_cols_array(&std::array::from_fn(|i| m[i])).transpose();
            if m.row(3) != DMat4::IDENTITY.row(3) {
                let message = "the last row of the matrix is not 0 0 0 1: perspective transforms are not supported";
                return Err(report.error(attr.loc, message));
            }
            Ok(m)
        }
        9 => Ok(DMat4::from_mat3(glam::DMat3::from_cols_array(&std::array::from_fn(|i| m[i])).transpose())),
        n => Err(report.error(attr.loc, format!("a matrix has 16 or 9 numbers, this one {n}"))),
    }
}

/// Camera space to world for an eye at `origin`.
fn lookat(attrs: &Attrs, report: &Report) -> Checked<DMat4> {
    let origin = Attrs::parse(attrs.need("origin", report)?, values::vector, report)?;
    let target = Attrs::parse(attrs.need("target", report)?, values::vector, report)?;
    let up = attrs.get("up").map(|up| Attrs::parse(up, values::vector, report)).transpose()?;
    look_at(origin, target, up.unwrap_or(DVec3::ZERO), attrs.loc, report)
}

/// See [`lookat`]; without a usable `up` any frame around the viewing direction is taken.
fn look_at(origin: DVec3, target: DVec3, up: DVec3, loc: Loc, report: &Report) -> Checked<DMat4> {
    let to = target - origin;
    let Some(z) = (to / to.abs().max_element()).try_normalize() else {
        return Err(report.error(loc, "origin and target of the lookat are the same point"));
    };
    let up = up.try_normalize().unwrap_or(DVec3::ZERO);
    let mut x = up.cross(z);
    if x.length_squared() < 1e-16 {
        if up != DVec3::ZERO {
            report.warn(loc, "up is parallel to the viewing direction; taking any other");
        }
        x = z.any_orthogonal_vector();
    }
    let x = x.normalize();
    let y = z.cross(x);
    Ok(DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), origin.extend(1.0)))
}
