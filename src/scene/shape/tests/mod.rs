//! Tests of shapes: what all of them share, and the errors of bad descriptions.

mod measured;
mod precision;
mod sampling;

use super::super::description::{GeometryDesc, ShapeDesc};
use super::super::mesh::MeshData;
use super::*;
use crate::math::{DMat4, DVec3};

fn describe(geometry: GeometryDesc, to_world: DMat4, flip_normals: bool) -> ShapeDesc {
    ShapeDesc { name: "test".into(), geometry, to_world, flip_normals, material: 0, emission: None }
}

fn build(geometry: GeometryDesc, to_world: DMat4, flip_normals: bool) -> Shape {
    Shape::new(describe(geometry, to_world, flip_normals)).expect("a good shape")
}

fn unit_sphere() -> GeometryDesc {
    GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 }
}

fn cylinder(z0: f64, z1: f64) -> GeometryDesc {
    GeometryDesc::Cylinder { p0: DVec3::new(0.0, 0.0, z0), p1: DVec3::new(0.0, 0.0, z1), radius: 1.0 }
}

/// Every kind of shape, turned, at a scale and distance from the origin.
fn zoo(scale: f64, offset: f64) -> Vec<Shape> {
    let rigid = DMat4::from_translation(DVec3::new(1.0, -0.7, 0.4) * offset * scale)
        * DMat4::from_rotation_x(0.4)
        * DMat4::from_rotation_y(1.1)
        * DMat4::from_scale(DVec3::splat(scale));
    let sheared =
        rigid * DMat4::from_cols_array(&[1.0, 0.2, 0., 0., 0.4, 0.8, 0., 0., 0., 0.3, 1.4, 0., 0., 0., 0., 1.]);
    let mesh = MeshData {
        positions: vec![Vec3::ZERO, Vec3::new(2.0, 0.1, 0.3), Vec3::new(0.4, 1.5, -0.3)],
        triangles: vec![[0, 1, 2]],
        ..Default::default()
    };
    vec![
        build(GeometryDesc::Rectangle, sheared, false),
        build(GeometryDesc::Disk, sheared, false),
        build(unit_sphere(), rigid, false),
        build(cylinder(-0.3, 1.7), rigid, true),
        build(GeometryDesc::Cube, sheared, false),
        build(GeometryDesc::Mesh(mesh), rigid, false),
    ]
}

#[test]
fn bad_transforms_are_errors_with_a_text() {
    let scale = |x, y, z| DMat4::from_scale(DVec3::new(x, y, z));
    let shear = DMat4::from_cols_array(&[1., 0., 0., 0., 0.5, 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]);
    let all = || [GeometryDesc::Rectangle, GeometryDesc::Cube, unit_sphere(), GeometryDesc::Disk, cylinder(0.0, 1.0)];
    for m in [DMat4::ZERO, scale(0.0, 0.0, 0.0), DMat4::NAN, scale(1e30, 1e30, 1e30), scale(f64::INFINITY, 1.0, 1.0)] {
        for geometry in all() {
            let text = Shape::new(describe(geometry.clone(), m, false)).expect_err("degenerate");
            assert!(text.len() > 10, "{geometry:?} {text}");
        }
    }
    let error = |g, m| Shape::new(describe(g, m, false)).expect_err("must be refused");
    assert!(error(unit_sphere(), scale(1.0, 2.0, 1.0)).contains("1 x 2 x 1"));
    assert!(error(unit_sphere(), shear).contains("scale"));
    assert!(error(cylinder(0.0, 1.0), scale(1.0, 2.0, 1.0)).contains("ellipse"));
    let slant = DMat4::from_cols_array(&[1., 0., 0., 0., 0., 1., 0., 0., 0.5, 0., 1., 0., 0., 0., 0., 1.]);
    assert!(error(cylinder(0.0, 1.0), slant).contains("shear"));
    assert!(error(cylinder(1.0, 1.0), DMat4::IDENTITY).contains("same point"));
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let center = DVec3::ZERO;
        assert!(error(GeometryDesc::Sphere { center, radius }, DMat4::IDENTITY).contains("radius"));
    }
    // Flattening a flat thing along its normal leaves it what it is; few digits are still a rotation.
    assert!(Shape::new(describe(GeometryDesc::Rectangle, scale(1.0, 1.0, 0.0), false)).is_ok());
    let mut turned = DMat4::from_rotation_x(0.3) * DMat4::from_rotation_z(1.1) * 3.0;
    turned.w_axis = crate::math::DMat4::IDENTITY.w_axis;
    let rounded = turned.to_cols_array().map(|v| (v * 1e4).round() / 1e4);
    let Geometry::Sphere(s) = build(unit_sphere(), DMat4::from_cols_array(&rounded), false).geometry else {
        panic!("a sphere")
    };
    assert!((s.radius - 3.0).abs() < 1e-3);
}
