//! Bounds of lights: boxes, cones of normals, importance at a point; where to cut a set of them in two.
//!
//! The equations are those of [`super`]. The cone of normals and the cone under which the bounding sphere is seen are added as one
//! angle, by its sine and cosine: no angle is computed in the descent.

use super::LitPoint;
use crate::math::Vec3;
use crate::scene::light::EmitterBounds;
use std::f32::consts::PI;

/// Buckets per axis in which splits are looked for.
const BUCKETS: usize = 12;

/// Bounds of a set of emitters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    lo: Vec3,
    hi: Vec3,
    cone: Cone,
    cos_emission: f32,
    /// Sum of largest intensities.
    pub strength: f32,
}

/// Directions up to an angle from an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    pub axis: Vec3,
    pub cos: f32,
}

impl Cone {
    const ALL: Cone = Cone { axis: Vec3::Z, cos: -1.0 };

    /// The smallest cone that holds both, or nearly so.
    pub(super) fn union(self, other: Cone) -> Cone {
        let angle = |c: f32| f64::from(c.clamp(-1.0, 1.0)).acos();
        let (a, b) = (angle(self.cos), angle(other.cos));
        let between = {
            let (u, v) = (self.axis.as_dvec3(), other.axis.as_dvec3());
            u.cross(v).length().atan2(u.dot(v))
        };
        if between + b <= a {
            return self;
        }
        if between + a <= b {
            return other;
        }
        let half = 0.5 * (a + between + b);
        let turn = self.axis.cross(other.axis);
        if half >= std::f64::consts::PI || turn.length_squared() < 1e-12 {
            return if turn.length_squared() < 1e-12 && self.axis.dot(other.axis) > 0.0 {
                Cone { axis: self.axis, cos: (self.cos.min(other.cos) - 1e-5).max(-1.0) }
            } else {
                Cone::ALL
            };
        }
        // From this axis towards the other one.
        let side = turn.normalize().cross(self.axis);
        let (sin, cos) = ((half - a) as f32).sin_cos();
        Cone { axis: (self.axis * cos + side * sin).normalize(), cos: half.cos() as f32 }
    }
}

impl Bounds {
    pub(super) fn of(e: &EmitterBounds) -> Self {
        let cone = Cone { axis: e.axis, cos: e.cos_normals };
        Bounds { lo: e.bounds.0, hi: e.bounds.1, cone, cos_emission: e.cos_emission, strength: e.intensity }
    }

    pub(super) fn union(self, o: Bounds) -> Self {
        Bounds {
            lo: self.lo.min(o.lo),
            hi: self.hi.max(o.hi),
            cone: self.cone.union(o.cone),
            cos_emission: self.cos_emission.min(o.cos_emission),
            strength: self.strength + o.strength,
        }
    }

    fn centre(&self) -> Vec3 {
        0.5 * (self.lo + self.hi)
    }

    /// Strength times the solid angle of emission times surface area: the cost of Conty Estevez and Kulla's eq. 1.
    fn cost(&self, stretch: f32) -> f32 {
        let (o, e) = (self.cone.cos.clamp(-1.0, 1.0).acos(), self.cos_emission.clamp(-1.0, 1.0).acos());
        let w = (o + e).min(PI);
        let sin_o = o.sin();
        let measure =
            2.0 * PI * (1.0 - o.cos()) + 0.5 * PI * (2.0 * w * sin_o - (o - 2.0 * w).cos() - 2.0 * o * sin_o + o.cos());
        let d = self.hi - self.lo;
        self.strength * measure * stretch * (d.x * d.y + d.y * d.z + d.z * d.x)
    }
}

/// Bounds as the descent reads them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prepared {
    centre: Vec3,
    half: Vec3,
    axis: Vec3,
    /// Squared radius of the bounding sphere.
    radius2: f32,
    /// Of the cone of normals, a little larger against rounding.
    sin_normals: f32,
    cos_normals: f32,
    cos_emission: f32,
    strength: f32,
}

