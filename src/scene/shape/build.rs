//! World-space geometry from object space and a transform.
//!
//! All in f64, rounded to f32 once. Sides as Mitsuba 3.9 has them (measured): disks, rectangles and cylinders keep the
//! side that their transformed normal (inverse transpose) points to, mirrored or not; a mirroring transform turns a
//! *sphere* inside out; for meshes see [`super::super::mesh`]. `flip_normals` turns any shape round.
//! Not handled: ellipsoids, elliptic or slanted cylinders, perspective transforms: errors.

use super::super::description::{GeometryDesc, ShapeDesc};
use super::super::mesh::Mesh;
use super::{Cylinder, Disk, Geometry, Rectangle, Shape, Sphere, cube};
use crate::math::{DMat4, DVec3, Frame};

/// Relative tolerance for "uniform" and "perpendicular": files give matrices with few digits.
const RIGID_TOLERANCE: f64 = 1e-3;

impl Shape {
    /// World-space shape from its description. The error is a text without location.
    ///
    /// Triangles without an area are left out: compare [`Shape::primitive_count`] with the description to count them.
    pub fn new(desc: ShapeDesc) -> Result<Self, String> {
        let m = &desc.to_world;
        check_affine(m)?;
        let flip = desc.flip_normals;
        let geometry = match desc.geometry {
            GeometryDesc::Rectangle => rectangle(m, flip).map(Geometry::Rectangle),
            GeometryDesc::Disk => disk(m, flip).map(Geometry::Disk),
            GeometryDesc::Cube => Mesh::new(cube::mesh_data(), m, flip).map(Geometry::Mesh),
            GeometryDesc::Sphere { center, radius } => sphere(m, center, radius, flip).map(Geometry::Sphere),
            GeometryDesc::Cylinder { p0, p1, radius } => cylinder(m, p0, p1, radius, flip).map(Geometry::Cylinder),
            GeometryDesc::Mesh(data) => Mesh::new(data, m, flip).map(Geometry::Mesh),
        }?;
        let shape = Shape { name: desc.name, geometry, material: desc.material, emission: desc.emission };
        let (lo, hi) = shape.bounds();
        let area = shape.area();
        // A density per area must exist in f32: neither the area nor its reciprocal may overflow.
        if !(lo.is_finite() && hi.is_finite() && (1e-37..=1e37).contains(&area)) {
            return Err(format!("the shape has an area of {area:e}, which cannot be rendered"));
        }
        Ok(shape)
    }
}

/// Columns of the upper 3x3: images of the object axes.
fn axes(m: &DMat4) -> [DVec3; 3] {
    [m.x_axis, m.y_axis, m.z_axis].map(|c| c.truncate())
}

fn determinant([x, y, z]: [DVec3; 3]) -> f64 {
    x.dot(y.cross(z))
}

/// The transform must be affine and finite. Flattening is no error here: a flattened rectangle or mesh still is one.
fn check_affine(m: &DMat4) -> Result<(), String> {
    if !m.is_finite() {
        return Err("to_world holds a value that is not finite".into());
    }
    let last = m.row(3);
    if last.truncate().length() > 1e-9 || (last.w - 1.0).abs() > 1e-9 {
        return Err("to_world is a perspective transform (its last row is not 0 0 0 1)".into());
    }
    Ok(())
}

/// Unit normal of the plane spanned by the images of x and y, on the side of the transformed +z (inverse transpose).
fn plane_normal(axes: [DVec3; 3], flip: bool) -> Result<DVec3, String> {
    let n = axes[0].cross(axes[1]).try_normalize().ok_or("to_world makes the shape flat: it has no area")?;
    let mirrored = determinant(axes) < 0.0;
    Ok(if mirrored != flip { -n } else { n })
}

