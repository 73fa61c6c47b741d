//! Faces of a cube as charts of directions: rectangles on them carry flux in closed form, and inside of one directions can be drawn in
//! proportion to it.
//!
//! A point (x, y) of a face is the direction m + x a + y b (m, a, b unit vectors, across each other), so that directions are affine in the
//! coordinates and margins exact (DESIGN.md section 1). With r^2 = 1 + x^2 + y^2:
//!
//! | measure | density g in (x, y) | integral over a corner, by differences |
//! | --- | --- | --- |
//! | solid angle | r^-3 | atan(x y / r) |
//! | solid angle x cos, top of a hemicube | r^-4 | 1/2 [x / sqrt(1+x^2) atan(y / sqrt(1+x^2)) + the same with x, y exchanged] |
//! | solid angle x cos, side (y upwards) | y r^-4 | -1/2 atan(x / sqrt(1+y^2)) / sqrt(1+y^2) |
//!
//! The second and third are form factors of rectangles (Cohen and Greenberg 1985, "The Hemi-Cube"). Drawing: x from its marginal, y from the
//! conditional density, each by Newton's method between brackets where there is no closed form, so that stratified numbers stay
//! stratified. Verified by `tests/cells.rs`: quadrature, chi-square, inverses.

use super::source::Drawn;
use super::warp::Mapped;
use crate::math::DVec3;

/// What is uniform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Solid angle.
    Solid,
    /// Solid angle times the cosine with m.
    Top,
    /// Solid angle times the cosine with b.
    Side,
}

/// A face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Middle.
    pub middle: DVec3,
    /// Directions in which x and y grow.
    pub half: [DVec3; 2],
    /// Measure.
    pub measure: Measure,
    /// Range of y; x runs over -1..1.
    pub y: [f64; 2],
}

/// Below this area of (x, y) the density is taken for constant: differences of integrals would lose digits.
const TINY: f64 = 1e-7;

/// The five faces of a hemicube round +z, for lamps.
pub fn hemicube() -> Vec<Face> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let side = |m: DVec3| Face { middle: m, half: [z.cross(m), z], measure: Measure::Side, y: [0.0, 1.0] };
    let top = Face { middle: z, half: [x, y], measure: Measure::Top, y: [-1.0, 1.0] };
    vec![top, side(x), side(y), side(-x), side(-y)]
}

/// The six faces of a cube.
pub fn cube() -> Vec<Face> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let face = |middle, a, b| Face { middle, half: [a, b], measure: Measure::Solid, y: [-1.0, 1.0] };
    vec![face(x, y, z), face(-x, -y, z), face(y, z, x), face(-y, -z, x), face(z, x, y), face(-z, -x, y)]
}

/// A step of Newton's method as short as this, over the bracket, was the last: errors are squared from step to step.
const CLOSE: f64 = 1e-7;

/// Root of a growing function between `lo` and `hi`: Newton's method, bisection where that leaves the bracket.
fn solve(mut lo: f64, mut hi: f64, guess: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let mut x = guess;
    let close = CLOSE * (hi - lo);
    for _ in 0..50 {
        let (value, slope) = f(x);
        if value > 0.0 {
            hi = x
        } else {
            lo = x
        }
        let next = x - value / slope;
        let next = if next >= lo && next <= hi { next } else { 0.5 * (lo + hi) };
        if (next - x).abs() <= close {
            return next;
        }
        x = next;
    }
    x
}

impl Face {
    /// Density in (x, y).
    pub fn density(&self, x: f64, y: f64) -> f64 {
        let r2 = 1.0 + x * x + y * y;
        match self.measure {
            Measure::Solid => 1.0 / (r2 * r2.sqrt()),
            Measure::Top => 1.0 / (r2 * r2),
            Measure::Side => y / (r2 * r2),
        }
    }

    fn corner(&self, x: f64, y: f64) -> f64 {
        match self.measure {
            Measure::Solid => (x * y / (1.0 + x * x + y * y).sqrt()).atan(),
            Measure::Top => {
                let (a, b) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
                0.5 * (x / a * (y / a).atan() + y / b * (x / b).atan())
            }
            Measure::Side => {
                let b = (1.0 + y * y).sqrt();
                -0.5 * (x / b).atan() / b
            }
        }
    }

