//! Light culling against the number of lights, at one bound of the error: how many lights are met, how much noise there is.
//!
//! N point lights on the walls and the ceiling of a unit box, of exponentially distributed intensities with a fixed sum, light points of
//! the floor (the toy of METHODS.md, section 2). All numbers are measured, over the passes of the ranges' own sequence.

use crate::cli::Failure;
use crate::formats::{LoadOptions, mitsuba_xml::load_text};
use crate::math::sampler::{hash, unit_f32};
use crate::math::{DVec3, Rgb, Vec2, Vec3};
use crate::scene::Scene;
use crate::scene::description::LightDesc;
use crate::transport::light_cull::{CullingSettings, LightCulling, Reservoir};
use crate::transport::light_tree::{LightTree, LitPoint};
use cpu_time::ProcessTime;
use std::borrow::Cow;
use std::f64::consts::PI;
use std::path::Path;

/// Numbers of lights.
pub const COUNTS: [usize; 5] = [256, 1024, 4096, 16_384, 65_536];
/// Lights that survive on average among the most of them: sets the bound for all.
const SURVIVORS: f32 = 240.0;
/// Shaded points.
const POINTS: u64 = 64;
/// Passes that are measured.
const PASSES: u64 = 64;
/// Passes over which the deviation of single lights is measured, and number of lights.
const SINGLE: (u64, usize) = (512, 1024);

/// What culling does to so many lights.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Saturation {
    /// Number of lights.
    pub lights: usize,
    /// Leaves met at a point, mean.
    pub met: f64,
    /// Lights that survive at a point, mean: those that would get a shadow ray.
    pub survivors: f64,
    /// Standard deviation of a point's radiance from pass to pass, root mean square over the points.
    pub sigma: f64,
    /// What it may be at most: sqrt(2 epsilon L).
    pub sigma_bound: f64,
    /// Mean relative difference of the mean of all passes from the sum over all lights.
    pub mean_error: f64,
    /// CPU microseconds per point, culled.
    pub culled_us: f64,
    /// CPU microseconds per point for the sum over all lights.
    pub all_us: f64,
}

/// All that is found out.
pub struct Study {
    /// Against the number of lights.
    pub rows: Vec<Saturation>,
    /// Bound of the error.
    pub epsilon: f64,
    /// Largest standard deviation of a single light at a point over the bound.
    pub max_sigma_over_epsilon: f64,
}

fn scene(n: usize) -> Result<Scene, Failure> {
    let empty = r#"<scene version="3.0.0"><sensor type="perspective"/></scene>"#;
    let mut description = load_text(Path::new("box"), empty, &LoadOptions::default())?.description;
    for i in 0..n as u64 {
        let r = |k| f64::from(unit_f32(hash(0x5a7, 8 * i + k)));
        let (u, v) = (r(1), r(2));
        let position = match (r(3) * 5.0) as u32 {
            0 => DVec3::new(0.0, u, v),
            1 => DVec3::new(1.0, u, v),
            2 => DVec3::new(u, v, 0.0),
            3 => DVec3::new(u, v, 1.0),
            _ => DVec3::new(u, 1.0, v),
        };
        let intensity = Rgb::splat((-(1.0 - r(4)).max(1e-7).ln() / n as f64) as f32);
        description.lights.push(LightDesc::Point { position, intensity });
    }
    Ok(Scene::new(description)?)
}

fn points() -> Vec<LitPoint> {
    let r = |i: u64, k| unit_f32(hash(0x91, 8 * i + k));
    (0..POINTS).map(|i| LitPoint { p: Vec3::new(r(i, 1), 0.0, r(i, 2)), n: Some(Vec3::Y), matte: true }).collect()
}

/// Radiance of a white surface by one light, and its distance; `None` below the horizon.
fn radiance(scene: &Scene, e: u32, at: &LitPoint) -> Option<(f64, f32)> {
    let s = scene.lights.view(&scene.shapes, scene.textures(), e, at.p)?.sample(Vec2::ZERO)?;
    let cos = s.wi.dot(at.n?);
    (cos > 0.0).then(|| (f64::from(s.weight.x * cos) / PI, s.distance))
}

fn micros<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = ProcessTime::now();
    let result = work();
    (result, start.elapsed().as_secs_f64() * 1e6)
}

/// Measures everything.
pub fn study() -> Result<Study, Failure> {
    let at = points();
    let most = scene(COUNTS[COUNTS.len() - 1])?;
    let settings = CullingSettings { lights: SURVIVORS, reservoir: Reservoir::Weighted, ..CullingSettings::default() };
    let epsilon = LightCulling::new(Cow::Owned(LightTree::new(&most)), settings, &at, 1).error();
    let settings = CullingSettings { error: Some(epsilon), ..settings };
    let rows = COUNTS.iter().map(|&n| Ok(row(&scene(n)?, settings, &at))).collect::<Result<_, Failure>>()?;
    let max_sigma_over_epsilon = single(&scene(SINGLE.1)?, settings, &at) / f64::from(epsilon);
    Ok(Study { rows, epsilon: f64::from(epsilon), max_sigma_over_epsilon })
}

