//! Uniform sampling of a triangle's solid angle.
//!
//! Source: the parametrisation is Arvo 1995, "Stratified Sampling of Spherical Triangles"; solid angle after
//! van Oosterom and Strackee 1983; the inversion through half-angle tangents follows the idea of Peters 2021, "BRDF
//! Importance Sampling for Polygonal Lights", section 4. Measure: per solid angle.
//!
//! With unit vertices a, b, c the part (a, b, c') of the triangle up to a point c' on the arc a-c has the solid angle s
//! given by  tan(s/2) = det(a,b,c') / (1 + a.b + b.c' + a.c').  Put c' = 2 (a.h) h - a, the mirror image of a in
//! h = x a + y c: then  tan(s/2) = det(a,b,h) / (b.h + a.h), which is linear in x and y.  No arc cosine, and no
//! difference of nearly equal angles, is left.

use super::angle;
use crate::math::DVec3;

/// A triangle as seen from the origin, ready to be sampled.
#[derive(Clone, Copy, Debug)]
pub struct SphericalTriangle {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    /// 1 / distance of the three vertices.
    inv_len: DVec3,
    /// |det(a, b, c)|.
    det: f64,
    /// c . (a + b)
    along: f64,
    /// 1 + a . b
    half: f64,
    solid_angle: f64,
}

/// A sampled point of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct TrianglePoint {
    /// The point, relative to the origin.
    pub position: DVec3,
    /// Barycentric coordinates of the three vertices; they sum to 1.
    pub barycentric: DVec3,
}

impl SphericalTriangle {
    /// The triangle with these vertices, relative to the origin; `None` where a vertex is the origin itself.
    pub fn new(a: DVec3, b: DVec3, c: DVec3) -> Option<Self> {
        let inv_len = DVec3::new(a.length(), b.length(), c.length()).recip();
        // From edges, not from unit vectors: the determinant of a distant triangle would be rounding only.
        let det = a.dot((b - a).cross(c - a)).abs() * inv_len.x * inv_len.y * inv_len.z;
        let (a, b, c) = (a * inv_len.x, b * inv_len.y, c * inv_len.z);
        let (along, half) = (c.dot(a + b), 1.0 + a.dot(b));
        let solid_angle = 2.0 * angle(det, half + along);
        det.is_finite().then_some(SphericalTriangle { a, b, c, inv_len, det, along, half, solid_angle })
    }

    /// Solid angle, in [0, 2 pi].
    pub fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// Density per solid angle, the same everywhere; infinite if the triangle is seen edge-on.
    pub fn pdf_dir(&self) -> f64 {
        1.0 / self.solid_angle
    }

    /// The point of the triangle for `u` in [0,1)^2. The solid angle must not be 0.
    pub fn sample(&self, u: [f64; 2]) -> TrianglePoint {
        let (sin, cos) = (0.5 * self.solid_angle * u[0]).sin_cos();
        // h = x a + y c as above; c' = (2 k x - 1) a + 2 k y c.
        let (x, y) = (self.det * cos - self.along * sin, self.half * sin);
        let h = self.a * x + self.c * y;
        let k = 2.0 * self.a.dot(h) / h.length_squared();
        let (ca, cc) = ((k * x - 1.0).max(0.0), (k * y).max(0.0));
        let end = self.a * ca + self.c * cc;
        // A point on the arc b-c' at height 1 - u m towards the pole b, m = 1 - b.c' and 2 - m from chords: either
        // may be tiny, for a small triangle or one that is almost a hemisphere.
        let m = 0.5 * (self.b - end).length_squared();
        let rest = 0.5 * (self.b + end).length_squared();
        let t = (u[1] * (2.0 - u[1] * m) / rest.max(f64::MIN_POSITIVE)).sqrt();
        let s = (1.0 - u[1] * m - t * (1.0 - m)).max(0.0);
        let weights = DVec3::new(t * ca, s, t * cc) * self.inv_len;
        let scale = 1.0 / weights.element_sum();
        TrianglePoint {
            // The sum of unit vectors is a unit vector, and the scale the distance.
            position: (self.b * s + end * t) * scale,
            barycentric: weights * scale,
        }
    }

    /// The numbers that [`Self::sample`] turns into the unit direction `dir`, which must meet the triangle.
    pub fn invert(&self, dir: DVec3) -> [f64; 2] {
        let arc = self.b.cross(dir).cross(self.a.cross(self.c));
        let end = arc.normalize_or(self.c);
        let end = if end.dot(self.a + self.c) < 0.0 { -end } else { end };
        let part = self.a.dot((self.b - self.a).cross(end - self.a)).abs();
        let part = 2.0 * angle(part, self.half + end.dot(self.a + self.b));
        [
            (part / self.solid_angle).clamp(0.0, 1.0),
            ((dir - self.b).length_squared() / (end - self.b).length_squared()).clamp(0.0, 1.0),
        ]
    }
}
