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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32};

    fn point(p: Vec3, p_error: Vec3, n: Vec3) -> SurfacePoint {
        SurfacePoint {
            p,
            p_error,
            n_geo: n,
            n_shade: n,
            uv: Vec2::ZERO,
            dp_du: Vec3::X,
            dp_dv: Vec3::Y,
            shape: 0,
            prim: 0,
        }
    }

    #[test]
    fn origins_clear_the_error_box_on_the_side_of_the_direction() {
        for i in 0..10_000u64 {
            let r = |k| unit_f32(hash(i, k)) * 2.0 - 1.0;
            let size = 10f32.powf(4.0 * r(0));
            let n = Vec3::new(r(1), r(2), r(3)).normalize();
            let p = Vec3::new(r(4), r(5), r(6)) * size;
            let error = Vec3::new(r(7), r(8), r(9)).abs() * size * 1e-6;
            let d = Vec3::new(r(10), r(11), r(12));
            let moved = point(p, error, n).spawn_origin(d).as_dvec3() - p.as_dvec3();
            // The corner of the error box that reaches farthest to the side of d.
            let reach = n.as_dvec3().abs().dot(error.as_dvec3());
            let along = moved.dot(n.as_dvec3()) * d.dot(n).signum() as f64;
            assert!(along >= reach * (1.0 - 1e-6), "{along:e} below {reach:e}");
            assert!(along <= 3.0 * reach + 3e-7 * size as f64, "{along:e} is too far for {reach:e}");
        }
    }

    #[test]
    fn an_exact_point_stays_and_a_tiny_error_moves_by_one_step_at_least() {
        let n = Vec3::Y;
        let p = Vec3::new(1e4, 3.0, -7.0);
        assert_eq!(point(p, Vec3::ZERO, n).spawn_origin(n), p);
        let o = point(p, Vec3::splat(1e-12), n).spawn_origin(-n);
        assert_eq!(o, Vec3::new(1e4, 3.0f32.next_down(), -7.0));
    }
}
