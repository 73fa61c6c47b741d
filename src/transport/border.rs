//! Kernels at borders: what of a kernel lies beyond the border of its surface is folded back.
//!
//! ```text
//! E(x) += flux (K(x - P) + sum_e K_e(x - P_e))       P_e, K_e: photon and kernel mirrored at the border e, in the tangent plane
//! ```
//!
//! Without that the foot of every wall were dark: at a straight border half of the light would be lost. With it constant light stays constant,
//! and no flux is lost. (Weighing each kernel up by the part that is lost would keep the flux as well, but at the border 0.74 of the
//! light were left.) Two borders at right angles need the image of the images too.
//! An edge counts as a border only if nothing goes on behind it: a ray down onto the lost piece finds no surface that faces the same way. So
//! neither tiles of one floor nor smooth meshes grow bright seams.
//! Source: Silverman 1986, "Density Estimation for Statistics and Data Analysis", 2.10 (reflection); METHODS 3.E, boundary bias.
//! Bias: the slope of the light is cut off at borders, first order in the kernel's width.
//! What stands on a surface is a border too ([`super::obstacle`]).
//! Not handled: borders of curved patches, concave corners, patches of more than [`MOST_TRIANGLES`] triangles (no images). Verified by `tests/borders.rs`: closed forms at the foot of walls, seams, corners.

use super::World;
use super::footprint_kernel::Ellipsoid;
use super::obstacle::{Obstacle, is_surface};
use super::photon::Photon;
use crate::math::{Vec2, Vec3};
use crate::scene::mesh::EdgeClass;
use crate::scene::{Geometry, Mesh};
use arrayvec::ArrayVec;

/// Triangles of a patch, at most.
pub const MOST_TRIANGLES: usize = 24;
/// Images of a photon, at most.
pub const MOST_IMAGES: usize = 8;
/// Cosine between what stands on a surface and a border beside it, and their distance in long half axes, from and up to which both are one.
const ALIKE: f32 = 0.9;
const NEXT: f32 = 0.25;
/// Cosine between borders up to which they are at right angles.
const RIGHT_ANGLE: f32 = 0.05;

/// The photon's kernel mirrored at the borders of its surface within reach.
pub type Images = ArrayVec<Ellipsoid, MOST_IMAGES>;

/// A border as a half-plane: unit normal in the tangent plane and offset.
type Border = (Vec3, f32);

/// Mirrors the kernel `e` of `photon` at the borders that it crosses, and at straight obstacles within it.
pub fn images(world: World, photon: &Photon, e: &Ellipsoid, obstacle: Option<&Obstacle>) -> Images {
    let mut fold = Fold { world, e, n: photon.n, borders: ArrayVec::new() };
    match &world.scene.shapes[photon.shape as usize].geometry {
        Geometry::Rectangle(r) => {
            let corners = [r.ex + r.ey, r.ey - r.ex, -r.ex - r.ey, r.ex - r.ey].map(|c| r.center + c);
            (0..4).for_each(|k| fold.edge(corners[k], corners[(k + 1) % 4]));
        }
        Geometry::Disk(d) => {
            // The tangent at the border point that lies in the photon's direction from the centre.
            let p = photon.p - d.center;
            let q = Vec2::new(p.dot(d.ex) / d.ex.length_squared(), p.dot(d.ey) / d.ey.length_squared());
            if let Some(q) = q.try_normalize() {
                let (on, along) = (d.center + d.ex * q.x + d.ey * q.y, d.ey * q.x - d.ex * q.y);
                fold.edge(on - along, on + along);
            }
        }
        Geometry::Mesh(mesh) => fold.coplanar(mesh, photon.prim),
        Geometry::Sphere(_) | Geometry::Cylinder(_) => {}
    }
    if let Some(obstacle) = obstacle {
        obstacle.borders().for_each(|border| fold.stands(border));
    }
    fold.images()
}

struct Fold<'a> {
    world: World<'a>,
    e: &'a Ellipsoid,
    n: Vec3,
    borders: ArrayVec<Border, 4>,
}

