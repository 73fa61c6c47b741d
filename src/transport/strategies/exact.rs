//! Every virtual light with its shadow ray: the oracle of all other strategies.
//!
//! pi = 1, q = 0, u = 1: no chance. Only lights whose tentative contribution is above 0 are asked.

use crate::math::ResidualRoulette;

/// The rule.
pub fn roulette() -> ResidualRoulette {
    ResidualRoulette::EXACT
}
