//! Cells of a light's emission: boxes of positions x directions whose directions are affine, and whose flux is known.
//!
//! | light | positions | directions |
//! | --- | --- | --- |
//! | rectangle, disk, triangles of a mesh | the numbers of the natural map | hemicube round the normal |
//! | sphere | the disk across the direction | cube |
//! | point, spot | - | cube (a spot's own; cells outside of its cone are none) |
//! | directional | the square round the disk across it, in its radii | - |
//!
//! Flux of a cell = value x share of the positions x measure of the rectangle ([`Face`]): exact where the value is constant, else
//! estimated at a few points to weigh cells, while each photon carries its own value. All rays of a cell lie in its [`Bundle`]s.
//! Not handled: cylinders, environments and meshes of more than [`MOST_TRIANGLES`] triangles are not cut.

use super::chart::{Face, cube, hemicube};
use super::interest::Bundle;
use super::source::{Kind, Source, Start};
use super::warp;
use crate::edge::view::to_dual;
use crate::math::DVec3;
use crate::scene::light::DeltaLight;
use crate::scene::{Geometry, Scene};
use dualux_dual::Family;
use std::f64::consts::PI;

/// Most triangles of a mesh that is cut.
pub const MOST_TRIANGLES: usize = 64;

/// Relative flux that a cell counts for at least where values are only sampled, so that none starves.
const LEAST_VALUE: f64 = 1e-2;

/// A box of primary-sample space: u0, u1 of the position, x, y on a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Light.
    pub light: u32,
    /// Face of its cube.
    pub face: u8,
    /// Lower corner.
    pub lo: [f64; 4],
    /// Upper corner.
    pub hi: [f64; 4],
}

/// A light that can be cut.
#[derive(Clone, Debug)]
pub struct Cutter<'a> {
    scene: &'a Scene,
    /// The light.
    pub source: Source<'a>,
    faces: Vec<Face>,
}

impl Cell {
    /// Middle.
    pub fn middle(&self) -> [f64; 4] {
        std::array::from_fn(|k| 0.5 * (self.lo[k] + self.hi[k]))
    }

    /// Widths.
    pub fn width(&self) -> [f64; 4] {
        std::array::from_fn(|k| self.hi[k] - self.lo[k])
    }

    /// Whether coordinates on its face lie in it, to within `slack` of its width; only axes that matter.
    pub fn holds(&self, at: [f64; 4], slack: f64) -> bool {
        let within = |k: usize| {
            let s = slack * (self.hi[k] - self.lo[k]);
            self.hi[k] == self.lo[k] || (at[k] >= self.lo[k] - s && at[k] <= self.hi[k] + s)
        };
        (0..4).all(within)
    }
}

impl<'a> Cutter<'a> {
    /// `None` if the light is of a kind that is not cut.
    pub fn new(scene: &'a Scene, source: Source<'a>) -> Option<Self> {
        let faces = match &source.kind {
            Kind::Lamp(lamp) => match &lamp.geometry().geometry {
                Geometry::Rectangle(_) | Geometry::Disk(_) => hemicube(),
                Geometry::Mesh(m) if m.triangles.len() <= MOST_TRIANGLES => hemicube(),
                _ => return None,
            },
            Kind::Ball(_) => cube(),
            Kind::Infinity(_) => return None,
            Kind::Delta(d) => match d.light {
                DeltaLight::Directional { .. } => Vec::new(),
                _ => cube(),
            },
        };
        Some(Cutter { scene, source, faces })
    }

    /// Cells that tile the light.
    pub fn roots(&self) -> Vec<Cell> {
        let light = self.source.light;
        if self.faces.is_empty() {
            return vec![Cell { light, face: 0, lo: [-1.0, -1.0, 0.0, 0.0], hi: [1.0, 1.0, 0.0, 0.0] }];
        }
        let positions: Vec<[f64; 2]> = match &self.source.kind {
            Kind::Lamp(lamp) => lamp.cdf.windows(2).map(|w| [w[0], w[1]]).collect(),
            _ => vec![[0.0, 1.0]],
        };
        let mut cells = Vec::new();
        for u in positions {
            for (face, f) in self.faces.iter().enumerate() {
                cells.push(Cell {
                    light,
                    face: face as u8,
                    lo: [u[0], 0.0, -1.0, f.y[0]],
                    hi: [u[1], 1.0, 1.0, f.y[1]],
                });
            }
        }
        cells.into_iter().filter(|c| self.measure(c) > 0.0).collect()
    }

