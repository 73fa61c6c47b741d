//! Emission: where photons start, how much flux they carry, and what part of the light's emission each one stands for.
//!
//! A light maps its primary-sample space, [0,1)^2 or [0,1)^4, to rays; natural density is in proportion to flux. Densities over that
//! space decide where photons go; the flux of each follows from them, so that the sum is the power of the lights whatever the density.

//!
//! * [`Source`]: one light as a map from its primary-sample space, with derivatives and inverse; `area`, `environment`, `delta`: the
//!   families of lights; `warp`: the maps they are made of
//! * `allocate`: photons per light, strata of positions
//! * [`Uniform`]: natural density
//! * `learned`, `arrival_tree`, `targets`: density that is learned from the photons of earlier passes, for lights that are not cut
//! * [`EdgeAdaptive`]: strata by the edges that a light sees; `chart`, `cell`: what they are cut from; `partition`, `cut`, `linearisation`: which
//!   are cut, and where; `interest`: which of them can make a caustic; [`DensityMap`]: a picture of it

mod allocate;
mod area;
mod arrival_tree;
mod cell;
mod chart;
mod cut;
mod delta;
mod density_map;
mod edge_adaptive;
mod environment;
mod interest;
mod learned;
mod linearisation;
mod partition;
mod source;
mod targets;
#[cfg(test)]
mod tests;
mod uniform;
mod warp;

pub use cell::Cell;
pub use cut::Cut;
pub use density_map::DensityMap;
pub use edge_adaptive::{EdgeAdaptive, LINEARITY, Settings, Summary};
pub use partition::Stratum;
pub use source::{Drawn, Source, Start};
pub use uniform::{Sequence, Uniform};
pub use warp::Mapped;

use crate::math::{Rgb, Vec3};
use std::ops::Range;

/// Parameters of the emission of one photon, at most: two of the position on a light, two of the direction.
pub const MOST_PARAMETERS: usize = 4;

/// Derivatives of a ray over the cell of primary-sample space that one photon stands for: parameter k runs over [-1, 1] across the cell,
/// whose measure is the photon's share of the power of all lights. Parameters beyond the light's own are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Derivatives of the origin.
    pub o: [Vec3; MOST_PARAMETERS],
    /// Derivatives of the direction, which is a unit vector at the centre.
    pub d: [Vec3; MOST_PARAMETERS],
}

/// A ray that leaves a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittedRay {
    /// Origin: robust for tracing (off the lamp's surface); for lights at infinity outside the scene.
    pub o: Vec3,
    /// Unit direction.
    pub d: Vec3,
    /// Power of the photon, W: the flux of its stratum over the number of photons there.
    pub flux: Rgb,
    /// The light, as an index into `Lights::infos`.
    pub light: u32,
    /// The stratum of the density.
    pub stratum: u32,
    /// The neighbourhood it stands for.
    pub spread: Spread,
}

/// A photon that got where it was wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Its index in the pass.
    pub index: usize,
    /// Power that it arrived with, mean of the channels, W.
    pub flux: f32,
}

/// A way to place photons. The photons of one pass, indices 0..count, together carry the power of all lights (in expectation, where a
/// count is random).
pub trait EmissionDensity: Sync {
    /// Photons of a pass.
    fn count(&self) -> usize;

    /// Photon `index` of pass `pass`: a pure function. `None` if it has no power (a dark texel, the back of a lamp).
    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay>;

    /// Shifts photons to the lights that have achieved more, from pass `pass` on: one number per light of `Lights::infos`, in any unit. To
    /// be called between passes only, at fixed ones. Densities that choose among no lights ignore it.
    fn set_light_weights(&mut self, learned: &[f32], pass: u64) {
        let _ = (learned, pass);
    }

    /// Photons of a pass whose fates teach where those of later passes should go: none if the density does not learn.
    fn learners(&self) -> Range<usize> {
        0..0
    }

    /// Takes note of what became of the [`Self::learners`] of pass `pass`, all of which were traced: `arrived` in order of their indices (others
    /// than learners are passed over). Changes nothing by itself.
    fn note(&mut self, arrived: &[Arrival], pass: u64) {
        let _ = (arrived, pass);
    }

    /// Follows what has been noted so far, from pass `pass` on. To be called between passes only, at fixed ones.
    fn follow(&mut self, pass: u64) {
        let _ = pass;
    }

    /// Gives a pass about `n` photons, from pass `pass` on. To be called between passes only, at fixed ones. Densities with a fixed number ignore it.
    fn set_count(&mut self, n: usize, pass: u64) {
        let _ = (n, pass);
    }

    /// A picture of the density of a light, faces of `size` x `size` pixels; `None` if it is the natural one.
    fn density_map(&self, light: u32, size: usize) -> Option<DensityMap> {
        let _ = (light, size);
        None
    }
}
