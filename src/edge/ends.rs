//! Surfaces that the ends of the rays' range cut: a camera's clip planes, the plane of a light.
//!
//! All rays of a [`View`](super::view::View) reach the same ray parameter in one plane, so that a surface ends where it crosses that plane: a polygon or disk on
//! a line, a sphere on a circle, a cylinder on an ellipse or two lines. Polygons and disks are exact; of the other curves a piece counts if
//! what a ray meets of the surface differs `ASIDE` half widths to either side of it.
//! In shadow only the far end counts as a swap with the light; in sight the surface has a boundary there.
//! Not handled: rays that start from a mirror's plane (what crosses it is seen to touch the mirror).

use super::chord::{Chord, clip, keep_affine};
use super::curved::{Surface, arcs};
use super::detect::{Detection, Mode, Owner, length, line_in_square};
use super::kinds::Kinds;
use super::swaps::{Section, circle_of, section};
use super::view::{Affine, range, to_dual};
use crate::math::DVec3;
use dualux_dual::{Plane, margins};

/// How far beside a curve its surface is looked for, half widths.
const ASIDE: f64 = 5e-3;
/// Relative difference of depth that is a jump.
const JUMP: f64 = 1e-3;

impl Detection<'_> {
    /// Surfaces cut by an end of the range.
    pub(super) fn end_cuts(&mut self) -> bool {
        let [near, far] = self.view.keys;
        let first = self.view.near.is_none() && near.is_finite();
        let last = self.view.t[1] != f64::INFINITY;
        (last && self.cuts_at(far, 1.0)) || (first && self.mode == Mode::Sight && self.cuts_at(near, -1.0))
    }

    /// Cuts at one end; `beyond`: whether greater (1) or smaller (-1) keys are out of range.
    fn cuts_at(&mut self, end: f64, beyond: f64) -> bool {
        for i in 0..self.surfaces.polygons.len() {
            let key = self.surfaces.polygons[i].key;
            if self.flat_cut(Owner::Polygon(i), &key, end, beyond) {
                return true;
            }
        }
        (0..self.surfaces.curved.len()).any(|i| self.curved_cut(i, end, beyond))
    }

    fn kind(&self) -> Kinds {
        if self.mode == Mode::Sight { Kinds::BOUNDARY } else { Kinds::SWAP }
    }

    /// A flat surface with this depth key.
    fn flat_cut(&mut self, owner: Owner, key: &Affine, end: f64, beyond: f64) -> bool {
        let inside = [end - key[0], -key[1], -key[2]].map(|x| x * beyond);
        let (lo, hi) = range(&inside);
        if !(lo < 0.0 && hi > 0.0) {
            return false;
        }
        let Some(p) = line_in_square(&inside, &self.view.domain) else { return false };
        let whole = Chord { p, key: [end; 2] };
        let mut s = [0.0, 1.0];
        match owner {
            Owner::Polygon(i) => {
                self.surfaces.polygons[i].sides().iter().for_each(|side| keep_affine(&whole, side, 0.0, &mut s));
            }
            Owner::Curved(_) => self.cut(&owner, &whole, &mut s),
        }
        if s[1] - s[0] < 1e-6 {
            return false;
        }
        let norm = -length(&inside);
        let chord = Chord { p: s.map(|s| whole.at(s)), key: [end; 2] };
        self.offer(self.kind(), chord, [inside[1] / norm, inside[2] / norm], [Some(owner), None])
    }

    /// A curved surface.
    fn curved_cut(&mut self, i: usize, end: f64, beyond: f64) -> bool {
        let (x, n) = self.view.plane_at(self.view.t_of(end));
        let section = match &self.surfaces.curved[i].surface {
            Surface::Disk(e) => {
                let key = self.view.plane_key(e.c, e.u.cross(e.v));
                return self.flat_cut(Owner::Curved(i), &key, end, beyond);
            }
            Surface::Sphere(s) => margins::plane_sphere_circle(&Plane::new(to_dual(x), to_dual(n)), s)
                .map_or(Section::Nothing, |circle| Section::Ellipse(circle_of(&circle))),
            Surface::Cylinder(c) => section(c, x, n),
        };
        // What lies on the end itself is kept whole.
        let mut open = *self.view;
        (open.keys, open.near) = ([f64::NEG_INFINITY, f64::INFINITY], None);
        match section {
            Section::Nothing => false,
            Section::Ellipse(circle) => {
                arcs(&open, &circle, &mut 0, &mut |chord, outward| self.piece_cut(i, chord, outward, end))
            }
            Section::Lines(lines) => lines.into_iter().any(|[a, b]: [DVec3; 2]| {
                clip(&open, &open.project(a), &open.project(b)).is_some_and(|chord| {
                    let [[x0, y0], [x1, y1]] = chord.p;
                    let length = (x1 - x0).hypot(y1 - y0).max(1e-30);
                    let across = [(y1 - y0) / length, (x0 - x1) / length];
                    [across, across.map(|x| -x)].into_iter().any(|outward| self.piece_cut(i, &chord, outward, end))
                })
            }),
        }
    }

    /// A straight piece of a curved surface's cut.
    fn piece_cut(&mut self, i: usize, chord: &Chord, outward: [f64; 2], end: f64) -> bool {
        let p = chord.at(0.5);
        let met = |aside: f64| self.surfaces.curved[i].hit(self.view, [0, 1].map(|k| p[k] + aside * outward[k]));
        let edge = match (met(-ASIDE), met(ASIDE)) {
            (Some(a), Some(b)) => self.mode == Mode::Sight && (a - b).abs() > JUMP * a.max(b),
            // In shadow `outward` is where light passes.
            (Some(_), None) => true,
            (None, Some(_)) => self.mode == Mode::Sight,
            (None, None) => false,
        };
        let chord = Chord { key: [end; 2], ..*chord };
        edge && self.offer(self.kind(), chord, outward, [Some(Owner::Curved(i)), None])
    }
}
