//! Predicted edges, looked at again: which of them show?
//!
//! Hidden is what lies behind a flat surface that covers the footprint. What is left is looked at with real rays of the family at
//! points where the margin vanishes (the nearest one, and those with one parameter at an end; Newton's steps on the margin's expansion
//! where it has a second order), and dropped if all of them meet something nearer.
//! The surface that the rays start from is no such thing where they start, and is where it bends back into their way.

use super::kinds::{Events, Kinds, Verdict};
use super::linear::Linear;
use super::predicted::{D1, Edge, Predictor};
use super::{EdgeDetector, Facet, NOTHING, beam};
use crate::accel::Ray as PlainRay;
use dualux_dual::{Jet, Ray};

/// Factor of distance by which an edge is clearly behind a curved surface.
const BEHIND: f64 = 1.05;
/// Newton's steps towards a margin's zero.
const STEPS: usize = 2;
/// How far beyond its ends an edge is still looked at, as a fraction of it.
const ENDS: f64 = 0.02;

/// What a family of rays is asked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Question {
    /// Range of the ray parameter.
    pub t: [f64; 2],
    /// Where the rays start.
    pub exclude: Facet,
    /// The last two parameters fill the unit disk.
    pub round: bool,
    /// By how much the footprint is enlarged.
    pub grow: f64,
    /// Look for all events, not only for one.
    pub all: bool,
    /// Look for depth swaps.
    pub swaps: bool,
}

impl<J: Jet<N, Primitive = f64>, const N: usize> Predictor<'_, J, N> {
    /// A place where the margin vanishes, with the parameters of `fixed` given.
    fn root(&self, e: &Edge<N>, fixed: &[Option<f64>; N]) -> Option<[f64; N]> {
        let mut p = e.margin.root(fixed)?;
        if J::NDERIV < 2 {
            return Some(p);
        }
        for _ in 0..STEPS {
            // The margin's tangent at p.
            let bent: [f64; N] = std::array::from_fn(|i| (0..N).map(|j| e.bend[i][j] * p[j]).sum());
            let half: f64 = (0..N).map(|i| 0.5 * bent[i] * p[i]).sum();
            let gradient = std::array::from_fn(|i| e.margin.gradient[i] + bent[i]);
            p = Linear { value: e.margin.value - half, gradient, rest: 0.0 }.root(fixed)?;
        }
        Some(p)
    }

    /// Whether real rays see an edge, or nothing can be said. `own`: where the centre ray meets the shape again that it starts from.
    fn shows(&self, detector: &EdgeDetector, e: &Edge<N>, t: [f64; 2], own: Option<f64>) -> bool {
        let mut asked = false;
        let none = [None; N];
        // The nearest root, and those with some parameters at their ends.
        let ends = (0..2 * N).map(|i| {
            let mut fixed = none;
            let (k, at) = (i / 2, if i % 2 == 0 { -0.9 } else { 0.9 });
            fixed[k] = Some(if self.round && k + 2 >= N { 0.7 * at } else { at });
            fixed
        });
        for p in std::iter::once(none).chain(ends).filter_map(|fixed| self.root(e, &fixed)) {
            if e.s.is_some_and(|s| !(-ENDS..=1.0 + ENDS).contains(&s.at(&p))) {
                continue;
            }
            asked = true;
            let at = e.t.at(&p);
            let mut ray = PlainRay {
                o: self.o.at(&p).as_vec3(),
                d: self.d.at(&p).as_vec3(),
                tmin: (t[0] as f32).max(at as f32 * 1e-4),
                tmax: (at * (1.0 - 1e-3)) as f32,
            };
            let starts = |shape: u32, prim: u32, t: f64| {
                let facet = shape == self.exclude.shape && (prim == self.exclude.prim || t < 1e-2 * at);
                facet && own.is_none_or(|own| t < 0.3 * own)
            };
            let mut hit = detector.closest_seen(&ray);
            if let Some(first) = hit.filter(|hit| starts(hit.shape, hit.prim, f64::from(hit.t))) {
                ray.tmin = first.t * 1.001;
                hit = detector.closest_seen(&ray).filter(|hit| !starts(hit.shape, hit.prim, f64::from(hit.t)));
            }
            // A curved surface is met before its silhouette.
            let counts = |shape: u32, t: f64| shape != e.shape || (e.s.is_some() && t < at / BEHIND);
            if !hit.is_some_and(|hit| counts(hit.shape, f64::from(hit.t))) {
                return true;
            }
        }
        !asked
    }
}

