//! Uniform emission: every light's photons in natural density, in proportion to flux.
//!
//! ```text
//! photon j of n_s in the position stratum s of a light:   flux = share_s x value / pdf / n_s
//! ```
//!
//! `value / pdf` is the light's power (see [`Source`]), so the sum is exact but for textures, maps and lights too faint for a photon of
//! their own. Numbers are independent, or an Owen-scrambled Sobol sequence per stratum that goes on from pass to pass (its first two
//! dimensions, a (0,2)-sequence, are the direction; position strata as in [`super::allocate`]).
//! Spread: a photon stands for 1 / n of its light; its cell has the width of the position stratum and 1 / sqrt(n_s) in both numbers of the
//! direction. Where a stratum covers several triangles, its position is taken for a square of the same area in the plane of
//! the photon's triangle.
//! Bias: none. Source: Owen-Sobol points after Burley 2020 (`math::Sampler`). Verified by `tests/flux.rs`.

use super::allocate::{
    Allocation, PositionStratum, apportion, balanced_strata, light_weights, position_strata, powers,
};
use super::source::{Kind, Source, Start};
use super::{EmissionDensity, EmittedRay, MOST_PARAMETERS};
use crate::math::sampler::{hash, unit_f64};
use crate::math::{DVec3, Sampler};
use crate::scene::Scene;

/// How numbers are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sequence {
    /// Independently.
    Random,
    /// Owen-scrambled Sobol points, stratified over positions as well.
    OwenSobol,
}

/// Natural density over all lights, by power.
#[derive(Clone, Debug)]
pub struct Uniform<'a> {
    scene: &'a Scene,
    sources: Vec<Source<'a>>,
    n: usize,
    sequence: Sequence,
    seed: u64,
    allocation: Allocation,
    strata: Vec<Stratum>,
}

/// Photons `first..first + count` of a pass.
#[derive(Clone, Copy, Debug)]
struct Stratum {
    light: u32,
    position: PositionStratum,
    first: usize,
    count: usize,
    /// Width in the numbers of a position that stands for several triangles: sqrt(area) of a stratum, else 0.
    patch: f64,
}

/// Four numbers in [0, 1) with 48 bits, of which the upper 24 may be those of a sequence.
pub(super) fn numbers(sequence: Sequence, seed: u64, stream: u64, index: u64) -> [f64; 4] {
    let key = hash(hash(seed, stream), index);
    let word = |k: u64| unit_f64(hash(key, k));
    match sequence {
        Sequence::Random => [word(1), word(2), word(3), word(4)],
        Sequence::OwenSobol => {
            let s = Sampler::new(seed, stream, index).next_4d();
            // Large meshes need more bits than a float has to find their triangles.
            std::array::from_fn(|k| f64::from(s[k]) + word(k as u64) * 2f64.powi(-24))
        }
    }
}

/// Derivatives by half a cell of widths `width` in the numbers, the position replaced by a square of side `patch` if that is not 0.
pub(super) fn spread(start: &Start, width: [f64; MOST_PARAMETERS], patch: f64) -> super::Spread {
    let mut start = *start;
    if patch > 0.0 {
        let u = start.o_u[0].normalize_or(DVec3::X);
        let v = (start.o_u[1] - u * u.dot(start.o_u[1])).normalize_or(DVec3::ZERO);
        let scale = |v: DVec3, width: f64| v * (patch / width);
        start.o_u[0] = scale(u, width[0]);
        start.o_u[1] = scale(v, width[1]);
        start.d_u[0] = DVec3::ZERO;
        start.d_u[1] = DVec3::ZERO;
    }
    start.spread(width.map(|w| 0.5 * w))
}

impl<'a> Uniform<'a> {
    /// About `n` photons a pass (one more where lights are too faint for one of their own).
    pub fn new(scene: &'a Scene, n: usize, sequence: Sequence, seed: u64) -> Self {
        let mut uniform = Uniform::with(scene, Source::all(scene), sequence, seed);
        uniform.n = n;
        uniform.set_allocation(Allocation::new(&light_weights(powers(scene), None), n));
        uniform
    }

    /// No photons yet; sources in the order of the lights.
    pub(super) fn with(scene: &'a Scene, sources: Vec<Source<'a>>, sequence: Sequence, seed: u64) -> Self {
        Uniform { scene, sources, n: 0, sequence, seed, allocation: Allocation::default(), strata: Vec::new() }
    }

    /// What photons of each light have achieved, in any unit, one number per light of `Lights::infos`: nine tenths of the photons follow
    /// it, the rest power. To be called between passes only, at fixed ones.
    pub fn set_light_weights(&mut self, learned: &[f32]) {
        self.renew_numbers();
        self.set_allocation(Allocation::new(&light_weights(powers(self.scene), Some(learned)), self.n));
    }

    /// Other numbers from here on: with other counts a sequence that goes on from pass to pass would repeat itself.
    pub(super) fn renew_numbers(&mut self) {
        self.seed = hash(self.seed, 1);
    }

