//! Materials: how surfaces scatter, as descriptions over textures. [`super::Bsdf`] is a material at one point.

use super::description::{MaterialId, TextureId};
use super::texture::{Color, Scalar};

/// Microfacet distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Beckmann.
    Beckmann,
    /// GGX (Trowbridge-Reitz).
    Ggx,
}

/// Roughness of a microfacet material.
#[derive(Clone, Debug, PartialEq)]
pub struct Roughness {
    /// Distribution of normals.
    pub distribution: Distribution,
    /// Roughness along the first tangent.
    pub alpha_u: Scalar,
    /// Roughness along the second tangent.
    pub alpha_v: Scalar,
}

/// How a surface scatters. Parameters as in the scene format of the same names; `eta` of dielectrics is
/// interior over exterior index, the exterior being the side the normal points to.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Material {
    /// Lambertian on the normal side, black behind.
    Diffuse { reflectance: Color },
    /// Oren-Nayar (qualitative model) on the normal side.
    RoughDiffuse { reflectance: Color, alpha: Scalar },
    /// Smooth metal on the normal side; `eta` 0 and `k` 1 is a perfect mirror.
    Conductor { eta: Color, k: Color, specular_reflectance: Color },
    /// Rough metal on the normal side.
    RoughConductor { eta: Color, k: Color, specular_reflectance: Color, roughness: Roughness },
    /// Smooth boundary between two media.
    Dielectric { eta: f32, specular_reflectance: Color, specular_transmittance: Color },
    /// Two parallel boundaries without bending (a pane).
    ThinDielectric { eta: f32, specular_reflectance: Color, specular_transmittance: Color },
    /// Rough boundary between two media.
    RoughDielectric { eta: f32, specular_reflectance: Color, specular_transmittance: Color, roughness: Roughness },
    /// Smooth dielectric coat on a diffuse base.
    Plastic { eta: f32, diffuse_reflectance: Color, specular_reflectance: Color, nonlinear: bool },
    /// Rough dielectric coat on a diffuse base.
    RoughPlastic {
        eta: f32,
        diffuse_reflectance: Color,
        specular_reflectance: Color,
        nonlinear: bool,
        roughness: Roughness,
    },
    /// Nothing happens.
    Null,
    /// `front` on the normal side, `back` (turned around) on the other.
    TwoSided { front: MaterialId, back: MaterialId },
    /// `nested` with probability `opacity`, else the ray goes straight on.
    Mask { opacity: Scalar, nested: MaterialId },
    /// (1 - weight) `first` + weight `second`. `absorbed` is the share that a legacy mixture loses.
    Blend { weight: Scalar, first: MaterialId, second: MaterialId, absorbed: f32 },
    /// Shading normal perturbed by the slope of a height map (world units times `scale`).
    BumpMap { texture: TextureId, scale: f32, nested: MaterialId },
    /// Shading normal from a tangent-space map, n = 2c - 1.
    NormalMap { texture: TextureId, nested: MaterialId },
}
