//! Orthonormal frames.

use super::Vec3;

/// Right-handed orthonormal basis (`s`, `t`, `n`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent, `n x s`.
    pub t: Vec3,
    /// Normal.
    pub n: Vec3,
}

impl Frame {
    /// Any frame around the unit vector `n` (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// The frame around the unit vector `n` whose `s` lies as close to `tangent` as it can (Gram-Schmidt);
    /// any frame around `n` if `tangent` is zero, not finite, or parallel to `n`.
    pub fn from_normal_tangent(n: Vec3, tangent: Vec3) -> Self {
        let s = tangent - n * n.dot(tangent);
        let len2 = s.length_squared();
        if len2 > 1e-12 * tangent.length_squared() && len2.is_finite() && len2 > 0.0 {
            let s = s / len2.sqrt();
            Frame { s, t: n.cross(s), n }
        } else {
            Frame::from_normal(n)
        }
    }

    /// Components of the world vector `v` in this frame.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// World vector with the components `v` in this frame.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orthonormal_and_right_handed_for_any_normal() {
        for i in 0..1000 {
            let a = i as f32 * 0.37;
            let z = 1.0 - 2.0 * (i as f32 / 999.0);
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3::new(r * a.cos(), r * a.sin(), z).normalize();
            for f in [Frame::from_normal(n), Frame::from_normal_tangent(n, Vec3::new(0.3, -2.0, 0.9))] {
                assert!((f.s.cross(f.t) - f.n).length() < 1e-5);
                assert!(f.s.dot(f.n).abs() < 1e-5 && (f.s.length() - 1.0).abs() < 1e-5);
                let v = Vec3::new(0.2, -0.7, 1.4);
                assert!((f.to_world(f.to_local(v)) - v).length() < 1e-5);
            }
        }
    }

    #[test]
    fn tangent_parallel_to_the_normal_still_gives_a_frame() {
        let f = Frame::from_normal_tangent(Vec3::Z, Vec3::Z);
        assert!((f.s.length() - 1.0).abs() < 1e-6 && f.s.dot(Vec3::Z).abs() < 1e-6);
    }
}
