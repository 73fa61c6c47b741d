//! The part of an edge inside a footprint, and which of it is left when surfaces are taken away.
//!
//! In a [`View`]'s coordinates a straight edge stays straight, its key (depth) is affine along it, and a polygon in front of it, or
//! across a light, takes one interval away: where all its sides and the difference of the keys are positive, each affine along the
//! chord. The rest is exact to rounding; the edge counts if more than `GAP` is left.

use super::view::{Affine, Point, View, at};
use arrayvec::ArrayVec;

/// Length, as a fraction of a chord, below which a gap between covering surfaces is rounding.
const GAP: f64 = 1e-5;

/// A straight piece of an edge in footprint coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chord {
    /// Its ends.
    pub p: [[f64; 2]; 2],
    /// Depth keys of the ends: -1/t for families with one origin, t for those with one direction.
    pub key: [f64; 2],
}

impl Chord {
    /// The point at fraction `u`.
    #[inline(always)]
    pub fn at(&self, u: f64) -> [f64; 2] {
        let [a, b] = self.p;
        [a[0] + (b[0] - a[0]) * u, a[1] + (b[1] - a[1]) * u]
    }

    /// The key at fraction `u`.
    #[inline(always)]
    pub fn key_at(&self, u: f64) -> f64 {
        self.key[0] + (self.key[1] - self.key[0]) * u
    }

    /// The chord moved sideways.
    pub fn shifted(&self, by: [f64; 2]) -> Chord {
        Chord { p: self.p.map(|p| [p[0] + by[0], p[1] + by[1]]), key: self.key }
    }

    /// Distance from the footprint's centre.
    pub fn distance(&self) -> f64 {
        let [a, b] = self.p;
        let e = [b[0] - a[0], b[1] - a[1]];
        let e2 = e[0] * e[0] + e[1] * e[1];
        let u = if e2 > 0.0 { (-(a[0] * e[0] + a[1] * e[1]) / e2).clamp(0.0, 1.0) } else { 0.0 };
        let q = self.at(u);
        (q[0] * q[0] + q[1] * q[1]).sqrt()
    }
}

/// The part of a segment that lies in the footprint, in its domain and within the rays' range.
#[inline]
pub fn clip(view: &View, a: &Point, b: &Point) -> Option<Chord> {
    let mut s = [0.0, 1.0];
    for axis in [1, 2] {
        keep(a[0] + a[axis], b[0] + b[axis], &mut s);
        keep(a[0] - a[axis], b[0] - b[axis], &mut s);
    }
    for l in view.domain.cuts() {
        let f = |q: &Point| l[0] * q[0] + l[1] * q[1] + l[2] * q[2];
        keep(f(a), f(b), &mut s);
    }
    let [near, far] = view.keys;
    if let Some(near) = &view.near {
        let beyond = |q: &Point| q[3] - (near[0] * q[0] + near[1] * q[1] + near[2] * q[2]);
        keep(beyond(a), beyond(b), &mut s);
    } else if near.is_finite() {
        keep(a[3] - near * a[0], b[3] - near * b[0], &mut s);
    }
    if far.is_finite() {
        keep(far * a[0] - a[3], far * b[0] - b[3], &mut s);
    }
    if s[0] > s[1] || s[0].is_nan() || s[1].is_nan() {
        return None;
    }
    let end = |s: f64| {
        let mix = |k: usize| a[k] + (b[k] - a[k]) * s;
        let inv = 1.0 / mix(0);
        ([(mix(1) * inv).clamp(-1.0, 1.0), (mix(2) * inv).clamp(-1.0, 1.0)], mix(3) * inv)
    };
    let ((p0, k0), (p1, k1)) = (end(s[0]), end(s[1]));
    // Only an edge through the origin itself ends at w = 0.
    let finite = p0.iter().chain(&p1).all(|x| x.is_finite()) && k0.is_finite() && k1.is_finite();
    finite.then_some(Chord { p: [p0, p1], key: [k0, k1] })
}

/// Shrinks `s` to where the function with values `f0` at 0 and `f1` at 1 is not negative.
#[inline(always)]
pub fn keep(f0: f64, f1: f64, s: &mut [f64; 2]) {
    if f0 >= 0.0 && f1 >= 0.0 {
        return;
    }
    if f0 < 0.0 && f1 < 0.0 {
        *s = [1.0, 0.0];
        return;
    }
    let root = f0 / (f0 - f1);
    if f0 < 0.0 {
        s[0] = s[0].max(root);
    } else {
        s[1] = s[1].min(root);
    }
}

/// Shrinks `s` to where an affine function of p is at least `-slack` along the chord.
#[inline(always)]
pub fn keep_affine(chord: &Chord, l: &Affine, slack: f64, s: &mut [f64; 2]) {
    keep(at(l, chord.p[0]) + slack, at(l, chord.p[1]) + slack, s);
}

/// What is left of a chord.
pub struct Gaps(ArrayVec<[f64; 2], 16>);

impl Gaps {
    /// All of it.
    pub fn all() -> Self {
        let mut gaps = ArrayVec::new();
        gaps.push([0.0, 1.0]);
        Gaps(gaps)
    }

    /// Takes the interval away. (If there are too many pieces nothing is taken away, which errs towards "visible".)
    pub fn remove(&mut self, [a, b]: [f64; 2]) {
        if a >= b || a.is_nan() || b.is_nan() {
            return;
        }
        let mut left = ArrayVec::<[f64; 2], 16>::new();
        for &[s, e] in &self.0 {
            for piece in [[s, e.min(a)], [s.max(b), e]] {
                if piece[1] - piece[0] > GAP && left.try_push(piece).is_err() {
                    return;
                }
            }
        }
        self.0 = left;
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The middle of the longest piece, as a fraction of the chord.
    pub fn middle(&self) -> Option<f64> {
        let longest = self.0.iter().max_by(|x, y| (x[1] - x[0]).total_cmp(&(y[1] - y[0])))?;
        Some(0.5 * (longest[0] + longest[1]))
    }
}
