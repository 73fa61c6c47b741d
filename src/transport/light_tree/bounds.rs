//! Bounds of lights: boxes and cones of normals; where to cut a set of them in two.

use crate::math::Vec3;
use crate::scene::light::EmitterBounds;
use std::f32::consts::{FRAC_PI_2, PI};

/// Length of the mean normal from which on it tells the axis.
const LONG: f32 = 0.5;
/// Steps of the power iteration for the axis of the greatest mean square.
const TURNS: u32 = 8;
/// Buckets per axis in which splits are looked for.
const BUCKETS: usize = 12;

/// Bounds of a set of emitters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub extent: Extent,
    /// Holds all normals.
    pub cone: Cone,
    pub cos_emission: f32,
    /// The part of the strength that goes in all directions alike.
    pub even: f32,
}

/// What is cheap to join: enough to say where a set of emitters is best cut.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub lo: Vec3,
    pub hi: Vec3,
    /// Sum of largest intensities.
    pub strength: f32,
    /// Sum of I n, I the intensity but for what goes in all directions alike, n the axis.
    pub moment: Vec3,
    /// Sum of I n n: diagonal, and yz, zx, xy.
    pub second: [Vec3; 2],
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
        // What is common among many lamps needs no angles.
        if self == other || self.cos <= -1.0 {
            return self;
        }
        if other.cos <= -1.0 {
            return other;
        }
        if self.surely_holds(&other) {
            return self;
        }
        if other.surely_holds(&self) {
            return other;
        }
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

    /// A cone around `axis` that holds this one; this one if that has no direction.
    pub(super) fn about(self, axis: Vec3) -> Cone {
        let Some(axis) = axis.try_normalize() else { return self };
        if self.cos <= -1.0 {
            return Cone { axis, ..self };
        }
        if axis.dot(self.axis) > 1.0 - 2.0 * f32::EPSILON {
            return self;
        }
        // The sum of two angles, by their sines and cosines.
        let (between, cos) = (axis.dot(self.axis).clamp(-1.0, 1.0), self.cos);
        let (sin_between, sin) = (axis.cross(self.axis).length().min(1.0), (1.0 - cos * cos).max(0.0).sqrt());
        let beyond_pi = sin_between * cos + between * sin < 0.0;
        let both = between * cos - sin_between * sin - 1e-6;
        Cone { axis, cos: if beyond_pi || both <= -1.0 { -1.0 } else { both } }
    }

    /// Whether the other cone lies within, beyond doubt by rounding: cos (a - b) against the cosine between the axes, without an angle.
    fn surely_holds(&self, other: &Cone) -> bool {
        let [a, b] = [self.cos, other.cos].map(f64::from);
        let between = self.axis.as_dvec3().dot(other.axis.as_dvec3());
        a <= b && between > a * b + ((1.0 - a * a) * (1.0 - b * b)).max(0.0).sqrt() + 1e-6
    }
}

impl Extent {
    pub(super) fn union(self, o: Extent) -> Self {
        Extent {
            lo: self.lo.min(o.lo),
            hi: self.hi.max(o.hi),
            strength: self.strength + o.strength,
            moment: self.moment + o.moment,
            second: [self.second[0] + o.second[0], self.second[1] + o.second[1]],
        }
    }

    /// Mean square of the cosine between the axes and the unit vector `a`, times the sum of I.
    pub(super) fn squares(&self, a: Vec3) -> f32 {
        self.second[0].dot(a * a) + 2.0 * self.second[1].dot(Vec3::new(a.y * a.z, a.z * a.x, a.x * a.y))
    }

    /// The axis of the mean, or where that is short, of the greatest mean square, turned to the side of the mean; not unit, zero if there is none.
    pub(super) fn axis(&self) -> Vec3 {
        let [diagonal, [yz, zx, xy]] = self.second.map(|v| v.to_array());
        if self.moment.length() >= LONG * diagonal.iter().sum::<f32>() {
            return self.moment;
        }
        let rows = [Vec3::new(diagonal[0], xy, zx), Vec3::new(xy, diagonal[1], yz), Vec3::new(zx, yz, diagonal[2])];
        // From the longest row, which is no right angle away.
        let longest =
            rows.into_iter().fold(Vec3::ZERO, |a, b| if b.length_squared() > a.length_squared() { b } else { a });
        let turn = |v: Vec3, _| Vec3::new(rows[0].dot(v), rows[1].dot(v), rows[2].dot(v)).normalize_or_zero();
        let axis = (0..TURNS).fold(longest.normalize_or_zero(), turn);
        if axis.dot(self.moment) < 0.0 { -axis } else { axis }
    }

    pub(super) fn centre(&self) -> Vec3 {
        0.5 * (self.lo + self.hi)
    }

