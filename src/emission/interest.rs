//! Which rays of a light can meet a shape of interest first? Asked for whole cells, conservatively.
//!
//! A caustic photon starts towards a specular surface; projection maps (Jensen 2001, section 7.3.1) remember which cells of a light see
//! one, by drawing the objects' bounding spheres. Here the answer is exact in one direction: a cell for which [`Interest::reached`]
//! is false holds no ray whose first hit is such a shape, so it needs no photons at all and nothing is lost.
//!
//! The rays of a cell start on a parallelogram, or in a ball, and go along d + x d1 + y d2, x and y in [-1, 1] ([`Bundle`]). The
//! hierarchy is walked with their boxes and, for triangles, with the four planes of the directions' pyramid moved outwards by what origins
//! add (x = o + t d with n.d >= 0 gives n.(x - o0) >= -max |n.(o - o0)|, exactly). Spheres are tested against the widened ray.
//! A flat polygon that *all* rays of the cell meet ends the walk behind it: rays from a corner of the parallelogram that hit a convex
//! polygon form a convex set in (x, y), and for a fixed direction so do the origins; 16 corner rays therefore decide.
//! Not handled: covering by several polygons together, or by curved surfaces; such cells are kept.

use super::targets::{Target, targets};
use crate::accel::Accel;
use crate::accel::footprint::{Beam, Visitor};
use crate::edge::View;
use crate::edge::view::to_dual;
use crate::math::{DVec3, Vec3};
use crate::scene::{Geometry, Scene};
use dualux_dual::Family;
use std::ops::ControlFlow;

/// All rays of a cell.
#[derive(Clone, Copy, Debug)]
pub struct Bundle {
    /// Middle of the origins.
    pub o: DVec3,
    /// Half edges of the parallelogram they lie on.
    pub patch: [DVec3; 2],
    /// How far they may lie from that.
    pub radius: f64,
    /// Middle direction, of any length.
    pub d: DVec3,
    /// Half the range of directions.
    pub d_p: [DVec3; 2],
}

/// Shapes that photons are wanted on.
#[derive(Clone, Debug)]
pub struct Interest<'a> {
    scene: &'a Scene,
    accel: &'a Accel,
    wanted: Vec<bool>,
    reach: f64,
}

impl Bundle {
    /// The beam of the walk; `None` if the bundle has neither a fixed direction nor a pyramid of them.
    fn beam(&self, reach: f64) -> Option<Beam> {
        let parallel = self.d_p == [DVec3::ZERO; 2];
        let t = [0.0, f64::INFINITY];
        let (o, d) = (to_dual(self.o), to_dual(self.d));
        if parallel {
            let beam = View::new(Family::parallel(o, self.patch.map(to_dual), d), t)?.beam(reach as f32);
            return (self.radius == 0.0).then_some(beam);
        }
        let mut beam = View::new(Family::fixed(o, d, self.d_p.map(to_dual)), t)?.beam(reach as f32);
        let wide = self.patch[0].abs() + self.patch[1].abs() + DVec3::splat(self.radius);
        let wide = wide * (1.0 + 1e-6);
        beam.o = [(self.o - wide).as_vec3().map(f32::next_down), (self.o + wide).as_vec3().map(f32::next_up)];
        let sides = beam.sides.as_mut()?;
        for (n, slack) in sides.n.iter().zip(&mut sides.slack) {
            let n = n.as_dvec3();
            let by = self.patch.iter().map(|p| n.dot(*p).abs()).sum::<f64>() + n.length() * self.radius;
            *slack += (by * (1.0 + 1e-6)) as f32;
        }
        Some(beam)
    }

    /// Whether any ray may pass within `r` of `c`: by the middle ray, widened.
    fn may_meet(&self, c: DVec3, r: f64) -> bool {
        // |v + t d| <= a + t w for some t >= 0.
        let v = self.o - c;
        let diagonal = |p: [DVec3; 2]| (p[0] + p[1]).length().max((p[0] - p[1]).length());
        let a = r + self.radius + diagonal(self.patch);
        let w = diagonal(self.d_p) * (1.0 + 1e-9);
        let (q2, q1, q0) = (self.d.length_squared() - w * w, v.dot(self.d) - a * w, v.length_squared() - a * a);
        if q0 <= 0.0 || q2 <= 0.0 {
            return true;
        }
        q1 < 0.0 && q1 * q1 >= q2 * q0 * (1.0 - 1e-9)
    }

