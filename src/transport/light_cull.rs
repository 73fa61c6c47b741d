//! Stochastic light culling for path tracing: of many lights, only those whose random range holds the point.
//!
//! Estimates   sum_i c_i(x) by  1/k sum over k kept lights of  c(y) / (pdf(y) p(y) s),  y a point of the light
//! Survival    p(y) = min(1, r_t^2 / |x - y|^2), r_t^2 = I / (2 pi epsilon), I the largest radiant intensity: light i survives where
//!             xi_i < p, xi_i in [0, 1) one number per light and pass, the same at all points, so that it has one range
//!             r_i = r_t / sqrt(xi_i), and a sphere around its middle of radius R_i + r_i holds all points that it may reach
//! Sphere tree the nodes of the [`LightTree`] with one radius more, fitted anew bottom-up for every pass; leaves *met* at x are those whose
//!             sphere holds x and whose bounds can send light there; the roulette proper is at the sampled point y, with the same xi
//! Reservoir   `Weighted`: k draws with replacement among the leaves met, s = w / W, w = importance / p at the light's middle, W their
//!             sum; `Uniform`: k without replacement, s = min(1, k / n) / k, n leaves met
//! Density     per solid angle, for multiple importance sampling, given the ranges of all *other* lights: pdf(y) p(y) k w / (W_o + w), or
//!             pdf(y) p(y) min(1, k / (n_o + 1)); W_o, n_o without the light itself. Both techniques know it, so the weights add up to 1 for
//!             every realisation (METHODS.md 2.A)
//! Error       beyond r_t a light of point size returns 0 or c / p <= 2 epsilon (Lambert, albedo <= 1): its standard deviation is at most
//!             epsilon, in units of radiance and of the mean channel
//! xi          frac(xi_0 + pass x golden ratio): of low discrepancy from pass to pass, in whole numbers
//! Source      Tokuyoshi and Harada, "Stochastic Light Culling" (JCGT 2016) and their talk on path tracing; densities: METHODS.md seed 2
//! Bias        none. Errors of one pass are the same at neighbouring points: bands, until passes average them
//! Not handled lights at infinity, which have no range: they are drawn apart; range by the lobe of the material
//! Verified by `tests`: enumeration, z-tests, leaves met against brute force, weights, standard deviation

mod settings;
#[cfg(test)]
mod tests;

pub use settings::{CullingSettings, Reservoir};

use super::light_tree::node::{Child, Node, WIDTH};
use super::light_tree::{LightTree, LitPoint};
use crate::math::Sampler;
use crate::math::sampler::{hash, refine, unit_f32};
use crate::math::{Vec2, Vec3};
use crate::scene::{LightSample, Scene, SurfacePoint};
use arrayvec::ArrayVec;
use std::borrow::Cow;
use std::f32::consts::TAU;

/// Most lights that are kept at a point.
pub const MOST_KEPT: usize = 16;
/// Spheres are larger by this share, against rounding.
const MARGIN: f32 = 1e-5;
/// The golden ratio's fraction in units of 2^-32.
const GOLDEN: u64 = 0x9e37_79b9;
/// Stream of random numbers.
const XI: u64 = 0xc11;

/// The lights of a scene with ranges for one pass.
#[derive(Clone, Debug)]
pub struct LightCulling<'a> {
    tree: Cow<'a, LightTree>,
    settings: CullingSettings,
    /// r_t^2 over intensity: 1 / (2 pi epsilon).
    scale: f32,
    /// Threshold of each emitter in this pass.
    xi: Vec<f32>,
    /// Radius of the sphere of each child of each node.
    reach: Vec<[f32; WIDTH]>,
    /// Seed of the thresholds.
    seed: u64,
}

/// A leaf whose sphere holds a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// The emitter.
    pub emitter: u32,
    /// Weight in a weighted reservoir.
    pub weight: f32,
}

/// A light in the reservoir: what its density is to be multiplied with, k times the probability of a draw.
#[derive(Clone, Copy, Debug)]
struct Kept {
    emitter: u32,
    rate: f32,
}

impl<'a> LightCulling<'a> {
    /// Culling of the lights of `tree`. `probes` are points of the scene that are lit: with [`CullingSettings::error`] unset, the bound of
    /// the error is such that [`CullingSettings::lights`] survive there on average.
    pub fn new(tree: Cow<'a, LightTree>, settings: CullingSettings, probes: &[LitPoint], seed: u64) -> Self {
        let epsilon = settings.error.unwrap_or_else(|| settings::error_for(&tree, probes, settings.lights));
        let scale = (1.0 / (TAU * epsilon)).clamp(f32::MIN_POSITIVE, f32::MAX);
        let (emitters, nodes) = (tree.leaf.len(), tree.nodes.len());
        let kept = settings.kept.clamp(1, MOST_KEPT as u32);
        let mut culling = LightCulling {
            tree,
            settings: CullingSettings { kept, ..settings },
            scale,
            xi: vec![0.0; emitters],
            reach: vec![[0.0; WIDTH]; nodes],
            seed,
        };
        culling.set_pass(0);
        culling
    }

