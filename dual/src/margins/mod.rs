//! Margins: signed smooth functions of a ray that are zero exactly on an edge.
//!
//! Whether a *neighbour* of a ray sees something else is asked of a polynomial whose sign decides, never of the hit distance
//! or of a square root, whose derivatives blow up at a silhouette. All margins are homogeneous in the (unnormalised) direction.
//!
//! | edge | margin | degree in p, origin fixed | exact at order |
//! | --- | --- | --- | --- |
//! | triangle, rectangle edge | [`line()`]; clipped to the segment: [`Projector::clip`] | 1 | 1 |
//! | plane side, horizon, back face | [`facing`] | 1 | 1 |
//! | mesh silhouette, from one origin or many | [`is_silhouette`], [`may_be_silhouette`] | (decides, no expansion) | |
//! | sphere | [`sphere`] | 2 | 2 |
//! | disk; rim of a cylinder; circle of a sphere's silhouette | [`rim`] | 2 | 2 |
//! | open cylinder | [`cylinder`] and two [`rim`]s; clipped: [`cylinder_silhouette`] | 2 | 2 |
//! | spot cone, emission cone | [`cone`] | 2 | 2 |
//! | depth swap: two planes | [`swap`]; clipped: [`shared_segment`] | 1 | 1 |
//! | depth swap: plane and sphere, two spheres | [`rim`] of [`plane_sphere_circle`], [`sphere_sphere_circle`] | 2 | 2 |
//! | total internal reflection at a plane | [`total_reflection`] | 2 | 2 |
//! | highlight about a mirror direction | [`cone`] with [`phong_border`] | 2 | 2 |
//! | highlight of a half-vector lobe | [`half_vector`] with [`ggx_border`] | not polynomial | prediction |
//! | one plane hides another | [`inverse_depth`] | 1 | 1 |
//!
//! Quadratic margins also vanish on the mirror image behind the origin. Each such margin has a linear **guard** (second
//! column of its own docs) that is positive in front; [`crate::footprint::Guarded`] tests both.
//!
//! Where the origin moves with p (lenses, 4 parameters, chains through mirrors and glass) the expansions are predictions.
//!
//! Not here: caustic folds (sign of det J), which need the chain's second derivatives.

mod chord;
mod cone;
mod cylinder;
mod facing;
mod highlight;
mod line;
mod rim;
mod sphere;
mod swap;
mod tir;

pub use chord::{Chord, Projector, predicted_chord};
pub use cone::{cone, cone_guard};
pub use cylinder::{cylinder, cylinder_silhouette};
pub use facing::{facing, is_silhouette, may_be_silhouette};
pub use highlight::{ggx_border, half_vector, phong_border};
pub use line::{line, line_distance, polygon};
pub use rim::{rim, rim_guard};
pub use sphere::{sphere, sphere_distance, sphere_guard, sphere_silhouette};
pub use swap::{inverse_depth, plane_sphere_circle, shared_segment, sphere_sphere_circle, swap};
pub use tir::total_reflection;

#[cfg(test)]
mod tests;
