//! Maps from the unit square to disks, hemispheres, spheres and cones with their derivatives, in f64.
//!
//! They are the natural direction and position maps of lights: area-preserving (cosine hemisphere: preserving projected solid
//! angle; cone: in proportion to a spot's profile), so that equal parts of the square carry equal flux, and of bounded distortion, so that
//! square cells become patches about as wide as long: footprints of photons are made of them.
//! `math::warp` has the same disk in f32 without derivatives; its map of the sphere stretches cells near the poles.
//!
//! | map | measure that it preserves | source |
//! | --- | --- | --- |
//! | [`disk`] | area | concentric, Shirley and Chiu 1997 |
//! | [`hemisphere`] | solid angle x cos | the disk, projected up (Malley) |
//! | [`sphere`] | solid angle | Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD" |
//! | [`Profile`] | solid angle x intensity of a spot | radius of the disk by the inverse of the profile's integral |
//!
//! Verified by `tests/maps.rs`: finite differences, determinants, inverses.

use crate::math::DVec3;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_4, TAU};

/// A value with its derivatives by the two numbers it is made of.
#[derive(Clone, Copy, Debug)]
pub struct Mapped<T> {
    /// Value.
    pub at: T,
    /// Derivatives.
    pub by: [T; 2],
}

type P2 = [f64; 2];

/// Smallest height over the rim of a hemisphere that is divided by.
const RIM: f64 = 1e-9;

/// Point of the unit disk.
pub fn disk(u: P2) -> Mapped<P2> {
    let [x, y] = u.map(|u| 2.0 * u - 1.0);
    if x == 0.0 && y == 0.0 {
        return Mapped { at: [0.0; 2], by: [[2.0, 0.0], [0.0, 0.5 * std::f64::consts::PI]] };
    }
    // Each quarter of the square becomes a quarter of the disk, squares become circles.
    let quarter = |r: f64, along: f64| {
        let a = FRAC_PI_4 * (along / r);
        let (s, c) = a.sin_cos();
        // Value, derivative by r, derivative by `along`; (cosine, sine) parts.
        ([r * c, r * s], [2.0 * (c + a * s), 2.0 * (s - a * c)], [-2.0 * FRAC_PI_4 * s, 2.0 * FRAC_PI_4 * c])
    };
    if x.abs() > y.abs() {
        let (at, by_x, by_y) = quarter(x, y);
        Mapped { at, by: [by_x, by_y] }
    } else {
        let (at, by_y, by_x) = quarter(y, x);
        let turn = |[c, s]: P2| [s, c];
        Mapped { at: turn(at), by: [turn(by_x), turn(by_y)] }
    }
}

/// The numbers that [`disk`] turns into `p`.
pub fn invert_disk([x, y]: P2) -> P2 {
    let r = x.hypot(y);
    let [a, b] = if x.abs() > y.abs() {
        let r = r.copysign(x);
        [r, r * (y / x).atan() / FRAC_PI_4]
    } else if y != 0.0 {
        let r = r.copysign(y);
        [r * (x / y).atan() / FRAC_PI_4, r]
    } else {
        [0.0; 2]
    };
    [a, b].map(|q| (0.5 * (q + 1.0)).clamp(0.0, 1.0))
}

/// Height over the disk at `q`, with derivatives.
pub fn height(q: &Mapped<P2>) -> Mapped<f64> {
    let [x, y] = q.at;
    let z = (1.0 - x * x - y * y).max(RIM * RIM).sqrt();
    Mapped { at: z, by: q.by.map(|[dx, dy]| -(x * dx + y * dy) / z) }
}

/// Direction of the hemisphere round +z with density cos / pi.
pub fn hemisphere(u: P2) -> Mapped<DVec3> {
    let q = disk(u);
    let z = height(&q);
    let v = |[x, y]: P2, z: f64| DVec3::new(x, y, z);
    Mapped { at: v(q.at, z.at), by: [v(q.by[0], z.by[0]), v(q.by[1], z.by[1])] }
}

/// The numbers that [`hemisphere`] turns into the unit vector `w`.
pub fn invert_hemisphere(w: DVec3) -> P2 {
    invert_disk([w.x, w.y])
}

