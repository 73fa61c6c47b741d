//! What a scene is: the plain [`description`] a file gives, and the checked, immutable [`Scene`] built from it.

pub mod bsdf;
pub mod build;
pub mod camera;
pub mod description;
pub mod light;
pub mod material;
pub mod mesh;
pub mod shape;
pub mod surface;
pub mod texture;

pub use bsdf::{Bsdf, BsdfSample, LobeKind, Transport};
pub use build::{Scene, SceneError};
pub use camera::Camera;
pub use description::Description;
pub use light::{LightSample, Lights};
pub use material::Material;
pub use mesh::Mesh;
pub use shape::{Geometry, Shape};
pub use surface::SurfacePoint;
pub use texture::{Bitmap, Color, Scalar, Texture};
