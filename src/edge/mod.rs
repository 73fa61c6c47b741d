//! Edges in footprints: does anything visible change among the rays of a pixel, towards a light, in a cell of a light's emission?
//!
//! ```text
//! family -> View (exact) ----> walk -> Surfaces -> Detection -> Verdict, LightVerdict
//!        \-> dual rays -------> walk with widened rays -> predicted edges -> Verdict
//! ```
//!
//! * [`view`]: a family as a projection; [`pixel`], [`light`], [`emission`]: the families
//! * `gather`, `polygon`, `curved`, `outline`, [`chord`]: what reaches a footprint, and which of an edge is left when surfaces are taken away
//! * [`detector`], `detect`, `swaps`, `ends`: `any` and `all` queries; [`kinds`]: what they answer
//! * [`mod@highlight`]: where a light leaves a glossy lobe
//! * [`predicted`], `bundle`, `feet`, `beam`, `lens`, `mesh_edge`, `clear_lens`, `confirmed`, [`chain`], [`main_chain`]: origins that move: lenses, mirrors, glass; [`surface`]: where a ray with derivatives meets a surface
//! * [`oracle`], [`score`]: brute force, and the detector held against it
//! * [`mod@map`], [`unrolled`]: maps of pixels, of a light, of emission
//!
//! Source: DESIGN.md section 1, METHODS.md 3.B; Namae and Makino for the corner test. Exact to rounding for polygons and quadrics where the
//! origin or the direction is fixed.
//! Not handled: caustic folds, depth swaps of a mesh with itself at a shared corner.
mod beam;
mod bundle;
pub mod chain;
pub mod chord;
mod clear_lens;
mod confirmed;
mod curved;
mod detect;
pub mod detector;
pub mod emission;
mod ends;
mod feet;
mod gather;
pub mod hard_shadow;
pub mod highlight;
pub mod kinds;
mod lampless;
mod lens;
pub mod light;
mod linear;
pub mod main_chain;
pub mod map;
mod mesh_edge;
pub mod oracle;
mod outline;
pub mod pixel;
mod polygon;
pub mod predicted;
pub mod score;
pub mod surface;
mod swaps;
pub mod unrolled;
pub mod view;

pub use detect::NOTHING;
#[cfg(test)]
mod tests;

pub use detector::{EdgeDetector, Settings};
pub use gather::Facet;
pub use kinds::{Events, Kinds, LightVerdict, Verdict};
pub use linear::Linear;
pub use view::View;
