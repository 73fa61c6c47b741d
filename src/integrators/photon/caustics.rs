//! Caustic photons of each pass: where they start, how many there are.

use super::FULL_SAMPLES;
use super::caustic_count::Counts;
use super::learned_emission;
use super::learned_lights::LearnedLights;
use super::looks::Found;
use super::settings::{Antialiasing, Emission, PhotonSettings};
use crate::emission::{self, DensityMap, EdgeAdaptive, EmissionDensity, Sequence, Uniform};
use crate::scene::material::has_sharp_lobe;
use crate::transport::photon::{Photon, PhotonClass};
use crate::transport::photon_map::{Kernel, PhotonSettings as MapSettings};
use crate::transport::photon_walk::{Goal, trace};
use crate::transport::{CausticMap, NEARLY_SPECULAR_ALPHA, World};

/// Most photons of a pass, if nothing is said: as many as pixels, within these bounds.
const AUTOMATIC: [usize; 2] = [1 << 15, 1 << 18];

/// Camera samples of a pass for each pixel, as adaptive sampling takes them.
const ADAPTIVE_SAMPLES: f64 = 1.5;

/// Emission and kernels of caustic photons.
pub struct Caustics<'a> {
    world: World<'a>,
    density: Box<dyn EmissionDensity + 'a>,
    map: MapSettings,
    /// `None`: photons follow power.
    learned: Option<LearnedLights>,
    /// Photons emitted in all passes so far, those that only taught included.
    emitted: u64,
    /// Photons emitted in the present pass.
    present: usize,
    /// Numbers of photons that the picture decides; `None`: always the same.
    counts: Option<Counts>,
}

impl<'a> Caustics<'a> {
    /// As [`Self::new`], with as many photons in a pass as the samples of the picture are worth, where nothing is said of them. Few of them come first,
    /// if nothing but caustics is shown as well: kernels shrink from pass to pass, and more passes with fewer photons blur less.
    pub fn weighed(world: World<'a>, settings: &PhotonSettings, pixels: usize) -> Option<Self> {
        let footprints = matches!(settings.kernel, Kernel::Footprint { .. });
        let free = settings.caustic_photons.is_none() && settings.emission == Emission::Adaptive;
        if !(free && footprints) {
            return Self::new(world, settings, pixels);
        }
        let samples = match settings.antialiasing {
            Antialiasing::Off => 1.0,
            Antialiasing::Adaptive => ADAPTIVE_SAMPLES,
            Antialiasing::Full => f64::from(FULL_SAMPLES),
        };
        let counts = Counts::new(pixels.clamp(AUTOMATIC[0], AUTOMATIC[1]), samples * pixels as f64, pixels);
        Some(Caustics { counts: Some(counts), ..Self::with(world, settings, [counts.first(), counts.most()])? })
    }

    /// `None` where there can be no caustic, or none is to be shown: without lights or nearly specular surfaces.
    pub fn new(world: World<'a>, settings: &PhotonSettings, pixels: usize) -> Option<Self> {
        let n = settings.caustic_photons.map_or(pixels.clamp(AUTOMATIC[0], AUTOMATIC[1]), |n| n as usize);
        Self::with(world, settings, [n, n])
    }

    /// With so many photons in the first pass, and at most in later ones.
    fn with(world: World<'a>, settings: &PhotonSettings, [n, later]: [usize; 2]) -> Option<Self> {
        let scene = world.scene;
        let sharp = |id: u32| has_sharp_lobe(&scene.materials, id, NEARLY_SPECULAR_ALPHA);
        let deep_enough = settings.path.max_depth.is_none_or(|d| d > 2);
        if scene.lights.is_empty() || !deep_enough || !scene.shapes.iter().any(|s| sharp(s.material)) {
            return None;
        }
        let mut density: Box<dyn EmissionDensity> = match settings.emission {
            Emission::Uniform => Box::new(Uniform::new(scene, n, Sequence::Random, settings.seed)),
            Emission::Adaptive => {
                let wanted = |shape: u32| sharp(scene.shapes[shape as usize].material);
                let adaptive = emission::Settings {
                    interest: Some(&wanted),
                    later,
                    cut: settings.emission_cut,
                    linearity: settings.emission_linearity,
                    ..Default::default()
                };
                Box::new(EdgeAdaptive::new(scene, world.accel, n, &adaptive, settings.seed))
            }
        };
        let learned = (settings.emission == Emission::Adaptive).then(LearnedLights::default);
        let (map, mut emitted) = (settings.map(), 0);
        if learned.is_some() {
            emitted = learned_emission::pilot(world, density.as_mut(), &map.walk(Goal::Caustics));
        }
        Some(Caustics { world, density, map, learned, emitted, present: 0, counts: None })
    }

    /// Gets ready for pass `pass`. To be called for one after the other.
    pub fn begin(&mut self, pass: u64) {
        if let Some(n) = self.counts.as_ref().and_then(|counts| counts.changed_in(pass)) {
            self.density.set_count(n, pass);
        }
    }

    /// Whether the number of photons waits for [`Self::learn_counts`], behind pass 1.
    pub fn is_weighed(&self) -> bool {
        self.counts.is_some()
    }

    /// Takes note of what the maps of the first two passes tell.
    pub fn learn_counts(&mut self, found: Found) {
        if let Some(counts) = &mut self.counts {
            counts.learn(found, self.present);
        }
    }

    /// Photons emitted for all maps so far, those that only taught where to start included.
    pub fn emitted(&self) -> u64 {
        self.emitted
    }

    /// The photons that the map of a pass is made of, and nothing else of it.
    pub fn photons(&self, pass: u64) -> Vec<Photon> {
        trace(self.world, self.density.as_ref(), &self.map.walk(Goal::Caustics), pass).photons
    }

