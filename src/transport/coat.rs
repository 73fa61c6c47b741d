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
//! Verified by `tests`: mean 1, the same for all that looks from above, Lambert's is 1

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DVec3, Rgb, Sampler, warp};
    use crate::scene::Color;
    use crate::scene::description::GeometryDesc;
    use crate::transport::tests::{Room, add, add_material, empty, square};

    /// The coat of a floor of the material, and the room it is in.
    fn floor(material: Material) -> (Room, Facet) {
        let mut scene = empty();
        let id = add_material(&mut scene, material);
        add(&mut scene, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 1.0), id);
        let facet = Facet { p: Vec3::ZERO, p_error: Vec3::ZERO, n_geo: Vec3::Y, n_shade: Vec3::Y, shape: 0 };
        (Room::new(scene), facet)
    }

    fn plastic(nonlinear: bool) -> Material {
        let grey = |v| Color::Constant(Rgb::splat(v));
        Material::Plastic { eta: 1.5, diffuse_reflectance: grey(0.6), specular_reflectance: grey(1.0), nonlinear }
    }

    #[test]
    fn what_coats_let_in_has_the_mean_one_and_falls_towards_the_horizon() {
        for nonlinear in [false, true] {
            let (room, facet) = floor(plastic(nonlinear));
            let coat = Coat::new(&room.world(), &facet);
            let n = 4096;
            let draw = |i| {
                let w = warp::sample_cosine_hemisphere(Sampler::new(4, 0, i).next_2d());
                f64::from(coat.response(Vec3::new(w.x, w.z, w.y)))
            };
            let mean = (0..n).map(draw).sum::<f64>() / n as f64;
            assert!((mean - 1.0).abs() < 3e-3, "{mean}");
            let at =
                |degrees: f32| coat.response(Vec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0));
            assert!(at(0.0) > 1.03 && at(85.0) < 0.5 && at(60.0) > at(80.0), "{} {}", at(0.0), at(85.0));
        }
    }

    #[test]
    fn without_a_coat_all_directions_count_alike() {
        let (room, facet) = floor(Material::Diffuse { reflectance: Color::Constant(Rgb::splat(0.5)) });
        let coat = Coat::new(&room.world(), &facet);
        assert!([Vec3::Y, Vec3::new(0.99, 0.14, 0.0)].iter().all(|w| coat.response(*w) == 1.0));
    }
}
