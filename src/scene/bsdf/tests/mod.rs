//! Tests of scattering. Here: the materials, surfaces and textures they share.

mod exact;
mod golden;
mod statistics;

use super::*;
use crate::math::Affine2;
use crate::math::sampler::{hash, unit_f32};
use crate::scene::material::Distribution::{Beckmann, Ggx};
use crate::scene::material::{Distribution, Roughness};
use crate::scene::texture::{Bitmap, Color, Scalar, TexFilter, Texture, Wrap};

/// Index of the metal in use, copper-like.
const ETA: Rgb = Rgb::new(0.2, 0.92, 1.1);
const K: Rgb = Rgb::new(3.9, 2.45, 2.14);

fn grey(x: f32) -> Color {
    Color::Constant(Rgb::splat(x))
}

fn diffuse(x: f32) -> Material {
    Material::Diffuse { reflectance: grey(x) }
}

fn rough(distribution: Distribution, alpha_u: f32, alpha_v: f32) -> Roughness {
    Roughness { distribution, alpha_u: Scalar::Constant(alpha_u), alpha_v: Scalar::Constant(alpha_v) }
}

fn metal(roughness: Roughness) -> Material {
    Material::RoughConductor {
        eta: Color::Constant(ETA),
        k: Color::Constant(K),
        specular_reflectance: grey(1.0),
        roughness,
    }
}

fn glass(eta: f32, roughness: Roughness) -> Material {
    Material::RoughDielectric { eta, specular_reflectance: grey(1.0), specular_transmittance: grey(1.0), roughness }
}

fn plastic(eta: f32, diffuse: f32, specular: f32, nonlinear: bool, roughness: Option<Roughness>) -> Material {
    let (diffuse_reflectance, specular_reflectance) = (grey(diffuse), grey(specular));
    match roughness {
        None => Material::Plastic { eta, diffuse_reflectance, specular_reflectance, nonlinear },
        Some(roughness) => {
            Material::RoughPlastic { eta, diffuse_reflectance, specular_reflectance, nonlinear, roughness }
        }
    }
}

fn flat() -> SurfacePoint {
    SurfacePoint {
        p: Vec3::ZERO,
        p_error: Vec3::ZERO,
        n_geo: Vec3::Z,
        n_shade: Vec3::Z,
        uv: Vec2::new(0.3, 0.6),
        dp_du: Vec3::X,
        dp_dv: Vec3::Y,
        shape: 0,
        prim: 0,
    }
}

/// The surface the maps were evaluated on.
fn tilted() -> SurfacePoint {
    SurfacePoint {
        n_shade: Vec3::new(0.2, -0.1, 1.0).normalize(),
        uv: Vec2::new(0.3, 0.45),
        dp_du: Vec3::new(0.8, 0.5, 0.1),
        dp_dv: Vec3::new(-0.3, 1.4, 0.2),
        ..flat()
    }
}

/// Texture 0: a colourful picture of 3 x 2 texels. Texture 1: the tangent-space normal (0.5, -0.3, 0.6) everywhere.
fn textures() -> ([Texture; 2], [Bitmap; 2]) {
    let texture =
        |image| Texture::Bitmap { image, filter: TexFilter::Bilinear, wrap: Wrap::Repeat, to_uv: Affine2::IDENTITY };
    let picture =
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.4, 0.6], [0.9, 0.1, 0.3], [0.5, 0.5, 0.0]];
    let normal = 0.5 * (Vec3::new(0.5, -0.3, 0.6).normalize() + Vec3::ONE);
    let images = [
        Bitmap { width: 3, height: 2, pixels: picture.iter().map(|&c| Rgb::from(c)).collect() },
        Bitmap { width: 1, height: 1, pixels: vec![normal] },
    ];
    ([texture(0), texture(1)], images)
}