impl Prepared {
    pub(super) fn new(b: &Bounds) -> Self {
        let half = 0.5 * (b.hi - b.lo);
        let cos_normals = (b.cone.cos - 1e-6).max(-1.0);
        Prepared {
            centre: b.centre(),
            half,
            axis: b.cone.axis,
            radius2: half.length_squared(),
            sin_normals: sine(cos_normals),
            cos_normals,
            cos_emission: b.cos_emission - 1e-6,
            strength: b.strength,
        }
    }

    /// Importance at a point.
    #[inline(always)]
    pub(super) fn importance(&self, at: &LitPoint) -> f32 {
        let to = self.centre - at.p;
        let true_d2 = to.length_squared();
        let d2 = true_d2.max(self.radius2);
        if !(d2 > 0.0) {
            return if self.strength > 0.0 { f32::MAX.sqrt() } else { 0.0 };
        }
        // Angle under which the bounding sphere is seen, a little larger against rounding; inside of it every angle.
        let sin2 = self.radius2 / d2 * 1.00001 + 1e-7;
        let inside = sin2 >= 1.0;
        let inverse = 1.0 / d2.sqrt();
        let (sin_around, cos_around) = (sin2.sqrt(), (1.0 - sin2).max(0.0).sqrt());
        let mut cos = 1.0;
        if !inside {
            // The cone of normals and that of the sphere, one after the other, are one of the sum of their angles.
            let cos_both = self.cos_normals * cos_around - self.sin_normals * sin_around;
            let sin_both = self.sin_normals * cos_around + self.cos_normals * sin_around;
            let theta = -to.dot(self.axis) * inverse;
            // A negative sine: more than pi, which holds all directions.
            if sin_both > 0.0 && theta < cos_both {
                cos = theta * cos_both + sine(theta) * sin_both;
            }
        }
        if cos <= self.cos_emission {
            return 0.0;
        }
        let mut importance = self.strength * cos.max(0.01) / d2;
        if let Some(n) = at.n {
            let height = to.dot(n);
            // Above the plane? A box is above it where its farthest corner is.
            let reach = height + self.half.dot(n.abs());
            if reach <= -1e-6 * (to.abs().max_element() + self.half.max_element()) {
                return 0.0;
            }
            let cos = height * inverse;
            if !inside && cos < cos_around {
                importance *= (cos * cos_around + sine(cos) * sin_around).max(1e-3);
            }
        }
        importance
    }
}

/// sqrt(1 - cos^2)
#[inline(always)]
fn sine(cos: f32) -> f32 {
    (1.0 - cos * cos).max(0.0).sqrt()
}

/// Reorders the list and returns where to cut it, within it.
pub(super) fn split(list: &mut [(Bounds, u32)]) -> usize {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (lo, hi) = list.iter().fold(empty, |b, (x, _)| (b.0.min(x.centre()), b.1.max(x.centre())));
    let extent = hi - lo;
    let bucket = |b: &Bounds, axis: usize| {
        let x = (b.centre()[axis] - lo[axis]) / extent[axis];
        ((x * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&a| extent[a] > 0.0) {
        let mut buckets: [Option<Bounds>; BUCKETS] = [None; BUCKETS];
        for (b, _) in list.iter() {
            let slot = &mut buckets[bucket(b, axis)];
            *slot = Some(slot.map_or(*b, |s| s.union(*b)));
        }
        let join = |part: &[Option<Bounds>]| part.iter().flatten().copied().reduce(Bounds::union);
        // Thin boxes cost more to cut the short way.
        let stretch = extent.max_element() / extent[axis];
        for cut in 1..BUCKETS {
            let (Some(a), Some(b)) = (join(&buckets[..cut]), join(&buckets[cut..])) else { continue };
            let cost = a.cost(stretch) + b.cost(stretch);
            if best.is_none_or(|(c, ..)| cost < c) {
                best = Some((cost, axis, cut));
            }
        }
    }
    let middle = list.len() / 2;
    let Some((_, axis, cut)) = best else { return middle };
    // A stable partition.
    list.sort_by_key(|(b, _)| bucket(b, axis) >= cut);
    let first = list.iter().take_while(|(b, _)| bucket(b, axis) < cut).count();
    if first == 0 || first == list.len() { middle } else { first }
}
