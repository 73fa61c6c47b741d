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

/// Whether the material `id` has a lobe, in any of its parts, that is sharper than the roughness `alpha` (Dirac lobes have 0), null
/// lobes excluded. Roughness from a texture counts as sharp.
pub fn has_sharp_lobe(materials: &[Material], id: MaterialId, alpha: f32) -> bool {
    let sharp = |r: &Roughness| {
        let one = |s: &Scalar| match s {
            Scalar::Constant(a) => *a < alpha,
            _ => true,
        };
        one(&r.alpha_u) || one(&r.alpha_v)
    };
    // Trees may share branches; each material is visited once.
    let (mut seen, mut waiting) = (vec![false; materials.len()], vec![id]);
    while let Some(id) = waiting.pop() {
        if std::mem::replace(&mut seen[id as usize], true) {
            continue;
        }
        match &materials[id as usize] {
            Material::Diffuse { .. } | Material::RoughDiffuse { .. } | Material::Null => {}
            Material::Conductor { .. }
            | Material::Dielectric { .. }
            | Material::ThinDielectric { .. }
            | Material::Plastic { .. } => return true,
            Material::RoughConductor { roughness, .. }
            | Material::RoughDielectric { roughness, .. }
            | Material::RoughPlastic { roughness, .. } => {
                if sharp(roughness) {
                    return true;
                }
            }
            Material::TwoSided { front, back } => waiting.extend([*front, *back]),
            Material::Blend { first, second, .. } => waiting.extend([*first, *second]),
            Material::Mask { nested, .. } | Material::BumpMap { nested, .. } | Material::NormalMap { nested, .. } => {
                waiting.push(*nested);
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rgb;

    #[test]
    fn sharp_lobes_are_found_in_any_branch() {
        let grey = || Color::Constant(Rgb::splat(0.5));
        let rough = |a| Roughness {
            distribution: Distribution::Ggx,
            alpha_u: Scalar::Constant(a),
            alpha_v: Scalar::Constant(a),
        };
        let metal =
            |a| Material::RoughConductor { eta: grey(), k: grey(), specular_reflectance: grey(), roughness: rough(a) };
        let materials = [
            Material::Diffuse { reflectance: grey() },
            metal(0.3),
            metal(0.05),
            Material::TwoSided { front: 0, back: 2 },
            Material::TwoSided { front: 0, back: 1 },
            Material::Null,
        ];
        let sharp: Vec<bool> = (0..6).map(|id| has_sharp_lobe(&materials, id, 0.1)).collect();
        assert_eq!(sharp, [false, false, true, true, false, false]);
    }
}
