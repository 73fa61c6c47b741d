//! The part of a straight edge that lies inside a footprint.
//!
//! Fixed origin, directions `d0 + p1 d1 + p2 d2`: a point x is seen at p where `x - o = w (d0 + p1 d1 + p2 d2)`, so
//! `(w, w p1, w p2) = [d0 d1 d2]^-1 (x - o)` is linear in x. A segment is clipped against the footprint's pyramid
//! `w > 0, |w p_i| <= w` in these homogeneous coordinates; what is left is the **chord**, straight in p. w is the ray parameter
//! t at which r(p) meets the edge, and 1/w is linear along the chord. Exact, no expansion.
//!
//! Moving origin: [`predicted_chord`] clips the line on which the *first-order* margin vanishes, cut to the segment's extent and
//! to t > 0 by their first-order expansions. A prediction.

use super::line;
use crate::ray::{Family, Ray};
use crate::real::{Jet, Scalar};
use crate::vec3::Vec3;

/// A piece of a straight edge inside the footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chord<F> {
    /// Its two ends, in footprint coordinates.
    pub p: [[F; 2]; 2],
    /// Ray parameter t of the edge at each end, on the ray r(p) of that end.
    pub t: [F; 2],
    /// Position of each end on the edge: 0 at its first point, 1 at its second.
    pub s: [F; 2],
}

/// Central projection of space on the footprint of a family with fixed origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projector<F> {
    o: Vec3<F>,
    /// Rows of [d0 d1 d2]^-1.
    rows: [Vec3<F>; 3],
}

impl<F: Scalar> Projector<F> {
    /// For a family with fixed origin (its `o_p` are not looked at).
    ///
    /// `None` if d0, d1, d2 are linearly dependent: the footprint is seen edge-on and has no interior.
    pub fn new(family: &Family<F, 2>) -> Option<Self> {
        let [d1, d2] = family.d_p;
        let (r0, r1, r2) = (d1.cross(d2), d2.cross(family.d), family.d.cross(d1));
        let inv = family.d.dot(r0).recip();
        (inv.is_finite()).then(|| Self { o: family.o, rows: [r0.scale(inv), r1.scale(inv), r2.scale(inv)] })
    }

    /// Homogeneous coordinates (w, w p1, w p2) of a point; it is in front if w > 0 and in the footprint if |w p_i| <= w.
    #[inline(always)]
    pub fn project(&self, x: Vec3<F>) -> [F; 3] {
        let v = x - self.o;
        self.rows.map(|r| r.dot(v))
    }

    /// The part of segment a-b inside the footprint, if any.
    ///
    /// ```
    /// use dualux_dual::{Family, margins::Projector, vec3};
    /// let pixel = Family::fixed(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0), [vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0)]);
    /// let view = Projector::new(&pixel).unwrap();
    /// let chord = view.clip(vec3(0.0, -9.0, 2.0), vec3(0.0, 9.0, 2.0)).unwrap();
    /// assert_eq!(chord.p, [[0.0, -1.0], [0.0, 1.0]]);
    /// assert_eq!(chord.t, [2.0, 2.0]);
    /// // The line goes through the pixel, the segment does not.
    /// assert!(view.clip(vec3(0.0, 1.0, 2.0), vec3(0.0, 9.0, 2.0)).is_none());
    /// ```
    pub fn clip(&self, a: Vec3<F>, b: Vec3<F>) -> Option<Chord<F>> {
        let (ha, hb) = (self.project(a), self.project(b));
        let (mut s0, mut s1) = (F::zero(), F::one());
        // The four sides of the pyramid; together they imply w >= 0.
        for axis in [1, 2] {
            for sign in [F::one(), -F::one()] {
                keep_positive(ha[0] + sign * ha[axis], hb[0] + sign * hb[axis], &mut s0, &mut s1);
            }
        }
        if !(s0 <= s1) {
            return None;
        }
        let end = |s: F| {
            let mix = |k: usize| ha[k] + (hb[k] - ha[k]) * s;
            let (w, inv) = (mix(0), mix(0).recip());
            let clamp = |x: F| x.max(-F::one()).min(F::one());
            ([clamp(mix(1) * inv), clamp(mix(2) * inv)], w)
        };
        let ((p0, t0), (p1, t1)) = (end(s0), end(s1));
        // Only an edge through the origin itself ends at w = 0.
        (t0 > F::zero() || t1 > F::zero()).then_some(Chord { p: [p0, p1], t: [t0, t1], s: [s0, s1] })
    }
}

