//! A light's emission domain unrolled: the hemicube round the middle of a flat light, its top in the middle of the picture and the
//! upper halves of its sides round it. Outside of it (the corners of the picture) there are no cells.

use super::emission::Cells;
use super::kinds::Kinds;
use super::light::MOST_TRIANGLES;
use super::map::{Cell, rows};
use super::view::{View, from_dual, to_dual};
use super::{EdgeDetector, Facet};
use crate::math::{DVec3, Vec3};
use crate::scene::{Geometry, Scene};
use dualux_dual::Family;

/// The cells of a light in a picture: one hemicube for all of its parts, each of which starts its rays in its middle.
#[derive(Clone, Debug)]
pub struct Unrolled {
    cells: Cells,
    /// Starts of rays: point, normal, facet.
    starts: Vec<(DVec3, DVec3, Facet)>,
    n: u32,
}

/// No event.
const EMPTY: Cell = Cell { event: false, kinds: Kinds::NONE, distance: f64::INFINITY };

impl Unrolled {
    /// For shape `light`, `n` cells (made even) across the top; `None` for curved lights and meshes of more than
    /// [`MOST_TRIANGLES`]. The hemicube stands on the mean of the parts' normals.
    pub fn new(scene: &Scene, light: u32, n: u32) -> Option<Self> {
        let flat = |c: Vec3, n: Vec3| vec![(c.as_dvec3(), n.as_dvec3().normalize(), Facet { shape: light, prim: 0 })];
        let starts = match &scene.shapes[light as usize].geometry {
            Geometry::Rectangle(r) => flat(r.center, r.n),
            Geometry::Disk(d) => flat(d.center, d.n),
            Geometry::Mesh(m) if m.triangles.len() <= MOST_TRIANGLES => (0..m.triangles.len() as u32)
                .map(|prim| {
                    let [a, b, c] = m.corners(prim);
                    let n = m.face_normal(prim).as_dvec3();
                    (((a + b + c) / 3.0).as_dvec3(), n, Facet { shape: light, prim })
                })
                .collect(),
            _ => return None,
        };
        let mean = starts.iter().map(|s| s.1).sum::<DVec3>();
        // A closed mesh has none.
        let normal = mean.try_normalize().unwrap_or(starts[0].1);
        let cells = Cells::hemicube(starts[0].0, normal);
        Some(Unrolled { cells, starts, n: n.next_multiple_of(2) })
    }

    /// Width and height of the picture.
    pub fn size(&self) -> u32 {
        2 * self.n
    }

    /// The footprints at (x, y) of the picture, with the facet they start from: one for each part of the light that shines there.
    pub fn views(&self, x: u32, y: u32) -> impl Iterator<Item = (View, Facet)> + '_ {
        let cell = self.cell(x, y);
        self.starts.iter().filter_map(move |(o, n, facet)| {
            let (face, centre, half) = cell?;
            let family = Family { o: to_dual(*o), ..self.cells.family(face, centre, half) };
            (n.dot(from_dual(family.d)) > 0.0).then_some(())?;
            Some((View::new(family, [0.0, f64::INFINITY])?, *facet))
        })
    }

    /// Face, centre and half widths of the cell at (x, y) of the picture, if there is one.
    fn cell(&self, x: u32, y: u32) -> Option<(usize, [f64; 2], [f64; 2])> {
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
        Some((face, centre, [half; 2]))
    }

    /// The map.
    pub fn map(&self, detector: &EdgeDetector) -> Vec<Cell> {
        rows(self.size(), self.size(), |x, y| {
            self.views(x, y).fold(EMPTY, |cell, (view, facet)| {
                let verdict = detector.all(&view, Some(facet));
                Cell {
                    event: cell.event || verdict.needs_samples(),
                    kinds: cell.kinds | verdict.kinds(),
                    distance: cell.distance.min(verdict.distance()),
                }
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Accel;
    use crate::formats::{LoadOptions, load};
    use crate::scene::mesh::MeshData;

    #[test]
    fn a_lamp_held_as_two_triangles_shows_the_edges_of_both() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-spheres.xml");
        let mut description = load(&path, &LoadOptions::default()).expect("a scene").description;
        let lamp = description.shapes.iter().position(|s| s.emission.is_some()).expect("a lamp");
        let map = |description| {
            let scene = Scene::new(description).expect("valid");
            let accel = Accel::new(&scene.shapes);
            let cells = Unrolled::new(&scene, lamp as u32, 16).expect("flat");
            let events = cells.map(&EdgeDetector::new(&scene, &accel)).iter().filter(|c| c.event).count();
            (cells.starts.len(), events)
        };
        let (one, from_the_middle) = map(description.clone());
        let r = |x: f32, y: f32| Vec3::new(x, y, 0.0);
        description.shapes[lamp].geometry = crate::scene::description::GeometryDesc::Mesh(MeshData {
            positions: vec![r(-1.0, -1.0), r(1.0, -1.0), r(1.0, 1.0), r(-1.0, 1.0)],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            face_normals: true,
            ..MeshData::default()
        });
        let (two, from_both) = map(description);
        assert_eq!((one, two), (1, 2));
        assert!(from_the_middle > 50 && from_both > from_the_middle, "{from_the_middle} {from_both}");
    }
}
