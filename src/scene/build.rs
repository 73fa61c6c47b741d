//! From description to the immutable scene.

use super::camera::Camera;
use super::description::{Description, FilmDesc, IntegratorDesc};
use super::light::Lights;
use super::material::Material;
use super::shape::Shape;
use super::texture::{Bitmap, Texture, Textures};
use crate::math::Vec3;

/// A scene that cannot be built.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct SceneError(pub String);

/// An immutable, checked scene in world space.
#[derive(Debug)]
pub struct Scene {
    /// Camera.
    pub camera: Camera,
    /// Film.
    pub film: FilmDesc,
    /// What the file says about light transport.
    pub integrator: IntegratorDesc,
    /// Samples per pixel the file asks for.
    pub sample_count: Option<u32>,
    /// Seed of the file.
    pub seed: u64,
    /// Pictures.
    pub images: Vec<Bitmap>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Shapes.
    pub shapes: Vec<Shape>,
    /// Lights.
    pub lights: Lights,
    /// Bounding sphere (centre, radius).
    pub bounds: (Vec3, f32),
}

impl Scene {
    /// The textures with their pictures.
    pub fn textures(&self) -> Textures<'_> {
        Textures {
            textures: &self.textures,
            images: &self.images,
        }
    }

    /// Builds the scene; shapes are built in parallel.
    pub fn new(desc: Description) -> Result<Self, SceneError> {
        let _ = desc;
        todo!()
    }
}
