//! Numbers that tell one scene from another: what a cache file belongs to.
//!
//! Three of them, since different things follow from a difference: other geometry or other materials make the stored hits wrong, other
//! lights only what they bring. Every vertex, parameter and texel counts, bit by bit.
//! Bias        none; two different scenes have the same number with the probability 2^-64
//! Verified by tests/irradiance_cache.rs

use super::World;
use crate::math::Vec3;
use crate::math::sampler::hash;
use crate::scene::light::LightKind;
use crate::scene::{Geometry, Mesh};
use std::fmt::{self, Debug, Write};

/// What a scene is, in three numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint {
    /// Shapes.
    pub geometry: u64,
    /// Materials, textures, and which shape has which.
    pub materials: u64,
    /// Lights and what they emit.
    pub lights: u64,
}

impl Fingerprint {
    /// Of a scene; looks at every vertex and texel.
    pub fn new(world: &World) -> Self {
        let scene = world.scene;
        let (mut geometry, mut materials, mut lights) = (Digest(1), Digest(2), Digest(3));
        for shape in &scene.shapes {
            match &shape.geometry {
                Geometry::Mesh(mesh) => geometry.mesh(mesh),
                other => geometry.text(other),
            }
            materials.text(&shape.material);
            lights.text(&shape.emission);
        }
        materials.text(&(&scene.materials, &scene.textures));
        for image in &scene.images {
            materials.number(image.width as u64);
            image.pixels.iter().for_each(|c| materials.vector(*c));
        }
        for light in 0..scene.lights.infos.len() {
            match scene.lights.kind(light) {
                LightKind::Lamp(shape) => lights.number(u64::from(shape)),
                LightKind::Delta(light) => lights.text(light),
                LightKind::Environment(light) => lights.text(light),
            }
        }
        Fingerprint { geometry: geometry.0, materials: materials.0, lights: lights.0 }
    }
}

/// A hash of all that was added, in its order.
struct Digest(u64);

impl Digest {
    fn number(&mut self, v: u64) {
        self.0 = hash(self.0, v);
    }

    fn vector(&mut self, v: Vec3) {
        self.number(u64::from(v.x.to_bits()) << 32 | u64::from(v.y.to_bits()));
        self.number(u64::from(v.z.to_bits()));
    }

    /// A value by its text, which shows every number in full.
    fn text(&mut self, v: &impl Debug) {
        // Writing to a digest cannot fail.
        let _ = write!(self, "{v:?};");
    }

    fn mesh(&mut self, mesh: &Mesh) {
        [mesh.positions.len(), mesh.normals.len(), mesh.uvs.len()].into_iter().for_each(|n| self.number(n as u64));
        mesh.positions.iter().chain(&mesh.normals).for_each(|v| self.vector(*v));
        mesh.uvs.iter().for_each(|v| self.vector(v.extend(0.0)));
        mesh.triangles.iter().flatten().for_each(|&i| self.number(u64::from(i)));
    }
}

impl Write for Digest {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for chunk in text.as_bytes().chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.number(u64::from_le_bytes(word));
        }
        Ok(())
    }
}
