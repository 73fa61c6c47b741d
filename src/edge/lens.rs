//! The rays of a lens in coordinates of their own.
//!
//! Parameters 0 and 1 turn the rays (a pixel), 2 and 3 move their origin over the lens, while they pass the same point in focus, at t = f.
//! With X, Y, T the coordinates of x - o (rows across the film, T = t for all rays), a ray has the origin (A q, 0) and the
//! direction (p - A q / f, 1), A a 2 x 2 matrix. So the margin of a line a-b, with c = a x b and e = b - a, is, up to a factor,
//!
//! `m = c_z + c_x p_0 + c_y p_1 + (A^T (-c_x / f - e_y, -c_y / f + e_x)) . q` + terms p q that the first order leaves out.
//!
//! At depth T the rays are off by `|X| <= T + A_x |1 - T / f|`, A_x the length of A's row: a side with a waist, of two planes.
//! Source: this project. Verified against the general margins (tests) and by the recall of lenses.

use super::linear::Linear;
use crate::accel::footprint::Sides;
use crate::math::DVec3;

/// Relative error of a lens's rays in focus.
const ROUNDING: f64 = 1e-6;

/// Coordinates of the rays of a lens.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    o: DVec3,
    /// X, Y, T.
    rows: [DVec3; 3],
    /// Origins by parameters 2 and 3: columns of A.
    by: [[f64; 2]; 2],
    /// 1 / f.
    power: f64,
}

impl Lens {
    /// Of rays with origin and direction `o`, `d` and their derivatives. They are those of a lens: what moves the
    /// origin turns the ray back to the same point in focus. `None` without a pixel, or seen edge-on.
    #[inline(always)]
    pub fn new(o: DVec3, o_p: &[DVec3], d: DVec3, d_p: &[DVec3]) -> Option<Self> {
        let (&[o0, o1, o2, o3], &[dx, dy, d2, d3]) = (o_p, d_p) else { return None };
        let c = dx.cross(dy);
        let inv = 1.0 / c.dot(d);
        let t = c * inv;
        let power = -d2.dot(o2) / o2.length_squared();
        debug_assert!([(o2, d2), (o3, d3)].iter().all(|(o, d)| (*d + *o * power).length() <= ROUNDING * d.length()));
        if !(o0 == DVec3::ZERO && o1 == DVec3::ZERO && inv.is_finite() && power.is_finite()) {
            return None;
        }
        let rows = [dy.cross(d) * inv, d.cross(dx) * inv, t];
        let by = [o2, o3].map(|o| [rows[0].dot(o), rows[1].dot(o)]);
        Some(Lens { o, rows, by, power })
    }

    /// Length of a row of A.
    #[inline(always)]
    fn radius(&self, k: usize) -> f64 {
        let [a, b] = [self.by[0][k], self.by[1][k]];
        (a * a + b * b).sqrt()
    }

    /// Whether all rays pass a ball.
    #[inline(always)]
    pub fn passes_ball(&self, centre: DVec3, radius: f64) -> bool {
        let x = self.project(centre);
        [(0, x.x), (1, x.y)].into_iter().any(|(k, x_k)| {
            // Outside of both planes of the side towards which it lies, by its radius.
            let (a, n) = (self.radius(k), self.rows[k] * x_k.signum());
            [a, -a].into_iter().all(|a| {
                let out = n - self.rows[2] * (1.0 - a * self.power);
                let off = x_k.abs() - x.z * (1.0 - a * self.power) - a;
                off > 0.0 && off * off > radius * radius * out.length_squared() * (1.0 + 1e-9)
            })
        })
    }

    /// Coordinates of a point.
    #[inline(always)]
    pub fn project(&self, x: DVec3) -> DVec3 {
        let v = x - self.o;
        DVec3::new(self.rows[0].dot(v), self.rows[1].dot(v), self.rows[2].dot(v))
    }

    /// (x, y) times A.
    #[inline(always)]
    fn lensed(&self, x: f64, y: f64) -> [f64; 2] {
        self.by.map(|a| a[0] * x + a[1] * y)
    }

    /// The margin of the line through two projected points.
    #[inline(always)]
    pub fn line<const N: usize>(&self, a: DVec3, b: DVec3) -> Linear<N> {
        let (c, e) = (a.cross(b), b - a);
        let [q0, q1] = self.lensed(-c.x * self.power - e.y, -c.y * self.power + e.x);
        let all = [c.x, c.y, q0, q1];
        let mut gradient = [0.0; N];
        for (to, from) in gradient.iter_mut().zip(all) {
            *to = from;
        }
        Linear { value: c.z, gradient, rest: 0.0 }
    }