    /// Photons of each light.
    pub(super) fn set_allocation(&mut self, allocation: Allocation) {
        self.allocation = allocation;
        // Typical distance of what is lit.
        let distance = f64::from(self.scene.bounds.1);
        self.strata.clear();
        let mut first = 0;
        for (light, &count) in self.allocation.counts.iter().enumerate().filter(|(_, c)| **c > 0) {
            let source = &self.sources[light];
            let positions = match self.sequence {
                Sequence::Random => vec![PositionStratum::ALL],
                Sequence::OwenSobol => position_strata(source, count, distance),
            };
            let shares: Vec<f64> = positions.iter().map(PositionStratum::share).collect();
            let k = match self.sequence {
                Sequence::Random => balanced_strata(source, count, distance),
                Sequence::OwenSobol => positions.len() as f64,
            };
            let several = matches!(&source.kind, Kind::Lamp(lamp) if k < (lamp.cdf.len() - 1) as f64);
            let patch = if several { (source.area() / k).sqrt() } else { 0.0 };
            for (position, count) in positions.iter().zip(apportion(&shares, count)) {
                self.strata.push(Stratum { light: light as u32, position: *position, first, count, patch });
                first += count;
            }
        }
    }

    /// Light number `light`.
    pub(super) fn source(&self, light: u32) -> &Source<'a> {
        &self.sources[light as usize]
    }

    /// Strata of a pass without those of the tail.
    pub fn strata_count(&self) -> usize {
        self.strata.len()
    }

    /// Photons of the light, without those of the tail.
    pub fn light_count(&self, light: usize) -> usize {
        self.allocation.counts[light]
    }

    fn tail(&self, j: usize, pass: u64) -> Option<EmittedRay> {
        let n = self.allocation.tail;
        let stream = u64::MAX;
        let index = pass * n as u64 + j as u64;
        let [jitter, ..] = numbers(Sequence::Random, self.seed, stream, index);
        let (light, p) = self.allocation.tail_light((j as f64 + jitter) / n as f64);
        let source = &self.sources[light as usize];
        let v = numbers(self.sequence, self.seed, stream - 1, index);
        let (start, flux) = source.emit([v[2], v[3], v[0], v[1]])?;
        // Less than a photon each: it stands for all of the light, and for others.
        Some(EmittedRay {
            o: start.o,
            d: start.d.as_vec3(),
            flux: flux / (p * n as f64) as f32,
            light,
            stratum: self.strata.len() as u32,
            spread: start.spread([0.5; 4]),
        })
    }

    /// Widths of a photon's cell in the numbers.
    fn width(&self, s: &Stratum, source: &Source) -> [f64; MOST_PARAMETERS] {
        let n = s.count as f64;
        let [a, b] = [0, 1].map(|k| s.position.hi[k] - s.position.lo[k]);
        match (source.has_position(), source.has_direction(), self.sequence) {
            (true, true, Sequence::OwenSobol) => [a, b, n.sqrt().recip(), n.sqrt().recip()],
            (true, true, Sequence::Random) => {
                // The same cells, though nobody keeps to them.
                let k = balanced_strata(source, s.count, f64::from(self.scene.bounds.1));
                let (a, b) = (k.sqrt().recip(), (n / k).sqrt().recip());
                [a, a, b, b]
            }
            (true, false, _) => [n.sqrt().recip(), n.sqrt().recip(), 0.0, 0.0],
            (false, _, _) => [0.0, 0.0, n.sqrt().recip(), n.sqrt().recip()],
        }
    }
}

impl EmissionDensity for Uniform<'_> {
    fn set_light_weights(&mut self, learned: &[f32], _: u64) {
        Uniform::set_light_weights(self, learned);
    }

    fn count(&self) -> usize {
        self.allocation.total()
    }

    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let stratum = self.strata.partition_point(|s| s.first <= index).checked_sub(1);
        let (stratum, s) = match stratum.map(|k| (k, &self.strata[k])) {
            Some((k, s)) if index < s.first + s.count => (k, s),
            _ => {
                let tail_first = self.strata.last().map_or(0, |s| s.first + s.count);
                return (index < self.count()).then(|| self.tail(index - tail_first, pass)).flatten();
            }
        };
        let source = &self.sources[s.light as usize];
        let j = pass * s.count as u64 + (index - s.first) as u64;
        let v = numbers(self.sequence, self.seed, stratum as u64, j);
        let (position, direction) =
            if source.has_direction() { ([v[2], v[3]], [v[0], v[1]]) } else { ([v[0], v[1]], [0.5; 2]) };
        let u = s.position.at(position);
        let (start, flux) = source.emit([u[0], u[1], direction[0], direction[1]])?;
        let share = s.position.share() / s.count as f64;
        Some(EmittedRay {
            o: start.o,
            d: start.d.as_vec3(),
            flux: flux * share as f32,
            light: s.light,
            stratum: stratum as u32,
            spread: spread(&start, self.width(s, source), s.patch),
        })
    }
}
