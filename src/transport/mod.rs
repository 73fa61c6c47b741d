//! Light transport: what integrators are made of.
//!
//! * [`World`]: a scene with its acceleration structure, and what every walk asks of the two

mod world;

pub use world::{MAX_PASSED_SURFACES, Through, World, power_heuristic};
