//! One record of the irradiance cache: where it may be used, and what it says there.
//!
//! ```text
//!   E_i(x, n) = max(0, E_i (1 + v.H v / (2 Y)) + grad E . v + dE/dn . (n - n_i))            per colour; H, Y: of the luminance
//!   d_i(x, n) = |((s.v)/R_1, (t.v)/R_2, (n_i.v)/R_n)| + sqrt((1 - n.n_i) / (1 - cos a)),    v = x - x_i
//!   w_i       = 1 - d_i / b  for d_i < b, else 0
//! ```
//!
//! A record covers x where d_i < 1, and is used up to d_i < b = [`BORDER`] with a weight that goes to zero there: whatever
//! lies within (b - 1) R of a covered point has a record (METHODS.md: a looser threshold for looking up than for placing).
//! Radii from the Hessian of the luminance, lambda_1 >= lambda_2 in size, for the mean relative error a over the disc
//!
//!   R = sqrt(8 a E / (|l1| + |l2|)),   R_1 = R (|l2| / |l1|)^(1/4),   R_2 = R (|l1| / |l2|)^(1/4)
//!
//! with the ratio of the two bounded; then not beyond E / |grad E| nor the nearest thing that rises from the surface, if it is small (what is wide,
//! such as a wall, the derivatives know), and within the limits of scene and pixels.
//! Refused: points in front of the record, points behind something that rises from the surface between the two, and normals
//! more than the angle a apart.
//! Source      Ward, Rubinstein, Clear 1988; Ward and Heckbert 1992 (gradients); Schwarzhaupt, Jensen, Jarosz 2012 (radii);
//!             Krivanek et al. 2006 (limits)
//! Bias        that of the interpolation; goes to 0 with a. Without the second-order term it would have one sign wherever the irradiance bends
//!             one way, as on the ceiling above a bright floor (+2 % with the default a): tangents lie above a dome
//! Verified by tests/irradiance_cache.rs

use super::cache_file::stored;
use super::gather_strata::Estimate;
use super::riser::{Riser, SECTORS, sector};
use crate::math::{Frame, Rgb, Vec2, Vec3, luminance};

/// b: how far beyond its radius a record is still used.
pub const BORDER: f32 = 1.4;
/// 1 - cos of the angle between normals at which a record ends.
const NORMAL_LIMIT: f32 = 0.06;
/// Most that the two radii may differ: the root of |l1| / |l2|.
const MAX_RATIO: f32 = 3.0;
/// Radius along the normal over the mean one along the surface.
const THICKNESS: f32 = 0.35;
/// A thing is small if it is the nearest in so many sectors at most, or nearly so.
const SMALL: usize = 2;
/// How much farther other things may be to count as near, relative.
const NEARLY: f32 = 1.5;
/// Most that the second-order term may amount to, over the disc of a record and relative to its irradiance: more is noise or an edge.
const MOST_BEND: f32 = 0.05;
/// Greatest height in front of a record, in mean radii (Ward's in-front test with its tolerance).
const FRONT: f32 = 0.05;

/// What stands on the foot of a rising surface is before it: tolerance for the rounding of its packed normal.
const FOOT: f32 = 5e-5;

/// A record as look-ups use it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Position, world.
    pub p: Vec3,
    /// Frame of the ellipse around the shading normal: the short radius along `s`.
    pub frame: Frame,
    /// Radii along `s` and `t`, world units.
    pub radii: Vec2,
    /// Indirect irradiance.
    pub irradiance: Rgb,
    /// Derivative by translation along `s` and `t`.
    pub translation: [Rgb; 2],
    /// Derivative by the normal's components along `s` and `t`.
    pub rotation: [Rgb; 2],
    /// Second derivatives of the luminance by translation: ss, st, tt; bounded like [`Self::translation`].
    pub curvature: [f32; 3],
    /// What rises in the sectors of its plane, counted from `s`.
    pub risers: [Riser; SECTORS],
}

stored!(Record { p, frame, radii, irradiance, translation, rotation, curvature, risers });

/// Limits of radii.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiusLimits {
    /// Mean relative error over the disc of a record.
    pub error: f32,
    /// Irradiance (luminance) below which the error is relative to this.
    pub floor: f32,
    /// Least radius.
    pub min: f32,
    /// Greatest radius.
    pub max: f32,
}