/// A material (the last of the list) with its name.
type Case = (&'static str, Vec<Material>);

fn blend(weight: f32) -> Material {
    Material::Blend { weight: Scalar::Constant(weight), first: 0, second: 1, absorbed: 0.0 }
}

fn cases() -> Vec<Case> {
    let mirror =
        Material::Conductor { eta: Color::Constant(ETA), k: Color::Constant(K), specular_reflectance: grey(1.0) };
    let oren_nayar = Material::RoughDiffuse { reflectance: grey(0.7), alpha: Scalar::Constant(0.5) };
    let tinted = Material::RoughDielectric {
        eta: 1.5,
        specular_reflectance: grey(0.4),
        specular_transmittance: grey(0.9),
        roughness: rough(Ggx, 0.3, 0.3),
    };
    let mask = Material::Mask { opacity: Scalar::Constant(0.3), nested: 0 };
    let two_sided = Material::TwoSided { front: 0, back: 1 };
    vec![
        ("diffuse", vec![diffuse(0.5)]),
        ("rough diffuse", vec![oren_nayar]),
        ("GGX metal", vec![metal(rough(Ggx, 0.3, 0.3))]),
        ("anisotropic GGX metal", vec![metal(rough(Ggx, 0.15, 0.6))]),
        ("Beckmann metal", vec![metal(rough(Beckmann, 0.3, 0.3))]),
        ("anisotropic Beckmann metal", vec![metal(rough(Beckmann, 0.2, 0.7))]),
        ("GGX glass", vec![glass(1.5, rough(Ggx, 0.4, 0.4))]),
        ("anisotropic GGX glass", vec![glass(1.3, rough(Ggx, 0.2, 0.5))]),
        ("Beckmann glass, inverted", vec![glass(0.7, rough(Beckmann, 0.3, 0.3))]),
        ("tinted glass", vec![tinted]),
        ("plastic", vec![plastic(1.5, 0.6, 0.8, false, None)]),
        ("nonlinear plastic", vec![plastic(1.9, 0.9, 1.0, true, None)]),
        ("GGX plastic", vec![plastic(1.5, 0.8, 1.0, false, Some(rough(Ggx, 0.3, 0.3)))]),
        ("Beckmann plastic", vec![plastic(1.5, 0.3, 1.0, true, Some(rough(Beckmann, 0.2, 0.2)))]),
        ("blend with a mirror", vec![diffuse(0.5), mirror, blend(0.4)]),
        ("blend with metal", vec![diffuse(0.5), metal(rough(Ggx, 0.2, 0.5)), blend(0.6)]),
        ("masked diffuse", vec![diffuse(0.8), mask]),
        ("two sides", vec![diffuse(0.8), metal(rough(Ggx, 0.4, 0.2)), two_sided]),
    ]
}

/// Directions to the viewer: near the normal, at an angle, grazing, and two below the surface.
fn views() -> Vec<Vec3> {
    [[0.01, 0.02, 1.0], [0.5, 0.3, 0.7], [-0.8, 0.4, 0.4], [0.3, -0.95, 0.08], [0.3, 0.2, -0.7], [-0.9, 0.1, -0.25]]
        .map(|v| Vec3::from(v).normalize())
        .to_vec()
}

fn resolve(materials: &[Material], at: &SurfacePoint, wo: Vec3) -> Bsdf {
    let (textures, images) = textures();
    let textures = Textures { textures: &textures, images: &images };
    Bsdf::new(materials, materials.len() as u32 - 1, textures, at, wo)
}

fn uniform(seed: u64, i: u64, dimension: u64) -> f32 {
    unit_f32(hash(hash(seed, dimension), i))
}

fn draw(bsdf: &Bsdf, wo: Vec3, seed: u64, i: u64, transport: Transport) -> Option<BsdfSample> {
    let u = Vec2::new(uniform(seed, i, 1), uniform(seed, i, 2));
    bsdf.sample(wo, uniform(seed, i, 0), u, transport)
}
