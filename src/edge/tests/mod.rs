//! Tests of the edge layer, and what they share: random numbers, shapes and scenes.
//!
//! * `sight`: exactness against the dual margins, recall 1 where expansions are exact, and what must not fire
//! * `lights`: verdicts on lights against shadow rays
//! * `predicted`: lenses, patches, chains, highlights

mod lights;
mod predicted;
mod sight;

use super::view::{View, to_dual};
use crate::accel::Accel;
use crate::math::sampler::{hash, unit_f32};
use crate::math::{DMat4, DVec3, Vec3};
use crate::scene::description::{Description, GeometryDesc, ShapeDesc};
use crate::scene::mesh::MeshData;
use crate::scene::{Color, Material, Scene};
use dualux_dual::Family;

pub(super) struct Rng(pub(super) u64, pub(super) u64);

impl Rng {
    pub(super) fn unit(&mut self) -> f64 {
        self.1 += 1;
        f64::from(unit_f32(hash(self.0, self.1)))
    }
    pub(super) fn range(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.unit()
    }
    pub(super) fn cube(&mut self, size: f64) -> DVec3 {
        DVec3::new(self.range(-size, size), self.range(-size, size), self.range(-size, size))
    }
}

pub(super) fn shape(geometry: GeometryDesc, to_world: DMat4) -> ShapeDesc {
    ShapeDesc { name: "s".into(), geometry, to_world, flip_normals: false, material: 0, emission: None }
}

pub(super) fn ball(center: DVec3, radius: f64) -> ShapeDesc {
    shape(GeometryDesc::Sphere { center, radius }, DMat4::IDENTITY)
}

pub(super) fn quad(c: DVec3, x: DVec3, y: DVec3) -> ShapeDesc {
    let n = x.cross(y).normalize();
    shape(GeometryDesc::Rectangle, DMat4::from_cols(x.extend(0.0), y.extend(0.0), n.extend(0.0), c.extend(1.0)))
}

pub(super) fn scene(shapes: Vec<ShapeDesc>) -> (Scene, Accel) {
    scene_of(shapes, Material::Diffuse { reflectance: Color::Constant(Vec3::ONE) })
}

pub(super) fn scene_of(shapes: Vec<ShapeDesc>, material: Material) -> (Scene, Accel) {
    scene_with(shapes, vec![material])
}

pub(super) fn scene_with(shapes: Vec<ShapeDesc>, materials: Vec<Material>) -> (Scene, Accel) {
    let mut description = Description::empty(DMat4::IDENTITY, 64, 64);
    description.camera.near_clip = 0.0;
    (description.materials, description.shapes) = (materials, shapes);
    let scene = Scene::new(description).unwrap();
    let accel = Accel::new(&scene.shapes);
    (scene, accel)
}

pub(super) fn random_view(rng: &mut Rng, o: DVec3, aim: DVec3, half: f64) -> View {
    let d = aim - o;
    let (u, v) = (rng.cube(1.0), rng.cube(1.0));
    let side = |u: DVec3| to_dual((u - d * (u.dot(d) / d.length_squared())).normalize() * half * d.length());
    View::new(Family::fixed(to_dual(o), to_dual(d), [side(u), side(v)]), [0.0, f64::INFINITY]).unwrap()
}

/// Soup of rectangles, a mesh, balls, a disk and a cylinder.
pub(super) fn soup(rng: &mut Rng, n: usize, kinds: usize) -> Vec<ShapeDesc> {
    let mut shapes = Vec::new();
    for i in 0..n {
        let (c, x) = (rng.cube(3.0), rng.cube(0.6));
        let y = x.cross(rng.cube(1.0)).normalize() * rng.range(0.05, 0.6);
        shapes.push(match i % kinds {
            0 | 1 => quad(c, x, y),
            2 => ball(c, rng.range(0.02, 0.5)),
            3 => shape(
                GeometryDesc::Disk,
                DMat4::from_cols(x.extend(0.0), y.extend(0.0), x.cross(y).normalize().extend(0.0), c.extend(1.0)),
            ),
            _ => shape(GeometryDesc::Cylinder { p0: c, p1: c + x, radius: rng.range(0.02, 0.3) }, DMat4::IDENTITY),
        });
    }
    shapes.push(shape(
        GeometryDesc::Cube,
        DMat4::from_translation(DVec3::new(0.5, 0.2, 0.0)) * DMat4::from_rotation_y(0.7),
    ));
    shapes
}

/// A closed smooth mesh: a torus of n x m quadrilaterals round z, radii 1 and 0.4.
pub(super) fn torus(n: usize, m: usize) -> MeshData {
    let mut data = MeshData::default();
    for i in 0..n {
        for j in 0..m {
            let (a, b) = (i as f32 / n as f32 * std::f32::consts::TAU, j as f32 / m as f32 * std::f32::consts::TAU);
            let r = 1.0 + 0.4 * b.cos();
            data.positions.push(Vec3::new(r * a.cos(), r * a.sin(), 0.4 * b.sin()));
            let at = |i: usize, j: usize| ((i % n) * m + j % m) as u32;
            data.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            data.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    data
}
