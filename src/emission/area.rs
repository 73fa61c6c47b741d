//! Rays of area lamps that are no spheres: rectangles, disks, cylinders, triangles.
//!
//! Position uniform by area, direction by cosine round the *geometric* normal. A mesh with interpolated normals emits on the side of
//! these: directions on their dark side are mirrored through the origin, which keeps |cos| and hence the flux, so that it is
//! constant there too and the power pi A L is exact (some light then leaves through the back of the facet, as the path tracer sees it).
//! The triangles of a mesh lie one after the other along u0, in proportion to flux.
//! Textured shapes of one primitive are sampled through a table of their radiance over the numbers, uniform to one twentieth.

use super::source::{Drawn, Start};
use super::warp::{self, Mapped};
use crate::math::distribution::Piecewise2;
use crate::math::{DVec3, Frame, Rgb, Vec2};
use crate::scene::{Color, Geometry, Scene, Shape, SurfacePoint};
use std::f64::consts::TAU;

/// Cells of the table of a textured lamp, per side.
const TABLE: usize = 64;
/// What a cell gets at least, as part of the mean.
const FLOOR: f32 = 0.05;
/// The largest float below 1.
const BELOW_ONE: f32 = 1.0 - 0.5 * f32::EPSILON;

/// A lamp.
#[derive(Clone, Debug)]
pub struct Lamp<'a> {
    scene: &'a Scene,
    /// Index of the shape.
    pub shape: u32,
    /// Area, world units squared: of a mesh the sum over all its triangles, which photons must not ask for again.
    area: f64,
    /// Where the triangles of a mesh begin along u0, and 1 at the end.
    pub cdf: Vec<f64>,
    table: Option<Piecewise2>,
}

/// A place on a lamp.
pub(super) struct Site {
    /// The surface point.
    pub at: SurfacePoint,
    /// Derivatives of the position.
    pub p_u: [DVec3; 2],
    /// Tangents and normal.
    pub frame: [DVec3; 3],
    /// Their derivatives by u0 (cylinders).
    pub frame_u: [DVec3; 3],
    /// Area over the density in the unit square.
    pub area: f64,
}

impl<'a> Lamp<'a> {
    /// Shape `shape`, which must emit and be no sphere.
    pub fn new(scene: &'a Scene, shape: u32) -> Self {
        let area = f64::from(scene.shapes[shape as usize].area());
        let mut lamp = Lamp { scene, shape, area, cdf: vec![0.0, 1.0], table: None };
        let count = lamp.geometry().primitive_count();
        let textured = matches!(lamp.geometry().emission, Some(Color::Texture(_)));
        if count > 1 {
            let weights: Vec<f64> = (0..count as u32).map(|t| lamp.triangle_weight(t, textured)).collect();
            let mean = weights.iter().sum::<f64>() / count as f64;
            let weights: Vec<f64> = weights
                .iter()
                .zip(0..)
                .map(|(w, t)| match textured {
                    true => w.max(f64::from(FLOOR) * mean).max(f64::MIN_POSITIVE),
                    false => f64::from(lamp.geometry().primitive_area(t)),
                })
                .collect();
            let total: f64 = weights.iter().sum();
            let mut run = 0.0;
            lamp.cdf = std::iter::once(0.0).chain(weights.iter().map(|w| (run += w / total, run).1)).collect();
            lamp.cdf[count] = 1.0;
        } else if textured {
            lamp.table = lamp.radiance_table();
        }
        lamp
    }