impl EdgeDetector<'_> {
    /// Predicted events of rays whose origin moves. `front`: shape and distance (in units of the direction) of what the centre ray
    /// meets, if known: where no flat surface covers the footprint but this has no edge in it, it hides what is clearly farther.
    pub fn predict<const N: usize>(
        &self,
        ray: &Ray<D1<N>>,
        t: [f64; 2],
        exclude: Option<Facet>,
        front: Option<(u32, f64)>,
    ) -> Verdict {
        self.predict_nearest(ray, t, exclude, front).0
    }

    /// The same, and the margin of the nearest edge that shows.
    pub fn predict_nearest<const N: usize>(
        &self,
        ray: &Ray<D1<N>>,
        t: [f64; 2],
        exclude: Option<Facet>,
        front: Option<(u32, f64)>,
    ) -> (Verdict, Option<Linear<N>>) {
        let exclude = exclude.unwrap_or(Facet::NONE);
        self.predict_edges(ray, Question { t, exclude, round: false, grow: 1.0, all: true, swaps: true }, || front)
    }

    /// [`Self::predict`] with any question; `front` is asked for only where there are edges.
    #[inline(always)]
    pub(super) fn predict_in<J: Jet<N, Primitive = f64>, const N: usize>(
        &self,
        ray: &Ray<J>,
        question: Question,
        front: impl FnOnce() -> Option<(u32, f64)>,
    ) -> Verdict {
        self.predict_edges(ray, question, front).0
    }

    #[inline(always)]
    fn predict_edges<J: Jet<N, Primitive = f64>, const N: usize>(
        &self,
        ray: &Ray<J>,
        question: Question,
        front: impl FnOnce() -> Option<(u32, f64)>,
    ) -> (Verdict, Option<Linear<N>>) {
        let Question { t, exclude, round, grow, all, swaps } = question;
        let mut p = Predictor::<J, N>::new(self.scene, ray, t, exclude, round, grow);
        let beam = beam::around(&p.o, &p.d, p.lens.as_ref(), t, self.reach);
        p.keeps_flats = swaps;
        self.walk_seen(&beam, &mut p);
        p.swaps();
        if p.edges.is_empty() && p.trouble == Kinds::NONE {
            return (Verdict::Clear, None);
        }
        self.confirm(&mut p, t, front(), all)
    }

    /// What of the predicted edges shows.
    fn confirm<J: Jet<N, Primitive = f64>, const N: usize>(
        &self,
        p: &mut Predictor<J, N>,
        t: [f64; 2],
        front: Option<(u32, f64)>,
        all: bool,
    ) -> (Verdict, Option<Linear<N>>) {
        let (mut found, mut nearest) = (NOTHING, None);
        // A surface without an edge of its own in the footprint hides what is behind.
        let cover = match front {
            Some((shape, t)) if !p.edges.iter().any(|e| e.shape == shape) => p.cover.min(t * BEHIND),
            _ => p.cover,
        };
        let own = front.filter(|f| f.0 == p.exclude.shape).map(|f| f.1);
        let mut live = 0;
        for i in 0..p.edges.len() {
            let e = &p.edges[i];
            if e.near > cover * (1.0 + 1e-6) {
                continue;
            }
            live += 1;
            if live > self.settings.busy {
                p.trouble |= Kinds::BUSY;
                break;
            }
            if p.shows(self, e, t, own) {
                found.kinds |= e.kind;
                let distance = e.margin.distance();
                if distance < found.distance {
                    (found.distance, nearest) = (distance, Some(e.margin));
                }
                if !all {
                    break;
                }
            }
        }
        let found = Events { kinds: found.kinds | p.trouble, ..found };
        let verdict = match (p.trouble == Kinds::NONE, found.kinds == Kinds::NONE) {
            (false, _) => Verdict::Unknown(found),
            (true, true) => Verdict::Clear,
            (true, false) => Verdict::Events(found),
        };
        (verdict, nearest)
    }
}
