//! A light's emission domain unrolled: the hemicube round the middle of a flat light, its top in the middle of the picture and the
//! upper halves of its sides round it. Outside of it (the corners of the picture) there are no cells.

use super::emission::Cells;
use super::kinds::Kinds;
use super::map::{Cell, rows};
use super::view::View;
use super::{EdgeDetector, Facet};
use crate::scene::{Geometry, Scene};

/// The cells of a light in a picture.
#[derive(Clone, Debug)]
pub struct Unrolled {
    cells: Cells,
    facet: Facet,
    n: u32,
}

/// No event.
const EMPTY: Cell = Cell { event: false, kinds: Kinds::NONE, distance: f64::INFINITY };

impl Unrolled {
    /// For shape `light`, `n` cells (made even) across the top; `None` for curved lights. A mesh is represented by its first triangle.
    pub fn new(scene: &Scene, light: u32, n: u32) -> Option<Self> {
        let (origin, normal) = match &scene.shapes[light as usize].geometry {
            Geometry::Rectangle(r) => (r.center, r.n),
            Geometry::Disk(d) => (d.center, d.n),
            Geometry::Mesh(m) => {
                let [a, b, c] = m.corners(0);
                ((a + b + c) / 3.0, m.face_normal(0))
            }
            Geometry::Sphere(_) | Geometry::Cylinder(_) => return None,
        };
        let cells = Cells::hemicube(origin.as_dvec3(), normal.as_dvec3().normalize());
        Some(Unrolled { cells, facet: Facet { shape: light, prim: 0 }, n: n.next_multiple_of(2) })
    }

    /// Width and height of the picture.
    pub fn size(&self) -> u32 {
        2 * self.n
    }

    /// Where the rays start.
    pub fn facet(&self) -> Facet {
        self.facet
    }

    /// The footprint at (x, y) of the picture, if there is one.
    pub fn view(&self, x: u32, y: u32) -> Option<View> {
        let (n, quarter) = (self.n, self.n / 2);
        let half = 1.0 / f64::from(n);
        let side = |i: u32| (f64::from(2 * i + 1) - f64::from(n)) * half;
        // Height on a side face of the k-th cell outwards from the top.
        let height = |k: u32| 1.0 - f64::from(2 * k + 1) * half;
        let (i, j) = (x.wrapping_sub(quarter), y.wrapping_sub(quarter));
        let (face, centre) = match (i < n, j < n) {
            (true, true) => (0, [side(i), side(j)]),
            (false, true) if x >= quarter + n => (1, [side(j), height(x - quarter - n)]),
            (false, true) => (3, [-side(j), height(quarter - 1 - x)]),
            (true, false) if y >= quarter + n => (2, [-side(i), height(y - quarter - n)]),
            (true, false) => (4, [side(i), height(quarter - 1 - y)]),
            (false, false) => return None,
        };
        self.cells.cell(face, centre, [half; 2])
    }

    /// The map.
    pub fn map(&self, detector: &EdgeDetector) -> Vec<Cell> {
        rows(self.size(), self.size(), |x, y| {
            let Some(view) = self.view(x, y) else { return EMPTY };
            let verdict = detector.all(&view, Some(self.facet));
            Cell { event: verdict.needs_samples(), kinds: verdict.kinds(), distance: verdict.distance() }
        })
    }
}
