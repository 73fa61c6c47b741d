//! Materials.
//!
//! Source      parameters and defaults of Mitsuba 3; `phong`, `ward`, `mixturebsdf`, `coating` of 0.6. Phong of
//!             exponent n becomes Beckmann of roughness sqrt(2 / (n + 2)) (Walter et al. 2007, section 5.2).
//! Not handled `principled`, `measured`, hair, polarisation: diffuse with a warning

use super::builder::Builder;
use super::legacy_bsdf;
use super::optics;
use super::props::Props;
use super::report::{Checked, Loc};
use super::texture::{color, scalar};
use super::tree::ObjectId;
use crate::formats::diagnostics::suggestion;
use crate::formats::spectrum::{Usage, to_rgb};
use crate::math::Rgb;
use crate::scene::description::{MaterialId, TextureId};
use crate::scene::material::{Distribution, Material, Roughness};
use crate::scene::texture::{Color, Texture};

const BSDFS: [&str; 18] = [
    "diffuse",
    "twosided",
    "dielectric",
    "thindielectric",
    "roughdielectric",
    "conductor",
    "roughconductor",
    "plastic",
    "roughplastic",
    "mask",
    "bumpmap",
    "normalmap",
    "blendbsdf",
    "mixturebsdf",
    "null",
    "roughdiffuse",
    "phong",
    "ward",
];
/// Known elsewhere, but not here.
const UNSUPPORTED: [&str; 10] = [
    "principled",
    "principledthin",
    "measured",
    "hair",
    "difftrans",
    "hk",
    "irawan",
    "pplastic",
    "circular",
    "hanrahan",
];

/// Lambertian grey.
pub fn grey(value: f32) -> Material {
    Material::Diffuse { reflectance: Color::Constant(Rgb::splat(value)) }
}

/// Reads a `<bsdf>`.
pub fn read(b: &mut Builder, id: ObjectId) -> Checked<Material> {
    let props = b.props(id);
    let kind = props.object.kind.as_str();
    let material = match kind {
        "diffuse" => Material::Diffuse { reflectance: reflectance(b, &props, "reflectance", 0.5)? },
        "roughdiffuse" => {
            props.ignore(&["use_fast_approx"]);
            Material::RoughDiffuse {
                reflectance: reflectance(b, &props, "reflectance", 0.5)?,
                alpha: scalar(b, &props, "alpha", 0.2, Usage::Constant)?,
            }
        }
        "dielectric" | "thindielectric" | "roughdielectric" => dielectric(b, &props, kind)?,
        "conductor" | "roughconductor" => conductor(b, &props, kind)?,
        "plastic" | "roughplastic" => plastic(b, &props, kind)?,
        "null" => Material::Null,
        "twosided" => two_sided(b, &props)?,
        "mask" => Material::Mask {
            opacity: scalar(b, &props, "opacity", 0.5, Usage::Reflectance)?,
            nested: nested(b, &props)?,
        },
        "bumpmap" => {
            let scale = props.float_or("scale", 1.0)? as f32;
            Material::BumpMap { texture: nested_texture(b, &props)?.0, scale, nested: nested(b, &props)? }
        }
        "normalmap" => {
            props.ignore(&["flip_invalid_normals", "use_shadowing_function"]);
            let (texture, loc) = match props.named("normalmap")? {
                Some((id, _, loc)) => (b.texture(id, loc)?, loc),
                None => nested_texture(b, &props)?,
            };
            if let Texture::Bitmap { image, .. } = b.textures[texture as usize]
                && b.decodes_srgb(image)
            {
                b.report.warn(loc, "the normal map is decoded as sRGB; set raw=true on its bitmap");
            }
            Material::NormalMap { texture, nested: nested(b, &props)? }
        }
        "blendbsdf" => blend(b, &props)?,
        "mixturebsdf" => legacy_bsdf::mixture(b, &props)?,
        "phong" | "ward" => legacy_bsdf::glossy(b, &props, kind)?,
        "coating" | "roughcoating" => {
            let message = format!("bsdf type \"{kind}\" is not supported; using the bsdf inside");
            b.report.unknown(props.object.kind_loc, message, None);
            let inside = nested(b, &props)?;
            return Ok(b.materials[inside as usize].clone());
        }
        _ => {
            let supported = if UNSUPPORTED.contains(&kind) { "is not supported" } else { "is unknown" };
            let message = format!("bsdf type \"{kind}\" {supported}; using diffuse");
            b.report.unknown(props.object.kind_loc, message, suggestion(kind, BSDFS));
            // The base colour keeps the picture recognisable.
            let reflectance = reflectance(b, &props, "base_color", 0.5)?;
            return Ok(Material::Diffuse { reflectance });
        }
    };
    props.finish();
    Ok(material)
}