    /// Measure of the rectangle `lo..hi`.
    pub fn measure(&self, lo: [f64; 2], hi: [f64; 2]) -> f64 {
        let area = (hi[0] - lo[0]) * (hi[1] - lo[1]);
        if area < TINY {
            return area * self.density(0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1]));
        }
        let c = |x, y| self.corner(x, y);
        (c(hi[0], hi[1]) - c(lo[0], hi[1]) - c(hi[0], lo[1]) + c(lo[0], lo[1])).max(0.0)
    }

    /// Integral of the density over y from 0 (side: from infinity) at fixed x.
    fn column(&self, x: f64, y: f64) -> f64 {
        let a2 = 1.0 + x * x;
        match self.measure {
            Measure::Solid => y / (a2 * (a2 + y * y).sqrt()),
            Measure::Top => {
                let a = a2.sqrt();
                0.5 * (y / (a2 * (a2 + y * y)) + (y / a).atan() / (a2 * a))
            }
            Measure::Side => -0.5 / (a2 + y * y),
        }
    }

    /// The point of the rectangle `lo..hi` for `f` in [0,1)^2.
    pub fn point(&self, lo: [f64; 2], hi: [f64; 2], f: [f64; 2]) -> [f64; 2] {
        let linear = |k: usize| lo[k] + f[k] * (hi[k] - lo[k]);
        if (hi[0] - lo[0]) * (hi[1] - lo[1]) < TINY {
            return [linear(0), linear(1)];
        }
        let target = f[0] * self.measure(lo, hi);
        let left = self.corner(lo[0], hi[1]) - self.corner(lo[0], lo[1]);
        let x = solve(lo[0], hi[0], linear(0), |x| {
            let part = self.corner(x, hi[1]) - self.corner(x, lo[1]) - left;
            (part - target, self.column(x, hi[1]) - self.column(x, lo[1]))
        });
        let (c0, c1) = (self.column(x, lo[1]), self.column(x, hi[1]));
        let c = c0 + f[1] * (c1 - c0);
        let a2 = 1.0 + x * x;
        let y = match self.measure {
            Measure::Solid => {
                // c a2 = y / sqrt(a2 + y^2)
                let h = c * a2;
                h * (a2 / (1.0 - h * h)).sqrt()
            }
            Measure::Side => (-0.5 / c - a2).max(0.0).sqrt(),
            Measure::Top => solve(lo[1], hi[1], linear(1), |y| (self.column(x, y) - c, self.density(x, y))),
        };
        [x, y.clamp(lo[1], hi[1])]
    }

    /// The numbers that [`Self::point`] turns into the point `p` of the rectangle.
    pub fn invert(&self, lo: [f64; 2], hi: [f64; 2], p: [f64; 2]) -> [f64; 2] {
        let part = self.measure(lo, [p[0], hi[1]]) / self.measure(lo, hi);
        let c = |y| self.column(p[0], y) - self.column(p[0], lo[1]);
        [part.clamp(0.0, 1.0), (c(p[1]) / c(hi[1])).clamp(0.0, 1.0)]
    }

    /// Direction at a point, of any length.
    pub fn along(&self, [x, y]: [f64; 2]) -> DVec3 {
        self.middle + self.half[0] * x + self.half[1] * y
    }

    /// The direction drawn at point `p` of a rectangle of measure `measure`; derivatives are by x and y.
    pub fn drawn(&self, p: [f64; 2], measure: f64) -> Drawn {
        let d = self.along(p);
        let r = d.length();
        let w = d / r;
        let by = self.half.map(|a| (a - w * w.dot(a)) / r);
        Drawn { w: Mapped { at: w, by }, per_pdf: measure }
    }

    /// The point whose direction is `w`, if it lies on this face.
    pub fn locate(&self, w: DVec3) -> Option<[f64; 2]> {
        let m = w.dot(self.middle);
        let [x, y] = self.half.map(|a| a.dot(w) / m);
        (m > 0.0 && x.abs() <= 1.0 && y >= self.y[0] && y <= self.y[1]).then_some([x, y])
    }
}
