//! Whether a pixel seen through a lens is clear: one flat or smooth surface, or nothing, in all of it.
//!
//! Most pixels are; they need no duals, no list of edges and no second look. Polygons are held against the lens's own coordinates
//! ([`Lens::line`], the same margins as those of predictions), balls against its sides. What cannot be decided so is left
//! to [`EdgeDetector::predict`].
//! Not handled (left to predictions): disks and cylinders, balls that any ray may meet, surfaces that let rays pass, what the clip planes cut.

use super::EdgeDetector;
use super::gather::Facet;
use super::lens::{Lens, Place};
use super::linear::Linear;
use super::mesh_edge::mesh_edge;
use super::view::from_dual;
use crate::accel::footprint::Visitor;
use crate::math::{DVec3, Vec3};
use crate::scene::Geometry;
use dualux_dual::Family;
use std::ops::ControlFlow;

/// Looks for what is not clear.
struct Clear<'a> {
    detector: &'a EdgeDetector<'a>,
    lens: Lens,
    o: DVec3,
    o_p: [DVec3; 2],
    limit: f32,
    /// Range of the ray parameter.
    t: [f64; 2],
    /// The shape that reaches the footprint: two may swap their depth order.
    shape: Option<u32>,
    /// The rectangle met last: its halves come one after the other.
    rectangle: u32,
    clear: bool,
}

impl Clear<'_> {
    fn unclear(&mut self) -> ControlFlow<()> {
        self.clear = false;
        ControlFlow::Break(())
    }

    /// A convex polygon; `is_edge` says whether its side k is one.
    #[inline(always)]
    fn polygon<const K: usize>(
        &mut self,
        shape: u32,
        points: &[DVec3; K],
        is_edge: impl Fn(&Self, usize) -> bool,
    ) -> ControlFlow<()> {
        let (mut p, mut sides) = ([DVec3::ZERO; K], [0i8; K]);
        for k in 0..K {
            p[k] = self.lens.project(points[k]);
        }
        let place = self.lens.place(&p, self.t);
        if place == Place::Outside || p.iter().all(|x| x.z > f64::from(self.limit)) {
            return ControlFlow::Continue(());
        }
        for k in 0..K {
            let margin: Linear<4> = self.lens.line(p[k], p[(k + 1) % K]);
            sides[k] = margin.side(true);
        }
        if sides.contains(&1) && sides.contains(&-1) {
            return ControlFlow::Continue(());
        }
        let second = self.shape.replace(shape).is_some_and(|first| first != shape);
        if second || place == Place::Cut || self.detector.lets_pass(&self.detector.scene.shapes[shape as usize]) {
            return self.unclear();
        }
        if !sides.contains(&0) {
            if let Some(far) = self.lens.covered_up_to([p[0], p[1], p[2]]) {
                self.limit = self.limit.min(far as f32 * 1.000_001);
            }
        } else if (0..K).any(|k| sides[k] == 0 && is_edge(self, k)) {
            return self.unclear();
        }
        ControlFlow::Continue(())
    }
}

impl Visitor for Clear<'_> {
    #[inline(always)]
    fn triangle(&mut self, index: u32, prim: u32, corners: [Vec3; 3]) -> ControlFlow<()> {
        if let Geometry::Rectangle(r) = &self.detector.scene.shapes[index as usize].geometry {
            if self.rectangle == index {
                return ControlFlow::Continue(());
            }
            self.rectangle = index;
            return self.polygon(index, &super::polygon::corners(r), |_, _| true);
        }
        self.polygon(index, &corners.map(|c| c.as_dvec3()), |this, k| {
            mesh_edge(this.detector.scene, [index, prim], k, Facet::NONE, this.o, &this.o_p).is_some()
        })
    }

    fn quadric(&mut self, index: u32) -> ControlFlow<()> {
        match &self.detector.scene.shapes[index as usize].geometry {
            Geometry::Sphere(s) if self.lens.passes_ball(s.center.as_dvec3(), f64::from(s.radius)) => {
                ControlFlow::Continue(())
            }
            _ => self.unclear(),
        }
    }

    fn limit(&self) -> f32 {
        self.limit
    }
}

impl EdgeDetector<'_> {
    /// Whether nothing changes among the rays of a lens, as far as can be told at once.
    #[inline(always)]
    pub(super) fn clear_lens(&self, family: &Family<f64, 4>, t: [f64; 2]) -> bool {
        let [o_p, d_p] = [family.o_p, family.d_p].map(|v| v.map(from_dual));
        let (o, d) = (from_dual(family.o), from_dual(family.d));
        let Some(lens) = Lens::new(o, &o_p, d, &d_p) else { return false };
        let beam = super::beam::of_lens(family, &lens, t, self.reach);
        let o_p = [o_p[2], o_p[3]];
        let (shape, rectangle) = (None, u32::MAX);
        let mut clear = Clear { detector: self, lens, o, o_p, limit: beam.tmax, t, shape, rectangle, clear: true };
        self.walk_seen(&beam, &mut clear);
        clear.clear
    }
}
