//! Where on a light photons start: the arrivals of a pass are told to the density of emission, for later passes.
//!
//! Before the first pass a *pilot* is traced, in rounds of as many photons as learn in a pass: without it the first pictures would be made of the
//! few photons that find a window by chance. Its photons teach and are thrown away, so that no photon decides about its own weight (METHODS
//! 3.B). It ends when enough of a round arrive, or after [`ROUNDS`]. Densities are renewed after pass 1, 2, 4, 8 ..., as weights of
//! lights are: pictures depend on nothing but passes. Bias: none.
//! Verified by the tests of `emission::learned` and those of this file.

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
const STREAM: u64 = 0x0070_696c_6f74; // "pilot"

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

/// Tells `density` what became of the photons of a pass, and to follow it if it is time to.
pub fn learn(traced: &Traced, density: &mut dyn EmissionDensity, pass: u64) {
    note(traced, 0, density, pass);
    if (pass + 1).is_power_of_two() {
        density.follow(pass + 1);
    }
}

/// `traced` are the photons of the pass from `first` on.
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

#[cfg(test)]
mod tests {
    use super::super::caustics::Caustics;
    use super::super::settings::{Emission, PhotonSettings};
    use crate::accel::Accel;
    use crate::formats::{LoadOptions, mitsuba_xml::load_text};
    use crate::math::Vec3;
    use crate::math::stats::z_test_p;
    use crate::scene::Scene;
    use crate::transport::World;
    use crate::transport::photon_map::Kernel;
    use std::path::Path;

    /// A box of walls 4 wide and deep with a glazed window, a glass ball on the floor before it, in an even sky.
    const ROOM: &str = r#"<scene version="3.0.0"><sensor type="perspective"/>
        <bsdf type="dielectric" id="glass"/>
        <bsdf type="thindielectric" id="pane"/>
        <bsdf type="diffuse" id="white"/>
        <shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="-90"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="2"/><rotate x="1" angle="90"/><translate y="3"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="2" y="1.5"/><translate y="1.5" z="-2"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="2" y="1.5"/><translate y="1.5" z="2"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="2" y="1.5"/><rotate y="1" angle="90"/><translate x="2" y="1.5"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="2" y="0.5"/><rotate y="1" angle="90"/><translate x="-2" y="0.5"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="2" y="0.5"/><rotate y="1" angle="90"/><translate x="-2" y="2.5"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="0.7" y="0.5"/><rotate y="1" angle="90"/><translate x="-2" y="1.5" z="1.3"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="0.7" y="0.5"/><rotate y="1" angle="90"/><translate x="-2" y="1.5" z="-1.3"/></transform><ref id="white"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale x="0.6" y="0.5"/><rotate y="1" angle="90"/><translate x="-2" y="1.5"/></transform><ref id="pane"/></shape>
        <shape type="sphere"><point name="center" x="0" y="0.5" z="0"/><float name="radius" value="0.4"/><ref id="glass"/></shape>
        <emitter type="constant"><rgb name="radiance" value="1"/></emitter></scene>"#;

    /// Of some passes: photons stored in each and emitted in all, and the flux that arrives at places of the floor, mean over passes.
    fn passes(emission: Emission, photons: u64, passes: u64, seed: u64) -> (Vec<usize>, u64, Vec<f32>) {
        let description = load_text(Path::new("room"), ROOM, &LoadOptions::default()).unwrap().description;
        let scene = Scene::new(description).unwrap();
        let accel = Accel::new(&scene.shapes);
        let kernel = Kernel::Fixed { radius: Some(0.25) };
        let settings = PhotonSettings { emission, caustic_photons: Some(photons), kernel, seed, ..Default::default() };
        let mut caustics = Caustics::new(World::new(&scene, &accel), &settings, 1).unwrap();
        let (mut stored, mut light) = (Vec::new(), vec![0.0; 36]);
        for pass in 0..passes {
            let map = caustics.map(pass);
            stored.push(map.stored());
            for (i, sum) in light.iter_mut().enumerate() {
                let p = Vec3::new((i % 6) as f32 * 0.5 - 1.25, 0.0, (i / 6) as f32 * 0.5 - 1.25);
                *sum += map.irradiance(p, Vec3::Y).x / passes as f32;
            }
        }
        (stored, caustics.emitted(), light)
    }

    #[test]
    fn photons_that_learn_agree_with_uniform_ones_and_more_of_them_arrive() {
        let runs = |emission, photons, seeds: std::ops::Range<u64>| -> Vec<_> {
            seeds.map(|seed| passes(emission, photons, 4, seed)).collect()
        };
        let (learned, plain) = (runs(Emission::Adaptive, 4000, 0..24), runs(Emission::Uniform, 32_000, 100..124));
        // Means and variances of the sum over all places.
        let moments = |runs: &[(Vec<usize>, u64, Vec<f32>)]| {
            let sums: Vec<f64> = runs.iter().map(|r| r.2.iter().map(|x| f64::from(*x)).sum()).collect();
            let mean = sums.iter().sum::<f64>() / sums.len() as f64;
            (mean, sums.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (sums.len() - 1) as f64)
        };
        let (a, b) = (moments(&learned), moments(&plain));
        let variance = a.1 / learned.len() as f64 + b.1 / plain.len() as f64;
        println!("{a:?} {b:?} {:?} {:?}", learned[0], plain[0]);
        assert!(z_test_p(a.0 - b.0, variance, 0.0) > 0.01, "{a:?} {b:?}");
        // Companion: 10 % too much is seen.
        assert!(z_test_p(1.1 * a.0 - b.0, variance, 0.0) < 1e-3, "{a:?} {b:?}");
        // The pilot has taught the first pass, and is counted.
        let share = |runs: &[(Vec<usize>, u64, Vec<f32>)], n: f64, pass: usize| {
            runs.iter().map(|r| r.0[pass] as f64 / n).sum::<f64>() / runs.len() as f64
        };
        let [first, last, natural] = [share(&learned, 4e3, 0), share(&learned, 4e3, 3), share(&plain, 32e3, 0)];
        assert!(first > 4.0 * natural && last > first, "{first} {last} {natural}");
        assert!((20_000..=28_000).contains(&learned[0].1), "{}", learned[0].1);
        assert_eq!(plain[0].1, 4 * 32_000);
    }

    #[test]
    fn what_is_learned_does_not_depend_on_threads() {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| passes(Emission::Adaptive, 9000, 3, 5))
        };
        let one = run(1);
        assert_eq!(one, run(2));
        assert_eq!(one, run(5));
        assert_ne!(one.2, passes(Emission::Adaptive, 9000, 3, 6).2, "another seed is seen");
    }
}
