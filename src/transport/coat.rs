//! How a coated diffuse surface weighs the light from a direction, over how Lambert's does.
//!
//! The diffuse part of a (rough) plastic is rho' T(wi) T(wo) / pi: what its coat lets in depends on the direction wi. Irradiance stands
//! for radiance over all directions; to serve as L = albedo(wo) / pi E it has to be weighted by
//!
//! ```text
//! r(wi) = pi f(n, wi) / albedo(n) = T(wi) / mean of T        the mean over a cosine hemisphere: r has the mean 1
//! ```
//!
//! which is the same for all wo. Light at grazing angles, such as what a window sends along its own reveal, is halved by it.
//! Bias        none for plastics; 1 is taken for other materials that are neither Lambertian nor a plastic, and under bump maps
//! Not handled neighbours of one surface of which one is coated and the other is not: their records mix
//! Not verified yet by a test of its own

use super::World;
use super::surfels::Facet;
use crate::math::{Vec3, luminance};
use crate::scene::{Bsdf, Material, Transport};
use std::f32::consts::PI;

/// The diffuse part of a material as irradiance needs it.
#[derive(Clone, Debug)]
pub struct Coat {
    n: Vec3,
    /// `None`: Lambert's.
    coated: Option<(Bsdf, f32)>,
}

impl Coat {
    /// That of the material at a place.
    pub fn new(world: &World, place: &Facet) -> Self {
        let n = place.n_shade;
        let scene = world.scene;
        let plain = Coat { n, coated: None };
        let Some(shape) = scene.shapes.get(place.shape as usize) else { return plain };
        let material = &scene.materials[shape.material as usize];
        let leaf = match material {
            Material::TwoSided { front, .. } => &scene.materials[*front as usize],
            other => other,
        };
        if !matches!(leaf, Material::Plastic { .. } | Material::RoughPlastic { .. }) {
            return plain;
        }
        let (diffuse, _) = world.bsdf(&place.surface_point(), n).split();
        let coated = diffuse.filter(|d| d.lambert(n).is_none()).map(|d| {
            let albedo = luminance(d.albedo(n));
            (d, albedo)
        });
        Coat { n, coated: coated.filter(|(_, albedo)| *albedo > 0.0) }
    }

    /// r(wi); `wi` unit, on the side of the normal.
    pub fn response(&self, wi: Vec3) -> f32 {
        let Some((diffuse, albedo)) = &self.coated else { return 1.0 };
        let cos = wi.dot(self.n);
        let f = luminance(diffuse.eval(self.n, wi, Transport::Radiance));
        if cos > 0.0 && f.is_finite() { PI * f / (albedo * cos) } else { 1.0 }
    }
}