    /// The farthest ray parameter at which the rays meet the convex polygon, if all of them do.
    fn covered(&self, corners: &[DVec3]) -> Option<f64> {
        if self.radius > 0.0 {
            return None;
        }
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let mut far = 0f64;
        for i in 0..16 {
            let sign = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let o = self.o + self.patch[0] * sign(0) + self.patch[1] * sign(1);
            let d = self.d + self.d_p[0] * sign(2) + self.d_p[1] * sign(3);
            let t = n.dot(corners[0] - o) / n.dot(d);
            if !(t > 0.0 && t < f64::INFINITY) {
                return None;
            }
            let p = o + d * t;
            // One side of all edges; the margin keeps rounding from closing gaps.
            let size = n.length();
            for k in 0..corners.len() {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                if !((b - a).cross(p - a).dot(n) > 1e-6 * size * size) {
                    return None;
                }
            }
            far = far.max(t);
        }
        Some(far)
    }
}

struct Walk<'a> {
    interest: &'a Interest<'a>,
    bundle: &'a Bundle,
    own: Option<(u32, u32)>,
    limit: f32,
    found: bool,
}

impl Walk<'_> {
    /// Notes a shape; `corners` if it is, or this part of it is, a flat polygon.
    fn meet(&mut self, index: u32, prim: u32, corners: &[DVec3]) -> ControlFlow<()> {
        let Interest { scene, wanted, .. } = self.interest;
        if self.own == Some((index, prim)) || self.own == Some((index, u32::MAX)) {
            return ControlFlow::Continue(());
        }
        let shape = &scene.shapes[index as usize];
        if wanted[index as usize] {
            let meets = match &shape.geometry {
                Geometry::Sphere(s) => self.bundle.may_meet(s.center.as_dvec3(), f64::from(s.radius) * (1.0 + 1e-6)),
                _ => true,
            };
            self.found |= meets;
            return if meets { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        }
        if scene.passes_light[shape.material as usize] || corners.is_empty() {
            return ControlFlow::Continue(());
        }
        if let Some(far) = self.bundle.covered(corners) {
            self.limit = self.limit.min(far as f32 * 1.000_01);
        }
        ControlFlow::Continue(())
    }
}

impl Visitor for Walk<'_> {
    fn triangle(&mut self, index: u32, prim: u32, corners: [Vec3; 3]) -> ControlFlow<()> {
        match &self.interest.scene.shapes[index as usize].geometry {
            // It covers as a whole what neither of its triangles does.
            Geometry::Rectangle(r) => {
                let (c, x, y) = (r.center.as_dvec3(), r.ex.as_dvec3(), r.ey.as_dvec3());
                self.meet(index, prim, &[c - x - y, c + x - y, c + x + y, c - x + y])
            }
            _ => self.meet(index, prim, &corners.map(|p| p.as_dvec3())),
        }
    }

    fn quadric(&mut self, index: u32) -> ControlFlow<()> {
        self.meet(index, 0, &[])
    }

    fn limit(&self) -> f32 {
        self.limit
    }
}

impl<'a> Interest<'a> {
    /// Shapes for which `wanted` is true.
    pub fn new(scene: &'a Scene, accel: &'a Accel, wanted: &dyn Fn(u32) -> bool) -> Self {
        let (centre, radius) = scene.bounds;
        Interest {
            scene,
            accel,
            wanted: (0..scene.shapes.len() as u32).map(wanted).collect(),
            reach: f64::from(centre.abs().max_element() + radius),
        }
    }

    /// Whether a shape is wanted.
    pub fn wants(&self, shape: u32) -> bool {
        self.wanted[shape as usize]
    }

    /// Whether a ray of the bundle may meet a wanted shape first. `own`: shape and triangle (`u32::MAX`: all of it) that rays start on and,
    /// being flat, cannot meet.
    pub fn reached(&self, bundle: &Bundle, own: Option<(u32, u32)>) -> bool {
        let Some(beam) = bundle.beam(self.reach) else { return true };
        let mut walk = Walk { interest: self, bundle, own, limit: f32::INFINITY, found: false };
        self.accel.walk(&beam, &mut walk);
        walk.found
    }

    /// Spheres round clusters of wanted shapes, see [`super::targets`].
    pub(super) fn targets(&self) -> Vec<Target> {
        targets(self.scene, &self.wanted)
    }

    /// A sphere round all wanted shapes, `None` if there are none.
    pub fn sphere(&self) -> Option<(DVec3, f64)> {
        let mut bounds: Option<(Vec3, Vec3)> = None;
        for (shape, _) in self.scene.shapes.iter().zip(&self.wanted).filter(|(_, w)| **w) {
            let (lo, hi) = shape.bounds();
            bounds = Some(bounds.map_or((lo, hi), |(a, b)| (a.min(lo), b.max(hi))));
        }
        let (lo, hi) = bounds?;
        let (lo, hi) = (lo.as_dvec3(), hi.as_dvec3());
        Some((0.5 * (lo + hi), 0.5 * (hi - lo).length() * (1.0 + 1e-6)))
    }
}