impl Record {
    /// The record at `p` whose tangent frame is `frame`, in which the estimate is given.
    pub fn new(
        p: Vec3,
        frame: &Frame,
        e: &Estimate,
        limits: &RadiusLimits,
        risers: impl Fn(&Frame) -> [Riser; SECTORS],
    ) -> Self {
        let [ss, st, tt] = e.hessian;
        let (mean, half) = (0.5 * (ss + tt), 0.5 * (ss - tt));
        let spread = half.hypot(st);
        let (mut first, mut second) = ((mean + spread).abs(), (mean - spread).abs());
        // Eigenvector of the greater eigenvalue: half the angle of (ss - tt, 2 st).
        let mut axis = Vec2::from_angle(0.5 * st.atan2(half));
        if second > first {
            (first, second) = (second, first);
            axis = axis.perp();
        }
        let turn = |[a, b]: [Rgb; 2]| [a * axis.x + b * axis.y, b * axis.x - a * axis.y];
        let translation = turn(e.translation);
        let level = luminance(e.irradiance).max(limits.floor);
        let size = (8.0 * limits.error * level / (first + second)).sqrt();
        let slope = Vec2::new(luminance(translation[0]), luminance(translation[1])).length();
        let bound = (level / slope).min(limits.max).min(small_obstacle(&risers(frame)));
        let ratio = (first / second).sqrt().clamp(1.0, MAX_RATIO).sqrt();
        // No Hessian and no light give NaN: the greatest radius then.
        let radius = |r: f32| if r < bound { r.max(limits.min) } else { bound.max(limits.min) };
        let frame =
            Frame { s: frame.s * axis.x + frame.t * axis.y, t: frame.t * axis.x - frame.s * axis.y, n: frame.n };
        let mut record = Record {
            p,
            frame,
            radii: Vec2::new(radius(size / ratio), radius(size * ratio)),
            irradiance: e.irradiance,
            translation,
            rotation: turn(e.rotation),
            curvature: turned(e.hessian, axis),
            risers: risers(&frame),
        };
        record.tame();
        record
    }

    /// Takes over the values of an estimate in `frame`; the radii stay.
    pub fn update(&mut self, frame: &Frame, e: &Estimate) {
        let own = self.frame;
        let turn = |[a, b]: [Rgb; 2]| {
            [a * own.s.dot(frame.s) + b * own.s.dot(frame.t), a * own.t.dot(frame.s) + b * own.t.dot(frame.t)]
        };
        self.irradiance = e.irradiance;
        self.translation = turn(e.translation);
        self.rotation = turn(e.rotation);
        self.curvature = turned(e.hessian, Vec2::new(own.s.dot(frame.s), own.s.dot(frame.t)));
        self.tame();
    }

    /// Bounds the derivatives where the radius is larger than they allow, because of the least radius or because the light has become
    /// known better since: over the mean radius the irradiance at most doubles (Krivanek et al. 2006, section 3), and bends by
    /// [`MOST_BEND`].
    fn tame(&mut self) {
        let slope = Vec2::new(luminance(self.translation[0]), luminance(self.translation[1])).length();
        let change = slope * self.mean_radius();
        let most = luminance(self.irradiance);
        if change > most {
            self.translation.iter_mut().for_each(|t| *t *= most / change);
        }
        let ([ss, st, tt], Vec2 { x, y }) = (self.curvature.map(f32::abs), self.radii);
        let bend = (ss * x * x + 2.0 * st * x * y + tt * y * y) / 8.0;
        if bend > MOST_BEND * most {
            self.curvature.iter_mut().for_each(|c| *c *= MOST_BEND * most / bend);
        }
    }

    /// Mean of the two radii.
    pub fn mean_radius(&self) -> f32 {
        0.5 * (self.radii.x + self.radii.y)
    }

    /// Radius of the sphere outside of which the record is of no use.
    pub fn extent(&self) -> f32 {
        BORDER * self.radii.max_element()
    }

    /// d_i, if the record may be used at the point at all.
    #[inline]
    pub fn distance(&self, p: Vec3, n: Vec3, n_geo: Vec3) -> Option<f32> {
        let turned = 1.0 - n.dot(self.frame.n);
        if turned > NORMAL_LIMIT * BORDER * BORDER {
            return None;
        }
        let local = self.frame.to_local(p - self.p);
        let along = local.truncate();
        let mean = self.mean_radius();
        let q = (along / self.radii).extend(local.z / (THICKNESS * mean));
        let d = q.length() + (turned.max(0.0) / NORMAL_LIMIT).sqrt();
        if !(d < BORDER) || 0.5 * (local.z + (p - self.p).dot(n_geo)) < -FRONT * mean {
            return None;
        }
        if along == Vec2::ZERO {
            return Some(d);
        }
        // The neighbours as well: where a wall runs along the border of two sectors, only one may have seen it.
        let k = sector(along) + SECTORS;
        let free = [k - 1, k, k + 1].into_iter().all(|k| {
            let riser = &self.risers[k % SECTORS];
            along.dot(riser.normal) >= riser.offset - FOOT * along.length()
        });
        free.then_some(d)
    }

