//! Depth-order swaps: surfaces that cross inside the footprint, and surfaces that pierce the far end of its rays.
//!
//! Two planes swap where the difference of their keys vanishes (degree 1, exact), cut to both polygons. A sphere and a plane, or two spheres,
//! swap on the circle they share (`dualux_dual::margins`), where it is on the near side of the spheres and inside the polygon.
//! Not handled: disks and cylinders; one mesh with itself where the two triangles share a corner.

use super::chord::{Chord, keep, keep_affine};
use super::curved::{Circle, Surface, arcs};
use super::detect::{Detection, Mode, Owner, length, line_in_square};
use super::kinds::Kinds;
use super::view::{Affine, at, from_dual, range, to_dual};
use dualux_dual::{Plane, Sphere, margins};

impl Detection<'_> {
    /// Surfaces that exchange their depth order.
    pub(super) fn swaps(&mut self) -> bool {
        if self.mode == Mode::Shadow {
            return false;
        }
        let (polygons, curved) = (&self.surfaces.polygons, &self.surfaces.curved);
        for i in 0..polygons.len() {
            for j in 0..i {
                let (a, b) = (&polygons[i], &polygons[j]);
                let difference: Affine = std::array::from_fn(|k| a.key[k] - b.key[k]);
                let (lo, hi) = range(&difference);
                if lo < 0.0 && hi > 0.0 && !(a.shape == b.shape && a.touches(b)) && self.swap(i, j, &difference) {
                    return true;
                }
            }
        }
        for i in 0..curved.len() {
            let Surface::Sphere(sphere) = curved[i].surface else { continue };
            for j in 0..polygons.len() {
                let points = polygons[j].points(self.scene);
                let (a, b, c) = (points[0], points[1], points[2]);
                let plane = Plane::new(to_dual(a), to_dual((b - a).cross(c - a)));
                let circle = margins::plane_sphere_circle(&plane, &sphere);
                if self.circle_swap(circle, &[sphere], [Owner::Curved(i), Owner::Polygon(j)]) {
                    return true;
                }
            }
            for j in 0..i {
                let Surface::Sphere(other) = curved[j].surface else { continue };
                let circle = margins::sphere_sphere_circle(&sphere, &other);
                if self.circle_swap(circle, &[sphere, other], [Owner::Curved(i), Owner::Curved(j)]) {
                    return true;
                }
            }
        }
        false
    }

    fn swap(&mut self, i: usize, j: usize, difference: &Affine) -> bool {
        let Some(p) = line_in_square(difference, &self.view.domain) else { return false };
        let (a, b) = (&self.surfaces.polygons[i], &self.surfaces.polygons[j]);
        let whole = Chord { p, key: p.map(|p| at(&a.key, p)) };
        let mut s = [0.0, 1.0];
        for side in a.sides().iter().chain(b.sides()) {
            keep_affine(&whole, side, 0.0, &mut s);
        }
        let [near, far] = self.view.keys;
        keep(far - whole.key[0], far - whole.key[1], &mut s);
        if near.is_finite() {
            keep(whole.key[0] - near, whole.key[1] - near, &mut s);
        }
        if s[1] - s[0] < 1e-6 {
            return false;
        }
        let chord = Chord { p: s.map(|s| whole.at(s)), key: s.map(|s| whole.key_at(s)) };
        self.offer(Kinds::SWAP, chord, [0.0; 2], [Some(Owner::Polygon(i)), Some(Owner::Polygon(j))])
    }

    /// A swap along a circle on one or two spheres, where it is on their near side and inside the polygon, if one is an owner.
    fn circle_swap(
        &mut self,
        circle: Option<dualux_dual::Disk<f64>>,
        spheres: &[Sphere<f64>],
        owners: [Owner; 2],
    ) -> bool {
        let Some(disk) = circle else { return false };
        let n = from_dual(disk.normal).normalize();
        let u = n.any_orthonormal_vector() * disk.radius;
        let circle = Circle { c: from_dual(disk.centre), u, v: n.cross(u) };
        let (view, mut offered) = (self.view, 0);
        arcs(view, &circle, &mut offered, &mut |chord, _| {
            let (ray, t) = (view.ray_at(chord.at(0.5)), view.t_of(chord.key_at(0.5)));
            let in_front = |s: &Sphere<f64>| t * ray.d.norm2() < (s.centre - ray.o).dot(ray.d);
            let mut s = [0.0, 1.0];
            for owner in owners {
                if let Owner::Polygon(i) = owner {
                    for side in self.surfaces.polygons[i].sides() {
                        keep_affine(chord, side, 0.0, &mut s);
                    }
                }
            }
            if s[1] - s[0] < 1e-6 || !spheres.iter().all(in_front) {
                return false;
            }
            let part = Chord { p: s.map(|s| chord.at(s)), key: s.map(|s| chord.key_at(s)) };
            self.offer(Kinds::SWAP, part, [0.0; 2], owners.map(Some))
        })
    }

    /// Surfaces that pierce the far end: their shadow ends there.
    pub(super) fn far_cuts(&mut self) -> bool {
        if self.mode == Mode::Sight || self.view.t[1] == f64::INFINITY {
            return false;
        }
        let far = self.view.keys[1];
        for i in 0..self.surfaces.polygons.len() {
            let polygon = &self.surfaces.polygons[i];
            let before = [far - polygon.key[0], -polygon.key[1], -polygon.key[2]];
            let (lo, hi) = range(&before);
            if !(lo < 0.0 && hi > 0.0) {
                continue;
            }
            let Some(p) = line_in_square(&before, &self.view.domain) else { continue };
            let whole = Chord { p, key: [far; 2] };
            let mut s = [0.0, 1.0];
            for side in polygon.sides() {
                keep_affine(&whole, side, 0.0, &mut s);
            }
            if s[1] - s[0] < 1e-6 {
                continue;
            }
            let norm = -length(&before);
            let chord = Chord { p: s.map(|s| whole.at(s)), key: [far; 2] };
            let owner = [Some(Owner::Polygon(i)), None];
            if self.offer(Kinds::SWAP, chord, [before[1] / norm, before[2] / norm], owner) {
                return true;
            }
        }
        false
    }
}
