//! A node of the light tree: the bounds of its children side by side, and their importance at a point.
//!
//! Whether anything arrives, bounds decide: the cone of normals and the cone under which the bounding sphere is seen are added as one
//! angle, by its sine and cosine; no angle is computed. How much, the mean over the lamps tells, with the first two moments of their
//! normals n along their axis a, that of their mean or, where they cancel each other, that along which most of them lie, r = mean of n . a and s = mean of (n . a)^2:
//!
//! ```text
//!   c   = e + (1 - e) (r cos + f sqrt(s cos^2 + (1 - s) / 2 sin^2)) / 2       mean of (n . w)+ = (x + |x|) / 2
//!   c_i = (cos_i + sqrt(cos_i^2 + k sin_u^2)) / 2                             mean of cos_i+ over the ball
//! ```
//!
//! e: share that goes in all directions alike; cos: between a and the direction w to the point; the root is that of the mean of (n . w)^2 if
//! normals lie evenly around a, and f, sqrt(3/4) ... 1, what the mean of |x| is over it. Since w varies over the ball, which is
//! seen under the half angle u, r is multiplied by (1 + cos u) / 2 and s - 1/3 by cos u (1 + cos u) / 2, as for directions that fill a
//! cone. Right for one small lamp, for lamps that face all ways (1/4), for any that face two opposite ways. Every lane does the same plain
//! arithmetic without a branch, which compilers turn into vector instructions, those of AVX2 where the processor has them; it is exact to
//! the last bit with any of them.
//!
//! What a choice among many lamps costs is memory: a node is kept in 300 bytes. Boxes are whole numbers of 65,535 steps of the node's own box,
//! axes of 32,767 steps of 1, cones the sine of half their angle. Boxes and cones are rounded outwards, from the middle as it is read
//! back; what rounding of the axis does to a cosine is allowed for where emission ends.

use super::LitPoint;
use super::bounds::Bounds;
use crate::math::Vec3;

/// Children of a node.
pub(in crate::transport) const WIDTH: usize = 8;
pub(in crate::transport) type Lanes = [f32; WIDTH];
type Short = [u16; WIDTH];
type Signed = [i16; WIDTH];

/// Steps of boxes and cones.
const STEPS: f32 = u16::MAX as f32;
/// Steps of axes and cosines.
const SIGNED_STEPS: f32 = i16::MAX as f32;
/// Steps of shares.
const SHARES: f32 = u8::MAX as f32;
/// k: seen from its border, with the middle on the horizon, a ball of evenly spread points has the mean cos_i+ 8 / (15 pi).
const FULL_BALL: f32 = 0.1153;
/// Least mean cosines, so that what is seldom drawn does not weigh too much.
const LEAST_COS: f32 = 0.01;
const LEAST_TILT: f32 = 1e-3;
/// Of points with glossy lobes.
const LEAST_GLOSSY_TILT: f32 = 0.25;
/// More than a cosine is off by a rounded axis: sqrt(3) / 2 steps.
const AXIS_ROUNDING: f32 = 1e-4;

/// What a child is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::transport) enum Child {
    Nothing,
    Node(u32),
    Emitter(u32),
}

/// A child in four bytes: emitters have the highest bit.
#[derive(Clone, Copy, Debug)]
struct Packed(u32);

impl Packed {
    const NOTHING: Packed = Packed(u32::MAX);
    const EMITTER: u32 = 1 << 31;

    fn new(child: Child) -> Self {
        match child {
            Child::Nothing => Packed::NOTHING,
            Child::Node(i) => Packed(i),
            Child::Emitter(e) => Packed(e | Packed::EMITTER),
        }
    }

    #[inline]
    fn get(self) -> Child {
        match self.0 {
            u32::MAX => Child::Nothing,
            e if e & Packed::EMITTER != 0 => Child::Emitter(e & !Packed::EMITTER),
            i => Child::Node(i),
        }
    }
}