/// A factor on scattered light.
fn reflectance(b: &mut Builder, props: &Props, name: &'static str, default: f64) -> Checked<Color> {
    color(b, props, name, default, Usage::Reflectance)
}

fn dielectric(b: &mut Builder, props: &Props, kind: &str) -> Checked<Material> {
    let eta = optics::relative_index(props, "bk7")?;
    let specular_reflectance = reflectance(b, props, "specular_reflectance", 1.0)?;
    let specular_transmittance = reflectance(b, props, "specular_transmittance", 1.0)?;
    Ok(match kind {
        "roughdielectric" => Material::RoughDielectric {
            eta,
            specular_reflectance,
            specular_transmittance,
            roughness: roughness(b, props)?,
        },
        "thindielectric" => Material::ThinDielectric { eta, specular_reflectance, specular_transmittance },
        _ => Material::Dielectric { eta, specular_reflectance, specular_transmittance },
    })
}

fn conductor(b: &mut Builder, props: &Props, kind: &str) -> Checked<Material> {
    let (eta, k) = if props.has("eta") || props.has("k") {
        if props.has("material") {
            return Err(props.error("material", "give either material or eta and k, not both"));
        }
        let missing = ["eta", "k"].into_iter().find(|name| !props.has(name));
        if let Some(name) = missing {
            return Err(props.error("", format!("{} with eta or k needs \"{name}\" as well", props.title())));
        }
        let eta = color(b, props, "eta", 0.0, Usage::Constant)?;
        (eta, color(b, props, "k", 1.0, Usage::Constant)?)
    } else {
        let legacy = props.object.legacy && !props.has("material");
        if legacy {
            b.report.warn(props.object.kind_loc, "no material is given; version 0.x means copper (Cu)");
        }
        let (eta, k) = optics::metal(props, if legacy { "Cu" } else { "none" })?;
        (Color::Constant(to_rgb(eta)), Color::Constant(to_rgb(k)))
    };
    let outside = if props.has("ext_eta") { optics::index(props, "ext_eta", "air")? as f32 } else { 1.0 };
    let (eta, k) = (divided(b, eta, outside), divided(b, k, outside));
    let specular_reflectance = reflectance(b, props, "specular_reflectance", 1.0)?;
    Ok(match kind {
        "roughconductor" => Material::RoughConductor { eta, k, specular_reflectance, roughness: roughness(b, props)? },
        _ => Material::Conductor { eta, k, specular_reflectance },
    })
}

/// A colour over a number.
fn divided(b: &mut Builder, color: Color, by: f32) -> Color {
    match color {
        Color::Constant(c) => Color::Constant(c / by),
        Color::Texture(_) if by == 1.0 => color,
        Color::Texture(texture) => {
            Color::Texture(b.add_texture(Texture::Scale { texture, factor: Rgb::splat(1.0 / by) }))
        }
    }
}

fn plastic(b: &mut Builder, props: &Props, kind: &str) -> Checked<Material> {
    let eta = optics::relative_index(props, "polypropylene")?;
    let diffuse_reflectance = reflectance(b, props, "diffuse_reflectance", 0.5)?;
    let specular_reflectance = reflectance(b, props, "specular_reflectance", 1.0)?;
    let nonlinear = props.boolean_or("nonlinear", false)?;
    Ok(match kind {
        "roughplastic" => Material::RoughPlastic {
            eta,
            diffuse_reflectance,
            specular_reflectance,
            nonlinear,
            roughness: roughness(b, props)?,
        },
        _ => Material::Plastic { eta, diffuse_reflectance, specular_reflectance, nonlinear },
    })
}

