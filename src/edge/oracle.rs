//! Brute force: n x n real rays per footprint, for tests and scores.
//!
//! A pixel has an edge if two neighbouring rays see another shape (or one nothing), normals that differ by
//! [`crate::scene::mesh::CREASE_ANGLE`] or more, or a jump in depth: neither point lies near the other's tangent plane. A light is partly visible if
//! some of its points are seen and some not. Finite n misses what is thinner than its grid, so that measured precision is a lower
//! bound, while recall is a real demand.

use super::EdgeDetector;
use super::light::Receiver;
use super::view::{View, from_dual};
use crate::accel::{Accel, Ray};
use crate::math::{DVec3, Vec3};
use crate::scene::mesh::CREASE_ANGLE;
use crate::scene::shape::ShapeHit;
use crate::scene::{Geometry, Scene, SurfacePoint};
use dualux_dual::Family;

/// What a ray sees.
#[derive(Clone, Copy, Debug)]
struct Seen {
    shape: u32,
    x: DVec3,
    n: Vec3,
}

/// Sine above which a step leaves a tangent plane.
const STEEP: f64 = 0.5;

fn differ(a: &Option<Seen>, b: &Option<Seen>) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return a.is_some() != b.is_some() };
    if a.shape != b.shape || a.n.dot(b.n).abs() < CREASE_ANGLE.cos() {
        return true;
    }
    let step = b.x - a.x;
    let off = |n: Vec3| n.as_dvec3().dot(step).abs() > STEEP * step.length();
    off(a.n) && off(b.n)
}

impl From<SurfacePoint> for Seen {
    fn from(at: SurfacePoint) -> Self {
        Seen { shape: at.shape, x: at.p.as_dvec3(), n: at.n_geo }
    }
}

fn meet(scene: &Scene, accel: &Accel, ray: &Ray) -> Option<SurfacePoint> {
    let hit = accel.closest(ray)?;
    let at = ShapeHit { t: hit.t, u: hit.u, v: hit.v };
    Some(scene.shapes[hit.shape as usize].surface_point(hit.shape, hit.prim, ray.o, ray.d, at))
}

fn plain<const N: usize>(family: &Family<f64, N>, t: [f64; 2], p: [f64; N]) -> Ray {
    let r = family.at(p);
    Ray { o: from_dual(r.o).as_vec3(), d: from_dual(r.d).as_vec3(), tmin: t[0] as f32, tmax: t[1] as f32 }
}

/// The centre of grid cell k of n, in -1..1.
fn grid(k: usize, n: usize) -> f64 {
    (2 * k + 1) as f64 / n as f64 - 1.0
}

/// Whether what n x n points of the footprint see changes between neighbours.
fn changes<T>(n: usize, see: impl Fn([f64; 2]) -> T, differ: impl Fn(&T, &T) -> bool) -> bool {
    let mut above: Vec<T> = Vec::new();
    for y in 0..n {
        let row: Vec<_> = (0..n).map(|x| see([grid(x, n), grid(y, n)])).collect();
        if row.windows(2).any(|w| differ(&w[0], &w[1])) || above.iter().zip(&row).any(|(a, b)| differ(a, b)) {
            return true;
        }
        above = row;
    }
    false
}

/// Whether the view of n x n rays changes.
pub fn sight(scene: &Scene, accel: &Accel, view: &View, n: usize) -> bool {
    let see = |p| meet(scene, accel, &plain(&view.family, view.t, p)).map(Seen::from);
    changes(n, see, differ)
}

/// The same, but `None` where only rays beyond the footprint's border see a change: an edge passes between the outermost rays of neighbouring
/// footprints, often exactly along their border, and which of them holds it rays do not tell.
pub fn sight_within(scene: &Scene, accel: &Accel, view: &View, n: usize) -> Option<bool> {
    let scale = (n + 2) as f64 / n as f64;
    let see = |p: [f64; 2]| meet(scene, accel, &plain(&view.family, view.t, p.map(|x| x * scale))).map(Seen::from);
    match sight(scene, accel, view, n) {
        true => Some(true),
        false => (!changes(n + 2, see, differ)).then_some(false),
    }
}