/// Shrinks [s0, s1] to where the linear function with f(0) = `fa`, f(1) = `fb` is not negative.
#[inline(always)]
fn keep_positive<F: Scalar>(fa: F, fb: F, s0: &mut F, s1: &mut F) {
    let zero = F::zero();
    if fa >= zero && fb >= zero {
        return;
    }
    if fa < zero && fb < zero {
        *s0 = F::one();
        *s1 = F::zero();
        return;
    }
    let s = fa * (fa - fb).recip();
    if fa < zero {
        *s0 = s0.max(s);
    } else {
        *s1 = s1.min(s);
    }
}

/// The chord of segment a-b predicted to first order, for families whose origin moves (orthographic pixels, lenses, rays that came
/// through mirrors or glass). Exact only in the limit of small footprints.
///
/// `None` if the prediction finds no part of the segment in the footprint, or no finite one.
pub fn predicted_chord<F: Scalar, T: Jet<2, Primitive = F>>(ray: &Ray<T>, a: Vec3<F>, b: Vec3<F>) -> Option<Chord<F>> {
    let (zero, one) = (F::zero(), F::one());
    // Nearest points of the two lines: s on the edge, t on the ray (both smooth in p unless parallel).
    let e = Vec3::lift(b - a);
    let v = Vec3::lift(a) - ray.o;
    let (ee, ed, dd) = (e.norm2(), e.dot(ray.d), ray.d.norm2());
    let (ve, vd) = (v.dot(e), v.dot(ray.d));
    let inv = (ee * dd - ed * ed).recip();
    let s = ((ed * vd - ve * dd) * inv).expansion();
    let t = ((ee * vd - ed * ve) * inv).expansion();
    let m = line(ray, a, b).expansion();
    if !(s.is_finite() && t.is_finite() && m.is_finite()) {
        return None;
    }
    let (s, t, m) = (s.first_order(), t.first_order(), m.first_order());
    let [g0, g1] = m.gradient;
    let g2 = g0 * g0 + g1 * g1;
    if !(g2 > zero) {
        return None;
    }
    // The zero line: foot + u (-g1, g0), long enough to leave the square on both sides.
    let foot = [-m.value * g0 * g2.recip(), -m.value * g1 * g2.recip()];
    let scale = F::of(4.0) * g2.sqrt().recip();
    let (qa, qb) = ([foot[0] - g1 * scale, foot[1] + g0 * scale], [foot[0] + g1 * scale, foot[1] - g0 * scale]);
    if m.value.abs() > g0.abs() + g1.abs() {
        return None;
    }
    let (mut u0, mut u1) = (zero, one);
    let mut cut = |f: &dyn Fn([F; 2]) -> F| keep_positive(f(qa), f(qb), &mut u0, &mut u1);
    for k in 0..2 {
        cut(&|p| one - p[k]);
        cut(&|p| one + p[k]);
    }
    cut(&|p| s.at(p));
    cut(&|p| one - s.at(p));
    cut(&|p| t.at(p));
    if !(u0 <= u1) {
        return None;
    }
    let p = [u0, u1].map(|u| [qa[0] + (qb[0] - qa[0]) * u, qa[1] + (qb[1] - qa[1]) * u]);
    Some(Chord { p, t: p.map(|p| t.at(p)), s: p.map(|p| s.at(p)) })
}