fn rectangle(m: &DMat4, flip: bool) -> Result<Rectangle, String> {
    let axes = axes(m);
    Ok(Rectangle {
        center: m.w_axis.truncate().as_vec3(),
        ex: axes[0].as_vec3(),
        ey: axes[1].as_vec3(),
        n: plane_normal(axes, flip)?.as_vec3(),
    })
}

fn disk(m: &DMat4, flip: bool) -> Result<Disk, String> {
    let axes = axes(m);
    Ok(Disk {
        center: m.w_axis.truncate().as_vec3(),
        ex: axes[0].as_vec3(),
        ey: axes[1].as_vec3(),
        n: plane_normal(axes, flip)?.as_vec3(),
    })
}

fn sphere(m: &DMat4, center: DVec3, radius: f64, flip: bool) -> Result<Sphere, String> {
    check_radius(radius)?;
    let axes = axes(m);
    let det = determinant(axes);
    let scale = det.abs().cbrt();
    let uniform = axes.iter().all(|a| (a.length() - scale).abs() <= RIGID_TOLERANCE * scale);
    let square =
        [(0, 1), (1, 2), (2, 0)].iter().all(|&(i, j)| axes[i].dot(axes[j]).abs() <= RIGID_TOLERANCE * scale * scale);
    if !(scale > 0.0 && uniform && square) {
        let lengths = axes.map(|a| a.length());
        return Err(format!(
            "to_world scales the sphere by {} x {} x {}{}: a sphere allows only one scale above 0 for all axes",
            lengths[0],
            lengths[1],
            lengths[2],
            if square { "" } else { " with a shear" }
        ));
    }
    // Rounding or few digits in the file must not tilt the axes against one another.
    let z = axes[2].normalize();
    let x = (axes[0] - z * axes[0].dot(z)).normalize();
    let y = z.cross(x) * det.signum();
    Ok(Sphere {
        center: m.transform_point3(center).as_vec3(),
        radius: (radius * scale) as f32,
        flip: flip != (det < 0.0),
        axes: [x, y, z].map(|a| a.as_vec3()),
    })
}

fn cylinder(m: &DMat4, p0: DVec3, p1: DVec3, radius: f64, flip: bool) -> Result<Cylinder, String> {
    check_radius(radius)?;
    let along = (p1 - p0).try_normalize().ok_or("the cylinder's p0 and p1 are the same point")?;
    let local = Frame::from_normal(along.as_vec3());
    // The frame in f64: its axes are only single precision, and must be exactly across.
    let s = local.s.as_dvec3();
    let s = (s - along * s.dot(along)).normalize();
    let t = along.cross(s);
    let (w0, w1) = (m.transform_point3(p0), m.transform_point3(p1));
    let axis = w1 - w0;
    let (ws, wt) = (m.transform_vector3(s), m.transform_vector3(t));
    let scale = 0.5 * (ws.length() + wt.length());
    let direction = axis.try_normalize().ok_or("to_world makes the cylinder flat: it has no area")?;
    let off = |v: f64| v.abs() > RIGID_TOLERANCE * scale;
    if !scale.is_finite() || off(ws.length() - scale) || off(ws.dot(wt) / scale) {
        return Err("to_world makes the cylinder's section an ellipse: it must stay a circle".into());
    }
    if off(ws.dot(direction)) || off(wt.dot(direction)) {
        return Err("to_world shears the cylinder: its axis must stay perpendicular to its section".into());
    }
    let reference = (ws - direction * ws.dot(direction)).normalize();
    let binormal = direction.cross(reference);
    Ok(Cylinder {
        p0: w0.as_vec3(),
        axis: axis.as_vec3(),
        radius: (radius * scale) as f32,
        flip,
        reference: reference.as_vec3(),
        binormal: (if binormal.dot(wt) < 0.0 { -binormal } else { binormal }).as_vec3(),
    })
}

fn check_radius(radius: f64) -> Result<(), String> {
    if radius.is_finite() && radius > 0.0 { Ok(()) } else { Err(format!("the radius is {radius}; it must be above 0")) }
}
