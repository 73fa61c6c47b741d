//! Light transport: what integrators are made of.
//!
//! * [`World`]: a scene with its acceleration structure, and what every walk asks of the two
//! * [`direct`]: light that comes straight from emitters; [`light_tree`]: one of many lights

pub mod direct;
pub mod light_tree;
mod world;

pub use world::{MAX_PASSED_SURFACES, Through, World, power_heuristic};
