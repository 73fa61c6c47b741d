//! Maps from the unit square to disks, spheres, cones and triangles, each with its density and its inverse.
//!
//! Names: `sample_x(u)` maps uniform numbers u in [0,1)^2, `pdf_x` is the density of the result, `invert_x` gives u back.
//! All are area-preserving (cosine hemisphere: preserving projected solid angle) and continuous inside the square, so
//! stratified numbers stay stratified; only angles wrap round.
//!
//! | warp | density | source |
//! | --- | --- | --- |
//! | disk | per area, 1/pi | concentric map, Shirley and Chiu 1997 |
//! | cosine hemisphere | per solid angle, cos/pi | the disk, projected up (Malley) |
//! | sphere | per solid angle, 1/(4 pi) | z uniform (Archimedes) |
//! | cone around +z | per solid angle, 1/(2 pi (1 - cos_max)) | z uniform in [cos_max, 1] |
//! | triangle | in (b, c) barycentrics, 2 | fold-free square map, Heitz 2019, "A Low-Distortion Map Between Triangle and Square" |
//!
//! Not handled: values outside `[0,1]^2` and arguments outside the target (inverses clamp to the square).

use super::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_4, PI, TAU};

/// Uniform point of the unit disk.
pub fn sample_disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - Vec2::ONE;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    // Each quarter of the square (by its diagonals) becomes a quarter of the disk, squares become circles.
    if p.x.abs() > p.y.abs() {
        p.x * Vec2::from_angle(FRAC_PI_4 * (p.y / p.x))
    } else {
        let a = FRAC_PI_4 * (p.x / p.y);
        p.y * Vec2::new(a.sin(), a.cos())
    }
}

/// Density of [`sample_disk`] per area: 1/pi inside, 0 outside.
pub fn pdf_disk(p: Vec2) -> f32 {
    if p.length_squared() <= 1.0 { FRAC_1_PI } else { 0.0 }
}

/// The numbers that [`sample_disk`] maps to `p`.
pub fn invert_disk(p: Vec2) -> Vec2 {
    let r = p.length();
    let q = if p.x.abs() > p.y.abs() {
        let r = r.copysign(p.x);
        Vec2::new(r, r * (p.y / p.x).atan() / FRAC_PI_4)
    } else if p.y != 0.0 {
        let r = r.copysign(p.y);
        Vec2::new(r * (p.x / p.y).atan() / FRAC_PI_4, r)
    } else {
        Vec2::ZERO
    };
    to_square(0.5 * (q + Vec2::ONE))
}

/// Direction of the hemisphere around +z with density cos/pi. z is above 0 for u in [0,1)^2.
pub fn sample_cosine_hemisphere(u: Vec2) -> Vec3 {
    let p = sample_disk(u);
    // On the rim z would be 0 and the density too; the smallest step inside keeps weights finite.
    let z = (1.0 - p.length_squared()).max(f32::MIN_POSITIVE).sqrt();
    p.extend(z)
}

/// Density of [`sample_cosine_hemisphere`] per solid angle of the unit vector `w`.
pub fn pdf_cosine_hemisphere(w: Vec3) -> f32 {
    w.z.max(0.0) * FRAC_1_PI
}

/// The numbers that [`sample_cosine_hemisphere`] maps to the unit vector `w`.
pub fn invert_cosine_hemisphere(w: Vec3) -> Vec2 {
    invert_disk(w.truncate())
}

/// Uniform direction of the whole sphere; u.x = 0 is +z.
pub fn sample_sphere(u: Vec2) -> Vec3 {
    // 1 - z = 2 u.x, sin^2 = (1 - z)(1 + z): no cancellation near the poles.
    let sin = 2.0 * (u.x * (1.0 - u.x)).max(0.0).sqrt();
    let (s, c) = (TAU * u.y).sin_cos();
    Vec3::new(sin * c, sin * s, 1.0 - 2.0 * u.x)
}

/// Density of [`sample_sphere`] per solid angle: 1/(4 pi).
pub fn pdf_sphere() -> f32 {
    0.25 * FRAC_1_PI
}

/// The numbers that [`sample_sphere`] maps to the unit vector `w`.
pub fn invert_sphere(w: Vec3) -> Vec2 {
    to_square(Vec2::new(one_minus_z(w) * 0.5, turn(w)))
}

/// Uniform direction of the cone of half angle acos(1 - `one_minus_cos`) around +z; u.x = 0 is +z.
///
/// The cone is given by 1 - cos, in (0, 2], because narrow cones lose all digits in cos itself.
pub fn sample_cone(u: Vec2, one_minus_cos: f32) -> Vec3 {
    let h = u.x * one_minus_cos;
    let sin = (h * (2.0 - h)).max(0.0).sqrt();
    let (s, c) = (TAU * u.y).sin_cos();
    Vec3::new(sin * c, sin * s, 1.0 - h)
}