    /// Bounds of the ray parameters at which the rays meet the plane of three projected points; `None` if some may be parallel to it.
    #[inline(always)]
    fn met_within(&self, [a, b, c]: [DVec3; 3]) -> Option<[f64; 2]> {
        let n = (b - a).cross(c - a);
        let n = if n.z < 0.0 { -n } else { n };
        let [x, y] = self.lensed(n.x, n.y);
        let off = (x * x + y * y).sqrt();
        let turn = n.x.abs() + n.y.abs() + off * self.power.abs();
        let (slowest, fastest) = (n.z - turn, n.z + turn);
        let [low, high] = [-off, off].map(|off| n.dot(a) + off);
        (slowest > 0.0).then(|| [(low / slowest).min(low / fastest), (high / slowest).max(high / fastest)])
    }

    /// A bound of the ray parameters at which the rays meet the plane of three projected points; `None` unless all of them do.
    #[inline(always)]
    pub fn covered_up_to(&self, points: [DVec3; 3]) -> Option<f64> {
        self.met_within(points).filter(|t| t[0] > 0.0).map(|t| t[1])
    }

    /// Where the rays meet a polygon of projected points, if they do.
    #[inline(always)]
    pub fn place(&self, points: &[DVec3], [near, far]: [f64; 2]) -> Place {
        let before = points.iter().filter(|x| x.z < near).count();
        let beyond = points.iter().filter(|x| x.z > far).count();
        if before == 0 && beyond == 0 {
            return Place::Within;
        }
        if before == points.len() || beyond == points.len() {
            return Place::Outside;
        }
        match self.met_within([points[0], points[1], points[2]]) {
            Some([low, high]) if low >= near && high <= far => Place::Within,
            Some([low, high]) if high < near || low > far => Place::Outside,
            _ => Place::Cut,
        }
    }

    /// What holds the rays.
    #[inline(always)]
    pub fn sides(&self) -> Sides {
        let t = self.rows[2];
        let side = |k: usize| (self.rows[k], self.radius(k));
        let planes = |sign: f64| {
            let [(n, a), (m, b)] = [side(0), side(1)];
            let (tn, tm) = (t * (1.0 - sign * a * self.power), t * (1.0 - sign * b * self.power));
            let normals = [tn - n, tn + n, tm - m, tm + m].map(|n| n.as_vec3());
            (normals, [a, a, b, b].map(|a| (sign * a) as f32))
        };
        let (n, slack) = planes(1.0);
        Sides { o: self.o.as_vec3(), n, slack, waist: Some(planes(-1.0)) }
    }
}

/// Where something is met, by the range of the ray parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Within it.
    Within,
    /// Partly.
    Cut,
    /// Before or beyond.
    Outside,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::edge::tests::Rng;
    use crate::edge::view::{from_dual, to_dual};
    use dualux_dual::num_dual::DualSVec64;
    use dualux_dual::{Family, Jet, margins};

    #[test]
    fn lines_are_the_dual_margins_and_sides_hold_all_rays() {
        let mut rng = Rng(41, 0);
        for _ in 0..200 {
            let (axis, o) = (rng.cube(1.0).normalize(), rng.cube(1.0));
            let (u, v) = axis.any_orthonormal_pair();
            let (focus, radius) = (rng.range(1.0, 5.0), rng.range(0.01, 0.3));
            let d = axis + u * rng.range(-0.5, 0.5) + v * rng.range(-0.5, 0.5);
            let [o2, o3] = [u, v].map(|v| v * radius);
            let none = DVec3::ZERO;
            let family = Family::new(
                to_dual(o),
                [none, none, o2, o3].map(to_dual),
                to_dual(d),
                [u * 0.02, v * 0.03, o2 * (-1.0 / focus), o3 * (-1.0 / focus)].map(to_dual),
            );
            let ray = family.ray::<DualSVec64<4>>();
            let [o_p, d_p] = [family.o_p, family.d_p].map(|v| v.map(from_dual));
            let lens = Lens::new(o, &o_p, d, &d_p).expect("a lens");
            let (a, b) = (rng.cube(5.0), rng.cube(5.0));
            let ours: Linear<4> = lens.line(lens.project(a), lens.project(b));
            let dual = margins::line(&ray, to_dual(a), to_dual(b)).expansion();
            let f = dual.value / ours.value;
            for (x, y) in ours.gradient.iter().zip(dual.gradient) {
                assert!((x * f - y).abs() <= 1e-9 * (1.0 + y.abs()), "{x} * {f} is not {y}");
            }
            let sides = lens.sides();
            let (second, slack) = sides.waist.expect("two planes");
            for _ in 0..50 {
                let (a, r) = (rng.range(0.0, std::f64::consts::TAU), rng.unit().sqrt());
                let ray = family.at([rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), r * a.cos(), r * a.sin()]);
                let x = from_dual(ray.at(rng.range(0.0, 3.0 * focus))).as_vec3() - sides.o;
                for k in 0..4 {
                    let inside = sides.n[k].dot(x) >= -sides.slack[k] - 1e-4 || second[k].dot(x) >= -slack[k] - 1e-4;
                    assert!(inside, "outside of side {k}");
                }
            }
        }
    }
}