    /// Pictures of the emission of the first `most` lights that have a density of their own.
    pub fn densities(&self, size: usize, most: usize) -> Vec<DensityMap> {
        let lights = 0..self.world.scene.lights.infos.len() as u32;
        lights.filter_map(|light| self.density.density_map(light, size)).take(most).collect()
    }

    /// The photons of a pass; those of later ones leave the lights, and the parts of their emission, from which more of them have arrived.
    pub fn map(&mut self, pass: u64) -> CausticMap {
        let walk = self.map.walk(Goal::Caustics);
        let traced = trace(self.world, self.density.as_ref(), &walk, pass);
        self.present = self.density.count();
        self.emitted += self.present as u64;
        if let Some(learned) = &mut self.learned {
            learned_emission::learn(&traced, self.density.as_mut(), pass);
            learned.learn(pass, &traced.ledger, PhotonClass::Caustic, self.density.as_mut());
        }
        CausticMap::from_photons(self.world, traced, &self.map, pass)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Accel;
    use crate::formats::{LoadOptions, mitsuba_xml::load_text};
    use crate::math::Vec3;
    use crate::scene::Scene;
    use std::path::Path;

    /// A glass ball over a floor under one lamp; another one of the same power shines into a black ball, which the partition
    /// of its emission does not know to hide everything.
    const TWO_LAMPS: &str = r#"<scene version="3.0.0"><sensor type="perspective"/>
        <bsdf type="dielectric" id="glass"/>
        <bsdf type="diffuse" id="white"/>
        <bsdf type="diffuse" id="black"><rgb name="reflectance" value="0"/></bsdf>
        <shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate x="1" angle="-90"/></transform><ref id="white"/></shape>
        <shape type="sphere"><point name="center" x="0" y="0.5" z="0"/><float name="radius" value="0.4"/><ref id="glass"/></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="0.2"/><rotate x="1" angle="90"/><translate y="2"/></transform>
            <ref id="black"/><emitter type="area"><rgb name="radiance" value="10"/></emitter></shape>
        <shape type="rectangle"><transform name="to_world"><scale value="0.2"/><rotate x="1" angle="90"/><translate x="1.5" y="2"/></transform>
            <ref id="black"/><emitter type="area"><rgb name="radiance" value="10"/></emitter></shape>
        <shape type="sphere"><point name="center" x="1.5" y="2" z="0"/><float name="radius" value="0.5"/><ref id="black"/></shape>
        </scene>"#;

    /// Stored caustic photons of each pass, and the flux that arrives at places below the ball.
    fn passes(learning: bool, passes: u64, seed: u64) -> (Vec<usize>, Vec<f64>) {
        let description = load_text(Path::new("lamps"), TWO_LAMPS, &LoadOptions::default()).unwrap().description;
        let scene = Scene::new(description).unwrap();
        let accel = Accel::new(&scene.shapes);
        let kernel = Kernel::Fixed { radius: Some(0.1) };
        let settings = PhotonSettings { caustic_photons: Some(2000), kernel, seed, ..Default::default() };
        let mut caustics = Caustics::new(World::new(&scene, &accel), &settings, 1).unwrap();
        if !learning {
            caustics.learned = None;
        }
        let (mut stored, mut light) = (Vec::new(), vec![0.0; 25]);
        for pass in 0..passes {
            let map = caustics.map(pass);
            stored.push(map.stored());
            for (i, sum) in light.iter_mut().enumerate() {
                let p = Vec3::new((i % 5) as f32 * 0.1 - 0.2, 0.0, (i / 5) as f32 * 0.1 - 0.2);
                *sum += f64::from(map.irradiance(p, Vec3::Y).x) / passes as f64;
            }
        }
        (stored, light)
    }

    #[test]
    fn photons_leave_a_lamp_that_achieves_nothing() {
        let (learned, _) = passes(true, 5, 0);
        let (plain, _) = passes(false, 5, 0);
        assert_eq!(learned[0], plain[0], "nothing is known in the first pass");
        for pass in 1..5 {
            let gain = learned[pass] as f64 / plain[pass] as f64;
            // 1.4: the cells of the useless lamp keep a photon each, without which the estimate would be biased.
            assert!(gain > 1.3, "{pass}: {learned:?} {plain:?}");
        }
        // Without learning nothing changes from pass to pass: the test can tell.
        assert!(plain.windows(2).all(|w| (w[1] as f64 / w[0] as f64 - 1.0).abs() < 0.1), "{plain:?}");
    }

    #[test]
    fn what_is_learned_changes_noise_and_not_the_mean() {
        let runs = |learning: bool| -> Vec<Vec<f64>> { (0..16).map(|seed| passes(learning, 3, seed).1).collect() };
        let (learned, plain) = (runs(true), runs(false));
        let mean = |runs: &[Vec<f64>], i: usize| runs.iter().map(|r| r[i]).sum::<f64>() / runs.len() as f64;
        let variance = |runs: &[Vec<f64>]| -> f64 {
            let of_place = |i: usize| {
                let m = mean(runs, i);
                runs.iter().map(|r| (r[i] - m).powi(2)).sum::<f64>() / (runs.len() - 1) as f64
            };
            (0..25).map(of_place).sum()
        };
        let total = |runs: &[Vec<f64>]| (0..25).map(|i| mean(runs, i)).sum::<f64>();
        let (a, b) = (total(&learned), total(&plain));
        assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
        // Two of three passes have more photons that count.
        let (a, b) = (variance(&learned), variance(&plain));
        assert!(a < 0.85 * b, "variance {a} with, {b} without");
    }
}
