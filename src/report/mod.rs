//! Reports of comparisons: statistics over independent runs, tables, plots, and one HTML file that needs no network.
//!
//! - [`ensemble`]: error, bias and variance apart, from independent pictures of one configuration
//! - [`curve`]: error against time, and the speed-up at equal error
//! - [`comparison`]: what was run, and the numbers that are reported of it
//! - [`table`]: tables as text and as HTML
//! - [`plot`]: log-log plots as SVG
//! - [`picture`]: pictures and false-colour maps as data within a page
//! - [`html`]: the page

pub mod comparison;
pub mod curve;
pub mod ensemble;
pub mod html;
pub mod picture;
pub mod plot;
pub mod table;
