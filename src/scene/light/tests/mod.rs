//! Tests of the lights. Family-wise significance 0.01 per test (Sidak), fixed seeds, each with a companion that must fail.

mod area;
mod delta;
mod emitter;
mod environment;
mod selection;

use super::*;
use crate::math::sampler::{hash, unit_f32};
use crate::math::{DMat4, DVec3};
use crate::scene::description::{GeometryDesc, ShapeDesc};
use crate::scene::mesh::MeshData;
use crate::scene::shape::ShapeHit;
use crate::scene::texture::Color;

pub(super) const NO_TEXTURES: Textures<'static> = Textures { textures: &[], images: &[] };

/// Independent numbers (no sequence: p-values are to mean what they say).
pub(super) fn random(seed: u64, i: u64, k: u64) -> f32 {
    unit_f32(hash(hash(seed, k), i))
}

pub(super) fn random2(seed: u64, i: u64) -> Vec2 {
    Vec2::new(random(seed, i, 1), random(seed, i, 2))
}

pub(super) fn lamp(geometry: GeometryDesc, to_world: DMat4, flip_normals: bool, radiance: Rgb) -> Shape {
    Shape::new(ShapeDesc {
        name: "lamp".into(),
        geometry,
        to_world,
        flip_normals,
        material: 0,
        emission: Some(Color::Constant(radiance)),
    })
    .expect("a good shape")
}

/// Square of half width `size` at `at`, its normal along -z: a ceiling lamp for receivers below.
pub(super) fn ceiling(at: DVec3, size: f64, radiance: f32) -> Shape {
    let to_world = DMat4::from_translation(at) * DMat4::from_rotation_x(std::f64::consts::PI);
    let to_world = to_world * DMat4::from_scale(DVec3::splat(size));
    lamp(GeometryDesc::Rectangle, to_world, false, Rgb::splat(radiance))
}

pub(super) fn triangles(corners: &[[[f32; 3]; 3]], normals: Vec<Vec3>) -> GeometryDesc {
    GeometryDesc::Mesh(MeshData {
        positions: corners.iter().flatten().map(|&p| Vec3::from(p)).collect(),
        face_normals: normals.is_empty(),
        normals,
        triangles: (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..MeshData::default()
    })
}

pub(super) fn sphere(center: DVec3, radius: f64, flip: bool, radiance: f32) -> Shape {
    lamp(GeometryDesc::Sphere { center, radius }, DMat4::IDENTITY, flip, Rgb::splat(radiance))
}

/// Lights of shapes and others, without textures, in a bounding sphere of radius 10.
pub(super) fn lights(shapes: &[Shape], others: &[LightDesc]) -> Lights {
    Lights::new(shapes, others, &[], &[], (Vec3::ZERO, 10.0))
}
