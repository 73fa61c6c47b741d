//! Roulette of the residual with the best probability for the whole picture.
//!
//! u = min(1, t sqrt(R / (c_v lambda))),  R = E (v - q)^2 of the calibrated posterior, lambda = S / C of the picture (METHODS 1.B): what
//! [`ResidualRoulette::residual`] says for lights that are all looked at. Bias: none. Verified by `tests`.

use crate::math::{Prediction, Price, ResidualRoulette};

/// The rule for a tentative contribution `t` > 0.
pub fn roulette(t: f32, known: &Prediction, price: &Price) -> ResidualRoulette {
    ResidualRoulette::residual(t, 1.0, known, price)
}
