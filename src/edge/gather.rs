//! All surfaces that reach a footprint, found by one walk.

use super::EdgeDetector;
use super::curved::{CORNERS, Curved};
use super::detect::Mode;
use super::kinds::Kinds;
use super::outline::Hull;
use super::polygon::{Polygon, corners};
use super::view::{View, range};
use crate::accel::footprint::Visitor;
use crate::math::{DVec3, Vec3};
use crate::scene::{Geometry, Shape};
use smallvec::SmallVec;
use std::ops::ControlFlow;

/// Most surfaces of a footprint that are looked at one by one.
pub const MOST_SURFACES: usize = 128;
/// Polygons kept without asking for memory.
const FEW_POLYGONS: usize = 10;

/// Where rays start: neither hit nor counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facet {
    /// Shape.
    pub shape: u32,
    /// Triangle of a mesh; other shapes are excluded as a whole.
    pub prim: u32,
}

impl Facet {
    /// No facet: no scene has that many shapes.
    pub const NONE: Facet = Facet { shape: u32::MAX, prim: u32::MAX };
}

/// What to gather, and the surfaces found.
pub struct Surfaces<'a> {
    /// Scene and settings.
    pub detector: &'a EdgeDetector<'a>,
    /// Footprint.
    pub view: &'a View,
    /// What is asked: of what is seen, all that lies behind a surface which covers the footprint is left out; a light behind
    /// such a surface is blocked.
    pub mode: Mode,
    /// Not to be counted.
    pub exclude: [Facet; 3],
    /// Normal of the plane the rays start from: what lies in it cannot be met.
    pub ground: Option<DVec3>,
    /// The solid of a round light, if that is what the rays go to: then the walk does not end where it is covered.
    pub hull: Option<Hull>,
    /// The beam's present end.
    pub limit: f32,
    /// Its depth key.
    last: f64,
    /// Triangles and rectangles.
    pub polygons: SmallVec<[Polygon; FEW_POLYGONS]>,
    /// The others.
    pub curved: SmallVec<[Curved; 2]>,
    /// Shadow: one surface hides all of the far end.
    pub covered: bool,
    /// `BUSY` if there are too many, `UNKNOWN` if one lets rays pass.
    pub trouble: Kinds,
}

impl<'a> Surfaces<'a> {
    /// Nothing found yet, for a walk with a beam that ends at `limit`. Inlined, so that the lists are made where they stay.
    #[inline(always)]
    pub fn new(
        detector: &'a EdgeDetector<'a>,
        view: &'a View,
        mode: Mode,
        exclude: [Facet; 3],
        ground: Option<DVec3>,
        limit: f32,
    ) -> Self {
        Surfaces {
            detector,
            view,
            mode,
            exclude,
            ground,
            hull: None,
            limit,
            last: view.keys[1],
            polygons: SmallVec::new(),
            curved: SmallVec::new(),
            covered: false,
            trouble: Kinds::NONE,
        }
    }

    /// Whether a surface may reach into the light's solid, so that it need not be in front of its surface.
    pub fn reach_into(&self, hull: &Hull) -> bool {
        let scene = self.detector.scene;
        self.polygons.iter().any(|p| hull.meets_polygon(&p.points(scene)))
            || self.curved.iter().map(Curved::ball).any(|(c, r)| hull.meets_ball(c, r))
    }

    #[inline(always)]
    fn polygon<const N: usize>(
        &mut self,
        shape: &Shape,
        index: u32,
        prim: u32,
        points: &[DVec3; N],
    ) -> ControlFlow<()> {
        let Some(polygon) = Polygon::new(self.view, index, prim, points, f64::from(self.limit) * (1.0 + 1e-6)) else {
            return ControlFlow::Continue(());
        };
        if self.ground.is_some_and(|n| in_plane(n, self.view.origin(), points)) {
            return ControlFlow::Continue(());
        }
        // The plane's key is affine: nearest and farthest points are corners.
        let (nearest, farthest) = range(&polygon.key);
        if nearest > self.last {
            return ControlFlow::Continue(());
        }
        if polygon.covers && self.covered_at(shape, self.view.t_of(farthest)).is_break() {
            return ControlFlow::Break(());
        }
        self.polygons.push(polygon);
        self.found(shape)
    }

    /// Notes that a surface covers the footprint at distances up to t.
    #[inline(always)]
    fn covered_at(&mut self, shape: &Shape, t: f64) -> ControlFlow<()> {
        if self.passes(shape) {
            return ControlFlow::Continue(());
        }
        if self.mode == Mode::Shadow {
            if t > 0.0 && t < self.view.t[1] {
                self.covered = true;
                return if self.hull.is_some() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
            }
        } else if t > 0.0 {
            self.limit = self.limit.min((t * (1.0 + 1e-6)) as f32);
            self.last = self.last.min(self.view.key(t * (1.0 + 1e-6)));
        }
        ControlFlow::Continue(())
    }

    /// Whether rays may pass a surface.
    #[inline(always)]
    fn passes(&self, shape: &Shape) -> bool {
        self.detector.lets_pass(shape)
    }

    /// After a surface has been added.
    #[inline(always)]
    fn found(&mut self, shape: &Shape) -> ControlFlow<()> {
        if self.passes(shape) {
            self.trouble |= Kinds::UNKNOWN;
        }
        if self.polygons.len() + self.curved.len() <= MOST_SURFACES {
            return ControlFlow::Continue(());
        }
        self.trouble |= Kinds::BUSY;
        ControlFlow::Break(())
    }
}

/// Whether all points lie in a plane, to the rounding of coordinates in f32.
pub fn in_plane(n: DVec3, p: DVec3, points: &[DVec3]) -> bool {
    let largest = points.iter().fold(p.abs(), |m, x| m.max(x.abs())).max_element();
    let tolerance = 8.0 * f64::from(f32::EPSILON) * largest;
    points.iter().all(|x| n.dot(*x - p).abs() <= tolerance)
}

impl Visitor for Surfaces<'_> {
    #[inline(always)]
    fn triangle(&mut self, index: u32, prim: u32, [a, b, c]: [Vec3; 3]) -> ControlFlow<()> {
        let shape = &self.detector.scene.shapes[index as usize];
        if let Geometry::Rectangle(r) = &shape.geometry {
            if self.exclude.iter().any(|f| f.shape == index) || self.polygons.iter().any(|p| p.shape == index) {
                return ControlFlow::Continue(());
            }
            return self.polygon(shape, index, Polygon::RECTANGLE, &corners(r));
        }
        if self.exclude.contains(&Facet { shape: index, prim }) {
            return ControlFlow::Continue(());
        }
        self.polygon(shape, index, prim, &[a.as_dvec3(), b.as_dvec3(), c.as_dvec3()])
    }

    fn quadric(&mut self, index: u32) -> ControlFlow<()> {
        let shape = &self.detector.scene.shapes[index as usize];
        if self.exclude.iter().any(|f| f.shape == index) {
            return ControlFlow::Continue(());
        }
        let settings = &self.detector.settings;
        let Some(curved) = Curved::new(self.view, shape, settings.test, settings.order) else {
            return ControlFlow::Continue(());
        };
        // Convex in (p, key): the farthest point of its front is at a corner.
        let far = |c: &Curved| CORNERS.iter().filter_map(|p| c.hit(self.view, *p)).fold(0.0, f64::max);
        let whole = curved.covers && self.view.near.is_none();
        if whole && self.covered_at(shape, far(&curved)).is_break() {
            return ControlFlow::Break(());
        }
        self.curved.push(curved);
        self.found(shape)
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.limit
    }
}