    /// Irradiance that the record predicts for a point.
    #[inline]
    pub fn predict(&self, p: Vec3, n: Vec3) -> Rgb {
        let (v, dn) = (p - self.p, n - self.frame.n);
        let moved = self.translation[0] * v.dot(self.frame.s) + self.translation[1] * v.dot(self.frame.t);
        let turned = self.rotation[0] * dn.dot(self.frame.s) + self.rotation[1] * dn.dot(self.frame.t);
        (self.irradiance * (1.0 + self.bend(v)) + moved + turned).max(Rgb::ZERO)
    }

    /// Second-order term over the irradiance, at the offset `v` from the record.
    #[inline]
    pub fn bend(&self, v: Vec3) -> f32 {
        let (s, t) = (v.dot(self.frame.s), v.dot(self.frame.t));
        let [ss, st, tt] = self.curvature;
        let level = luminance(self.irradiance);
        if level > 0.0 { (0.5 * (ss * s * s + tt * t * t) + st * s * t) / level } else { 0.0 }
    }
}

/// Second derivatives ss, st, tt in the frame whose first axis is the unit vector `axis`.
fn turned([ss, st, tt]: [f32; 3], axis: Vec2) -> [f32; 3] {
    let (c, s) = (axis.x, axis.y);
    [
        c * c * ss + 2.0 * c * s * st + s * s * tt,
        (c * c - s * s) * st + c * s * (tt - ss),
        s * s * ss - 2.0 * c * s * st + c * c * tt,
    ]
}