/// `distribution`, and `alpha` or both of `alpha_u`, `alpha_v`.
fn roughness(b: &mut Builder, props: &Props) -> Checked<Roughness> {
    let distribution = match props.choice("distribution", &["beckmann", "ggx", "phong", "as"])? {
        "ggx" => Distribution::Ggx,
        "beckmann" => Distribution::Beckmann,
        other => {
            let message = format!("distribution \"{other}\" is not supported; using \"beckmann\"");
            b.report.warn(props.loc("distribution"), message);
            Distribution::Beckmann
        }
    };
    props.ignore(&["sample_visible"]);
    let split = [props.has("alpha_u"), props.has("alpha_v")];
    if split[0] != split[1] {
        let (given, missing) = if split[0] { ("alpha_u", "alpha_v") } else { ("alpha_v", "alpha_u") };
        return Err(props.error(given, format!("{given} needs {missing} as well")));
    }
    if split[0] && props.has("alpha") {
        return Err(props.error("alpha", "give either alpha or alpha_u and alpha_v, not both"));
    }
    let names = if split[0] { ["alpha_u", "alpha_v"] } else { ["alpha", "alpha"] };
    let mut alpha = |name: &'static str| -> Checked<_> {
        let value = scalar(b, props, name, 0.1, Usage::Constant)?;
        let positive = !matches!(value, crate::scene::texture::Scalar::Constant(v) if v < 0.0);
        props.check(positive, name, "must not be negative")?;
        Ok(value)
    };
    let (alpha_u, alpha_v) = (alpha(names[0])?, alpha(names[1])?);
    Ok(Roughness { distribution, alpha_u, alpha_v })
}

/// The one nested material.
pub fn nested(b: &mut Builder, props: &Props) -> Checked<MaterialId> {
    let (id, loc) = props.nested_count("bsdf", 1, 1)?[0];
    b.material(id, loc)
}

/// The one nested texture, whatever its name.
fn nested_texture(b: &mut Builder, props: &Props) -> Checked<(TextureId, Loc)> {
    let (id, loc) = props.nested_count("texture", 1, 1)?[0];
    Ok((b.texture(id, loc)?, loc))
}

fn two_sided(b: &mut Builder, props: &Props) -> Checked<Material> {
    let sides = props.nested_count("bsdf", 1, 2)?;
    let allowed = props.boolean_or("allow_transmission", false)?;
    let mut ids = Vec::new();
    for &(id, loc) in &sides {
        let material = b.material(id, loc)?;
        if transmits(b, material) {
            if !allowed {
                let help = Some("use it without twosided".into());
                return Err(b.report.error_help(loc, "a twosided bsdf cannot hold one that lets light through", help));
            }
            // Such a material has two sides already.
            return Ok(b.materials[material as usize].clone());
        }
        ids.push(material);
    }
    Ok(Material::TwoSided { front: ids[0], back: ids[ids.len() - 1] })
}

/// Whether a material lets light through.
fn transmits(b: &Builder, id: MaterialId) -> bool {
    use Material as M;
    match b.materials[id as usize] {
        M::Dielectric { .. } | M::ThinDielectric { .. } | M::RoughDielectric { .. } | M::Null | M::Mask { .. } => true,
        M::Blend { first, second, .. } => transmits(b, first) || transmits(b, second),
        M::BumpMap { nested, .. } | M::NormalMap { nested, .. } => transmits(b, nested),
        M::TwoSided { front, back } => transmits(b, front) || transmits(b, back),
        _ => false,
    }
}

fn blend(b: &mut Builder, props: &Props) -> Checked<Material> {
    if !props.has("weight") {
        return Err(props.error("", "bsdf type \"blendbsdf\" needs the property \"weight\""));
    }
    let weight = scalar(b, props, "weight", 0.5, Usage::Reflectance)?;
    let parts = props.nested_count("bsdf", 2, 2)?;
    Ok(Material::Blend {
        weight,
        first: b.material(parts[0].0, parts[0].1)?,
        second: b.material(parts[1].0, parts[1].1)?,
        absorbed: 0.0,
    })
}
