//! Depth-order swaps: surfaces that cross inside the footprint. (What pierces the far end of its rays: `ends`.)
//!
//! Two planes swap where the difference of their keys vanishes (degree 1, exact), cut to both outlines: polygons by their sides, disks
//! by their hit condition, quadratic along the line. A sphere and a plane, or two spheres, swap on the circle they share
//! (`dualux_dual::margins`), a cylinder and a plane on an ellipse or two lines, where that is what rays meet first of both.
//! A cylinder and a sphere or cylinder share a curve of degree 4: they swap if their order differs among `ASKED` x `ASKED` points of
//! the footprint, a prediction.
//! Not handled: one mesh with itself where the two triangles share a corner.

use super::chord::{Chord, clip, keep, keep_affine};
use super::curved::{Circle, Surface, arcs, ellipse_at};
use super::detect::{Detection, Mode, Owner, line_in_square};
use super::kinds::Kinds;
use super::view::{Affine, at, from_dual, range, to_dual};
use crate::math::DVec3;
use dualux_dual::{Cylinder, Disk, Plane, margins};

/// Points asked per axis for the order of two curved surfaces.
const ASKED: usize = 9;

/// A flat surface by its place in the lists, with a point and the normal of its plane, and its depth key.
struct Flat {
    owner: Owner,
    x: DVec3,
    n: DVec3,
    key: Affine,
}

/// What a plane cuts out of a cylinder.
pub(super) enum Section {
    Nothing,
    /// Obliquely; it may lie beyond the cylinder's ends.
    Ellipse(Circle),
    /// The plane holds the axis' direction.
    Lines([[DVec3; 2]; 2]),
}

/// The section of a cylinder with the plane through `x` with normal `n`.
pub(super) fn section(c: &Cylinder<f64>, x: DVec3, n: DVec3) -> Section {
    let (a, axis) = (from_dual(c.a), from_dual(c.axis()));
    let n = n.normalize();
    let along = n.dot(axis) / axis.length();
    if along.abs() > 1e-4 {
        let onto = |v: DVec3| v - axis * (n.dot(v) / n.dot(axis));
        let unit = axis.normalize();
        let u = unit.any_orthonormal_vector() * c.radius;
        let v = unit.cross(u);
        let centre = a + axis * (n.dot(x - a) / n.dot(axis));
        return Section::Ellipse(Circle { c: centre, u: onto(u), v: onto(v) });
    }
    let off = n.dot(x - a);
    if off.abs() >= c.radius {
        return Section::Nothing;
    }
    let aside = axis.cross(n).normalize() * (c.radius * c.radius - off * off).sqrt();
    Section::Lines([aside, -aside].map(|side| [a + n * off + side, a + n * off + side + axis]))
}

pub(super) fn circle_of(disk: &Disk<f64>) -> Circle {
    let n = from_dual(disk.normal).normalize();
    let u = n.any_orthonormal_vector() * disk.radius;
    Circle { c: from_dual(disk.centre), u, v: n.cross(u) }
}

