//! Veach's efficiency-optimised Russian roulette.
//!
//! ```text
//! u = min(1, t / delta),   delta = sqrt(sigma_0^2 / n_0),   n_0 = n_d / N + 1
//! ```
//!
//! Small contributions are rarely checked, whatever is known of their visibility. sigma_0^2 is the variance of t v over the lights, read from the cache
//! points (METHODS 1.B); n_0 counts rays per light, n_d of them from the eye.
//! Source: Veach 1997, section 10.4.1, as the baseline of Nabata et al. Bias: none; u is kept above [`LEAST_CHECK`].
//! Verified by `tests`: mean over all coin patterns.

use crate::math::ResidualRoulette;
use crate::math::residual_roulette::LEAST_CHECK;

/// The rule for a tentative contribution `t` > 0, with the variance `sigma2` over the lights and `n0` rays per light.
pub fn roulette(t: f32, sigma2: f32, n0: f32) -> ResidualRoulette {
    let u = t / (sigma2 / n0).sqrt();
    // Without variance (0, or nothing known) everything is checked.
    ResidualRoulette::plain(if u < 1.0 { u.max(LEAST_CHECK) } else { 1.0 })
}