impl Fold<'_> {
    /// A point of the tangent plane in coordinates in which the kernel is the unit disk.
    fn local(&self, x: Vec3) -> Vec2 {
        let d = x - self.e.p;
        Vec2::new(self.e.rows[0].dot(d), self.e.rows[1].dot(d))
    }

    /// Notes the edge a-b if the kernel crosses it and nothing goes on behind.
    fn edge(&mut self, a: Vec3, b: Vec3) {
        let (la, lb) = (self.local(a), self.local(b));
        if distance(la, lb) >= 1.0 {
            return;
        }
        let Some(m) = self.n.cross(b - a).try_normalize() else { return };
        let border = (m, m.dot(a));
        // Triangles of one patch may share a border.
        let reach = self.e.radii[1];
        let same = |o: &Border| m.dot(o.0).abs() > 0.999 && (o.0.dot(a) - o.1).abs() < 1e-3 * reach;
        if !self.borders.iter().any(same) && !self.goes_on(la, lb) {
            let _ = self.borders.try_push(border);
        }
    }

    /// Notes a border at which something stands, unless an edge lies there or another one next to it.
    fn stands(&mut self, (m, offset): Border) {
        let reach = self.e.radii[0];
        let away = |(m, offset): &Border| (m.dot(self.e.p) - offset).abs();
        let same = |o: &Border| m.dot(o.0).abs() > ALIKE && (away(o) - away(&(m, offset))).abs() < NEXT * reach;
        if !self.borders.iter().any(same) {
            let _ = self.borders.try_push((m, offset));
        }
    }

    /// Edges of the triangles around `prim` that lie in its plane.
    fn coplanar(&mut self, mesh: &Mesh, prim: u32) {
        let mut patch = ArrayVec::<u32, MOST_TRIANGLES>::new();
        patch.push(prim);
        let mut next = 0;
        while next < patch.len() {
            let triangle = patch[next];
            next += 1;
            let corners = mesh.corners(triangle);
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if distance(self.local(a), self.local(b)) >= 1.0 {
                    continue;
                }
                let beyond = mesh.neighbors[triangle as usize][k];
                if mesh.edges[triangle as usize][k] != EdgeClass::Never || beyond == u32::MAX {
                    self.edge(a, b);
                } else if !patch.contains(&beyond) && patch.try_push(beyond).is_err() {
                    self.borders.clear();
                    return;
                }
            }
        }
    }

    /// Whether a surface that faces the same way lies behind an edge, within the kernel.
    fn goes_on(&self, a: Vec2, b: Vec2) -> bool {
        // From the edge's nearest point half of the way to the kernel's border.
        let u = (b - a).normalize_or_zero();
        let foot = a + u * (-a.dot(u)).max(0.0).min((b - a).length());
        let out = Vec2::new(u.y, -u.x);
        let out = if out.dot(foot) < 0.0 { -out } else { out };
        let x = foot + out * (0.5 * (1.0 - foot.length())).max(1e-3);
        let axis = |row: Vec3| row / row.length_squared();
        let up = axis(self.e.rows[2]);
        let p = self.e.p + axis(self.e.rows[0]) * x.x + axis(self.e.rows[1]) * x.y;
        is_surface(self.world, p, up, 1)
    }

    fn images(&self) -> Images {
        let mut images = Images::new();
        for (i, first) in self.borders.iter().enumerate() {
            let image = mirrored(self.e, first);
            let _ = images.try_push(image);
            for second in &self.borders[i + 1..] {
                if first.0.dot(second.0).abs() < RIGHT_ANGLE {
                    let _ = images.try_push(mirrored(&image, second));
                }
            }
        }
        images
    }
}

/// An ellipsoid mirrored at a border.
fn mirrored(e: &Ellipsoid, (m, offset): &Border) -> Ellipsoid {
    let turn = |v: Vec3| v - *m * (2.0 * m.dot(v));
    Ellipsoid { p: e.p - *m * (2.0 * (m.dot(e.p) - offset)), rows: e.rows.map(turn), radii: e.radii }
}

/// Distance of the segment a-b from the origin.
fn distance(a: Vec2, b: Vec2) -> f32 {
    let d = b - a;
    let t = (-a.dot(d) / d.length_squared()).clamp(0.0, 1.0);
    (a + d * if t.is_nan() { 0.0 } else { t }).length()
}
