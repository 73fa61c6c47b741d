//! Lights as seen from a point: which part of an area light reaches it?
//!
//! The footprint is the light itself, or what holds it (`outline`): rectangles, triangles and convex quadrilaterals of two
//! triangles exactly; disks, spheres and cylinders in a parallelogram, which errs towards "partial". A light made of many
//! parts is the sum of them. p = -1..1 spans the light; t = 1 is its surface (round lights: the plane of their outline).
//!
//! Not handled, hence `Unknown`: textured emission, points inside a lamp and surfaces that reach into one, cylinders that shine
//! inwards, points on the inner side of a sphere or cylinder unless the light lies inside as well, more than
//! [`MOST_TRIANGLES`] triangles.

use super::EdgeDetector;
use super::detect::NOTHING;
use super::gather::Facet;
use super::kinds::{Events, Kinds, LightVerdict};
pub use super::outline::MOST_TRIANGLES;
use super::outline::{Facing, Hull, Outline, Part};
use crate::math::DVec3;
use crate::scene::{Color, Geometry, SurfacePoint};

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

/// A light prepared for queries from many points: what does not depend on the point is computed once.
#[derive(Clone, Debug)]
pub struct Lamp {
    light: u32,
    parts: Option<Vec<Part>>,
}

impl EdgeDetector<'_> {
    /// What the receiver sees of the light that is shape `light`. With `all`, every event is looked for, not only one.
    /// From many points: [`lamp`](Self::lamp).
    pub fn light(&self, light: u32, from: &Receiver, all: bool) -> LightVerdict {
        let shape = &self.scene.shapes[light as usize];
        if !matches!(shape.emission, Some(Color::Constant(_))) {
            return unknown();
        }
        match &shape.geometry {
            Geometry::Mesh(mesh) if mesh.triangles.len() > MOST_TRIANGLES => unknown(),
            Geometry::Mesh(mesh) => {
                let part = |prim: u32| Part::of_mesh(mesh, light, prim).map(|part| self.part(&part, from, all));
                (0..mesh.triangles.len() as u32).filter_map(part).reduce(both).unwrap_or(LightVerdict::Blocked)
            }
            Geometry::Sphere(s) => {
                let (c, r) = (s.center.as_dvec3(), f64::from(s.radius));
                match Outline::sphere(from.p, c, r) {
                    None => unknown(),
                    Some(_) if s.flip => LightVerdict::Blocked,
                    Some(outline) => self.round(light, &outline, Hull::Ball(c, r), from, all),
                }
            }
            Geometry::Cylinder(c) if c.flip => unknown(),
            Geometry::Cylinder(c) => match Outline::cylinder(from.p, c) {
                None => LightVerdict::Blocked,
                Some(outline) => {
                    let p0 = c.p0.as_dvec3();
                    let hull = Hull::Tube([p0, p0 + c.axis.as_dvec3()], f64::from(c.radius));
                    self.round(light, &outline, hull, from, all)
                }
            },
            geometry @ (Geometry::Rectangle(_) | Geometry::Disk(_)) => match flat(geometry, light) {
                Some(part) => self.part(&part, from, all),
                None => unknown(),
            },
        }
    }

    /// The same for one primitive of a light: triangle `prim` of a mesh (other shapes are one primitive).
    pub fn light_prim(&self, light: u32, prim: u32, from: &Receiver, all: bool) -> LightVerdict {
        let shape = &self.scene.shapes[light as usize];
        match &shape.geometry {
            Geometry::Mesh(mesh) if matches!(shape.emission, Some(Color::Constant(_))) => {
                self.part(&Part::triangle(mesh, light, prim), from, all)
            }
            Geometry::Mesh(_) => unknown(),
            _ => self.light(light, from, all),
        }
    }

    /// Prepares a light for [`seen_from`](Self::seen_from).
    pub fn lamp(&self, light: u32) -> Lamp {
        let shape = &self.scene.shapes[light as usize];
        let parts = match &shape.geometry {
            _ if !matches!(shape.emission, Some(Color::Constant(_))) => None,
            Geometry::Mesh(mesh) if mesh.triangles.len() <= MOST_TRIANGLES => {
                Some((0..mesh.triangles.len() as u32).filter_map(|prim| Part::of_mesh(mesh, light, prim)).collect())
            }
            geometry => flat(geometry, light).map(|part| vec![part]),
        };
        Lamp { light, parts }
    }

    /// What the receiver sees of a prepared light: the same answer as [`light`](Self::light).
    #[inline]
    pub fn seen_from(&self, lamp: &Lamp, from: &Receiver, all: bool) -> LightVerdict {
        match lamp.parts.as_deref() {
            None => self.light(lamp.light, from, all),
            Some(parts) => {
                parts.iter().map(|part| self.part(part, from, all)).reduce(both).unwrap_or(LightVerdict::Blocked)
            }
        }
    }

    /// A flat part of a light.
    #[inline(always)]
    fn part(&self, part: &Part, from: &Receiver, all: bool) -> LightVerdict {
        let facing = match &part.facing {
            Facing::Flat(n) => n.dot(from.p - part.outline.centre),
            // Which side emits is the interpolated normal's to say: linear in the barycentrics but for its length.
            Facing::Smooth(corners) => {
                let towards = |[v, n]: &[DVec3; 2]| n.dot(from.p - *v);
                let lit = corners.iter().filter(|c| towards(c) > 0.0).count();
                if lit > 0 && lit < corners.len() {
                    return LightVerdict::Partial(Events { kinds: Kinds::EMITTER, ..NOTHING });
                }
                lit as f64
            }
        };
        if facing <= 0.0 {
            return LightVerdict::Blocked;
        }
        match self.inner_side(from, &part.outline, 0.0) {
            Inner::Simple => {}
            Inner::Hidden => return LightVerdict::Blocked,
            Inner::Unknown => return unknown(),
        }
        match part.outline.view(from.p) {
            // Seen edge-on.
            None => LightVerdict::Blocked,
            Some(view) => {
                let facets = [from.facet.unwrap_or(Facet::NONE), part.facets[0], part.facets[1]];
                self.shadow(&view, from.n, facets, None, all)
            }
        }
    }

    /// A round light in its outline.
    fn round(&self, light: u32, outline: &Outline, hull: Hull, from: &Receiver, all: bool) -> LightVerdict {
        match self.inner_side(from, outline, hull.thickness()) {
            Inner::Simple => {}
            Inner::Hidden => return LightVerdict::Blocked,
            Inner::Unknown => return unknown(),
        }
        let Some(view) = outline.view(from.p) else { return unknown() };
        let lamp = Facet { shape: light, prim: 0 };
        self.shadow(&view, from.n, [from.facet.unwrap_or(Facet::NONE), lamp, lamp], Some(hull), all)
    }
}
/// Whether the receiver's own shape, excluded as a whole, shades it otherwise than by its horizon.
enum Inner {
    /// It does not.
    Simple,
    /// It lies between the receiver and all of the light.
    Hidden,
    Unknown,
}