    fn face(&self, cell: &Cell) -> &Face {
        &self.faces[cell.face as usize]
    }

    /// Share of positions times measure of directions: flux = value x measure. 0 where nothing is emitted.
    pub fn measure(&self, cell: &Cell) -> f64 {
        let w = cell.width();
        if self.faces.is_empty() {
            let nearest = |k: usize| 0f64.clamp(cell.lo[k], cell.hi[k]);
            return if nearest(0).hypot(nearest(1)) < 1.0 { w[0] * w[1] / PI } else { 0.0 };
        }
        let face = self.face(cell);
        if self.is_outside_the_cone(cell) {
            return 0.0;
        }
        let directions = face.measure([cell.lo[2], cell.lo[3]], [cell.hi[2], cell.hi[3]]);
        if self.source.has_position() { w[0] * w[1] * directions } else { directions }
    }

    /// Faces, 1 for parallel light.
    pub fn face_count(&self) -> usize {
        self.faces.len().max(1)
    }

    /// Measure of all directions of the faces; of the square for parallel light.
    pub fn whole_measure(&self) -> f64 {
        if self.faces.is_empty() {
            return 4.0;
        }
        self.faces.iter().map(|f| f.measure([-1.0, f.y[0]], [1.0, f.y[1]])).sum()
    }

    /// Measure of the cell's directions; of its part of the square for parallel light.
    pub fn direction_measure(&self, cell: &Cell) -> f64 {
        if self.faces.is_empty() {
            return cell.width()[0] * cell.width()[1];
        }
        self.face(cell).measure([cell.lo[2], cell.lo[3]], [cell.hi[2], cell.hi[3]])
    }

    /// Whether no direction of the cell lies in a spot's cone.
    fn is_outside_the_cone(&self, cell: &Cell) -> bool {
        let Kind::Delta(delta) = &self.source.kind else { return false };
        let DeltaLight::Spot { cutoff, .. } = delta.light else { return false };
        let (middle, reach) = self.cone(cell);
        middle.z.clamp(-1.0, 1.0).acos() - reach > f64::from(*cutoff)
    }

    /// Middle direction of a cell, in the light's frame, and the largest angle of others with it.
    fn cone(&self, cell: &Cell) -> (DVec3, f64) {
        let face = self.face(cell);
        let [.., x, y] = cell.middle();
        let middle = face.along([x, y]).normalize();
        let corner = |a: f64, b: f64| face.along([a, b]).normalize().angle_between(middle);
        let corners = [
            corner(cell.lo[2], cell.lo[3]),
            corner(cell.hi[2], cell.lo[3]),
            corner(cell.lo[2], cell.hi[3]),
            corner(cell.hi[2], cell.hi[3]),
        ];
        (middle, corners.into_iter().fold(0.0, f64::max) * (1.0 + 1e-9))
    }

    /// The ray of the cell for numbers `f` in [0,1)^4 (position, direction), and its flux over its value. Derivatives of the start are by the
    /// coordinates of the cell. `None` where nothing is emitted.
    pub fn draw(&self, cell: &Cell, f: [f64; 4]) -> Option<(Start, f64)> {
        let u = [0, 1].map(|k| cell.lo[k] + f[k] * (cell.hi[k] - cell.lo[k]));
        if self.faces.is_empty() {
            return self.parallel(cell, u);
        }
        let (lo, hi) = ([cell.lo[2], cell.lo[3]], [cell.hi[2], cell.hi[3]]);
        let face = self.face(cell);
        let measure = face.measure(lo, hi);
        let p = face.point(lo, hi, [f[2], f[3]]);
        let drawn = face.drawn(p, measure);
        let mut start = self.source.start(u, &drawn)?;
        // Directions are dense where the cell's own density is: a photon's part of the rectangle is smaller there.
        let area = (hi[0] - lo[0]) * (hi[1] - lo[1]);
        let narrow = (measure / (area * face.density(p[0], p[1])).max(1e-300)).sqrt().min(2.0);
        start.o_u[2..].iter_mut().chain(&mut start.d_u[2..]).for_each(|v| *v *= narrow);
        let share = if self.source.has_position() { cell.width()[0] * cell.width()[1] } else { 1.0 };
        Some((start, share * measure))
    }

