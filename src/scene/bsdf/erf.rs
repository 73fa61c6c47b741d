//! The error function and its inverse, in single precision, for the Beckmann distribution.
//!
//! Source: erf by Abramowitz & Stegun 7.1.26 (absolute error below 2e-7 with f32 rounding); its inverse by Giles 2012,
//! "Approximating the erfinv function", table 5 (relative error below 3e-7 in exact arithmetic).

/// erf(x).
pub fn erf(x: f32) -> f32 {
    let a = x.abs();
    let t = 1.0 / (1.0 + 0.327_591_1 * a);
    let poly =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (1.0 - poly * (-a * a).exp()).copysign(x)
}

/// The x with erf(x) = y, for y in (-1, 1); finite (about 4 in size) at the ends.
pub fn erf_inv(y: f32) -> f32 {
    // The largest f32 below 1: keeps the logarithm finite.
    let y = y.clamp(-1.0 + f32::EPSILON * 0.5, 1.0 - f32::EPSILON * 0.5);
    let w = -((1.0 - y) * (1.0 + y)).ln();
    let horner = |w: f32, c: [f32; 9]| c.iter().fold(0.0, |sum, &c| sum * w + c);
    let p = if w < 5.0 {
        let central = [
            2.810_226_36e-8,
            3.432_739_39e-7,
            -3.523_387_7e-6,
            -4.391_506_54e-6,
            2.185_808_7e-4,
            -1.253_725_03e-3,
            -4.177_681_64e-3,
            2.466_407_27e-1,
            1.501_409_41,
        ];
        horner(w - 2.5, central)
    } else {
        let tail = [
            -2.002_142_57e-4,
            1.009_505_58e-4,
            1.349_343_22e-3,
            -3.673_428_44e-3,
            5.739_507_73e-3,
            -7.622_461_3e-3,
            9.438_870_47e-3,
            1.001_674_06,
            2.832_976_82,
        ];
        horner(w.sqrt() - 3.0, tail)
    };
    p * y
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn erf_agrees_with_tables_and_quadrature() {
        for (x, y) in [(0.0, 0.0), (0.5, 0.520_499_88), (1.0, 0.842_700_79), (2.0, 0.995_322_27)] {
            assert!((erf(x) - y).abs() < 3e-7 && (erf(-x) + y).abs() < 3e-7, "{x}");
        }
        let mut sum = 0.0f64;
        for i in 0..3000 {
            let x = (i as f64 + 0.5) * 1e-3;
            sum += (-x * x).exp() * 1e-3 * 2.0 / std::f64::consts::PI.sqrt();
            let e = erf((i + 1) as f32 * 1e-3) as f64;
            assert!((e - sum).abs() < 5e-7, "{x}: {e} {sum}");
        }
    }

    #[test]
    fn inverse_undoes_erf() {
        for i in -999..1000 {
            let y = i as f32 / 1000.0;
            assert!((erf(erf_inv(y)) - y).abs() < 6e-7, "{y}");
        }
        for y in [-1.0, 1.0, 2.0] {
            assert!(erf_inv(y).is_finite() && erf_inv(y).abs() > 3.5);
        }
    }
}
