//! Tests of emission. Fixed seeds, family-wise significance 0.01 per test (Sidak), each with a companion that must fail.

mod adaptive;
mod cells;
mod flux;
mod interest;
mod learned;
mod maps;
mod partition;

use super::*;
use crate::math::{DMat4, DVec3, Vec2, Vec3};
use crate::scene::description::{Description, GeometryDesc, LightDesc, ShapeDesc};
use crate::scene::mesh::MeshData;
use crate::scene::texture::{TexFilter, Wrap};
use crate::scene::{Bitmap, Color, Material, Scene, Texture};

/// A scene of shapes and lights; material 0 is diffuse, 1 a mirror, 2 glass; texture 0 is an uneven picture.
pub(super) fn scene(shapes: Vec<ShapeDesc>, lights: Vec<LightDesc>) -> Scene {
    let white = || Color::Constant(Vec3::ONE);
    let pixels = [[0.1, 1.0, 0.0], [4.0, 0.2, 0.3], [0.0, 0.5, 2.0], [1.0, 0.0, 3.0], [0.0; 3], [0.4, 0.5, 0.6]];
    Scene::new(Description {
        images: vec![Bitmap { width: 3, height: 2, pixels: pixels.map(Vec3::from).to_vec() }],
        textures: vec![Texture::Bitmap {
            image: 0,
            filter: TexFilter::Bilinear,
            wrap: Wrap::Repeat,
            to_uv: crate::math::Affine2::IDENTITY,
        }],
        materials: vec![
            Material::Diffuse { reflectance: white() },
            Material::Conductor { eta: Color::Constant(Vec3::ZERO), k: white(), specular_reflectance: white() },
            Material::Dielectric { eta: 1.5, specular_reflectance: white(), specular_transmittance: white() },
            Material::Null,
        ],
        shapes,
        lights,
        ..Description::empty(DMat4::IDENTITY, 8, 8)
    })
    .expect("a good scene")
}

pub(super) fn shape(geometry: GeometryDesc, to_world: DMat4, material: u32, emission: Option<Color>) -> ShapeDesc {
    ShapeDesc { name: "s".into(), geometry, to_world, flip_normals: false, material, emission }
}

/// Centre, half edges; the normal is x cross y.
pub(super) fn placed(c: DVec3, x: DVec3, y: DVec3) -> DMat4 {
    let n = x.cross(y).normalize();
    DMat4::from_cols(x.extend(0.0), y.extend(0.0), n.extend(0.0), c.extend(1.0))
}

pub(super) fn lit(geometry: GeometryDesc, to_world: DMat4) -> ShapeDesc {
    shape(geometry, to_world, 0, Some(Color::Constant(Vec3::new(1.0, 2.0, 3.0))))
}

pub(super) fn tilted() -> DMat4 {
    placed(DVec3::new(0.3, 2.0, -0.4), DVec3::new(0.5, 0.1, 0.2), DVec3::new(-0.2, 0.1, 0.45))
}

/// Triangles of a roof with smooth normals that lean away from the facets.
pub(super) fn roof(smooth: bool) -> GeometryDesc {
    let v = Vec3::new;
    let positions = vec![v(-1.0, -1.0, 0.0), v(1.0, -1.0, 0.1), v(0.0, 1.0, 0.0), v(1.5, 1.0, -0.8)];
    let normals = [v(-0.9, 0.0, 0.3), v(0.6, 0.0, 0.7), v(0.0, 0.8, 0.5), v(0.9, 0.5, 0.3)].map(Vec3::normalize);
    GeometryDesc::Mesh(MeshData {
        positions,
        normals: if smooth { normals.to_vec() } else { vec![] },
        uvs: vec![Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE],
        triangles: vec![[0, 1, 2], [1, 3, 2]],
        face_normals: !smooth,
        max_smooth_angle: None,
    })
}

/// One scene per kind of light, with a floor to give it an extent.
pub(super) fn every_light() -> Vec<(&'static str, Scene)> {
    let v = DVec3::new;
    let floor = || shape(GeometryDesc::Rectangle, placed(DVec3::ZERO, v(3.0, 0.0, 0.0), v(0.0, 0.0, -2.0)), 0, None);
    let lamp = |s: ShapeDesc| scene(vec![floor(), s], vec![]);
    let light = |l: LightDesc| scene(vec![floor()], vec![l]);
    let textured = |g: GeometryDesc| shape(g, tilted(), 0, Some(Color::Texture(0)));
    let ball = || GeometryDesc::Sphere { center: v(0.3, 1.5, 0.2), radius: 0.4 };
    let tube = || GeometryDesc::Cylinder { p0: v(0.0, 1.0, 0.0), p1: v(0.6, 1.3, 0.1), radius: 0.2 };
    let flipped = |s: ShapeDesc| ShapeDesc { flip_normals: true, ..s };
    let one = DMat4::IDENTITY;
    let spot = |beam: f64, texture: Option<u32>| LightDesc::Spot {
        to_world: tilted(),
        intensity: Vec3::new(3.0, 2.0, 1.0),
        cutoff_angle: 0.7,
        beam_width: beam,
        texture,
    };
    vec![
        ("rectangle", lamp(lit(GeometryDesc::Rectangle, tilted()))),
        ("rectangle, textured", lamp(textured(GeometryDesc::Rectangle))),
        ("disk", lamp(lit(GeometryDesc::Disk, tilted()))),
        ("disk, textured", lamp(textured(GeometryDesc::Disk))),
        ("sphere", lamp(lit(ball(), one))),
        ("sphere, inwards", lamp(flipped(lit(ball(), one)))),
        ("cylinder", lamp(lit(tube(), one))),
        ("cylinder, inwards", lamp(flipped(lit(tube(), one)))),
        ("facets", lamp(lit(roof(false), tilted()))),
        ("facets, textured", lamp(textured(roof(false)))),
        ("smooth mesh", lamp(lit(roof(true), tilted()))),
        ("point", light(LightDesc::Point { position: v(0.1, 1.2, 0.3), intensity: Vec3::new(1.0, 2.0, 0.5) })),
        ("spot", light(spot(0.4, None))),
        ("spot, sharp", light(spot(0.7, None))),
        ("spot, textured", light(spot(0.5, Some(0)))),
        ("directional", light(LightDesc::Directional { direction: v(0.3, -2.0, 0.4), irradiance: Vec3::splat(1.5) })),
        ("constant", light(LightDesc::Constant { radiance: Vec3::new(0.2, 0.3, 0.4) })),
        ("envmap", light(LightDesc::EnvMap { image: 0, scale: Vec3::splat(2.0), to_world: tilted() })),
    ]
}

/// Independent numbers.
pub(super) fn random(seed: u64, i: u64) -> [f64; 4] {
    uniform::numbers(Sequence::Random, seed, 0, i)
}
