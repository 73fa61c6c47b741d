//! A node of the light tree: the bounds of its children side by side, and their importance at a point.
//!
//! The equations are those of [`super`]. The cone of normals and the cone under which the bounding sphere is seen are added as one
//! angle, by its sine and cosine: no angle is computed. Every lane does the same plain arithmetic without a branch, which
//! compilers turn into vector instructions, those of AVX2 where the processor has them; it is exact to the last bit with any of them.

use super::LitPoint;
use super::bounds::Bounds;
use crate::math::Vec3;

/// Children of a node.
pub(in crate::transport) const WIDTH: usize = 8;
pub(in crate::transport) type Lanes = [f32; WIDTH];

/// What a child is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::transport) enum Child {
    Nothing,
    Node(u32),
    Emitter(u32),
}

/// Up to eight children; lanes without one have no strength.
#[derive(Clone, Debug)]
pub(in crate::transport) struct Node {
    centre: [Lanes; 3],
    half: [Lanes; 3],
    axis: [Lanes; 3],
    /// Squared radius of the bounding sphere.
    pub radius2: Lanes,
    /// Of the cone of normals, a little larger against rounding.
    sin_normals: Lanes,
    cos_normals: Lanes,
    cos_emission: Lanes,
    /// Sum of largest intensities.
    pub strength: Lanes,
    /// What the lanes stand for.
    pub children: [Child; WIDTH],
    /// The node above and the lane there.
    pub parent: Option<(u32, u8)>,
}

impl Node {
    /// A node without children.
    pub fn new(parent: Option<(u32, u8)>) -> Self {
        let zero = [0.0; WIDTH];
        Node {
            centre: [zero; 3],
            half: [zero; 3],
            axis: [zero; 3],
            radius2: zero,
            sin_normals: zero,
            cos_normals: zero,
            cos_emission: zero,
            strength: zero,
            children: [Child::Nothing; WIDTH],
            parent,
        }
    }

    /// Sets a lane.
    pub(super) fn set(&mut self, lane: usize, b: &Bounds, child: Child) {
        let half = 0.5 * (b.hi - b.lo);
        for (k, (c, (h, a))) in
            b.centre().to_array().into_iter().zip(half.to_array().into_iter().zip(b.cone.axis.to_array())).enumerate()
        {
            (self.centre[k][lane], self.half[k][lane], self.axis[k][lane]) = (c, h, a);
        }
        let cos = (b.cone.cos - 1e-6).max(-1.0);
        self.radius2[lane] = half.length_squared();
        self.sin_normals[lane] = (1.0 - cos * cos).max(0.0).sqrt();
        self.cos_normals[lane] = cos;
        self.cos_emission[lane] = b.cos_emission - 1e-6;
        self.strength[lane] = b.strength;
        self.children[lane] = child;
    }

    /// Importance of each child at a point, and their sum.
    #[inline]
    pub fn importance(&self, at: &LitPoint) -> (Lanes, f32) {
        let (out, _) = self.importance_and_distance2(at);
        (out, out.iter().sum())
    }

    /// Importance of each child at a point, and the squared distance of the middle of its box.
    #[inline]
    pub fn importance_and_distance2(&self, at: &LitPoint) -> (Lanes, Lanes) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function enables.
            return unsafe { self.lanes_avx2(at) };
        }
        self.lanes(at)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn lanes_avx2(&self, at: &LitPoint) -> (Lanes, Lanes) {
        self.lanes(at)
    }

    #[inline(always)]
    pub(super) fn lanes(&self, at: &LitPoint) -> (Lanes, Lanes) {
        let (n, one_sided) = at.n.map_or((Vec3::ZERO, false), |n| (n, true));
        let (mut out, mut distance2) = ([0.0; WIDTH], [0.0; WIDTH]);
        for (k, (out, distance2)) in out.iter_mut().zip(&mut distance2).enumerate() {
            let x = self.centre[0][k] - at.p.x;
            let y = self.centre[1][k] - at.p.y;
            let z = self.centre[2][k] - at.p.z;
            let true_d2 = x * x + y * y + z * z;
            *distance2 = true_d2;
            let d2 = larger(larger(true_d2, self.radius2[k]), f32::MIN_POSITIVE);
            let inverse = 1.0 / d2.sqrt();
            // Angle under which the bounding sphere is seen, a little larger against rounding; inside of it every angle.
            let sin2 = self.radius2[k] / d2 * 1.00001 + 1e-7;
            let inside = sin2 >= 1.0;
            let (sin_around, cos_around) = (sin2.sqrt(), larger(1.0 - sin2, 0.0).sqrt());
            let (sin_n, cos_n) = (self.sin_normals[k], self.cos_normals[k]);
            let cos_both = cos_n * cos_around - sin_n * sin_around;
            let sin_both = sin_n * cos_around + cos_n * sin_around;
            let theta = -(x * self.axis[0][k] + y * self.axis[1][k] + z * self.axis[2][k]) * inverse;
            let beyond = theta * cos_both + larger(1.0 - theta * theta, 0.0).sqrt() * sin_both;
            // A negative sine of the sum: more than pi, which holds all directions.
            let within = inside | (sin_both <= 0.0) | (theta >= cos_both);
            let cos = if within { 1.0 } else { beyond };
            let importance = self.strength[k] * larger(cos, 0.01) / d2;
            // Above the plane? A box is above it where its farthest corner is.
            let height = x * n.x + y * n.y + z * n.z;
            let (hx, hy, hz) = (self.half[0][k], self.half[1][k], self.half[2][k]);
            let reach = height + hx * n.x.abs() + hy * n.y.abs() + hz * n.z.abs();
            let rounding = 1e-6 * (x.abs() + y.abs() + z.abs() + hx + hy + hz);
            let cos_i = height * inverse;
            let low = larger(cos_i * cos_around + larger(1.0 - cos_i * cos_i, 0.0).sqrt() * sin_around, 1e-3);
            let tilt = if !one_sided | inside | (cos_i >= cos_around) { 1.0 } else { low };
            let lit = (cos > self.cos_emission[k]) & (!one_sided | (reach > -rounding));
            *out = if lit { importance * tilt } else { 0.0 };
        }
        (out, distance2)
    }

    /// Squared distance of the middle of each child's box.
    #[inline]
    pub fn distance2(&self, p: Vec3) -> Lanes {
        std::array::from_fn(|k| {
            let (x, y, z) = (self.centre[0][k] - p.x, self.centre[1][k] - p.y, self.centre[2][k] - p.z);
            x * x + y * y + z * z
        })
    }

    /// Middle of a child's box.
    pub fn centre(&self, lane: usize) -> Vec3 {
        Vec3::new(self.centre[0][lane], self.centre[1][lane], self.centre[2][lane])
    }
}

/// The larger one, without the care for NaN that `f32::max` takes.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