/// Uniform direction of the whole sphere.
pub fn sphere(u: P2) -> Mapped<DVec3> {
    let [x, y] = u.map(|u| 2.0 * u - 1.0);
    let (ax, ay) = (x.abs(), y.abs());
    let (sx, sy) = (1f64.copysign(x), 1f64.copysign(y));
    // Distance from the diagonals: upper hemisphere inside, lower outside.
    let s = 1.0 - (ax + ay);
    let side = if s < 0.0 { -1.0 } else { 1.0 };
    let r = (1.0 - s.abs()).max(0.0);
    // dr by |x| and by |y| are both `side`. Angle: phi = pi/4 ((|y| - |x|) / r + 1).
    let (phi, phi_x, phi_y) = if r > 0.0 {
        let turn = (ay - ax) / r;
        (FRAC_PI_4 * (turn + 1.0), FRAC_PI_4 * (-1.0 - turn * side) / r, FRAC_PI_4 * (1.0 - turn * side) / r)
    } else {
        (FRAC_PI_4, 0.0, 0.0)
    };
    let (sin, cos) = phi.sin_cos();
    let root = (2.0 - r * r).sqrt();
    let rho = r * root;
    let rho_r = 2.0 * (1.0 - r * r) / root;
    let at = DVec3::new(sx * rho * cos, sy * rho * sin, side * (1.0 - r * r));
    let by = |phi_a: f64, sign: f64| {
        2.0 * sign
            * DVec3::new(
                sx * (rho_r * side * cos - rho * sin * phi_a),
                sy * (rho_r * side * sin + rho * cos * phi_a),
                -2.0 * r,
            )
    };
    Mapped { at, by: [by(phi_x, sx), by(phi_y, sy)] }
}

/// The numbers that [`sphere`] turns into the unit vector `w`.
pub fn invert_sphere(w: DVec3) -> P2 {
    let (ax, ay) = (w.x.abs(), w.y.abs());
    let rho2 = w.x * w.x + w.y * w.y;
    // 1 - |z| without cancellation.
    let r = (rho2 / (1.0 + w.z.abs())).sqrt();
    let phi = if rho2 > 0.0 { ay.atan2(ax) } else { 0.0 };
    let b = phi * FRAC_2_PI * r;
    let a = r - b;
    let (a, b) = if w.z < 0.0 { (1.0 - b, 1.0 - a) } else { (a, b) };
    [a.copysign(w.x), b.copysign(w.y)].map(|q| (0.5 * (q + 1.0)).clamp(0.0, 1.0))
}

/// A spot's intensity over the angle t from its axis: 1 up to `beam`, then linear to 0 at `cutoff`, radians.
#[derive(Clone, Copy, Debug)]
pub struct Profile {
    beam: f64,
    cutoff: f64,
    total: f64,
}

impl Profile {
    /// `beam` must not exceed `cutoff`.
    pub fn new(beam: f64, cutoff: f64) -> Self {
        let p = Profile { beam, cutoff, total: 0.0 };
        Profile { total: p.integral(cutoff), ..p }
    }

    /// Solid angle weighted by intensity: 2 pi times the integral of the profile.
    pub fn solid_angle(&self) -> f64 {
        TAU * self.total
    }

    /// Relative intensity at angle `t`.
    pub fn intensity(&self, t: f64) -> f64 {
        if t <= self.beam {
            1.0
        } else if t < self.cutoff {
            (self.cutoff - t) / (self.cutoff - self.beam)
        } else {
            0.0
        }
    }

    /// Integral of intensity x sin from 0 to `t`.
    fn integral(&self, t: f64) -> f64 {
        // 1 - cos without cancellation.
        let flat = |t: f64| 2.0 * (0.5 * t).sin().powi(2);
        if t <= self.beam {
            return flat(t);
        }
        let (b, c) = (self.beam, self.cutoff);
        // Integral of (c - t) sin t is -(c - t) cos t - sin t, written from b on by differences.
        let x = t.min(c) - b;
        let mid = b + 0.5 * x;
        let sines = 2.0 * mid.cos() * (0.5 * x).sin();
        let cosines = 2.0 * mid.sin() * (0.5 * x).sin();
        flat(b) + ((c - b) * cosines + x * (b + x).cos() - sines) / (c - b)
    }

    /// The angle below which the share `f` of the flux lies.
    fn angle(&self, f: f64) -> f64 {
        let target = f * self.total;
        let flat = 2.0 * (0.5 * self.beam).sin().powi(2);
        if target <= flat {
            return 2.0 * (0.5 * target).sqrt().min(1.0).asin();
        }
        // Newton between brackets: the integral grows, its slope falls to 0 at the cut-off.
        let (mut lo, mut hi) = (self.beam, self.cutoff);
        let mut t = 0.5 * (lo + hi);
        for _ in 0..60 {
            let miss = self.integral(t) - target;
            if miss > 0.0 {
                hi = t
            } else {
                lo = t
            }
            let next = t - miss / (self.intensity(t) * t.sin()).max(1e-300);
            let next = if next > lo && next < hi { next } else { 0.5 * (lo + hi) };
            if (next - t).abs() <= 1e-15 * self.cutoff {
                return next;
            }
            t = next;
        }
        t
    }