    /// Bound of a light's standard deviation, epsilon.
    pub fn error(&self) -> f32 {
        1.0 / (TAU * self.scale)
    }

    /// Ranges of a pass.
    pub fn set_pass(&mut self, pass: u64) {
        let turn = pass.wrapping_mul(GOLDEN);
        let key = hash(self.seed, XI);
        let xi = |e: u64| unit_f32(((hash(key, e) >> 32).wrapping_add(turn) & 0xffff_ffff) << 32);
        (0..self.xi.len()).for_each(|e| self.xi[e] = xi(e as u64));
        self.fit();
    }

    /// Spheres for the thresholds as they are, from the leaves up: children of a node come after it.
    fn fit(&mut self) {
        for index in (0..self.tree.nodes.len()).rev() {
            let node = &self.tree.nodes[index];
            for lane in 0..WIDTH {
                let centre = node.centre(lane);
                let reach = match node.child(lane) {
                    Child::Nothing => continue,
                    Child::Emitter(e) => {
                        let range = (node.strength[lane] * self.scale / self.xi[e as usize]).sqrt();
                        // At xi = 0 everything is in range.
                        node.radius2(lane).sqrt() + if range.is_nan() { f32::INFINITY } else { range }
                    }
                    Child::Node(below) => {
                        let inner = &self.tree.nodes[below as usize];
                        let reach = &self.reach[below as usize];
                        let full = (0..WIDTH).filter(|&k| inner.child(k) != Child::Nothing);
                        full.map(|k| (inner.centre(k) - centre).length() + reach[k]).fold(0.0, f32::max)
                    }
                };
                self.reach[index][lane] = reach * (1.0 + MARGIN) + MARGIN * 0.1 * centre.abs().max_element();
            }
        }
    }

    /// Survival probability of a light of this intensity at squared distance `d2`.
    fn survival(&self, intensity: f32, d2: f32) -> f32 {
        let r2 = intensity * self.scale;
        if r2 >= d2 { 1.0 } else { r2 / d2 }
    }

    /// Survival probability of a point `distance` away of an emitter; 0 if it is in no tree.
    pub fn survival_of(&self, emitter: u32, distance: f32) -> f32 {
        let place = self.tree.leaf.get(emitter as usize).copied().flatten();
        place.map_or(0.0, |(node, lane)| {
            self.survival(self.tree.nodes[node as usize].strength[lane as usize], distance * distance)
        })
    }

    /// Whether a point `distance` away of an emitter survives in this pass.
    pub fn survives(&self, emitter: u32, distance: f32) -> bool {
        self.xi[emitter as usize] < self.survival_of(emitter, distance)
    }

    /// The leaves met at a point, in the order of the tree.
    pub fn for_each_met(&self, at: &LitPoint, mut visit: impl FnMut(Met)) {
        if !self.tree.nodes.is_empty() {
            self.walk(0, at, &mut visit);
        }
    }

    fn walk(&self, index: u32, at: &LitPoint, visit: &mut impl FnMut(Met)) {
        let node = &self.tree.nodes[index as usize];
        let reach = &self.reach[index as usize];
        let distance2 = node.distance2(at.p);
        // What the bounds say costs more than the distance, and is asked of leaves alone.
        let mut importance = None;
        for lane in 0..WIDTH {
            if distance2[lane] >= reach[lane] * reach[lane] {
                continue;
            }
            match node.child(lane) {
                Child::Emitter(emitter) => {
                    let importance = importance.get_or_insert_with(|| node.importance(at).0)[lane];
                    if importance > 0.0 {
                        visit(Met { emitter, weight: self.weight(node, lane, importance, distance2[lane]) });
                    }
                }
                Child::Node(below) => self.walk(below, at, visit),
                Child::Nothing => {}
            }
        }
    }

    /// Weight in a reservoir of a leaf of this importance.
    fn weight(&self, node: &Node, lane: usize, importance: f32, distance2: f32) -> f32 {
        importance / self.survival(node.strength[lane], distance2.max(node.radius2(lane)))
    }

    /// Weight in a reservoir of an emitter, whether it is met or not: 0 where its bounds send nothing.
    fn weight_at(&self, emitter: u32, at: &LitPoint) -> f32 {
        let Some((index, lane)) = self.tree.leaf[emitter as usize] else { return 0.0 };
        let (node, lane) = (&self.tree.nodes[index as usize], lane as usize);
        self.weight(node, lane, node.importance(at).0[lane], node.distance2(at.p)[lane])
    }