fn row(scene: &Scene, settings: CullingSettings, at: &[LitPoint]) -> Saturation {
    let n = scene.lights.emitter_count();
    let mut culling = LightCulling::new(Cow::Owned(LightTree::new(scene)), settings, &[], 1);
    let sum = |at: &LitPoint| (0..n as u32).filter_map(|e| radiance(scene, e, at)).map(|v| v.0).sum::<f64>();
    let (truth, all_us) = micros(|| at.iter().map(sum).collect::<Vec<f64>>());
    let mut moments = vec![[0.0f64; 2]; at.len()];
    let (mut met, mut survivors, mut culled_us) = (0u64, 0u64, 0.0);
    for pass in 0..PASSES {
        culling.set_pass(pass);
        let (counts, us) = micros(|| {
            let (mut met, mut survivors) = (0u64, 0u64);
            for (at, m) in at.iter().zip(&mut moments) {
                let mut v = 0.0;
                culling.for_each_met(at, |leaf| {
                    met += 1;
                    let Some((c, distance)) = radiance(scene, leaf.emitter, at) else { return };
                    if culling.survives(leaf.emitter, distance) {
                        survivors += 1;
                        v += c / f64::from(culling.survival_of(leaf.emitter, distance));
                    }
                });
                *m = [m[0] + v, m[1] + v * v];
            }
            (met, survivors)
        });
        (met, survivors, culled_us) = (met + counts.0, survivors + counts.1, culled_us + us);
    }
    let (passes, queries) = (PASSES as f64, (PASSES * at.len() as u64) as f64);
    let variance = |m: &[f64; 2]| (m[1] / passes - (m[0] / passes).powi(2)) * passes / (passes - 1.0);
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / at.len() as f64;
    Saturation {
        lights: n,
        met: met as f64 / queries,
        survivors: survivors as f64 / queries,
        sigma: mean(&mut moments.iter().map(variance)).sqrt(),
        sigma_bound: (2.0 * f64::from(culling.error()) * mean(&mut truth.iter().copied())).sqrt(),
        mean_error: mean(&mut moments.iter().zip(&truth).map(|(m, t)| m[0] / passes / t - 1.0)),
        culled_us: culled_us / queries,
        all_us: all_us / at.len() as f64,
    }
}

/// Largest standard deviation of a light at a point.
fn single(scene: &Scene, settings: CullingSettings, at: &[LitPoint]) -> f64 {
    let n = scene.lights.emitter_count();
    let mut culling = LightCulling::new(Cow::Owned(LightTree::new(scene)), settings, &[], 2);
    let known: Vec<Option<(f64, f32)>> =
        at.iter().flat_map(|at| (0..n as u32).map(move |e| radiance(scene, e, at))).collect();
    let mut survived = vec![0u32; known.len()];
    for pass in 0..SINGLE.0 {
        culling.set_pass(pass);
        for (k, count) in survived.iter_mut().enumerate() {
            let e = (k % n) as u32;
            *count += u32::from(known[k].is_some_and(|(_, distance)| culling.survives(e, distance)));
        }
    }
    // A light returns c / p where it survives, else 0.
    let deviation = |(k, &count): (usize, &u32)| {
        let (c, distance) = known[k]?;
        let value = c / f64::from(culling.survival_of((k % n) as u32, distance));
        let share = f64::from(count) / SINGLE.0 as f64;
        Some(value * (share * (1.0 - share)).sqrt())
    };
    survived.iter().enumerate().filter_map(deviation).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_noise_follow_the_bound() {
        let at = points();
        let few = scene(256).unwrap();
        let settings = CullingSettings { error: Some(0.004), ..CullingSettings::default() };
        let many = row(&scene(4096).unwrap(), settings, &at);
        let few = row(&few, settings, &at);
        for r in [few, many] {
            assert!(r.sigma < 1.05 * r.sigma_bound && r.mean_error.abs() < 0.02, "{r:?}");
            assert!(r.met >= r.survivors && r.survivors < 0.9 * r.lights as f64, "{r:?}");
        }
        // 16 times the lights, far from 16 times as many that survive.
        assert!(many.survivors < 3.0 * few.survivors, "{few:?} {many:?}");
        let single = single(&scene(256).unwrap(), settings, &at) / 0.004;
        assert!(single < 1.01 && single > 0.8, "{single}");
    }
}
