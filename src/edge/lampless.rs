//! What a camera that does not see lamps (`hide_emitters`) sees: everything behind them.
//!
//! Lamps are hidden from rays that come from the camera, by what mirrors and glass show they are seen, and they cast shadows as ever.
//! Source: this project. Verified by the tests of sight.

use super::EdgeDetector;
use crate::accel::footprint::{Beam, Visitor};
use crate::accel::{Hit, Ray};
use crate::math::Vec3;
use crate::scene::{Scene, Shape};
use std::ops::ControlFlow;

/// Most surfaces of lamps that a ray passes, as many as a picture's rays do.
const MOST_PASSED: u32 = 256;

/// A visitor that is not shown lamps.
struct Lampless<'v, V> {
    scene: &'v Scene,
    inner: &'v mut V,
}

impl<V> Lampless<'_, V> {
    #[inline(always)]
    fn is_lamp(&self, shape: u32) -> bool {
        is_lamp(&self.scene.shapes[shape as usize])
    }
}

fn is_lamp(shape: &Shape) -> bool {
    shape.emission.is_some()
}

impl<V: Visitor> Visitor for Lampless<'_, V> {
    fn triangle(&mut self, shape: u32, prim: u32, corners: [Vec3; 3]) -> ControlFlow<()> {
        if self.is_lamp(shape) { ControlFlow::Continue(()) } else { self.inner.triangle(shape, prim, corners) }
    }

    fn quadric(&mut self, shape: u32) -> ControlFlow<()> {
        if self.is_lamp(shape) { ControlFlow::Continue(()) } else { self.inner.quadric(shape) }
    }

    fn limit(&self) -> f32 {
        self.inner.limit()
    }
}

impl EdgeDetector<'_> {
    /// Whether the camera does not see lamps.
    pub fn hiding_lamps(self, hidden: bool) -> Self {
        EdgeDetector { lampless: hidden && self.scene.shapes.iter().any(is_lamp), ..self }
    }

    /// The same detector for rays that have left a surface: these see lamps.
    pub(super) fn behind_surfaces(self) -> Self {
        EdgeDetector { lampless: false, ..self }
    }

    /// Shows the visitor all that a beam may see.
    #[inline(always)]
    pub(super) fn walk_seen(&self, beam: &Beam, visitor: &mut impl Visitor) {
        if self.lampless {
            self.accel.walk(beam, &mut Lampless { scene: self.scene, inner: visitor });
        } else {
            self.accel.walk(beam, visitor);
        }
    }

    /// What a ray sees first.
    #[inline(always)]
    pub(super) fn closest_seen(&self, ray: &Ray) -> Option<Hit> {
        let hit = self.accel.closest(ray)?;
        if self.lampless && is_lamp(&self.scene.shapes[hit.shape as usize]) {
            self.behind_lamps(ray, hit)
        } else {
            Some(hit)
        }
    }

    #[cold]
    fn behind_lamps(&self, ray: &Ray, mut hit: Hit) -> Option<Hit> {
        let mut behind = *ray;
        for _ in 0..MOST_PASSED {
            // The next number but a few: lamps of one plane may meet.
            behind.tmin = hit.t + hit.t.abs() * 1e-6;
            hit = self.accel.closest(&behind)?;
            if !is_lamp(&self.scene.shapes[hit.shape as usize]) {
                return Some(hit);
            }
        }
        None
    }
}
