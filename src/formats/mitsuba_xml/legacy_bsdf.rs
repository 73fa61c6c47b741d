//! Materials of Mitsuba 0.6 that become combinations of today's: `mixturebsdf`, `phong`, `ward`.
//!
//! Bias        `phong` and `ward` keep the reflectances of their lobes but not their exact shapes

use super::builder::Builder;
use super::props::Props;
use super::report::Checked;
use super::texture::{color, scalar};
use super::values;
use crate::formats::spectrum::Usage;
use crate::math::Rgb;
use crate::scene::material::{Distribution, Material, Roughness};
use crate::scene::texture::{Color, Scalar, Texture};

/// `weights` "a, b, ...": a chain of blends; what is missing to 1 is absorbed.
pub fn mixture(b: &mut Builder, props: &Props) -> Checked<Material> {
    let Some(text) = props.string("weights")? else {
        return Err(props.error("", "bsdf type \"mixturebsdf\" needs the property \"weights\""));
    };
    let weights = values::numbers(text).map_err(|m| props.error("weights", m))?;
    let parts = props.nested_count("bsdf", 1, 64)?;
    if weights.len() != parts.len() {
        let message = format!("{} weights are given for {} nested bsdfs", weights.len(), parts.len());
        return Err(props.error("weights", message));
    }
    let sum: f64 = weights.iter().sum();
    let positive = weights.iter().all(|w| *w >= 0.0) && sum > 0.0 && sum.is_finite();
    props.check(positive, "weights", "must not be negative, and their sum must be above 0")?;
    if sum > 1.0 + 1e-6 {
        b.report.warn(props.loc("weights"), format!("the weights add up to {sum}; scaled to 1"));
    } else if sum < 1.0 - 1e-6 {
        let message = format!("the weights add up to {sum}; the rest of the light is absorbed");
        b.report.warn(props.loc("weights"), message);
    }
    let mut first = b.material(parts[0].0, parts[0].1)?;
    let (mut second, mut weight, mut so_far) = (first, 0.0, weights[0]);
    for (i, &(id, loc)) in parts.iter().enumerate().skip(1) {
        if i > 1 {
            first = b.add_material(Material::Blend {
                weight: Scalar::Constant(weight as f32),
                first,
                second,
                absorbed: 0.0,
            });
        }
        second = b.material(id, loc)?;
        so_far += weights[i];
        weight = if so_far > 0.0 { weights[i] / so_far } else { 0.0 };
    }
    Ok(Material::Blend {
        weight: Scalar::Constant(weight as f32),
        first,
        second,
        absorbed: (1.0 - sum).max(0.0) as f32,
    })
}

/// A diffuse and a glossy lobe, added: kd + ks = (1-w) kd/(1-w) + w ks/w, the glossy one a Beckmann mirror.
pub fn glossy(b: &mut Builder, props: &Props, kind: &str) -> Checked<Material> {
    let diffuse = color(b, props, "diffuse_reflectance", 0.5, Usage::Reflectance)?;
    let specular = color(b, props, "specular_reflectance", 0.2, Usage::Reflectance)?;
    let (alpha_u, alpha_v) = if kind == "phong" {
        let exponent = props.float_or("exponent", 30.0)?;
        props.check(exponent >= 0.0, "exponent", "must not be negative")?;
        let alpha = Scalar::Constant((2.0 / (exponent + 2.0)).sqrt() as f32);
        (alpha.clone(), alpha)
    } else {
        props.ignore(&["variant"]);
        (scalar(b, props, "alpha_u", 0.1, Usage::Constant)?, scalar(b, props, "alpha_v", 0.1, Usage::Constant)?)
    };
    let message = format!("bsdf type \"{kind}\" is approximated by a Beckmann lobe");
    b.report.warn(props.object.kind_loc, message);
    let mean = |c: &Color| match c {
        Color::Constant(c) => Some(c.element_sum() / 3.0),
        Color::Texture(_) => None,
    };
    let weight = match (mean(&diffuse), mean(&specular)) {
        (Some(d), Some(s)) if d + s > 0.0 => s / (d + s),
        (None, Some(s)) => s,
        (Some(d), None) => 1.0 - d,
        _ => 0.5,
    };
    // Neither lobe may vanish by its weight alone unless it is black.
    let weight = match (mean(&diffuse), mean(&specular)) {
        (_, Some(0.0)) => 0.0,
        (Some(0.0), _) => 1.0,
        _ => weight.clamp(0.05, 0.95),
    };
    let reflectance = scaled(b, diffuse, 1.0 - weight);
    let specular_reflectance = scaled(b, specular, weight);
    let first = b.add_material(Material::Diffuse { reflectance });
    let roughness = Roughness { distribution: Distribution::Beckmann, alpha_u, alpha_v };
    let second = b.add_material(Material::RoughConductor {
        eta: Color::Constant(Rgb::ZERO),
        k: Color::Constant(Rgb::ONE),
        specular_reflectance,
        roughness,
    });
    Ok(Material::Blend { weight: Scalar::Constant(weight), first, second, absorbed: 0.0 })
}

/// A colour divided by the weight of its lobe (black where that is 0).
fn scaled(b: &mut Builder, color: Color, weight: f32) -> Color {
    let factor = if weight > 0.0 { 1.0 / weight } else { 0.0 };
    match color {
        Color::Constant(c) => Color::Constant(c * factor),
        Color::Texture(texture) => {
            Color::Texture(b.add_texture(Texture::Scale { texture, factor: Rgb::splat(factor) }))
        }
    }
}
