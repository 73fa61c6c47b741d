//! Light tree: one of many lights in proportion to what it may contribute at a point.
//!
//! Estimates   sum_i c_i over all lights by c_i / pmf_i for a light i drawn by descent: at each node of eight children the child j is
//!             taken with probability I_j / sum I, I the importance of its bounds at the point; nodes near the point are
//!             opened before (`cut`)
//!             I = P c c_i / d^2, P the sum of the largest radiant intensities (with power, narrow spots would come off too low), c and c_i
//!             the mean cosines at the lamps and at the point (`node`), 0 only where nothing arrives: by the bounds of Conty Estevez
//!             and Kulla 2018, eq. 3, beyond the emission, or all below the receiver's plane
//! Measure     discrete (`pmf`), the product of the probabilities on the way; what is missing to a sum of 1 is the probability
//!             to end at a node whose children turn out to send nothing
//! Source      Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting": cones,
//!             bounds, surface area orientation heuristic (eq. 1); Pharr et al., PBR 4 section 12.6.3, for clamped cosines. Mean cosines in
//!             place of the greatest ones are ours: of a cluster whose lamps face all ways bounds say nothing
//! At infinity parallel light and the environment (one unit, all of it together) are entries beside the root, by their irradiance
//! Bias        none
//! Not handled visibility; single-precision ties
//! Verified by `tests`: pmf sums to 1, chi-square, what is left out sends nothing, brute-force importance

mod bounds;
mod cut;
pub(in crate::transport) mod node;
#[cfg(test)]
mod tests;

use self::bounds::{Bounds, Extent, around, split};
pub use self::cut::Cut;
use self::node::{Child, Node, WIDTH};
use crate::math::sampler::{hash, refine, unit_f32};
use crate::math::{Vec2, Vec3};
use crate::scene::{LightSample, Scene, SurfacePoint};
use std::f32::consts::PI;

/// The share of the tree against lights at infinity, and the reverse, is at least this where both can contribute.
const LEAST_SHARE: f32 = 0.1;

/// What is chosen: an emitter of the scene's lights, or all that comes from infinity with a density.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Index of an emitter.
    Emitter(u32),
    /// The environment.
    Environment,
}

/// A point that is lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LitPoint {
    /// Position.
    pub p: Vec3,
    /// Unit normal, if nothing that comes from below its plane counts.
    pub n: Option<Vec3>,
    /// Whether what is reflected falls with the cosine to the normal: not so by glossy lobes, which are as bright near the horizon. Light samples and the
    /// weights of scattered rays have to agree about it.
    pub matte: bool,
}

/// A tree over the lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    pub(in crate::transport) nodes: Vec<Node>,
    /// Node and lane of each emitter that is in the tree.
    pub(in crate::transport) leaf: Vec<Option<(u32, u8)>>,
    /// Lights at infinity.
    infinite: Vec<(Unit, Infinite)>,
    units: Vec<Unit>,
}

#[derive(Clone, Copy, Debug)]
enum Infinite {
    /// Direction towards it, irradiance.
    Parallel(Vec3, f32),
    /// Mean radiance.
    Environment(f32),
}

impl Infinite {
    /// On the scale of [`Node::importance`]: irradiance.
    fn importance(&self, at: &LitPoint) -> f32 {
        match self {
            Infinite::Parallel(towards, e) => {
                let cos = at.n.map_or(1.0, |n| n.dot(*towards));
                if cos > 0.0 { e * cos.max(node::least_tilt(at)) } else { 0.0 }
            }
            Infinite::Environment(radiance) => PI * radiance,
        }
    }
}

impl LightTree {
    /// The tree of a scene's lights.
    pub fn new(scene: &Scene) -> Self {
        LightTree::of(scene, |_| true)
    }

    /// The tree of those emitters that `wanted` names, and of the environment.
    pub fn of(scene: &Scene, wanted: impl Fn(u32) -> bool) -> Self {
        let lights = &scene.lights;
        let mut tree = LightTree { leaf: vec![None; lights.emitter_count()], ..LightTree::default() };
        let mut finite = Vec::new();
        for i in (0..lights.emitter_count() as u32).filter(|&i| wanted(i)) {
            if let Some(bounds) = lights.emitter_bounds(&scene.shapes, i) {
                if bounds.intensity > 0.0 && bounds.bounds.0.is_finite() && bounds.bounds.1.is_finite() {
                    finite.push((Bounds::of(&bounds), i));
                }
            } else if let Some((towards, irradiance)) = lights.parallel(i).filter(|(_, e)| *e > 0.0) {
                tree.infinite.push((Unit::Emitter(i), Infinite::Parallel(towards, irradiance)));
            }
        }
        let mean = lights.mean_environment();
        if lights.has_environment() && mean > 0.0 {
            tree.infinite.push((Unit::Environment, Infinite::Environment(mean)));
        }
        tree.units = finite.iter().map(|f| Unit::Emitter(f.1)).chain(tree.infinite.iter().map(|i| i.0)).collect();
        if !finite.is_empty() {
            tree.build(&mut finite, None);
        }
        tree
    }

    /// The same lights at infinity without any other.
    pub fn at_infinity(&self) -> Self {
        let units = self.infinite.iter().map(|i| i.0).collect();
        LightTree { nodes: Vec::new(), leaf: vec![None; self.leaf.len()], infinite: self.infinite.clone(), units }
    }

