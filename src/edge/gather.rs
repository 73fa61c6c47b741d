//! All surfaces that reach a footprint, found by one walk.

use super::curved::{CORNERS, Curved};
use super::detect::Mode;
use super::kinds::Kinds;
use super::polygon::Polygon;
use super::view::{View, range};
use crate::accel::footprint::Visitor;
use crate::math::DVec3;
use crate::scene::{Geometry, Scene};
use arrayvec::ArrayVec;
use dualux_dual::Test;
use std::ops::ControlFlow;

/// Most polygons looked at one by one.
pub const MOST_POLYGONS: usize = 128;
/// Most curved surfaces looked at one by one.
pub const MOST_CURVED: usize = 24;

/// Where rays start: neither hit nor counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facet {
    /// Shape.
    pub shape: u32,
    /// Triangle of a mesh; other shapes are excluded as a whole.
    pub prim: u32,
}

/// The surfaces found.
pub struct Surfaces<'a> {
    scene: &'a Scene,
    view: &'a View,
    exclude: [Option<Facet>; 2],
    test: Test,
    order: usize,
    passable: bool,
    mode: Mode,
    ground: Option<[DVec3; 2]>,
    busy: usize,
    limit: f32,
    /// Triangles and rectangles.
    pub polygons: ArrayVec<Polygon, MOST_POLYGONS>,
    /// The others.
    pub curved: ArrayVec<Curved, MOST_CURVED>,
    /// Shadow: one surface hides all of the far end.
    pub covered: bool,
    /// `BUSY` if there are too many, `UNKNOWN` if one lets rays pass.
    pub trouble: Kinds,
}

/// What to gather.
pub struct Gather<'a> {
    /// Scene.
    pub scene: &'a Scene,
    /// Footprint.
    pub view: &'a View,
    /// Not to be counted.
    pub exclude: [Option<Facet>; 2],
    /// Footprint test of curved borders.
    pub test: Test,
    /// Order of expansions.
    pub order: usize,
    /// Whether any material of the scene lets rays pass.
    pub passable: bool,
    /// What is asked: of what is seen, all that lies behind a surface which covers the footprint is left out; a light behind
    /// such a surface is blocked.
    pub mode: Mode,
    /// Normal and point of the plane the rays start from: what lies in it cannot be met.
    pub ground: Option<[DVec3; 2]>,
    /// Number of surfaces that counts as too many.
    pub busy: usize,
}

impl<'a> Gather<'a> {
    /// Nothing found yet, for a walk with a beam that ends at `limit`. Inlined, so that the lists are made where they stay.
    #[inline(always)]
    pub fn start(self, limit: f32) -> Surfaces<'a> {
        Surfaces {
            scene: self.scene,
            view: self.view,
            exclude: self.exclude,
            test: self.test,
            order: self.order,
            passable: self.passable,
            mode: self.mode,
            ground: self.ground,
            busy: self.busy,
            covered: false,
            limit,
            polygons: ArrayVec::new(),
            curved: ArrayVec::new(),
            trouble: Kinds::NONE,
        }
    }
}

impl Surfaces<'_> {
    #[inline(always)]
    fn polygon<const N: usize>(&mut self, shape: u32, prim: u32, points: &[DVec3; N]) -> ControlFlow<()> {
        let Some(polygon) = Polygon::new(self.view, shape, prim, points) else {
            return ControlFlow::Continue(());
        };
        if self.ground.is_some_and(|[n, p]| in_plane(n, p, points)) {
            return ControlFlow::Continue(());
        }
        // The plane's key is affine: the farthest point is a corner.
        let farthest = range(&polygon.key).1;
        if polygon.covers && self.covered_at(shape, self.view.t_of(farthest)).is_break() {
            return ControlFlow::Break(());
        }
        if self.polygons.len() + self.curved.len() >= self.busy {
            return self.busy();
        }
        self.polygons.try_push(polygon).map_or_else(|_| self.busy(), |()| ControlFlow::Continue(()))
    }

    /// Notes that a surface covers the footprint at distances up to t.
    fn covered_at(&mut self, shape: u32, t: f64) -> ControlFlow<()> {
        if self.passable && self.scene.passes_light[self.scene.shapes[shape as usize].material as usize] {
            return ControlFlow::Continue(());
        }
        if self.mode == Mode::Shadow {
            if t > 0.0 && t < self.view.t[1] {
                self.covered = true;
                return ControlFlow::Break(());
            }
        } else if t > 0.0 {
            self.limit = self.limit.min((t * (1.0 + 1e-6)) as f32);
        }
        ControlFlow::Continue(())
    }

    fn busy(&mut self) -> ControlFlow<()> {
        self.trouble |= Kinds::BUSY;
        ControlFlow::Break(())
    }
}

/// Whether all points lie in a plane, to the rounding of coordinates in f32.
fn in_plane(n: DVec3, p: DVec3, points: &[DVec3]) -> bool {
    let largest = points.iter().fold(p.abs(), |m, x| m.max(x.abs())).max_element();
    let tolerance = 8.0 * f64::from(f32::EPSILON) * largest;
    points.iter().all(|x| n.dot(*x - p).abs() <= tolerance)
}

impl Visitor for Surfaces<'_> {
    #[inline]
    fn visit(&mut self, index: u32, prim: u32) -> ControlFlow<()> {
        let shape = &self.scene.shapes[index as usize];
        let (before, curved_before) = (self.polygons.len(), self.curved.len());
        let excluded = |prim: Option<u32>| {
            self.exclude.iter().flatten().any(|f| f.shape == index && prim.is_none_or(|p| p == f.prim))
        };
        let flow = match &shape.geometry {
            Geometry::Mesh(mesh) => {
                if excluded(Some(prim)) {
                    return ControlFlow::Continue(());
                }
                self.polygon(index, prim, &mesh.corners(prim).map(|p| p.as_dvec3()))
            }
            Geometry::Rectangle(r) => {
                if excluded(None) || self.polygons.iter().any(|p| p.shape == index) {
                    return ControlFlow::Continue(());
                }
                let (c, x, y) = (r.center.as_dvec3(), r.ex.as_dvec3(), r.ey.as_dvec3());
                self.polygon(index, Polygon::RECTANGLE, &[c - x - y, c + x - y, c + x + y, c - x + y])
            }
            _ => {
                if excluded(None) {
                    return ControlFlow::Continue(());
                }
                match Curved::new(self.view, shape, self.test, self.order) {
                    None => ControlFlow::Continue(()),
                    Some(curved) => {
                        // Convex in (p, key): the farthest point of its front is at a corner.
                        let far = |c: &Curved| CORNERS.iter().filter_map(|p| c.hit(self.view, *p)).fold(0.0, f64::max);
                        if curved.covers && self.covered_at(index, far(&curved)).is_break() {
                            return ControlFlow::Break(());
                        }
                        self.curved.try_push(curved).map_or_else(|_| self.busy(), |()| ControlFlow::Continue(()))
                    }
                }
            }
        };
        let found = self.polygons.len() > before || self.curved.len() > curved_before;
        if found && self.passable && self.scene.passes_light[shape.material as usize] {
            self.trouble |= Kinds::UNKNOWN;
        }
        flow
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }
}