/// Up to eight children; lanes without one have no strength.
#[derive(Clone, Debug)]
pub(in crate::transport) struct Node {
    /// Corner of the box of all children, and its edges over [`STEPS`].
    origin: [f32; 3],
    step: [f32; 3],
    centre: [Short; 3],
    half: [Short; 3],
    axis: [Signed; 3],
    /// Sine of half the angle of the cone of normals.
    half_cone: Short,
    cos_emission: Signed,
    /// e, r and s, in parts of [`SHARES`].
    even: [u8; WIDTH],
    common: [u8; WIDTH],
    square: [u8; WIDTH],
    /// Sum of largest intensities.
    pub strength: Lanes,
    /// What the lanes stand for.
    children: [Packed; WIDTH],
    /// The node above and the lane there.
    pub parent: Option<(u32, u8)>,
}

impl Node {
    /// A node without children, whose children will lie in the box `[lo, hi]`.
    pub fn new(parent: Option<(u32, u8)>, lo: Vec3, hi: Vec3) -> Self {
        Node {
            origin: lo.to_array(),
            step: ((hi - lo) / STEPS).to_array(),
            centre: [[0; WIDTH]; 3],
            half: [[0; WIDTH]; 3],
            axis: [[0; WIDTH]; 3],
            half_cone: [0; WIDTH],
            cos_emission: [0; WIDTH],
            even: [0; WIDTH],
            common: [0; WIDTH],
            square: [0; WIDTH],
            strength: [0.0; WIDTH],
            children: [Packed::NOTHING; WIDTH],
            parent,
        }
    }

    /// Sets a lane.
    pub(super) fn set(&mut self, lane: usize, b: &Bounds, child: Child) {
        // Casts end at the limits of their types.
        let e = &b.extent;
        let cone = b.cone.about(e.axis());
        let (axis, own) = (cone.axis, (e.strength - b.even).max(f32::MIN_POSITIVE));
        self.common[lane] = (e.moment.dot(axis) / own * SHARES).round() as u8;
        self.square[lane] = (e.squares(axis) / own * SHARES).round() as u8;
        self.even[lane] = (b.even / e.strength * SHARES).round() as u8;
        for k in 0..3 {
            let (lo, hi, step) = (e.lo[k], e.hi[k], self.step[k]);
            if step > 0.0 {
                self.centre[k][lane] = ((0.5 * (lo + hi) - self.origin[k]) / step).round() as u16;
                let middle = self.centre(lane)[k];
                let reach = (hi - middle).max(middle - lo);
                self.half[k][lane] = (reach / step * (1.0 + 1e-6)).ceil() as u16;
            }
            // Towards zero: a longer axis would make the angle to it too small.
            self.axis[k][lane] = (axis[k] * SIGNED_STEPS) as i16;
        }
        let half_cone = (0.5 * (1.0 - cone.cos)).clamp(0.0, 1.0).sqrt();
        self.half_cone[lane] = (half_cone * STEPS * (1.0 + 1e-6)).ceil() as u16;
        self.cos_emission[lane] = ((b.cos_emission - AXIS_ROUNDING) * SIGNED_STEPS).floor() as i16;
        self.strength[lane] = e.strength;
        self.children[lane] = Packed::new(child);
    }

