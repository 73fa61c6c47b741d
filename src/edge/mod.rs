//! Edges in footprints.
pub mod chord;
mod curved;
mod detect;
pub mod detector;
mod gather;
pub mod kinds;
pub mod light;
pub mod map;
pub mod oracle;
pub mod pixel;
mod polygon;
pub mod score;
pub mod view;

pub use detect::NOTHING;
pub use detector::{EdgeDetector, Settings};
pub use gather::Facet;
pub use kinds::{Events, Kinds, LightVerdict, Verdict};
pub use view::View;
