//! Reflectance of boundaries: dielectric and conductor, unpolarised.
//!
//! Source: Born & Wolf, "Principles of Optics", 1.5.2 (dielectrics) and 14.2 (conductors).
//! Everything is a function of the cosine on the incident side; nothing here knows directions.

use crate::math::Rgb;

/// Share of light reflected at a dielectric boundary, and the cosine of the refracted direction (0 with total internal
/// reflection). `cos_i` in [0, 1] on the incident side, `eta` = index of the other side over that of the incident side.
pub fn dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_i * cos_i).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let denom_s = cos_i + eta * cos_t;
    let denom_p = eta * cos_i + cos_t;
    if denom_s <= 0.0 || denom_p <= 0.0 {
        return (1.0, cos_t);
    }
    let r_s = (cos_i - eta * cos_t) / denom_s;
    let r_p = (eta * cos_i - cos_t) / denom_p;
    (0.5 * (r_s * r_s + r_p * r_p), cos_t)
}

/// Share of light reflected by a conductor of the complex index `eta + i k` (relative to the outside), per channel.
pub fn conductor(cos_i: f32, eta: Rgb, k: Rgb) -> Rgb {
    let cos2 = cos_i * cos_i;
    let sin2 = (1.0 - cos2).max(0.0);
    let t0 = eta * eta - k * k - Rgb::splat(sin2);
    let a2_b2 = (t0 * t0 + 4.0 * (eta * eta) * (k * k)).map(f32::sqrt);
    let a = (0.5 * (a2_b2 + t0)).max(Rgb::ZERO).map(f32::sqrt);
    let t1 = a2_b2 + Rgb::splat(cos2);
    let t2 = 2.0 * cos_i * a;
    let t3 = cos2 * a2_b2 + Rgb::splat(sin2 * sin2);
    let t4 = sin2 * t2;
    let r_s = ratio(t1 - t2, t1 + t2);
    let r_p = r_s * ratio(t3 - t4, t3 + t4);
    (0.5 * (r_s + r_p)).clamp(Rgb::ZERO, Rgb::ONE)
}

/// `a / b` per channel, 1 where `b` vanishes (grazing incidence: everything is reflected).
fn ratio(a: Rgb, b: Rgb) -> Rgb {
    let one = |a: f32, b: f32| if b > 0.0 { a / b } else { 1.0 };
    Rgb::new(one(a.x, b.x), one(a.y, b.y), one(a.z, b.z))
}

/// Reflectance of a dielectric boundary averaged over cosine-distributed directions: 2 int_0^1 F(mu, eta) mu dmu.
///
/// Polynomial fits, as Mitsuba uses them so that plastics agree: Egan & Hilgeman 1973 for `eta` < 1, d'Eon & Irving 2011
/// for `eta` > 1 (absolute error below 0.01 for indices between 1/2.5 and 2.5).
pub fn diffuse_reflectance(eta: f32) -> f32 {
    let inv = 1.0 / eta;
    let fit = if eta < 1.0 {
        -1.4399 * eta * eta + 0.7099 * eta + 0.6681 + 0.0636 * inv
    } else {
        0.919317 + inv * (-3.4793 + inv * (6.75335 + inv * (-7.80989 + inv * (4.98554 - 1.36881 * inv))))
    };
    fit.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_has_its_closed_form() {
        for eta in [0.5f32, 0.8, 1.0, 1.5, 2.4] {
            let r = ((eta - 1.0) / (eta + 1.0)).powi(2);
            assert!((dielectric(1.0, eta).0 - r).abs() < 1e-6);
            let c = conductor(1.0, Rgb::splat(eta), Rgb::splat(3.0)).x;
            let expected = ((eta - 1.0).powi(2) + 9.0) / ((eta + 1.0).powi(2) + 9.0);
            assert!((c - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn brewster_angle_total_reflection_and_mirror() {
        // At tan(theta) = eta only one polarisation is reflected: F = ((1 - eta^2) / (1 + eta^2))^2 / 2.
        let eta = 1.5f32;
        let (f, _) = dielectric((1.0 / (1.0 + eta * eta)).sqrt(), eta);
        assert!((f - 0.5 * ((1.0 - eta * eta) / (1.0 + eta * eta)).powi(2)).abs() < 1e-6);
        assert_eq!(dielectric(0.5, 1.0 / 1.5), (1.0, 0.0));
        assert_eq!(dielectric(0.0, 1.5).0, 1.0);
        for cos in [0.0, 0.1, 0.7, 1.0] {
            assert!((conductor(cos, Rgb::ZERO, Rgb::ONE) - Rgb::ONE).length() < 1e-5, "a perfect mirror");
        }
    }

    #[test]
    fn a_conductor_that_absorbs_nothing_is_a_dielectric() {
        for eta in [1.2f32, 1.5, 2.0] {
            for i in 1..20 {
                let cos = i as f32 / 20.0;
                let c = conductor(cos, Rgb::splat(eta), Rgb::ZERO).x;
                assert!((c - dielectric(cos, eta).0).abs() < 1e-5, "{eta} {cos}");
            }
        }
    }

    #[test]
    fn the_refracted_cosine_obeys_snell_and_reflectance_is_the_same_from_both_sides() {
        for i in 1..20 {
            let cos = i as f32 / 20.0;
            let (f, cos_t) = dielectric(cos, 1.5);
            assert!(((1.0 - cos * cos) - 2.25 * (1.0 - cos_t * cos_t)).abs() < 1e-5);
            assert!((dielectric(cos_t, 1.0 / 1.5).0 - f).abs() < 1e-4);
        }
    }

    #[test]
    fn the_diffuse_fit_is_near_the_integral() {
        for eta in [0.4f32, 0.5, 0.67, 0.8, 1.2, 1.5, 2.0, 2.5] {
            let n = 10_000;
            let integral: f64 = (0..n)
                .map(|i| {
                    let mu = (i as f32 + 0.5) / n as f32;
                    2.0 * (mu * dielectric(mu, eta).0) as f64 / n as f64
                })
                .sum();
            let fit = diffuse_reflectance(eta);
            assert!((integral - fit as f64).abs() < 0.01, "{eta}: {integral} {fit}");
        }
    }
}
