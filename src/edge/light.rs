//! Lights as seen from a point: which part of an area light reaches it?
//!
//! The footprint is the light itself: a rectangle exactly, a triangle as half a parallelogram, a disk or sphere in its
//! circumscribed parallelogram (what enters only the corners of that counts, which errs towards "partial"). A light made of many
//! triangles is the sum of its triangles. p = -1..1 spans the light; t = 1 is its surface (sphere: the plane of its outline).
//!
//! Not handled, hence `Unknown`: cylinders as lights, textured emission, points inside a lamp, points on the inner side of a
//! cylinder or sphere that may shade itself, more than [`MOST_TRIANGLES`] triangles.

use super::detect::NOTHING;
use super::gather::Facet;
use super::kinds::{Events, Kinds, LightVerdict};
use super::view::{View, to_dual};
use super::{EdgeDetector, gather};
use crate::math::DVec3;
use crate::scene::{Color, Geometry, SurfacePoint};
use dualux_dual::{Family, Sphere, margins};

/// Most triangles of a light looked at one by one.
pub const MOST_TRIANGLES: usize = 64;

/// Rays end this much short of the light, so that what touches it does not shade it.
const SHORT: f64 = 1.0 - 1e-6;

/// A point that is lit.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position.
    pub p: DVec3,
    /// Geometric normal on the side that is looked at; `None`: no horizon (a medium, a two-sided surface).
    pub n: Option<DVec3>,
    /// The facet it lies on.
    pub facet: Option<Facet>,
}

impl Receiver {
    /// A surface point seen from direction `wo` (away from the surface).
    pub fn new(at: &SurfacePoint, wo: crate::math::Vec3) -> Self {
        let n = at.n_geo.as_dvec3();
        Receiver {
            p: at.p.as_dvec3(),
            n: Some(if at.n_geo.dot(wo) < 0.0 { -n } else { n }),
            facet: Some(Facet { shape: at.shape, prim: at.prim }),
        }
    }
}

fn unknown() -> LightVerdict {
    LightVerdict::Unknown(Events { kinds: Kinds::UNKNOWN, ..NOTHING })
}

fn parallelogram(o: DVec3, centre: DVec3, half: [DVec3; 2]) -> Option<View> {
    View::new(Family::towards(to_dual(o), to_dual(centre), half.map(to_dual)), [0.0, SHORT])
}

