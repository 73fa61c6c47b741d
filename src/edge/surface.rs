//! Where a ray with derivatives meets the primitive that its centre ray has hit.
//!
//! Traversal runs in f32; point and normal are then computed once more in f64 duals on the *known* primitive, its plane or root, without
//! an inside test. The point's derivatives slide along the primitive (its geometric plane on meshes); the normal is the shading normal,
//! interpolated on smooth meshes. Source: Igehy 1999 (transfer and interpolated normals). Not handled: bump and normal maps.
//! Verified by the derivatives of whole chains against central differences (transport's tests).

use super::view::{from_dual, to_dual};
use crate::scene::{Geometry, Shape, SurfacePoint};
use dualux_dual::{Cylinder, Plane, Ray, Real, Root, Sphere, Triangle, Vec3, interpolate_normal};

/// Point and unit shading normal (on the shape's normal side, or turned round as a whole), with derivatives, where `ray` meets the
/// primitive of `at` in `shape`.
#[inline]
pub fn meet<J: Real<Primitive = f64>>(shape: &Shape, ray: &Ray<J>, at: &SurfacePoint) -> (Vec3<J>, Vec3<J>) {
    let outside = from_dual(ray.d.re()).dot(at.n_geo.as_dvec3()) < 0.0;
    let flat = |n: Vec3<f64>| {
        let p = ray.at(Plane::new(to_dual(at.p.as_dvec3()), n).t(ray));
        (p, Vec3::lift(n.normalized()))
    };
    // The root whose side the ray meets.
    let root = |inside: bool| if inside { Root::Far } else { Root::Near };
    match &shape.geometry {
        Geometry::Mesh(mesh) => {
            let [a, b, c] = mesh.corners(at.prim).map(|v| to_dual(v.as_dvec3()));
            let triangle = Triangle::new(a, b, c);
            let p = ray.at(triangle.t(ray));
            if mesh.normals.is_empty() {
                (p, Vec3::lift(triangle.normal()))
            } else {
                let normals = mesh.triangles[at.prim as usize].map(|i| to_dual(mesh.normals[i as usize].as_dvec3()));
                (p, interpolate_normal(triangle.barycentrics(p), normals))
            }
        }
        Geometry::Rectangle(r) => flat(to_dual(r.ex.as_dvec3().cross(r.ey.as_dvec3()))),
        Geometry::Disk(d) => flat(to_dual(d.ex.as_dvec3().cross(d.ey.as_dvec3()))),
        Geometry::Sphere(s) => {
            let sphere = Sphere::new(to_dual(s.center.as_dvec3()), f64::from(s.radius));
            let p = ray.at(sphere.t(ray, root(outside == s.flip)));
            (p, sphere.normal(p))
        }
        Geometry::Cylinder(c) => {
            let a = c.p0.as_dvec3();
            let cylinder = Cylinder::new(to_dual(a), to_dual(a + c.axis.as_dvec3()), f64::from(c.radius));
            let p = ray.at(cylinder.t(ray, root(outside == c.flip)));
            (p, cylinder.normal(p))
        }
    }
}