/// Density of [`sample_cone`] per solid angle of directions inside the cone.
pub fn pdf_cone(one_minus_cos: f32) -> f32 {
    1.0 / (TAU * one_minus_cos)
}

/// The numbers that [`sample_cone`] maps to the unit vector `w` inside the cone.
pub fn invert_cone(w: Vec3, one_minus_cos: f32) -> Vec2 {
    to_square(Vec2::new(one_minus_z(w) / one_minus_cos, turn(w)))
}

/// Barycentrics of the second and third vertex of a uniform point of a triangle.
pub fn sample_triangle(u: Vec2) -> Vec2 {
    if u.x < u.y {
        let b = 0.5 * u.x;
        Vec2::new(b, u.y - b)
    } else {
        let c = 0.5 * u.y;
        Vec2::new(u.x - c, c)
    }
}

/// Density of [`sample_triangle`] per area of the plane of barycentrics (b, c): 2 inside, 0 outside. Divide by twice
/// the area of a triangle for the density per its own area.
pub fn pdf_triangle(b: Vec2) -> f32 {
    if b.min_element() >= 0.0 && b.x + b.y <= 1.0 { 2.0 } else { 0.0 }
}

/// The numbers that [`sample_triangle`] maps to the barycentrics `b`.
pub fn invert_triangle(b: Vec2) -> Vec2 {
    to_square(if b.x < b.y { Vec2::new(2.0 * b.x, b.x + b.y) } else { Vec2::new(b.x + b.y, 2.0 * b.y) })
}

/// 1 - z of a unit vector, without cancellation near +z.
fn one_minus_z(w: Vec3) -> f32 {
    if w.z > 0.0 { w.truncate().length_squared() / (1.0 + w.z) } else { 1.0 - w.z }
}

/// Azimuth over 2 pi, in [0, 1].
fn turn(w: Vec3) -> f32 {
    let a = w.y.atan2(w.x);
    (if a < 0.0 { a + 2.0 * PI } else { a }) / TAU
}