impl EdgeDetector<'_> {
    /// `thickness`: how far the light may stand out of its outline.
    #[inline(always)]
    fn inner_side(&self, from: &Receiver, outline: &Outline, thickness: f64) -> Inner {
        let Some(facet) = from.facet else { return Inner::Simple };
        let shape = &self.scene.shapes[facet.shape as usize];
        let outside = |c: DVec3| from.n.is_some_and(|n| n.dot(from.p - c) > 0.0);
        match &shape.geometry {
            Geometry::Sphere(s) if !outside(s.center.as_dvec3()) => {
                let (c, r) = (s.center.as_dvec3(), f64::from(s.radius));
                let reach = outline.half[0].length() + outline.half[1].length() + thickness;
                if outline.corners().iter().all(|x| (*x - c).length() + thickness <= r) {
                    Inner::Simple
                } else if (outline.centre - c).length() - reach > r && !self.lets_pass(shape) {
                    Inner::Hidden
                } else {
                    Inner::Unknown
                }
            }
            Geometry::Cylinder(c) => {
                let (p0, axis, r) = (c.p0.as_dvec3(), c.axis.as_dvec3(), f64::from(c.radius));
                let along = |x: DVec3| axis.dot(x - p0) / axis.length_squared();
                // Convex: what lies inside with all of its corners is not shaded.
                let inside = |x: DVec3| {
                    let (z, off) = (along(x), (x - p0 - axis * along(x)).length());
                    (0.0..=1.0).contains(&z) && off + thickness <= r
                };
                if outside(p0 + axis * along(from.p)) || outline.corners().into_iter().all(inside) {
                    Inner::Simple
                } else {
                    Inner::Unknown
                }
            }
            _ => Inner::Simple,
        }
    }
}

/// A rectangle or disk.
#[inline(always)]
fn flat(geometry: &Geometry, light: u32) -> Option<Part> {
    let (c, x, y, n) = match geometry {
        Geometry::Rectangle(r) => (r.center, r.ex, r.ey, r.n),
        Geometry::Disk(d) => (d.center, d.ex, d.ey, d.n),
        _ => return None,
    };
    let outline = Outline::whole(c.as_dvec3(), [x.as_dvec3(), y.as_dvec3()]);
    Some(Part { outline, facets: [Facet { shape: light, prim: 0 }; 2], facing: Facing::Flat(n.as_dvec3()) })
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
