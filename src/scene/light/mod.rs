//! Lights: direct sampling towards a point with its densities, and what a ray that arrives sees.

use super::description::LightDesc;
use super::shape::Shape;
use super::surface::SurfacePoint;
use super::texture::{Bitmap, Texture, Textures};
use crate::math::{Rgb, Vec2, Vec3};

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the shaded point to the light.
    pub wi: Vec3,
    /// Distance to the sampled point; infinite for lights at infinity.
    pub distance: f32,
    /// Radiance that arrives if nothing is in between, over `pdf_dir` and selection probability; for delta lights
    /// intensity / distance^2 or irradiance over the selection probability.
    pub weight: Rgb,
    /// Density per solid angle, selection probability included; 0 for delta lights (points, directions).
    pub pdf_dir: f32,
    /// The light, as an index into [`Lights::infos`].
    pub light: u32,
}

/// A light as `info` lists it.
#[derive(Clone, Debug)]
pub struct LightInfo {
    /// Kind: `area (rectangle)`, `point`, `envmap`, ...
    pub kind: String,
    /// Name of the shape, or empty.
    pub name: String,
    /// Emitted power, W (for lights at infinity: what enters the scene's bounding sphere).
    pub power: Rgb,
    /// Emitting primitives (triangles of a mesh; 1 for others).
    pub primitives: usize,
}

/// All lights of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    /// One entry per light of the file: area lights in order of their shapes, then the others.
    pub infos: Vec<LightInfo>,
}

impl Lights {
    /// Collects the lights. `bounds` is the scene's bounding sphere (centre, radius).
    pub fn new(
        shapes: &[Shape],
        lights: &[LightDesc],
        textures: &[Texture],
        images: &[Bitmap],
        bounds: (Vec3, f32),
    ) -> Self {
        let _ = (shapes, lights, textures, images, bounds);
        todo!("helper lights")
    }

    /// Samples a light towards the point `p`: `u_light` selects it (by power), `u` the direction.
    pub fn sample(&self, shapes: &[Shape], textures: Textures, p: Vec3, u_light: f32, u: Vec2) -> Option<LightSample> {
        let _ = (shapes, textures, p, u_light, u);
        todo!()
    }

    /// Radiance that the surface point `at` emits towards the unit vector `w`; zero for what is no lamp.
    pub fn emitted(&self, shapes: &[Shape], textures: Textures, at: &SurfacePoint, w: Vec3) -> Rgb {
        let _ = (shapes, textures, at, w);
        todo!()
    }

    /// Density per solid angle with which [`Self::sample`] at `p` draws the direction to the lamp point `at`.
    pub fn pdf_dir_surface(&self, shapes: &[Shape], p: Vec3, at: &SurfacePoint) -> f32 {
        let _ = (shapes, p, at);
        todo!()
    }

    /// Radiance from infinity along the unit direction `w` (away from the scene): all environment lights.
    pub fn environment(&self, textures: Textures, w: Vec3) -> Rgb {
        let _ = (textures, w);
        todo!()
    }

    /// Density per solid angle with which [`Self::sample`] draws the direction `w` into the environment.
    pub fn pdf_dir_environment(&self, w: Vec3) -> f32 {
        let _ = w;
        todo!()
    }
}