    /// All lights that emit anything.
    pub fn units(&self) -> &[Unit] {
        &self.units
    }

    /// Adds the subtree over `list`: its index and bounds.
    fn build(&mut self, list: &mut [(Bounds, u32)], parent: Option<(u32, u8)>) -> (u32, Option<Bounds>) {
        // Cut the costliest part until there are enough of them.
        let mut parts = match list.len() {
            n if n <= WIDTH => (0..n).map(|i| (i..i + 1, Some(list[i].0.extent))).collect(),
            n => vec![(0..n, around(list))],
        };
        while parts.len() < WIDTH {
            let cost = |p: &(std::ops::Range<usize>, Option<Extent>)| p.1.map_or(0.0, |e| e.cost(1.0));
            let cuttable = (0..parts.len()).filter(|&i| parts[i].0.len() > 1);
            let Some(i) = cuttable.max_by(|&i, &j| cost(&parts[i]).total_cmp(&cost(&parts[j]))) else { break };
            let range = parts[i].0.clone();
            let (cut, [a, b]) = split(&mut list[range.clone()]);
            let cut = range.start + cut;
            parts[i] = (range.start..cut, a);
            parts.push((cut..range.end, b));
        }
        let index = self.nodes.len() as u32;
        let (lo, hi) = parts
            .iter()
            .filter_map(|p| p.1)
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), b| (lo.min(b.lo), hi.max(b.hi)));
        self.nodes.push(Node::new(parent, lo, hi));
        let mut all = None;
        for (lane, (range, _)) in parts.into_iter().enumerate() {
            let here = Some((index, lane as u8));
            let (child, bounds) = match &mut list[range] {
                [(bounds, emitter)] => {
                    self.leaf[*emitter as usize] = here;
                    (Child::Emitter(*emitter), Some(*bounds))
                }
                part => {
                    let (node, bounds) = self.build(part, here);
                    (Child::Node(node), bounds)
                }
            };
            if let Some(bounds) = bounds {
                self.nodes[index as usize].set(lane, &bounds, child);
                all = Some(all.map_or(bounds, |all: Bounds| all.union(bounds)));
            }
        }
        (index, all)
    }

    /// Probability of the tree against lights at infinity, of these importances.
    fn share(&self, tree: f32, infinite: f32) -> f32 {
        match (tree, infinite) {
            _ if self.nodes.is_empty() => 0.0,
            _ if self.infinite.is_empty() => 1.0,
            (tree, _) if tree <= 0.0 => 0.0,
            (_, infinite) if infinite <= 0.0 => 1.0,
            (tree, infinite) => (tree / (tree + infinite)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE),
        }
    }

    /// The tree as seen from a point: for several draws there.
    pub fn cut(&self, at: &LitPoint) -> Cut<'_> {
        Cut::new(self, *at)
    }

    /// Draws a light for `u` in [0, 1): it and its probability. `None` if none can contribute, as far as bounds tell.
    pub fn sample(&self, at: &LitPoint, u: f64) -> Option<(Unit, f32)> {
        self.cut(at).sample(u)
    }

    /// A direction towards a light of the scene: `u_light` draws the light, `u` the direction. Weight and density include the
    /// probability of the light. `None` counts as a sample of value 0.
    pub fn sample_light(&self, scene: &Scene, at: &LitPoint, u_light: f32, u: Vec2) -> Option<LightSample> {
        let (unit, pmf) = self.sample(at, refine(u_light, u))?;
        let s = match unit {
            Unit::Emitter(e) => scene.lights.view(&scene.shapes, scene.textures(), e, at.p)?.sample(u)?,
            // What is left of the number after the choice of the light is not independent of it: a new one.
            Unit::Environment => {
                let u_map = unit_f32(hash(u64::from(u_light.to_bits()), u64::from(u.x.to_bits())));
                scene.lights.sample_environment(scene.textures(), u_map, u)?
            }
        };
        Some(LightSample { weight: s.weight / pmf, pdf_dir: s.pdf_dir * pmf, ..s })
    }

    /// Density per solid angle with which [`Self::sample_light`] draws the point `lamp` of a lamp.
    pub fn pdf_dir_surface(&self, scene: &Scene, at: &LitPoint, lamp: &SurfacePoint) -> f32 {
        let Some(e) = scene.lights.emitter_at(lamp) else { return 0.0 };
        let pdf = scene.lights.pdf_dir_of(&scene.shapes, e, at.p, lamp);
        if pdf > 0.0 { pdf * self.pmf(at, Unit::Emitter(e)) } else { 0.0 }
    }

    /// Density per solid angle with which [`Self::sample_light`] draws the unit direction `w` into the environment.
    pub fn pdf_dir_environment(&self, scene: &Scene, at: &LitPoint, w: Vec3) -> f32 {
        let pdf = scene.lights.pdf_dir_infinity(w);
        if pdf > 0.0 { pdf * self.pmf(at, Unit::Environment) } else { 0.0 }
    }

    /// Probability with which [`Self::sample`] draws the light.
    pub fn pmf(&self, at: &LitPoint, unit: Unit) -> f32 {
        self.cut(at).pmf(unit)
    }
}
