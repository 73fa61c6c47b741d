//! Uniform sampling of a rectangle's solid angle.
//!
//! Source: Urena, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles": the local frame,
//! and equations for x (from the solid angle of the part left of it) and y (uniform on the arc). Measure: per solid angle.
//! The four inner angles g_i are kept as complex numbers (cos, sin), not as arc cosines: in the local frame
//! sin g_i is |z| times a corner's distance up to the factor that cos g_i has, so no digits are lost near
//! 0 and pi, and one arc tangent of their product gives the solid angle g_0 + g_1 + g_2 + g_3 - 2 pi.

use super::angle;
use crate::math::DVec3;
use std::f64::consts::TAU;

/// A rectangle in space with its local frame.
#[derive(Clone, Copy, Debug)]
pub struct RectangleFrame {
    center: DVec3,
    /// Unit vectors along the edges and their cross product.
    axes: [DVec3; 3],
    /// Half lengths of the edges.
    half: [f64; 2],
}

/// A rectangle as seen from a point, ready to be sampled.
#[derive(Clone, Copy, Debug)]
pub struct SphericalRectangle {
    axes: [DVec3; 3],
    x: [f64; 2],
    y: [f64; 2],
    /// Distance of the plane, above or equal to 0; the rectangle lies at -z along `axes[2]`.
    z: f64,
    solid_angle: f64,
    /// exp(i k), k = 2 pi - g_2 - g_3: the angle at which the sampling of x starts; not normalised.
    start: [f64; 2],
}

/// Product of two complex numbers.
fn mul(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// Solid angle of [x0,x1] x [y0,y1] at distance z, and the product of exp(i g_2) exp(i g_3), not normalised.
fn solid_angle(x: [f64; 2], y: [f64; 2], z: f64) -> (f64, [f64; 2]) {
    let r = |x: f64, y: f64| z * (x * x + y * y + z * z).sqrt();
    let g01 = mul([x[1] * y[0], r(x[1], y[0])], [-x[1] * y[1], r(x[1], y[1])]);
    let g23 = mul([x[0] * y[1], r(x[0], y[1])], [-x[0] * y[0], r(x[0], y[0])]);
    let all = mul(g01, g23);
    let s = angle(all[1], all[0]);
    // The angle lies in [0, 2 pi); just below 0 is rounding, not nearly the whole hemisphere.
    (if s < -1e-12 { s + TAU } else { s.max(0.0) }, g23)
}

impl RectangleFrame {
    /// The rectangle center + x ex + y ey, x and y in `[-1,1]`; `ex` and `ey` must be orthogonal. `None` if an edge has no
    /// length.
    pub fn new(center: DVec3, ex: DVec3, ey: DVec3) -> Option<Self> {
        let half = [ex.length(), ey.length()];
        let (ax, ay) = (ex / half[0], ey / half[1]);
        (ax.is_finite() && ay.is_finite()).then_some(RectangleFrame { center, axes: [ax, ay, ax.cross(ay)], half })
    }

    /// The rectangle seen from the point `p`.
    pub fn seen_from(&self, p: DVec3) -> SphericalRectangle {
        let [ax, ay, mut az] = self.axes;
        let c = self.center - p;
        let (cx, cy, mut z) = (c.dot(ax), c.dot(ay), -c.dot(az));
        if z < 0.0 {
            (az, z) = (-az, -z);
        }
        let [hx, hy] = self.half;
        let (x, y) = ([cx - hx, cx + hx], [cy - hy, cy + hy]);
        let (solid_angle, g23) = solid_angle(x, y, z);
        SphericalRectangle { axes: [ax, ay, az], x, y, z, solid_angle, start: [g23[0], -g23[1]] }
    }
}

impl SphericalRectangle {
    /// Solid angle, in [0, 2 pi].
    pub fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// Density per solid angle, the same everywhere; infinite if the rectangle is seen edge-on.
    pub fn pdf_dir(&self) -> f64 {
        1.0 / self.solid_angle
    }

    /// The point of the rectangle for `u` in [0,1)^2, relative to the origin. The solid angle must not be 0.
    pub fn sample(&self, u: [f64; 2]) -> DVec3 {
        let ([x0, x1], [y0, y1], z2) = (self.x, self.y, self.z * self.z);
        let (sin, cos) = (u[0] * self.solid_angle).sin_cos();
        // Angle a = start + u S; its cosine and sin are c / w and s / w.
        let [c, s] = mul(self.start, [cos, sin]);
        let w = (c * c + s * s).sqrt();
        // Urena's b0 = -y0 / r0 and b1 = y1 / r1: f = (b0 cos a - b1) / sin a, and x = z q / sqrt(1 - q^2) with
        // q = sign(f) / sqrt(f^2 + b0^2); everything times r0 r1 w.
        let (r0, r1) = ((y0 * y0 + z2).sqrt(), (y1 * y1 + z2).sqrt());
        let f = -(c * y0 * r1 + y1 * r0 * w);
        let under = f * f - s * s * z2 * (r1 * r1);
        let x = self.z * s * 1f64.copysign(f) * (r0 * r1) / under.max(f64::MIN_POSITIVE).sqrt();
        let x = x.clamp(x0, x1);
        // y: the height y / r on the unit sphere is uniform between those of the two edges.
        let d2 = x * x + z2;
        let (h0, h1) = (y0 / (d2 + y0 * y0).sqrt(), y1 / (d2 + y1 * y1).sqrt());
        let h = h0 + u[1] * (h1 - h0);
        let y = h * (d2 / (1.0 - h * h).max(f64::MIN_POSITIVE)).sqrt();
        self.axes[0] * x + self.axes[1] * y.clamp(y0, y1) - self.axes[2] * self.z
    }

    /// The numbers that [`Self::sample`] turns into the point `p` of the rectangle (relative to the origin).
    pub fn invert(&self, p: DVec3) -> [f64; 2] {
        let (x, y) = (p.dot(self.axes[0]), p.dot(self.axes[1]));
        let x = x.clamp(self.x[0], self.x[1]);
        let d2 = x * x + self.z * self.z;
        let height = |y: f64| y / (d2 + y * y).sqrt();
        let (h0, h1) = (height(self.y[0]), height(self.y[1]));
        let part = solid_angle([self.x[0], x], self.y, self.z).0;
        [(part / self.solid_angle).clamp(0.0, 1.0), ((height(y) - h0) / (h1 - h0)).clamp(0.0, 1.0)]
    }
}