impl EdgeDetector<'_> {
    /// What the receiver sees of the light that is shape `light`. With `all`, every event is looked for, not only one.
    pub fn light(&self, light: u32, from: &Receiver, all: bool) -> LightVerdict {
        let shape = &self.scene.shapes[light as usize];
        if !matches!(shape.emission, Some(Color::Constant(_))) || !self.shades_simply(from) {
            return unknown();
        }
        let ask = |view: Option<View>| match view {
            // Seen edge-on.
            None => LightVerdict::Blocked,
            Some(view) => {
                let lamp = Facet { shape: light, prim: u32::MAX };
                self.shadow(&view, from.n, [from.facet, Some(lamp)], all)
            }
        };
        match &shape.geometry {
            Geometry::Rectangle(r) => {
                let c = r.center.as_dvec3();
                if r.n.as_dvec3().dot(from.p - c) <= 0.0 {
                    return LightVerdict::Blocked;
                }
                ask(parallelogram(from.p, c, [r.ex.as_dvec3(), r.ey.as_dvec3()]))
            }
            Geometry::Disk(d) => {
                let c = d.center.as_dvec3();
                if d.n.as_dvec3().dot(from.p - c) <= 0.0 {
                    return LightVerdict::Blocked;
                }
                ask(parallelogram(from.p, c, [d.ex.as_dvec3(), d.ey.as_dvec3()]))
            }
            Geometry::Sphere(s) => {
                let sphere = Sphere::new(to_dual(s.center.as_dvec3()), f64::from(s.radius));
                let Some(circle) = margins::sphere_silhouette(to_dual(from.p), &sphere) else {
                    return unknown();
                };
                if s.flip {
                    return LightVerdict::Blocked;
                }
                let n = super::view::from_dual(circle.normal).normalize();
                let u = n.any_orthonormal_vector() * circle.radius;
                ask(parallelogram(from.p, super::view::from_dual(circle.centre), [u, n.cross(u)]))
            }
            Geometry::Cylinder(_) => unknown(),
            Geometry::Mesh(mesh) if mesh.triangles.len() > MOST_TRIANGLES => unknown(),
            Geometry::Mesh(mesh) => {
                let one = |prim: u32| self.triangle(light, prim, from, all);
                (0..mesh.triangles.len() as u32).map(one).reduce(both).unwrap_or(LightVerdict::Blocked)
            }
        }
    }

    /// One triangle of a mesh that is a light.
    fn triangle(&self, light: u32, prim: u32, from: &Receiver, all: bool) -> LightVerdict {
        let Geometry::Mesh(mesh) = &self.scene.shapes[light as usize].geometry else { return unknown() };
        let [a, b, c] = mesh.corners(prim).map(|v| v.as_dvec3());
        // Which side emits is the interpolated normal's to say: linear in the barycentrics but for its length.
        let face = (b - a).cross(c - a).normalize();
        let towards = |i: usize, v: DVec3| match mesh.normals.is_empty() {
            true => face.dot(from.p - a),
            false => mesh.normals[mesh.triangles[prim as usize][i] as usize].as_dvec3().dot(from.p - v),
        };
        let sides = [towards(0, a), towards(1, b), towards(2, c)];
        if sides.iter().all(|s| *s <= 0.0) {
            return LightVerdict::Blocked;
        }
        if sides.iter().any(|s| *s <= 0.0) {
            return LightVerdict::Partial(Events { kinds: Kinds::EMITTER, ..NOTHING });
        }
        let Some(mut view) = parallelogram(from.p, 0.5 * (b + c), [0.5 * (b - a), 0.5 * (c - a)]) else {
            return LightVerdict::Blocked;
        };
        view.domain = Some([0.0, -1.0, -1.0]);
        self.shadow(&view, from.n, [from.facet, Some(gather::Facet { shape: light, prim })], all)
    }

    /// Whether the receiver's own shape, excluded as a whole, cannot shade it but by its horizon.
    fn shades_simply(&self, from: &Receiver) -> bool {
        let Some(facet) = from.facet else { return true };
        let outside = |c: DVec3| from.n.is_some_and(|n| n.dot(from.p - c) > 0.0);
        match &self.scene.shapes[facet.shape as usize].geometry {
            Geometry::Sphere(s) => outside(s.center.as_dvec3()),
            Geometry::Cylinder(c) => {
                let axis = c.axis.as_dvec3();
                let along = axis.dot(from.p - c.p0.as_dvec3()) / axis.length_squared();
                outside(c.p0.as_dvec3() + axis * along)
            }
            _ => true,
        }
    }
}

/// Of two parts of a light.
fn both(a: LightVerdict, b: LightVerdict) -> LightVerdict {
    use LightVerdict::{Blocked, Partial, Unknown, Visible};
    let join = |x: Events, y: Events| {
        let nearer = if y.distance < x.distance { y } else { x };
        Events { kinds: x.kinds | y.kinds, ..nearer }
    };
    match (a, b) {
        (Visible, Visible) => Visible,
        (Blocked, Blocked) => Blocked,
        (Unknown(x), Unknown(y) | Partial(y)) | (Partial(x), Unknown(y)) => Unknown(join(x, y)),
        (Unknown(x), _) | (_, Unknown(x)) => Unknown(x),
        (Partial(x), Partial(y)) => Partial(join(x, y)),
        (Partial(x), _) | (_, Partial(x)) => Partial(x),
        // Between the parts, no margin vanishes in any.
        (Visible, Blocked) | (Blocked, Visible) => Partial(Events { kinds: Kinds::EMITTER, ..NOTHING }),
    }
}