    /// What a lane stands for.
    #[inline]
    pub fn child(&self, lane: usize) -> Child {
        self.children[lane].get()
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
        let least_tilt = least_tilt(at);
        let (mut out, mut distance2) = ([0.0; WIDTH], [0.0; WIDTH]);
        let [sx, sy, sz] = self.step;
        for (k, (out, distance2)) in out.iter_mut().zip(&mut distance2).enumerate() {
            let x = (self.origin[0] + f32::from(self.centre[0][k]) * sx) - at.p.x;
            let y = (self.origin[1] + f32::from(self.centre[1][k]) * sy) - at.p.y;
            let z = (self.origin[2] + f32::from(self.centre[2][k]) * sz) - at.p.z;
            let (hx, hy, hz) =
                (f32::from(self.half[0][k]) * sx, f32::from(self.half[1][k]) * sy, f32::from(self.half[2][k]) * sz);
            let radius2 = hx * hx + hy * hy + hz * hz;
            let true_d2 = x * x + y * y + z * z;
            *distance2 = true_d2;
            let d2 = larger(larger(true_d2, radius2), f32::MIN_POSITIVE);
            let inverse2 = 1.0 / d2;
            let inverse = inverse2.sqrt();
            // Angle under which the bounding sphere is seen, a little larger against rounding; inside of it every angle.
            let sin2 = radius2 * inverse2 * 1.00001 + 1e-7;
            let inside = sin2 >= 1.0;
            let (sin_around, cos_around) = (sin2.sqrt(), larger(1.0 - sin2, 0.0).sqrt());
            let half_sin = f32::from(self.half_cone[k]) * (1.0 / STEPS);
            let half_cos2 = larger(1.0 - half_sin * half_sin, 0.0);
            let (sin_n, cos_n) = (2.0 * half_sin * half_cos2.sqrt(), half_cos2 - half_sin * half_sin);
            let cos_both = cos_n * cos_around - sin_n * sin_around;
            let sin_both = sin_n * cos_around + cos_n * sin_around;
            let along =
                x * f32::from(self.axis[0][k]) + y * f32::from(self.axis[1][k]) + z * f32::from(self.axis[2][k]);
            let theta = -along * (1.0 / SIGNED_STEPS) * inverse;
            let beyond = theta * cos_both + larger(1.0 - theta * theta, 0.0).sqrt() * sin_both;
            // A negative sine of the sum: more than pi, which holds all directions.
            let within = inside | (sin_both <= 0.0) | (theta >= cos_both);
            let cos = if within { 1.0 } else { beyond };
            let (even, common) = (f32::from(self.even[k]) * (1.0 / SHARES), f32::from(self.common[k]) * (1.0 / SHARES));
            let square = f32::from(self.square[k]) * (1.0 / SHARES);
            let blur = 0.5 + 0.5 * cos_around;
            let s = (square - 1.0 / 3.0) * (cos_around * blur) + 1.0 / 3.0;
            let f2 = 0.75 + 0.25 * larger(1.5 * s - 0.5, 0.0);
            let (cos2, r) = (theta * theta, common * blur);
            let x2 = f2 * (s * cos2 + 0.5 * (1.0 - s) * larger(1.0 - cos2, 0.0));
            let lobe = 0.5 * (r * theta + x2.sqrt());
            let importance = self.strength[k] * larger(even + (1.0 - even) * lobe, LEAST_COS) * inverse2;
            // Above the plane? A box is above it where its farthest corner is.
            let height = x * n.x + y * n.y + z * n.z;
            let reach = height + hx * n.x.abs() + hy * n.y.abs() + hz * n.z.abs();
            let rounding = 1e-6 * (x.abs() + y.abs() + z.abs() + hx + hy + hz);
            let cos_i = height * inverse;
            let tilted = larger(0.5 * (cos_i + (cos_i * cos_i + FULL_BALL * sin2).sqrt()), least_tilt);
            let tilt = if one_sided { tilted } else { 1.0 };
            let lit =
                (cos > f32::from(self.cos_emission[k]) * (1.0 / SIGNED_STEPS)) & (!one_sided | (reach > -rounding));
            *out = if lit { importance * tilt } else { 0.0 };
        }
        (out, distance2)
    }

    /// Squared distance of the middle of each child's box.
    #[inline]
    pub fn distance2(&self, p: Vec3) -> Lanes {
        std::array::from_fn(|k| (self.centre(k) - p).length_squared())
    }

    /// Middle of a child's box.
    #[inline]
    pub fn centre(&self, lane: usize) -> Vec3 {
        let of = |k: usize| self.origin[k] + f32::from(self.centre[k][lane]) * self.step[k];
        Vec3::new(of(0), of(1), of(2))
    }

    /// Squared radius of the sphere around a child's box.
    #[inline]
    pub fn radius2(&self, lane: usize) -> f32 {
        let of = |k: usize| f32::from(self.half[k][lane]) * self.step[k];
        Vec3::new(of(0), of(1), of(2)).length_squared()
    }
}

/// Least mean cosine at a point.
pub(super) fn least_tilt(at: &LitPoint) -> f32 {
    if at.matte { LEAST_TILT } else { LEAST_GLOSSY_TILT }
}

/// The larger one, without the care for NaN that `f32::max` takes.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
