//! Where on a light photons start: the arrivals of a pass are told to the density of emission, for later passes.
//!
//! Before the first pass a *pilot* is traced, in rounds of as many photons as learn in a pass: without it the first pictures would be made of the
//! few photons that find a window by chance. Its photons teach and are thrown away, so that no photon decides about its own weight (METHODS
//! 3.B). It ends when enough of a round arrive, or after [`ROUNDS`]. Densities are renewed after pass 1, 2, 4, 8 ..., as weights of
//! lights are: pictures depend on nothing but passes. Bias: none.
//! Verified by the tests of `emission::learned` and those of [`super::caustics`].

use crate::emission::{Arrival, EmissionDensity, EmittedRay};
use crate::math::sampler::hash;
use crate::transport::World;
use crate::transport::photon_walk::{Traced, WalkSettings, trace};
use std::ops::Range;

/// Rounds of the pilot, at most.
const ROUNDS: u64 = 3;
/// Part of a round's photons whose arrival ends the pilot.
const ENOUGH: f64 = 0.1;
/// Separates the random numbers of the pilot from those of the passes.
const STREAM: u64 = 0x7069_6c6f_74; // "pilot"

/// Some photons of a density.
struct Part<'a> {
    density: &'a dyn EmissionDensity,
    range: Range<usize>,
}

impl EmissionDensity for Part<'_> {
    fn count(&self) -> usize {
        self.range.len()
    }

    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        self.density.emit(self.range.start + index, pass)
    }
}

/// Tells `density` what became of the photons of a pass, of which `traced` are those from `first` on, and to follow it if it is time to.
pub fn learn(traced: &Traced, first: usize, density: &mut dyn EmissionDensity, pass: u64) {
    note(traced, first, density, pass);
    if (pass + 1).is_power_of_two() {
        density.follow(pass + 1);
    }
}

fn note(traced: &Traced, first: usize, density: &mut dyn EmissionDensity, pass: u64) {
    let arrived = traced.photons.iter().zip(&traced.indices);
    let arrived = arrived.map(|(p, &i)| Arrival { index: first + i as usize, flux: p.flux.element_sum() / 3.0 });
    density.note(&arrived.collect::<Vec<_>>(), pass);
}

/// Traces the pilot; the number of its photons.
pub fn pilot(world: World, density: &mut dyn EmissionDensity, walk: &WalkSettings) -> u64 {
    let mut emitted = 0;
    for round in 0..ROUNDS {
        let range = density.learners();
        if range.is_empty() {
            break;
        }
        let first = range.start;
        let part = Part { density, range };
        let count = part.count();
        let walk = WalkSettings { seed: hash(walk.seed, STREAM + round), ..*walk };
        let traced = trace(world, &part, &walk, 0);
        emitted += count as u64;
        note(&traced, first, density, 0);
        density.follow(0);
        if traced.photons.len() as f64 >= ENOUGH * count as f64 {
            break;
        }
    }
    emitted
}