    /// Face and coordinates of the ray through `o` along `d`; `None` if it is no ray of this light. (See [`Source::invert`] for `o`.)
    pub fn coordinates(&self, o: DVec3, d: DVec3) -> Option<(u8, [f64; 4])> {
        let u = self.source.invert(o, d)?;
        if let (true, Kind::Delta(_)) = (self.faces.is_empty(), &self.source.kind) {
            let [x, y] = warp::disk([u[0], u[1]]).at;
            return Some((0, [x, y, 0.0, 0.0]));
        }
        let whole = Cell { light: self.source.light, face: 0, lo: u, hi: u };
        let f = self.frame(&whole);
        let local = DVec3::new(f[0].dot(d), f[1].dot(d), f[2].dot(d));
        // Smooth meshes emit to the other side of a facet by mirroring.
        let local = if matches!(self.source.kind, Kind::Lamp(_)) && local.z < 0.0 { -local } else { local };
        let (face, [x, y]) = self.faces.iter().enumerate().find_map(|(i, f)| Some((i, f.locate(local)?)))?;
        Some((face as u8, [u[0], u[1], x, y]))
    }

    /// The numbers that [`Self::draw`] turns into the ray at these coordinates of the cell.
    pub fn invert(&self, cell: &Cell, at: [f64; 4]) -> [f64; 4] {
        let part = |k: usize| (at[k] - cell.lo[k]) / (cell.hi[k] - cell.lo[k]);
        if self.faces.is_empty() {
            return [part(0), part(1), 0.5, 0.5];
        }
        let face = self.face(cell);
        let [x, y] = face.invert([cell.lo[2], cell.lo[3]], [cell.hi[2], cell.hi[3]], [at[2], at[3]]);
        [part(0), part(1), x, y]
    }

    /// Parallel light from point `q` of the square.
    fn parallel(&self, cell: &Cell, q: [f64; 2]) -> Option<(Start, f64)> {
        let Kind::Delta(delta) = &self.source.kind else { return None };
        if q[0].hypot(q[1]) > 1.0 {
            return None;
        }
        let drawn = self.source.direction([0.5; 2]);
        let mut start = self.source.start(warp::invert_disk(q), &drawn)?;
        let [s, t] = warp::frame(start.d, [DVec3::ZERO; 2]);
        start.o_u[..2].copy_from_slice(&[s.at * delta.radius, t.at * delta.radius]);
        Some((start, cell.width()[0] * cell.width()[1] / PI))
    }