    pub(super) fn geometry(&self) -> &'a Shape {
        &self.scene.shapes[self.shape as usize]
    }

    /// Area, world units squared.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Whether positions pass through a table.
    pub fn is_tabulated(&self) -> bool {
        self.table.is_some()
    }

    fn radiance(&self, at: &SurfacePoint) -> Rgb {
        match &self.geometry().emission {
            Some(color) => self.scene.textures().color(color, at.uv),
            None => Rgb::ZERO,
        }
    }

    /// Area times mean radiance over a few points.
    fn triangle_weight(&self, prim: u32, textured: bool) -> f64 {
        let area = f64::from(self.geometry().primitive_area(prim));
        if !textured {
            return area;
        }
        let corners = [[0.2, 0.2], [0.8, 0.2], [0.2, 0.8], [0.8, 0.8]];
        let at = |u: [f32; 2]| self.geometry().sample_area(self.shape, prim, Vec2::from(u)).0;
        let sum: Rgb = corners.map(|u| self.radiance(&at(u))).into_iter().sum();
        area * f64::from(sum.element_sum().max(0.0) / 12.0)
    }

    fn radiance_table(&self) -> Option<Piecewise2> {
        let fine = 2 * TABLE;
        let mut values = vec![0f32; TABLE * TABLE];
        for k in 0..fine * fine {
            let (i, j) = (k % fine, k / fine);
            let u = (Vec2::new(i as f32, j as f32) + 0.5) / fine as f32;
            let at = self.geometry().sample_area(self.shape, 0, u).0;
            let value = self.radiance(&at).element_sum();
            values[j / 2 * TABLE + i / 2] += if value.is_finite() { value.max(0.0) } else { 0.0 };
        }
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let floored: Vec<f32> = values.iter().map(|v| v + FLOOR * mean).collect();
        (mean > 0.0 && mean.is_finite()).then(|| Piecewise2::new(&floored, TABLE))
    }

    /// The primitive at u0.
    pub(super) fn primitive(&self, u0: f64) -> usize {
        self.cdf.partition_point(|&c| c <= u0).clamp(1, self.cdf.len() - 1) - 1
    }

    /// The place of the numbers `u`.
    pub(super) fn site(&self, u: [f64; 2]) -> Site {
        let prim = self.primitive(u[0]);
        let share = self.cdf[prim + 1] - self.cdf[prim];
        let mut inner = [(u[0] - self.cdf[prim]) / share, u[1]];
        // Derivatives of the inner numbers, and the density of the position relative to a uniform one.
        let (mut slope, mut density) = ([1.0 / share, 1.0], 1.0);
        if let Some(table) = &self.table {
            let c = table.sample_cell(Vec2::new(inner[0] as f32, inner[1] as f32));
            let size = table.cell_size(c.x, c.y).as_dvec2();
            let n = TABLE as f64;
            inner = [(c.x as f64 + f64::from(c.inside.x)) / n, (c.y as f64 + f64::from(c.inside.y)) / n];
            slope = [1.0 / (n * size.x), 1.0 / (n * size.y)];
            density = f64::from(c.pmf) * n * n;
        }
        let shape = self.geometry();
        let rounded = inner.map(|x| (x as f32).clamp(0.0, BELOW_ONE));
        let at = shape.sample_area(self.shape, prim as u32, Vec2::from(rounded)).0;
        let area = f64::from(shape.primitive_area(prim as u32)) / (share * density);
        let (p_u, frame, frame_u) = self.tangents(prim as u32, inner, &at);
        let p_u = [p_u[0] * slope[0], p_u[1] * slope[1]];
        Site { at, p_u, frame, frame_u: frame_u.map(|f| f * slope[0]), area }
    }

    /// Derivatives of the position by the inner numbers, frame, and its derivative by the first.
    fn tangents(&self, prim: u32, u: [f64; 2], at: &SurfacePoint) -> ([DVec3; 2], [DVec3; 3], [DVec3; 3]) {
        let flat = |p_u: [DVec3; 2]| {
            let f = Frame::from_normal(at.n_geo);
            (p_u, [f.s, f.t, f.n].map(|v| v.as_dvec3()), [DVec3::ZERO; 3])
        };
        match &self.geometry().geometry {
            Geometry::Rectangle(r) => flat([r.ex, r.ey].map(|e| 2.0 * e.as_dvec3())),
            Geometry::Disk(d) => {
                let q = warp::disk(u);
                flat(q.by.map(|[x, y]| d.ex.as_dvec3() * x + d.ey.as_dvec3() * y))
            }
            Geometry::Mesh(mesh) => {
                let [a, b, c] = mesh.corners(prim).map(|v| v.as_dvec3());
                let (e1, e2) = (b - a, c - a);
                flat(if u[0] < u[1] { [0.5 * (e1 - e2), e2] } else { [e1, 0.5 * (e2 - e1)] })
            }
            Geometry::Cylinder(c) => {
                let (sin, cos) = (TAU * u[0]).sin_cos();
                let (x, y) = (c.reference.as_dvec3(), c.binormal.as_dvec3());
                let turn = TAU * (y * cos - x * sin);
                let side = if c.flip { -1.0 } else { 1.0 };
                let n = side * (x * cos + y * sin);
                let s = c.axis.as_dvec3().normalize();
                let n_u = side * turn;
                ([turn * f64::from(c.radius), c.axis.as_dvec3()], [s, n.cross(s), n], [DVec3::ZERO, n_u.cross(s), n_u])
            }
            Geometry::Sphere(_) => flat([DVec3::ZERO; 2]),
        }
    }

    /// A parallelogram (centre, half edges) that holds all positions of the box `lo..hi`, which must lie within one primitive.
    pub(super) fn parallelogram(&self, lo: [f64; 2], hi: [f64; 2]) -> (DVec3, [DVec3; 2]) {
        let prim = self.primitive(0.5 * (lo[0] + hi[0]));
        let (start, end) = (self.cdf[prim], self.cdf[prim + 1]);
        let inner = |u: f64| ((u - start) / (end - start)).clamp(0.0, 1.0);
        let (mut lo, mut hi) = ([inner(lo[0]), lo[1]], [inner(hi[0]), hi[1]]);
        if self.table.is_some() {
            // Columns of the table depend on the row.
            (lo, hi) = ([0.0; 2], [1.0; 2]);
        }
        // c + x e1 + y e2 for x, y in these ranges.
        let within = |c: DVec3, e1: DVec3, e2: DVec3, x: [f64; 2], y: [f64; 2]| {
            let half = |r: [f64; 2]| 0.5 * (r[1] - r[0]);
            (c + e1 * (0.5 * (x[0] + x[1])) + e2 * (0.5 * (y[0] + y[1])), [e1 * half(x), e2 * half(y)])
        };
        let signed = |k: usize| [2.0 * lo[k] - 1.0, 2.0 * hi[k] - 1.0];
        match &self.geometry().geometry {
            Geometry::Rectangle(r) => {
                within(r.center.as_dvec3(), r.ex.as_dvec3(), r.ey.as_dvec3(), signed(0), signed(1))
            }
            Geometry::Disk(d) => {
                let [low, high] = warp::disk_bounds(lo, hi);
                let range = |k: usize| [low[k] - 1e-6, high[k] + 1e-6];
                within(d.center.as_dvec3(), d.ex.as_dvec3(), d.ey.as_dvec3(), range(0), range(1))
            }
            Geometry::Mesh(mesh) => {
                let [a, b, c] = mesh.corners(prim as u32).map(|v| v.as_dvec3());
                // Barycentrics of b grow with the first number and fall with the second, those of c the other way round.
                let at = |u: f64, v: f64| if u < v { [0.5 * u, v - 0.5 * u] } else { [u - 0.5 * v, 0.5 * v] };
                let (low_b, high_b) = (at(lo[0], hi[1])[0], at(hi[0], lo[1])[0]);
                let (low_c, high_c) = (at(hi[0], lo[1])[1], at(lo[0], hi[1])[1]);
                within(a, b - a, c - a, [low_b, high_b], [low_c, high_c])
            }
            // Not cut.
            Geometry::Cylinder(_) | Geometry::Sphere(_) => (DVec3::NAN, [DVec3::NAN; 2]),
        }
    }

    /// Whether interpolated normals may turn away from a direction d + x d1 + y d2 of triangle `own`, x and y in [-1, 1].
    pub(super) fn may_mirror(&self, own: Option<(u32, u32)>, d: DVec3, d_p: [DVec3; 2]) -> bool {
        let (Geometry::Mesh(mesh), Some((_, prim))) = (&self.geometry().geometry, own) else { return false };
        // Normals are convex combinations of those of the corners, up to their length.
        !mesh.normals.is_empty()
            && mesh.triangles[prim as usize].iter().any(|&i| {
                let n = mesh.normals[i as usize].as_dvec3();
                n.dot(d) - n.dot(d_p[0]).abs() - n.dot(d_p[1]).abs() <= 1e-6 * d.length()
            })
    }

    /// The side that emits at `at` for direction `d`: -1 if it is the opposite one.
    pub(super) fn side(&self, at: &SurfacePoint, d: DVec3) -> f64 {
        if at.n_shade.as_dvec3().dot(d) < 0.0 { -1.0 } else { 1.0 }
    }

    /// The ray of number `u`.
    pub fn start(&self, u: [f64; 2], drawn: &Drawn) -> Start {
        let site = self.site(u);
        let world = |w: DVec3, f: &[DVec3; 3]| f[0] * w.x + f[1] * w.y + f[2] * w.z;
        let Mapped { at: w, by } = drawn.w;
        let d = world(w, &site.frame);
        let side = self.side(&site.at, d);
        let d = (side * d).normalize();
        let zero = DVec3::ZERO;
        Start {
            o: site.at.spawn_origin(d.as_vec3()),
            d,
            value: self.radiance(&site.at) * site.area as f32,
            o_u: [site.p_u[0], site.p_u[1], zero, zero],
            d_u: [
                side * world(w, &site.frame_u),
                zero,
                side * world(by[0], &site.frame),
                side * world(by[1], &site.frame),
            ],
        }
    }

    /// The numbers of the ray that leaves near to `o` along `d`.
    pub fn invert(&self, o: DVec3, d: DVec3) -> Option<[f64; 4]> {
        let (prim, inner) = self.locate(o, d)?;
        let rounded = inner.map(|x| (x as f32).clamp(0.0, BELOW_ONE));
        let at = self.geometry().sample_area(self.shape, prim, Vec2::from(rounded)).0;
        let (_, [s, t, n], _) = self.tangents(prim, inner, &at);
        if at.n_shade.as_dvec3().dot(d) <= 0.0 {
            return None;
        }
        let d = if n.dot(d) < 0.0 { -d } else { d };
        let [v0, v1] = warp::invert_hemisphere(DVec3::new(s.dot(d), t.dot(d), n.dot(d)));
        let mut inner = inner;
        if let Some(table) = &self.table {
            let cell = inner.map(|x| ((x * TABLE as f64) as usize).min(TABLE - 1));
            let inside = [0, 1].map(|k| (inner[k] * TABLE as f64 - cell[k] as f64) as f32);
            inner = table.invert_cell(cell[0], cell[1], Vec2::from(inside)).as_dvec2().to_array();
        }
        let [lo, hi] = [self.cdf[prim as usize], self.cdf[prim as usize + 1]];
        Some([lo + inner[0] * (hi - lo), inner[1], v0, v1])
    }

    /// Primitive and inner numbers of the place where the line through `o` along `d` leaves the lamp.
    fn locate(&self, o: DVec3, d: DVec3) -> Option<(u32, [f64; 2])> {
        // Coordinates along x and y from c of the line's point in their plane, and how far away it is.
        let plane = |c: DVec3, x: DVec3, y: DVec3| {
            let n = x.cross(y);
            let t = n.dot(c - o) / n.dot(d);
            let q = o + d * t - c;
            ([q.cross(y).dot(n) / n.length_squared(), x.cross(q).dot(n) / n.length_squared()], t)
        };
        let inside = |x: f64| (-1.0 - 1e-4..=1.0 + 1e-4).contains(&x);
        match &self.geometry().geometry {
            Geometry::Rectangle(r) => {
                let (q, _) = plane(r.center.as_dvec3(), r.ex.as_dvec3(), r.ey.as_dvec3());
                q.into_iter().all(inside).then(|| (0, q.map(|x| (0.5 * (x + 1.0)).clamp(0.0, 1.0))))
            }
            Geometry::Disk(disk) => {
                let (q, _) = plane(disk.center.as_dvec3(), disk.ex.as_dvec3(), disk.ey.as_dvec3());
                inside(q[0].hypot(q[1])).then(|| (0, warp::invert_disk(q)))
            }
            Geometry::Cylinder(c) => {
                let q = o - c.p0.as_dvec3();
                let axis = c.axis.as_dvec3();
                let z = q.dot(axis) / axis.length_squared();
                let turn = q.dot(c.binormal.as_dvec3()).atan2(q.dot(c.reference.as_dvec3())) / TAU;
                inside(2.0 * z - 1.0).then(|| (0, [turn.rem_euclid(1.0), z.clamp(0.0, 1.0)]))
            }
            Geometry::Mesh(mesh) => {
                let mut best = (f64::INFINITY, None);
                for prim in 0..mesh.triangles.len() as u32 {
                    let [a, b, c] = mesh.corners(prim).map(|v| v.as_dvec3());
                    let ([x, y], t) = plane(a, b - a, c - a);
                    let hit = x >= -1e-4 && y >= -1e-4 && x + y <= 1.0 + 1e-4;
                    if hit && t.abs() < best.0 {
                        let inner = if x < y { [2.0 * x, x + y] } else { [x + y, 2.0 * y] };
                        best = (t.abs(), Some((prim, inner.map(|x| x.clamp(0.0, 1.0)))));
                    }
                }
                best.1
            }
            Geometry::Sphere(_) => None,
        }
    }
}