/// Rounding must not leave the unit square.
fn to_square(u: Vec2) -> Vec2 {
    u.clamp(Vec2::ZERO, Vec2::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::{hash, unit_f32};
    use crate::math::stats::{chi_square_p, sidak};

    const SAMPLES: usize = 200_000;
    const CELLS: usize = 20;

    fn numbers(seed: u64) -> impl Iterator<Item = Vec2> {
        (0..SAMPLES as u64).map(move |i| Vec2::new(unit_f32(hash(seed, 2 * i)), unit_f32(hash(seed, 2 * i + 1))))
    }

    /// Chi-square p-value of points in the box lo..hi against a density on it (midpoint rule, 8 x 8 per cell).
    fn fit(points: impl Iterator<Item = Vec2>, lo: Vec2, hi: Vec2, pdf: impl Fn(Vec2) -> f32) -> f64 {
        let mut observed = vec![0.0; CELLS * CELLS];
        for p in points {
            let q = ((p - lo) / (hi - lo) * CELLS as f32).floor();
            let [i, j] = [q.x, q.y].map(|c| (c.max(0.0) as usize).min(CELLS - 1));
            observed[j * CELLS + i] += 1.0;
        }
        let fine = 8 * CELLS;
        let step = (hi - lo) / fine as f32;
        let mut expected = vec![0.0; CELLS * CELLS];
        for j in 0..fine {
            for i in 0..fine {
                let p = lo + step * Vec2::new(i as f32 + 0.5, j as f32 + 0.5);
                expected[j / 8 * CELLS + i / 8] += (pdf(p) * step.x * step.y) as f64 * SAMPLES as f64;
            }
        }
        chi_square_p(&observed, &expected, 5.0)
    }

    /// Polar coordinates (r^2 or 1 - cos, azimuth): in them the area elements are constant.
    fn azimuth(p: Vec2) -> f32 {
        turn(p.extend(0.0))
    }

    #[test]
    fn samples_follow_their_densities_and_not_others() {
        let square = (Vec2::ZERO, Vec2::ONE);
        // dA = 1/2 d(r^2) da = pi d(r^2) d(turn); dw = 2 pi d(1 - cos) d(turn); family-wise significance 0.01.
        let polar = |p: Vec2| Vec2::new(p.length_squared(), azimuth(p));
        let at = |q: Vec2| q.x.sqrt() * Vec2::from_angle(TAU * q.y);
        let height = |w: Vec3| Vec2::new(1.0 - w.z, azimuth(w.truncate()));
        let cone = 0.3f32;
        let tests = [
            fit(numbers(1).map(|u| polar(sample_disk(u))), square.0, square.1, |q| PI * pdf_disk(at(q))),
            fit(numbers(2).map(|u| height(sample_cosine_hemisphere(u))), square.0, square.1, |q| {
                TAU * pdf_cosine_hemisphere(Vec3::new(0.0, 0.0, 1.0 - q.x))
            }),
            fit(numbers(3).map(|u| height(sample_sphere(u))), square.0, Vec2::new(2.0, 1.0), |_| TAU * pdf_sphere()),
            fit(numbers(4).map(|u| height(sample_cone(u, cone))), square.0, Vec2::new(cone, 1.0), |_| {
                TAU * pdf_cone(cone)
            }),
            // The triangle as a square, by shear: b = q.x (1 - c).
            fit(numbers(5).map(|u| shear(sample_triangle(u))), square.0, square.1, |q| {
                pdf_triangle(Vec2::new(q.x * (1.0 - q.y), q.y)) * (1.0 - q.y)
            }),
        ];
        let level = sidak(0.01, tests.len());
        assert!(tests.iter().all(|&p| p > level), "{tests:?}");

        // The companions: plausible mistakes must be noticed.
        let wrong = [
            // Radius uniform instead of its square.
            fit(numbers(6).map(|u| polar(u.x * Vec2::from_angle(TAU * u.y))), square.0, square.1, |q| {
                PI * pdf_disk(at(q))
            }),
            // Uniform hemisphere taken for the cosine one.
            fit(numbers(7).map(|u| height(sample_cone(u, 1.0))), square.0, square.1, |q| {
                TAU * pdf_cosine_hemisphere(Vec3::new(0.0, 0.0, 1.0 - q.x))
            }),
            // A cone three percent too wide.
            fit(numbers(8).map(|u| height(sample_cone(u, 1.03 * cone))), square.0, Vec2::new(cone, 1.0), |_| {
                TAU * pdf_cone(cone)
            }),
            // Triangle: barycentrics (u, v (1 - u)).
            fit(numbers(9).map(|u| shear(Vec2::new(u.x, u.y * (1.0 - u.x)))), square.0, square.1, |q| {
                pdf_triangle(Vec2::new(q.x * (1.0 - q.y), q.y)) * (1.0 - q.y)
            }),
        ];
        assert!(wrong.iter().all(|&p| p < 1e-6), "{wrong:?}");
    }

    /// The triangle b, c >= 0, b + c <= 1 as a square: (b / (1 - c), c).
    fn shear(b: Vec2) -> Vec2 {
        Vec2::new(b.x / (1.0 - b.y), b.y)
    }

    #[test]
    fn inverses_give_the_numbers_back() {
        for u in numbers(10).take(20_000) {
            let close = |v: Vec2, tolerance: f32| (v - u).abs().max_element() < tolerance;
            assert!(close(invert_disk(sample_disk(u)), 1e-5), "{u}");
            assert!(close(invert_cosine_hemisphere(sample_cosine_hemisphere(u)), 1e-5), "{u}");
            assert!(close(invert_sphere(sample_sphere(u)), 1e-5), "{u}");
            assert!(close(invert_triangle(sample_triangle(u)), 1e-5), "{u}");
            for cone in [2.0, 0.5, 1e-4, 1e-9] {
                assert!(close(invert_cone(sample_cone(u, cone), cone), 1e-5), "{u} {cone}");
            }
        }
    }

    #[test]
    fn corners_of_the_square_are_safe() {
        let last = 1.0f32.next_down();
        for x in [0.0, 0.5, last] {
            for y in [0.0, 0.5, last] {
                let u = Vec2::new(x, y);
                let w = sample_cosine_hemisphere(u);
                assert!(w.is_normalized() && w.z > 0.0 && pdf_cosine_hemisphere(w) > 0.0, "{u}");
                assert!(sample_disk(u).length() <= 1.0 + 1e-6);
                assert!(sample_sphere(u).is_normalized() && sample_cone(u, 1e-3).is_normalized());
                let b = sample_triangle(u);
                assert!(b.min_element() >= 0.0 && b.x + b.y <= 1.0, "{u} {b}");
                for v in [invert_disk(sample_disk(u)), invert_sphere(sample_sphere(u))] {
                    assert!(v.is_finite());
                }
            }
        }
        assert_eq!(sample_sphere(Vec2::ZERO), Vec3::Z);
    }
}