    /// Strength times solid angle of emission times surface area: the cost of Conty Estevez and Kulla's eq. 1, with hemispheres about a
    /// cone of normals that is evenly filled and has a mean of this length, (1 + cos) / 2: that of the cone which holds all takes angles,
    /// and a few that stray do not matter here. What shines in all directions counts as a full cone.
    pub(super) fn cost(&self, stretch: f32) -> f32 {
        let length = if self.strength > 0.0 { self.moment.length() / self.strength } else { 1.0 };
        let o = (2.0 * length - 1.0).clamp(-1.0, 1.0).acos();
        let w = (o + FRAC_PI_2).min(PI);
        let (sin_o, cos_o) = o.sin_cos();
        let measure =
            2.0 * PI * (1.0 - cos_o) + 0.5 * PI * (2.0 * w * sin_o - (o - 2.0 * w).cos() - 2.0 * o * sin_o + cos_o);
        let d = self.hi - self.lo;
        self.strength * measure * stretch * (d.x * d.y + d.y * d.z + d.z * d.x)
    }
}

impl Bounds {
    pub(super) fn of(e: &EmitterBounds) -> Self {
        let even = e.even * e.intensity;
        let ((lo, hi), n) = (e.bounds, e.axis);
        let own = e.intensity - even;
        let second = [n * n * own, Vec3::new(n.y * n.z, n.z * n.x, n.x * n.y) * own];
        Bounds {
            extent: Extent { lo, hi, strength: e.intensity, moment: n * own, second },
            cone: Cone { axis: e.axis, cos: e.cos_normals },
            cos_emission: e.cos_emission,
            even,
        }
    }

    pub(super) fn union(self, o: Bounds) -> Self {
        Bounds {
            extent: self.extent.union(o.extent),
            cone: self.cone.union(o.cone),
            cos_emission: self.cos_emission.min(o.cos_emission),
            even: self.even + o.even,
        }
    }
}

/// The extent of all of a list.
pub(super) fn around(list: &[(Bounds, u32)]) -> Option<Extent> {
    list.iter().map(|x| x.0.extent).reduce(Extent::union)
}

/// Reorders the list and returns where to cut it, within it, and the extents of both parts.
pub(super) fn split(list: &mut [(Bounds, u32)]) -> (usize, [Option<Extent>; 2]) {
    if let [a, b] = list {
        return (1, [Some(a.0.extent), Some(b.0.extent)]);
    }
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (lo, hi) = list.iter().fold(empty, |b, (x, _)| {
        let centre = x.extent.centre();
        (b.0.min(centre), b.1.max(centre))
    });
    let extent = hi - lo;
    let bucket = |b: &Bounds, axis: usize| {
        let x = (b.extent.centre()[axis] - lo[axis]) / extent[axis];
        ((x * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let join = |a: Option<Extent>, b: Option<Extent>| match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b),
    };
    let mut best: Option<(f32, usize, usize, [Option<Extent>; 2])> = None;
    for axis in (0..3).filter(|&a| extent[a] > 0.0) {
        let mut buckets: [Option<Extent>; BUCKETS] = [None; BUCKETS];
        for (b, _) in list.iter() {
            let slot = &mut buckets[bucket(b, axis)];
            *slot = join(*slot, Some(b.extent));
        }
        // All from each bucket on, and then those before it, one after the other.
        let mut from = buckets;
        (0..BUCKETS - 1).rev().for_each(|k| from[k] = join(from[k + 1], from[k]));
        let mut before = None;
        // Thin boxes cost more to cut the short way.
        let stretch = extent.max_element() / extent[axis];
        for cut in 1..BUCKETS {
            if buckets[cut - 1].is_none() && before.is_some() {
                // The same two parts as the cut before.
                continue;
            }
            before = join(before, buckets[cut - 1]);
            let (Some(a), Some(b)) = (before, from[cut]) else { continue };
            let cost = a.cost(stretch) + b.cost(stretch);
            if best.is_none_or(|(c, ..)| cost < c) {
                best = Some((cost, axis, cut, [before, from[cut]]));
            }
        }
    }
    let halves = |list: &[(Bounds, u32)]| {
        let middle = list.len() / 2;
        (middle, [around(&list[..middle]), around(&list[middle..])])
    };
    let Some((_, axis, cut, parts)) = best else { return halves(list) };
    // A stable partition.
    let (mut first, second): (Vec<_>, Vec<_>) = list.iter().partition(|(b, _)| bucket(b, axis) < cut);
    let count = first.len();
    first.extend(second);
    list.copy_from_slice(&first);
    if count == 0 || count == list.len() { halves(list) } else { (count, parts) }
}