impl Detection<'_> {
    /// Surfaces that exchange their depth order.
    pub(super) fn swaps(&mut self) -> bool {
        if self.mode == Mode::Shadow {
            return false;
        }
        let polygons = &self.surfaces.polygons;
        for i in 0..polygons.len() {
            for j in 0..i {
                let (a, b) = (&polygons[i], &polygons[j]);
                let difference: Affine = std::array::from_fn(|k| a.key[k] - b.key[k]);
                let (lo, hi) = range(&difference);
                if lo < 0.0
                    && hi > 0.0
                    && !(a.shape == b.shape && a.touches(b))
                    && self.flat_swap([Owner::Polygon(i), Owner::Polygon(j)], &a.key, &difference)
                {
                    return true;
                }
            }
        }
        (0..self.surfaces.curved.len()).any(|i| self.curved_swaps(i))
    }

    /// Swaps of a curved surface with all polygons, and with the curved surfaces before it.
    fn curved_swaps(&mut self, i: usize) -> bool {
        let surfaces = self.surfaces;
        let flats = (0..surfaces.polygons.len()).map(|j| {
            let polygon = &surfaces.polygons[j];
            let p = polygon.points(self.scene);
            Flat { owner: Owner::Polygon(j), x: p[0], n: (p[1] - p[0]).cross(p[2] - p[0]), key: polygon.key }
        });
        let disks = (0..i).filter_map(|j| self.as_flat(j));
        let flats: smallvec::SmallVec<[Flat; 4]> = flats.chain(disks).collect();
        let me = Owner::Curved(i);
        for flat in &flats {
            let pair = [me, flat.owner];
            let plane = || Plane::new(to_dual(flat.x), to_dual(flat.n));
            let found = match &surfaces.curved[i].surface {
                Surface::Disk(_) => self.as_flat(i).is_some_and(|disk| {
                    let difference: Affine = std::array::from_fn(|k| disk.key[k] - flat.key[k]);
                    let (lo, hi) = range(&difference);
                    lo < 0.0 && hi > 0.0 && self.flat_swap(pair, &disk.key, &difference)
                }),
                Surface::Sphere(s) => margins::plane_sphere_circle(&plane(), s)
                    .is_some_and(|circle| self.circle_swap(&circle_of(&circle), pair)),
                Surface::Cylinder(c) => self.cylinder_swap(c, flat, pair),
            };
            if found {
                return true;
            }
        }
        (0..i).any(|j| {
            let pair = [me, Owner::Curved(j)];
            match (&surfaces.curved[i].surface, &surfaces.curved[j].surface) {
                (Surface::Sphere(a), Surface::Sphere(b)) => margins::sphere_sphere_circle(a, b)
                    .is_some_and(|circle| self.circle_swap(&circle_of(&circle), pair)),
                (_, Surface::Disk(_)) => false, // a plane, above
                (Surface::Disk(disk), other) => {
                    let n = disk.u.cross(disk.v);
                    let flat = Flat { owner: me, x: disk.c, n, key: self.view.plane_key(disk.c, n) };
                    match other {
                        Surface::Sphere(s) => {
                            let plane = Plane::new(to_dual(flat.x), to_dual(n));
                            margins::plane_sphere_circle(&plane, s)
                                .is_some_and(|circle| self.circle_swap(&circle_of(&circle), pair))
                        }
                        Surface::Cylinder(c) => self.cylinder_swap(c, &flat, pair),
                        Surface::Disk(_) => false,
                    }
                }
                _ => self.order_differs(i, j) && self.is_swap(),
            }
        })
    }

    /// A disk with its plane.
    fn as_flat(&self, i: usize) -> Option<Flat> {
        let Surface::Disk(e) = &self.surfaces.curved[i].surface else { return None };
        let n = e.u.cross(e.v);
        Some(Flat { owner: Owner::Curved(i), x: e.c, n, key: self.view.plane_key(e.c, n) })
    }

    fn is_swap(&mut self) -> bool {
        self.found.kinds |= Kinds::SWAP;
        self.found.distance = self.found.distance.min(1.0);
        !self.all
    }

    /// Two planes, along the line where their keys are equal.
    fn flat_swap(&mut self, owners: [Owner; 2], key: &Affine, difference: &Affine) -> bool {
        let Some(p) = line_in_square(difference, &self.view.domain) else { return false };
        let whole = Chord { p, key: p.map(|p| at(key, p)) };
        let mut s = [0.0, 1.0];
        owners.iter().for_each(|o| self.cut(o, &whole, &mut s));
        let [near, far] = self.view.keys;
        keep(far - whole.key[0], far - whole.key[1], &mut s);
        if let Some(near) = &self.view.near {
            keep(whole.key[0] - at(near, p[0]), whole.key[1] - at(near, p[1]), &mut s);
        } else if near.is_finite() {
            keep(whole.key[0] - near, whole.key[1] - near, &mut s);
        }
        if s[1] - s[0] < 1e-6 {
            return false;
        }
        let chord = Chord { p: s.map(|s| whole.at(s)), key: s.map(|s| whole.key_at(s)) };
        self.offer(Kinds::SWAP, chord, [0.0; 2], owners.map(Some))
    }

    /// Shrinks `s` to the part of a chord inside the outline of a flat surface.
    pub(super) fn cut(&self, owner: &Owner, chord: &Chord, s: &mut [f64; 2]) {
        match *owner {
            Owner::Polygon(i) => {
                for side in self.surfaces.polygons[i].sides() {
                    keep_affine(chord, side, 0.0, s);
                }
            }
            Owner::Curved(i) => {
                let Surface::Disk(e) = &self.surfaces.curved[i].surface else { return };
                // f(u) = f0 + b u + a u^2, positive inside.
                let [f0, half, f1] = [0.0, 0.5, 1.0].map(|u| ellipse_at(self.view, e, chord.at(u)));
                let (a, b) = (2.0 * (f0 + f1 - 2.0 * half), 4.0 * half - 3.0 * f0 - f1);
                let root = (b * b - 4.0 * a * f0).sqrt();
                if root.is_nan() && f0 < 0.0 {
                    *s = [1.0, 0.0];
                } else if a < 0.0 && root >= 0.0 {
                    s[0] = s[0].max((-b + root) / (2.0 * a));
                    s[1] = s[1].min((-b - root) / (2.0 * a));
                }
            }
        }
    }

    /// A cylinder and a plane.
    fn cylinder_swap(&mut self, c: &Cylinder<f64>, flat: &Flat, owners: [Owner; 2]) -> bool {
        match section(c, flat.x, flat.n) {
            Section::Nothing => false,
            Section::Ellipse(circle) => self.circle_swap(&circle, owners),
            Section::Lines(lines) => lines.into_iter().any(|ends| {
                let ends = ends.map(|x| self.view.project(x));
                clip(self.view, &ends[0], &ends[1]).is_some_and(|chord| self.part_swap(&chord, owners))
            }),
        }
    }

    /// A swap along an ellipse.
    fn circle_swap(&mut self, circle: &Circle, owners: [Owner; 2]) -> bool {
        let (view, mut offered) = (self.view, 0);
        arcs(view, circle, &mut offered, &mut |chord, _| self.part_swap(chord, owners))
    }

    /// A straight piece of a swap, where it is inside the flat owners and what the rays meet first of the curved ones.
    fn part_swap(&mut self, chord: &Chord, owners: [Owner; 2]) -> bool {
        let view = self.view;
        let mut s = [0.0, 1.0];
        owners.iter().for_each(|o| self.cut(o, chord, &mut s));
        if s[1] - s[0] < 1e-6 {
            return false;
        }
        let part = Chord { p: s.map(|s| chord.at(s)), key: s.map(|s| chord.key_at(s)) };
        let (p, t) = (part.at(0.5), view.t_of(part.key_at(0.5)));
        let met = |o: &Owner| match o {
            Owner::Curved(i) => self.surfaces.curved[*i].hit(view, p).is_some_and(|hit| hit >= t * (1.0 - 1e-3)),
            Owner::Polygon(_) => true,
        };
        owners.iter().all(met) && self.offer(Kinds::SWAP, part, [0.0; 2], owners.map(Some))
    }

    /// Whether the order of two curved surfaces differs among points of the footprint.
    fn order_differs(&self, i: usize, j: usize) -> bool {
        let [a, b] = [i, j].map(|k| &self.surfaces.curved[k]);
        let mut seen = [false; 2];
        // From corner to corner.
        let at = |k: usize| 2.0 * k as f64 / (ASKED - 1) as f64 - 1.0;
        for k in 0..ASKED * ASKED {
            let p = [at(k % ASKED), at(k / ASKED)];
            if let (Some(s), Some(t)) = (a.hit(self.view, p), b.hit(self.view, p)) {
                seen[usize::from(s < t)] = true;
            }
        }
        seen == [true; 2]
    }
}
