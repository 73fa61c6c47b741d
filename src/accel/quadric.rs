//! Intersection of rays with spheres, disks (ellipses) and open cylinders.
//!
//! Everything is computed in f64 from the f32 description and rounded once, so that t is right to an ulp of f32 for any
//! distance. The quadratic is solved as in Haines et al. 2019, "Precision Improvements for Ray/Sphere
//! Intersection" (Ray Tracing Gems, ch. 7): discriminant from the distance of centre and ray, roots without
//! cancellation. Both roots are tried, so that rays may start inside.
//! Not handled: surfaces of zero size (never hit; left out by the builder).

use crate::math::{DVec3, Vec3};
use crate::scene::shape::{Cylinder, Disk, Sphere};

/// An analytic primitive, prepared for queries.
#[derive(Clone, Debug)]
pub(crate) struct Quadric {
    /// Shape index.
    pub shape: u32,
    /// Enclosing box (min, max).
    pub bounds: (DVec3, DVec3),
    /// The surface.
    pub kind: Kind,
}

/// The surface of a quadric.
#[derive(Clone, Debug)]
pub(crate) enum Kind {
    /// Sphere.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius.
        radius: f64,
    },
    /// Points p of a plane with ((p - center) . gx)^2 + ((p - center) . gy)^2 <= 1.
    Disk {
        /// Centre.
        center: DVec3,
        /// Normal (any length).
        n: DVec3,
        /// Dual of the radius vector at angle 0.
        gx: DVec3,
        /// Dual of the radius vector at angle pi/2.
        gy: DVec3,
    },
    /// Open cylinder.
    Cylinder {
        /// Centre of the first rim.
        p0: DVec3,
        /// Unit vector from the first rim's centre to the second's.
        dir: DVec3,
        /// Distance of the rims' centres.
        length: f64,
        /// Radius.
        radius: f64,
    },
}

impl Quadric {
    /// None for a sphere without size.
    pub fn sphere(shape: u32, s: &Sphere) -> Option<Self> {
        let (center, radius) = (s.center.as_dvec3(), s.radius as f64);
        let reach = DVec3::splat(radius);
        (radius > 0.0).then_some(Quadric {
            shape,
            bounds: (center - reach, center + reach),
            kind: Kind::Sphere { center, radius },
        })
    }

    /// None for a disk without area.
    pub fn disk(shape: u32, d: &Disk) -> Option<Self> {
        let (center, ex, ey) = (d.center.as_dvec3(), d.ex.as_dvec3(), d.ey.as_dvec3());
        let n = ex.cross(ey);
        let (gx, gy) = (ey.cross(n) / n.length_squared(), n.cross(ex) / n.length_squared());
        let reach = DVec3::new(ex.x.hypot(ey.x), ex.y.hypot(ey.y), ex.z.hypot(ey.z));
        (n.length_squared() > 0.0).then_some(Quadric {
            shape,
            bounds: (center - reach, center + reach),
            kind: Kind::Disk { center, n, gx, gy },
        })
    }

    /// None for a cylinder without area.
    pub fn cylinder(shape: u32, c: &Cylinder) -> Option<Self> {
        let (p0, p1, radius) = (c.p0.as_dvec3(), (c.p0.as_dvec3() + c.axis.as_dvec3()), c.radius as f64);
        let length = c.axis.as_dvec3().length();
        let dir = c.axis.as_dvec3() / length;
        let reach = (DVec3::ONE - dir * dir).max(DVec3::ZERO).map(f64::sqrt) * radius;
        (radius > 0.0 && length > 0.0).then_some(Quadric {
            shape,
            bounds: (p0.min(p1) - reach, p0.max(p1) + reach),
            kind: Kind::Cylinder { p0, dir, length, radius },
        })
    }

    /// The smallest t in [tmin, tmax] at which the ray meets the surface.
    #[inline(never)] // keeps the loop over nodes and triangles small
    pub fn intersect(&self, o: Vec3, d: Vec3, tmin: f32, tmax: f32) -> Option<f32> {
        let (o, d) = (o.as_dvec3(), d.as_dvec3());
        let inside = |t: f64| {
            let t = t as f32;
            (tmin <= t && t <= tmax).then_some(t)
        };
        match &self.kind {
            Kind::Sphere { center, radius } => {
                let [t0, t1] = roots(o - center, d, *radius)?;
                inside(t0).or_else(|| inside(t1))
            }
            Kind::Disk { center, n, gx, gy } => {
                let t = n.dot(center - o) / n.dot(d);
                let p = o + d * t - center;
                let (x, y) = (p.dot(*gx), p.dot(*gy));
                if x * x + y * y <= 1.0 { inside(t) } else { None }
            }
            Kind::Cylinder { p0, dir, length, radius } => {
                let across = |v: DVec3| v - dir * v.dot(*dir);
                let from = o - p0;
                let on_wall = |t: f64| (0.0..=*length).contains(&(from + d * t).dot(*dir));
                roots(across(from), across(d), *radius)?.into_iter().find_map(|t| inside(t).filter(|_| on_wall(t)))
            }
        }
    }
}

/// Both solutions of |f + t d| = r in ascending order. None if there is none, d is zero or anything is NaN.
fn roots(f: DVec3, d: DVec3, r: f64) -> Option<[f64; 2]> {
    let a = d.length_squared();
    let b = -f.dot(d);
    let nearest = f + d * (b / a);
    let discriminant = r * r - nearest.length_squared();
    if discriminant >= 0.0 {
        let c = f.length_squared() - r * r;
        let q = b + (discriminant * a).sqrt().copysign(b);
        // q = 0 only for a ray that starts on the surface and touches it there: both roots are 0.
        let (t0, t1) = if q == 0.0 { (0.0, 0.0) } else { (c / q, q / a) };
        Some([t0.min(t1), t0.max(t1)])
    } else {
        None
    }
}
