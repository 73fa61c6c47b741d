//! From description to the immutable scene.

use super::camera::Camera;
use super::description::{Description, FilmDesc, IntegratorDesc};
use super::light::Lights;
use super::material::Material;
use super::shape::Shape;
use super::texture::{Bitmap, Texture, Textures};
use crate::math::Vec3;
use rayon::prelude::*;

/// A scene that cannot be built; the text names the shape or the camera.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
    /// For each material: whether rays may pass straight through it (masks, null surfaces).
    pub passes_light: Vec<bool>,
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
        Textures { textures: &self.textures, images: &self.images }
    }

    /// Builds the scene; shapes are built in parallel, in the order of the description.
    pub fn new(desc: Description) -> Result<Self, SceneError> {
        let camera = Camera::new(&desc.camera, &desc.film).map_err(|e| SceneError(format!("camera: {e}")))?;
        let shapes = desc
            .shapes
            .into_par_iter()
            .map(|s| {
                let name = s.name.clone();
                Shape::new(s).map_err(|e| SceneError(format!("shape \"{name}\": {e}")))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let bounds = bounding_sphere(&shapes);
        let lights = Lights::new(&shapes, &desc.lights, &desc.textures, &desc.images, bounds);
        Ok(Scene {
            camera,
            film: desc.film,
            integrator: desc.integrator,
            sample_count: desc.sample_count,
            seed: desc.seed,
            passes_light: (0..desc.materials.len()).map(|m| passes_light(&desc.materials, m)).collect(),
            images: desc.images,
            textures: desc.textures,
            materials: desc.materials,
            shapes,
            lights,
            bounds,
        })
    }

    /// Triangles of all meshes.
    pub fn triangle_count(&self) -> usize {
        let triangles = |s: &Shape| match &s.geometry {
            super::Geometry::Mesh(m) => m.triangles.len(),
            _ => 0,
        };
        self.shapes.iter().map(triangles).sum()
    }
}

/// Sphere around the box of all shapes; a unit sphere for an empty scene.
fn bounding_sphere(shapes: &[Shape]) -> (Vec3, f32) {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (lo, hi) = shapes.iter().map(Shape::bounds).fold(empty, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let radius = 0.5 * (hi - lo).length();
    if radius.is_finite() && radius > 0.0 { (0.5 * (lo + hi), radius) } else { (Vec3::ZERO, 1.0) }
}

/// Whether material `id`, or one nested in it, lets rays pass straight through.
fn passes_light(materials: &[Material], id: usize) -> bool {
    let nested = |m: u32| passes_light(materials, m as usize);
    match &materials[id] {
        Material::Null | Material::Mask { .. } => true,
        Material::TwoSided { front, back } => nested(*front) || nested(*back),
        Material::Blend { first, second, .. } => nested(*first) || nested(*second),
        Material::BumpMap { nested: m, .. } | Material::NormalMap { nested: m, .. } => nested(*m),
        _ => false,
    }
}