/// Whether the view of the rays of a family with four parameters changes: n x n values of the first two for each of n x n values of
/// the last two (with `round`: of those in the unit disk, a lens), and from one of these to the next.
pub fn sight4(scene: &Scene, accel: &Accel, family: &Family<f64, 4>, t: [f64; 2], n: usize, round: bool) -> bool {
    let outer = (0..n * n).map(|i| [grid(i % n, n), grid(i / n, n)]);
    let outer: Vec<_> = outer.filter(|q| !round || q[0] * q[0] + q[1] * q[1] <= 1.0).collect();
    let see =
        |p: [f64; 2], q: [f64; 2]| meet(scene, accel, &plain(family, t, [p[0], p[1], q[0], q[1]])).map(Seen::from);
    outer.iter().any(|q| changes(n, |p| see(p, *q), differ)) || {
        let all = |q: &[f64; 2]| -> Vec<_> { (0..n * n).map(|i| see([grid(i % n, n), grid(i / n, n)], *q)).collect() };
        let views: Vec<_> = outer.iter().map(all).collect();
        views.windows(2).any(|w| w[0].iter().zip(&w[1]).any(|(a, b)| differ(a, b)))
    }
}

/// Whether what n x n rays see *behind* smooth surfaces changes, by the same tree of segments as [`EdgeDetector::chain`] follows.
/// `None` where they do not all meet the same smooth surface first, without an edge.
pub fn chain(detector: &EdgeDetector, view: &View, n: usize) -> Option<bool> {
    let (scene, accel) = (detector.scene, detector.accel);
    let first = meet(scene, accel, &plain(&view.family, view.t, [0.0; 2]))?;
    let to_us = -from_dual(view.family.d).as_vec3();
    let outside = first.n_geo.dot(to_us) > 0.0;
    detector.optics(scene.shapes[first.shape as usize].material as usize, outside)?;
    if sight(scene, accel, view, n) {
        return None;
    }
    let see = |p| detector.follow(&plain(&view.family, view.t, p)).into_iter().map(|at| at.map(Seen::from)).collect();
    Some(changes(n, see, |a: &Vec<Option<Seen>>, b| a.len() != b.len() || a.iter().zip(b).any(|(a, b)| differ(a, b))))
}

/// Whether some, and some not, of about n x n points of a light (on each triangle: n x n) are seen from the receiver. Of round lights
/// only what turns to the receiver counts. `None` where they turn nothing.
pub fn light(scene: &Scene, accel: &Accel, light: u32, from: &Receiver, n: usize) -> Option<bool> {
    let shape = &scene.shapes[light as usize];
    let (prims, round) = match &shape.geometry {
        Geometry::Mesh(mesh) => (mesh.triangles.len() as u32, false),
        Geometry::Rectangle(_) | Geometry::Disk(_) => (1, false),
        Geometry::Sphere(_) | Geometry::Cylinder(_) => (1, true),
    };
    let mut seen = [false; 2];
    for i in 0..prims as usize * n * n {
        let (prim, x, y) = (i / (n * n), i % n, i / n % n);
        let u = crate::math::Vec2::new(x as f32 + 0.5, y as f32 + 0.5) / n as f32;
        let (at, _) = shape.sample_area(light, prim as u32, u);
        let q = at.p.as_dvec3();
        let d = q - from.p;
        let turned = at.n_shade.as_dvec3().dot(d) < 0.0;
        if round && !turned {
            continue;
        }
        let lit = turned && from.n.is_none_or(|n| n.dot(d) > 0.0) && {
            let o = from.p + from.n.unwrap_or(DVec3::ZERO) * (1e-5 * d.length());
            // It ends before the light, and before what a round light's own surface is off by there.
            let ray = Ray { o: o.as_vec3(), d: (q - o).as_vec3(), tmin: 1e-6, tmax: 1.0 - 1e-4 };
            !accel.occluded(&ray)
        };
        seen[usize::from(lit)] = true;
        if seen == [true; 2] {
            return Some(true);
        }
    }
    (seen != [false; 2]).then_some(false)
}