/// Distance of the nearest thing that rises from the surface, if few rays have met it, so that the second derivative knows little of it; else infinity.
fn small_obstacle(risers: &[Riser; SECTORS]) -> f32 {
    let away = risers.map(|r| if r.normal == Vec2::ZERO { f32::INFINITY } else { (-r.offset).max(0.0) });
    let nearest = away.iter().copied().fold(f32::INFINITY, f32::min);
    let beside = away.iter().filter(|d| **d <= NEARLY * nearest).count();
    if beside <= SMALL { nearest } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A record whose light changes a hundredfold within a tenth of its least radius, as in the last pixel before an edge.
    fn steep() -> (Frame, Estimate, RadiusLimits) {
        let e = Estimate {
            irradiance: Rgb::ONE,
            translation: [Rgb::splat(1000.0), Rgb::ZERO],
            rotation: [Rgb::ZERO; 2],
            hessian: [1e6, 0.0, 0.0],
        };
        (Frame::from_normal(Vec3::Z), e, RadiusLimits { error: 0.01, floor: 0.1, min: 1.0, max: 10.0 })
    }

    #[test]
    fn a_record_ends_at_a_small_thing_that_rises_beside_it() {
        let (frame, e, limits) = steep();
        let flat = Estimate { translation: [Rgb::ZERO; 2], hessian: [0.0; 3], ..e };
        let beside = |distance: f32, sectors: usize| {
            let thing = Riser { normal: Vec2::X, offset: -distance };
            let risers = |_: &Frame| std::array::from_fn(|k| if k < sectors { thing } else { Riser::NONE });
            Record::new(Vec3::ZERO, &frame, &flat, &limits, risers).radii
        };
        // Light that does not vary reaches as far as it may, but for the thing.
        assert_eq!([beside(100.0, 1), beside(3.0, 2), beside(0.1, 1)], [10.0, 3.0, 1.0].map(Vec2::splat));
        // A wall is in the derivatives.
        assert_eq!(beside(3.0, 7), Vec2::splat(10.0));
    }

    #[test]
    fn a_radius_larger_than_the_derivative_allows_does_not_extrapolate_to_fireflies() {
        let (frame, e, limits) = steep();
        let mut record = Record::new(Vec3::ZERO, &frame, &e, &limits, |_| [Riser::NONE; SECTORS]);
        let brightest = |r: &Record| {
            let along = |k: i32| r.predict(frame.s * (0.01 * k as f32 * r.extent()), Vec3::Z).x;
            (-100..=100).map(along).fold(0.0, f32::max)
        };
        assert_eq!(record.radii, Vec2::ONE);
        // Doubled at the radius, and the second-order term: 4 BORDER^2 times its mean over the disc if it bends one way only.
        let most = 1.0 + BORDER + 4.0 * MOST_BEND * BORDER * BORDER + 1e-5;
        assert!(brightest(&record) <= most, "{}", brightest(&record));
        // Light that became known later.
        record.update(&frame, &Estimate { irradiance: Rgb::splat(0.5), ..e });
        assert!(brightest(&record) <= 0.5 * most, "{}", brightest(&record));
        // A derivative within bounds is left alone.
        record.update(&frame, &Estimate { translation: [Rgb::splat(0.3), Rgb::ZERO], hessian: [0.0; 3], ..e });
        assert!((record.predict(frame.s, Vec3::Z).x - 1.3).abs() < 1e-5);
    }

    #[test]
    fn the_second_derivative_is_kept_whatever_the_frame_and_takes_off_what_tangents_have_too_much() {
        let (_, e, limits) = steep();
        let frame = Frame::from_normal(Vec3::new(0.3, -0.5, 0.8).normalize());
        let dome = Estimate { translation: [Rgb::splat(0.1), Rgb::splat(-0.05)], hessian: [-0.03, 0.012, -0.008], ..e };
        let at = |q: Vec2| {
            let [ss, st, tt] = dome.hessian;
            1.0 + 0.1 * q.x - 0.05 * q.y + 0.5 * (ss * q.x * q.x + tt * q.y * q.y) + st * q.x * q.y
        };
        let mut record = Record::new(Vec3::ZERO, &frame, &dome, &limits, |_| [Riser::NONE; SECTORS]);
        let check = |r: &Record| {
            for k in 0..64 {
                let q = Vec2::from_angle(0.7 * k as f32) * 0.02 * k as f32;
                let got = r.predict(frame.s * q.x + frame.t * q.y, frame.n).x;
                assert!((got - at(q)).abs() < 1e-5, "{q}: {got}, not {}", at(q));
            }
        };
        check(&record);
        // Values that come later, in the frame of the gather rays.
        record.update(&frame, &dome);
        check(&record);
        // The radii are such that tangents are off by the bound of the error, 0.01, on average over a disc, by less over an ellipse.
        let (mut sum, mut flat) = ([0.0; 2], record);
        flat.curvature = [0.0; 3];
        for k in 0..10_000 {
            let q = Vec2::from_angle(2.399_963 * k as f32) * ((k as f32 + 0.5) / 10_000.0).sqrt() * record.radii;
            let x = record.frame.s * q.x + record.frame.t * q.y;
            let truth = at(Vec2::new(x.dot(frame.s), x.dot(frame.t)));
            for (sum, r) in sum.iter_mut().zip([&record, &flat]) {
                *sum += (r.predict(x, frame.n).x - truth) / 10_000.0;
            }
        }
        assert!(sum[0].abs() < 1e-5 && (0.005..0.0101).contains(&sum[1]), "{sum:?}");
    }

    #[test]
    fn a_second_derivative_beyond_the_radius_is_bounded() {
        let (frame, e, limits) = steep();
        let flat = Estimate { translation: [Rgb::ZERO; 2], ..e };
        let record = Record::new(Vec3::ZERO, &frame, &flat, &limits, |_| [Riser::NONE; SECTORS]);
        let furthest = frame.s * record.extent();
        // All of MOST_BEND in one direction, whose mean over the disc is an eighth: at the border 4 BORDER^2 of it.
        let most = 4.0 * MOST_BEND * BORDER * BORDER;
        assert!(record.predict(furthest, Vec3::Z).x <= 1.0 + most + 1e-5, "{}", record.predict(furthest, Vec3::Z).x);
        // Axes that were chosen while there was no light: all of the second derivative is beside the diagonal.
        let dark = Estimate { irradiance: Rgb::ZERO, hessian: [0.0; 3], ..flat };
        let mut record = Record::new(Vec3::ZERO, &frame, &dark, &limits, |_| [Riser::NONE; SECTORS]);
        record.update(&frame, &Estimate { hessian: [0.0, 1.0, 0.0], ..flat });
        let furthest = (record.frame.s + record.frame.t).normalize() * record.extent();
        assert!(record.predict(furthest, Vec3::Z).x <= 1.0 + most + 1e-5, "{}", record.predict(furthest, Vec3::Z).x);
    }
}