    /// Flux of the cell, mean of the channels: exact for constant values.
    pub fn flux(&self, cell: &Cell) -> f64 {
        let measure = self.measure(cell);
        if measure <= 0.0 {
            return 0.0;
        }
        let value = |f: [f64; 4]| {
            self.draw(cell, f).map_or(0.0, |(start, _)| f64::from(start.value.element_sum().max(0.0)) / 3.0)
        };
        let constant = match &self.source.kind {
            Kind::Delta(d) => !matches!(d.light, DeltaLight::Spot { .. }),
            _ => !self.scene.lights.is_estimated(self.source.light as usize, &self.scene.shapes),
        };
        if constant && !self.faces.is_empty() {
            return value([0.5; 4]) * measure;
        }
        // Points of a lattice in four dimensions.
        let lattice =
            |i: usize| [0.819_172_5, 0.671_043_6, 0.549_700_5, 0.450_306_0].map(|a: f64| (0.5 + a * i as f64).fract());
        let values = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15].map(|i| value(lattice(i)));
        let largest = values.into_iter().fold(0.0, f64::max).max(self.typical_value());
        (values.into_iter().sum::<f64>() / 16.0).max(LEAST_VALUE * largest) * measure
    }

    fn typical_value(&self) -> f64 {
        let power = self.scene.lights.infos[self.source.light as usize].power;
        f64::from(power.element_sum()) / 3.0 / self.source.directions()
    }

    /// Frame of the cell's directions.
    fn frame(&self, cell: &Cell) -> [DVec3; 3] {
        match &self.source.kind {
            Kind::Lamp(lamp) => lamp.site([0.5 * (cell.lo[0] + cell.hi[0]), 0.5]).frame,
            Kind::Delta(d) => match d.light {
                DeltaLight::Spot { to_local, .. } => {
                    let m = to_local.transpose().as_dmat3();
                    [m.x_axis, m.y_axis, m.z_axis]
                }
                _ => [DVec3::X, DVec3::Y, DVec3::Z],
            },
            _ => [DVec3::X, DVec3::Y, DVec3::Z],
        }
    }

    /// Shape and triangle that the rays start on, if it is flat.
    pub fn own(&self, cell: &Cell) -> Option<(u32, u32)> {
        match &self.source.kind {
            Kind::Lamp(lamp) => match &lamp.geometry().geometry {
                Geometry::Mesh(_) => Some((lamp.shape, lamp.primitive(0.5 * (cell.lo[0] + cell.hi[0])) as u32)),
                _ => Some((lamp.shape, u32::MAX)),
            },
            _ => None,
        }
    }

    /// All rays of the cell. Two bundles where a smooth mesh may emit to the other side of its facet.
    pub fn bundles(&self, cell: &Cell) -> (Bundle, Option<Bundle>) {
        let zero = DVec3::ZERO;
        if let (true, Kind::Delta(delta)) = (self.faces.is_empty(), &self.source.kind) {
            let d = self.source.direction([0.5; 2]).w.at;
            let [s, t] = warp::frame(d, [zero; 2]).map(|v| v.at * delta.radius);
            let ([x, y, ..], w) = (cell.middle(), cell.width());
            let o = delta.centre - d * delta.away + s * x + t * y;
            let patch = [s * (0.5 * w[0]), t * (0.5 * w[1])];
            return (Bundle { o, patch, radius: 0.0, d, d_p: [zero; 2] }, None);
        }
        let f = self.frame(cell);
        let world = |v: DVec3| f[0] * v.x + f[1] * v.y + f[2] * v.z;
        let face = self.face(cell);
        let ([.., x, y], w) = (cell.middle(), cell.width());
        let d = world(face.along([x, y]));
        let d_p = [world(face.half[0]) * (0.5 * w[2]), world(face.half[1]) * (0.5 * w[3])];
        let from = |o: DVec3, patch: [DVec3; 2], radius: f64| Bundle { o, patch, radius, d, d_p };
        match &self.source.kind {
            Kind::Lamp(lamp) => {
                let (o, patch) = lamp.parallelogram([cell.lo[0], cell.lo[1]], [cell.hi[0], cell.hi[1]]);
                let bundle = from(o, patch, 0.0);
                let back = Bundle { d: -d, d_p: d_p.map(|v| -v), ..bundle };
                (bundle, lamp.may_mirror(self.own(cell), d, d_p).then_some(back))
            }
            Kind::Ball(ball) => (from(ball.centre, [zero; 2], ball.radius * (1.0 + 1e-5)), None),
            Kind::Delta(delta) => {
                let o = match delta.light {
                    DeltaLight::Point { position, .. } | DeltaLight::Spot { position, .. } => position.as_dvec3(),
                    DeltaLight::Directional { .. } => zero,
                };
                (from(o, [zero; 2], 0.0), None)
            }
            Kind::Infinity(_) => (from(zero, [zero; 2], f64::INFINITY), None),
        }
    }

    /// The family of the detector: origins on the patch (a sphere's on the disk across the middle direction), directions of the rectangle.
    pub fn family(&self, cell: &Cell) -> Family<f64, 4> {
        let b = self.bundles(cell).0;
        let mut patch = b.patch;
        if let Kind::Ball(ball) = &self.source.kind {
            let d = b.d.normalize();
            let [s, t] = warp::frame(d, [DVec3::ZERO; 2]).map(|v| v.at * ball.radius);
            // The disk as a square of its own area.
            let half = 0.5 * PI.sqrt();
            let w = cell.width();
            patch = [s * (half * w[0]), t * (half * w[1])];
        }
        let zero = dualux_dual::Vec3::zero();
        let [a, c] = patch.map(to_dual);
        let [x, y] = b.d_p.map(to_dual);
        Family::new(to_dual(b.o), [a, c, zero, zero], to_dual(b.d), [zero, zero, x, y])
    }
}
