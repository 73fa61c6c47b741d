//! Which lights photons leave from: those whose photons have arrived where they are wanted.
//!
//! ```text
//! n_l  ~  sqrt(S_l F_l)       F_l: flux that light l has emitted, S_l: flux of its photons that was stored
//! ```
//!
//! A photon of light l carries F_l / n_l, so what the light adds to the sum of squared errors goes with S_l F_l / n_l; for a given
//! number of photons the sum over all lights is least for this choice (Neyman 1934). With nothing lost it is the choice by power; a
//! light that achieves nothing keeps the floor that every density has ([`EmissionDensity::set_light_weights`]).
//! Sums over passes are taken in order and weights are renewed after pass 1, 2, 4, 8 ...: pictures depend on nothing but passes.
//! Bias: none; a pass is drawn from weights that earlier passes made. Not handled: whether the eye sees what is lit.
//! Verified by the tests of [`super::caustics`].

use crate::emission::EmissionDensity;
use crate::transport::photon::{Ledger, PhotonClass};

/// What the lights' photons have achieved.
#[derive(Clone, Debug, Default)]
pub struct LearnedLights {
    /// Flux emitted and stored by each light, mean of the channels.
    flux: Vec<[f64; 2]>,
}

impl LearnedLights {
    /// Takes note of pass `pass`, whose photons of `class` were wanted, and tells `density` if it is time to.
    pub fn learn(&mut self, pass: u64, ledger: &Ledger, class: PhotonClass, density: &mut dyn EmissionDensity) {
        self.flux.resize(ledger.lights.len(), [0.0; 2]);
        for (sum, light) in self.flux.iter_mut().zip(&ledger.lights) {
            sum[0] += light.emitted.element_sum() / 3.0;
            sum[1] += light.stored_flux[class as usize].element_sum() / 3.0;
        }
        if self.flux.len() > 1 && (pass + 1).is_power_of_two() {
            let weights: Vec<f32> = self.flux.iter().map(|[f, s]| (f * s).sqrt() as f32).collect();
            density.set_light_weights(&weights, pass + 1);
        }
    }
}
