//! Discrete and piecewise-constant densities with their inverses.
//!
//! [`AliasTable`] picks one of many entries in constant time (light selection); [`Piecewise1`] and [`Piecewise2`]
//! are inverse-CDF samplers that keep the order of their input, so that stratified numbers stay stratified
//! (environment maps). Densities are read off the tables that sampling uses: what is drawn and what `pmf` says agree to
//! the rounding of one table entry.

mod alias;
mod piecewise;

pub use alias::AliasTable;
pub use piecewise::{Cell, Piecewise1, Piecewise2};
