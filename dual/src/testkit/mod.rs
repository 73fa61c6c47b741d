//! Test kit.

mod rng;
pub use rng::Rng;
