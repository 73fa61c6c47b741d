//! A point on a surface, as found by a ray: all that shading needs.

use crate::math::{Vec2, Vec3};

/// A point on a surface. Both normals are on the shape's normal side (its outside), not turned to any ray.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Position, world.
    pub p: Vec3,
    /// Bound on the error of `p`, per axis, world units: rays start outside of it (Pharr et al., PBR 6.8).
    pub p_error: Vec3,
    /// Geometric normal, unit.
    pub n_geo: Vec3,
    /// Interpolated normal, unit, on the same side as given by the mesh (not forced to agree with `n_geo`).
    pub n_shade: Vec3,
    /// Texture coordinates.
    pub uv: Vec2,
    /// Derivative of the position by u; not normalised.
    pub dp_du: Vec3,
    /// Derivative of the position by v; not normalised.
    pub dp_dv: Vec3,
    /// Index of the shape in [`super::Scene::shapes`].
    pub shape: u32,
    /// Triangle of the shape's mesh, 0 for other shapes.
    pub prim: u32,
}

impl SurfacePoint {
    /// Origin for a ray that leaves towards `d`: `p` moved along the geometric normal, to the side `d` points to,
    /// by just more than the error bound. Use it with `tmin` > 0 (`f32::MIN_POSITIVE`).
    pub fn spawn_origin(&self, d: Vec3) -> Vec3 {
        let offset = self.n_geo * self.n_geo.abs().dot(self.p_error);
        let offset = if d.dot(self.n_geo) < 0.0 { -offset } else { offset };
        let away = |p: f32, o: f32| {
            let q = p + o;
            if o > 0.0 {
                q.next_up()
            } else if o < 0.0 {
                q.next_down()
            } else {
                q
            }
        };
        Vec3::new(away(self.p.x, offset.x), away(self.p.y, offset.y), away(self.p.z, offset.z))
    }
}