    /// Direction round +z with a density in proportion to the profile.
    pub fn direction(&self, u: P2) -> Mapped<DVec3> {
        let q = disk(u);
        let [x, y] = q.at;
        let r2 = x * x + y * y;
        let t = self.angle(r2.min(1.0));
        let (sin, cos) = t.sin_cos();
        let r = r2.sqrt();
        // On the axis sin t / r has the limit sqrt(2 total), and t grows as r does.
        let per_r = if r > 1e-8 { sin / r } else { (2.0 * self.total).sqrt() };
        let slope = if r > 1e-8 {
            self.total * 2.0 * r / (self.intensity(t) * sin).max(1e-12)
        } else {
            (2.0 * self.total).sqrt()
        };
        let (hx, hy) = if r > 0.0 { (x / r, y / r) } else { (1.0, 0.0) };
        let by = |[dx, dy]: P2| {
            let along = hx * dx + hy * dy;
            let (ox, oy) = (dx - hx * along, dy - hy * along);
            let t_u = slope * along;
            DVec3::new(ox * per_r + hx * cos * t_u, oy * per_r + hy * cos * t_u, -sin * t_u)
        };
        Mapped { at: DVec3::new(x * per_r, y * per_r, cos), by: q.by.map(by) }
    }

    /// The numbers that [`Self::direction`] turns into the unit vector `w`.
    pub fn invert(&self, w: DVec3) -> P2 {
        let rho = w.x.hypot(w.y);
        let r = (self.integral(rho.atan2(w.z)) / self.total).min(1.0).sqrt();
        if rho > 0.0 { invert_disk([w.x / rho * r, w.y / rho * r]) } else { [0.5; 2] }
    }
}

/// Two unit vectors across the unit vector `d`, with derivatives along `d_u` (Duff et al. 2017; the same as `math::Frame`, which has none).
pub fn frame(d: DVec3, d_u: [DVec3; 2]) -> [Mapped<DVec3>; 2] {
    let sign = 1f64.copysign(d.z);
    let a = -1.0 / (sign + d.z);
    let s = DVec3::new(1.0 + sign * d.x * d.x * a, sign * d.x * d.y * a, -sign * d.x);
    let t = DVec3::new(d.x * d.y * a, sign + d.y * d.y * a, -d.y);
    let by = d_u.map(|e| {
        let a_u = a * a * e.z;
        let xy_u = (e.x * d.y + d.x * e.y) * a + d.x * d.y * a_u;
        let s_u = DVec3::new(sign * (2.0 * d.x * e.x * a + d.x * d.x * a_u), sign * xy_u, -sign * e.x);
        let t_u = DVec3::new(xy_u, 2.0 * d.y * e.y * a + d.y * d.y * a_u, -e.y);
        (s_u, t_u)
    });
    [Mapped { at: s, by: by.map(|b| b.0) }, Mapped { at: t, by: by.map(|b| b.1) }]
}

/// The box (min, max) round the image of the box `lo..hi` of numbers under [`disk`], exactly: along the sides of a box both coordinates are monotone
/// between its crossings with the axes and diagonals, and the extremes of a homeomorphism's image lie on its border.
pub fn disk_bounds(lo: P2, hi: P2) -> [P2; 2] {
    let signed = |u: f64| 2.0 * u - 1.0;
    let (lo, hi) = (lo.map(signed), hi.map(signed));
    let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let mut add = |p: P2| {
        let q = disk(p.map(|x| 0.5 * (x + 1.0))).at;
        for k in 0..2 {
            bounds[0][k] = bounds[0][k].min(q[k]);
            bounds[1][k] = bounds[1][k].max(q[k]);
        }
    };
    for k in 0..2 {
        let other = 1 - k;
        for fixed in [lo[k], hi[k]] {
            for along in [lo[other], hi[other], 0.0, fixed, -fixed] {
                if along >= lo[other] && along <= hi[other] {
                    add(if k == 0 { [fixed, along] } else { [along, fixed] });
                }
            }
        }
    }
    bounds
}