    /// The reservoir at a point, for one number in [0, 1) per light kept.
    fn reservoir(&self, at: &LitPoint, u: &[f64]) -> ArrayVec<Kept, MOST_KEPT> {
        let mut kept: ArrayVec<Kept, MOST_KEPT> = ArrayVec::new();
        let k = u.len();
        let mut u: ArrayVec<f64, MOST_KEPT> = u.iter().copied().collect();
        match self.settings.reservoir {
            Reservoir::Weighted => {
                let mut sum = 0.0f32;
                self.for_each_met(at, |met| {
                    sum += met.weight;
                    for slot in 0..k {
                        let one = Kept { emitter: met.emitter, rate: met.weight };
                        if kept.len() < k {
                            kept.push(one);
                        } else if decide(&mut u[slot], f64::from(met.weight / sum)) {
                            kept[slot] = one;
                        }
                    }
                });
                kept.iter_mut().for_each(|one| one.rate *= k as f32 / sum);
            }
            Reservoir::Uniform => {
                let mut n = 0usize;
                self.for_each_met(at, |met| {
                    n += 1;
                    let one = Kept { emitter: met.emitter, rate: 1.0 };
                    if kept.len() < k {
                        kept.push(one);
                    } else if decide(&mut u[0], k as f64 / n as f64) {
                        // Which one goes: by another number.
                        let slot = if k > 1 { (u[1] * k as f64) as usize } else { 0 };
                        if k > 1 {
                            u[1] = (u[1] * k as f64).fract();
                        }
                        kept[slot.min(k - 1)] = one;
                    }
                });
                kept.iter_mut().for_each(|one| one.rate = (k as f32 / n as f32).min(1.0));
            }
        }
        kept
    }

    /// Light samples at a point: their weights add up to the estimate, their densities are those of all draws together.
    pub fn sample(&self, scene: &Scene, at: &LitPoint, rng: &mut Sampler, mut each: impl FnMut(LightSample)) {
        let k = self.settings.kept as usize;
        let (mut u, mut points) = (ArrayVec::<f64, MOST_KEPT>::new(), ArrayVec::<Vec2, MOST_KEPT>::new());
        for _ in 0..k {
            let [ux, uy, u_light, _] = rng.next_4d();
            points.push(Vec2::new(ux, uy));
            u.push(refine(u_light, Vec2::new(ux, uy)));
        }
        for (one, point) in self.reservoir(at, &u).into_iter().zip(points) {
            let view = scene.lights.view(&scene.shapes, scene.textures(), one.emitter, at.p);
            let Some(s) = view.and_then(|v| v.sample(point)) else { continue };
            let p = self.survival_of(one.emitter, s.distance);
            if self.xi[one.emitter as usize] < p {
                let rate = p * one.rate;
                each(LightSample { weight: s.weight / rate, pdf_dir: s.pdf_dir * rate, ..s });
            }
        }
    }

    /// Density per solid angle with which [`Self::sample`] finds the point `lamp` of a lamp, given the ranges of the other lights.
    pub fn pdf_dir_surface(&self, scene: &Scene, at: &LitPoint, lamp: &SurfacePoint) -> f32 {
        let Some(emitter) = scene.lights.emitter_at(lamp) else { return 0.0 };
        let pdf = scene.lights.pdf_dir_of(&scene.shapes, emitter, at.p, lamp);
        let own = if pdf > 0.0 { self.weight_at(emitter, at) } else { 0.0 };
        if own <= 0.0 {
            return 0.0;
        }
        let (mut others, mut sum) = (0u32, 0.0f32);
        self.for_each_met(at, |met| {
            if met.emitter != emitter {
                others += 1;
                sum += met.weight;
            }
        });
        let k = self.settings.kept as f32;
        let rate = match self.settings.reservoir {
            Reservoir::Weighted => k * own / (sum + own),
            Reservoir::Uniform => (k / (others + 1) as f32).min(1.0),
        };
        pdf * rate * self.survival_of(emitter, distance(at.p, lamp.p))
    }

    /// Number of leaves met at a point.
    pub fn count_met(&self, at: &LitPoint) -> usize {
        let mut n = 0;
        self.for_each_met(at, |_| n += 1);
        n
    }
}

/// Yes with probability `p`; what is left of `u` after the decision is a number for the next one.
fn decide(u: &mut f64, p: f64) -> bool {
    let yes = *u < p;
    *u = if yes { *u / p } else { (*u - p) / (1.0 - p) }.min(1.0 - f64::EPSILON);
    yes
}

fn distance(a: Vec3, b: Vec3) -> f32 {
    (a - b).length()
}
