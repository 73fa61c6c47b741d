//! Edges in footprints.
pub mod chain;
pub mod chord;
mod curved;
mod detect;
pub mod detector;
pub mod emission;
mod gather;
pub mod kinds;
pub mod light;
pub mod map;
pub mod oracle;
pub mod pixel;
mod polygon;
pub mod predicted;
pub mod score;
pub mod unrolled;
pub mod view;

pub use detect::NOTHING;
#[cfg(test)]
mod tests;

pub use detector::{EdgeDetector, Settings};
pub use gather::Facet;
pub use kinds::{Events, Kinds, LightVerdict, Verdict};
pub use view::View;
