//! Light tree: one of many lights in proportion to what it may contribute at a point.
//!
//! Estimates   sum_i c_i over all lights by c_i / pmf_i for a light i drawn by descent: at each node the child j is taken with
//!             probability I_j / (I_1 + I_2), I the importance of its bounds at the point
//!             I = P cos(theta') cos(theta_i') / d^2,  theta' = (theta - theta_o - theta_u)+,  theta_i' = (theta_i - theta_u)+
//!             (Conty Estevez and Kulla 2018, eq. 3), P the sum of the largest radiant intensities
//!             (with power, narrow spots would come off too low), 0 only where nothing arrives: theta' beyond the emission, or all below
//!             the receiver's plane
//! Measure     discrete (`pmf`), the product of the probabilities on the way; what is missing to a sum of 1 is the probability
//!             to end at a node whose children turn out to send nothing
//! Source      Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting": cones,
//!             importance, surface area orientation heuristic (eq. 1); Pharr et al., PBR 4 section 12.6.3, for clamped cosines
//! At infinity parallel light and the environment (one unit, all of it together) are entries beside the root, by their irradiance
//! Bias        none
//! Not handled visibility; splitting (callers draw several lights with stratified numbers); single-precision ties
//! Verified by `tests`: pmf sums to 1, chi-square, what is left out sends nothing, brute-force importance

mod bounds;
#[cfg(test)]
mod tests;

use self::bounds::{Bounds, Prepared, split};
use crate::math::sampler::{hash, refine, unit_f32};
use crate::math::{Vec2, Vec3};
use crate::scene::{LightSample, Scene, SurfacePoint};
use std::f32::consts::PI;

/// The share of the tree against lights at infinity, and the reverse, is at least this where both can contribute.
const LEAST_SHARE: f32 = 0.1;
const NONE: u32 = u32::MAX;

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
}

/// A tree over the lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// Leaf of each emitter, or [`NONE`].
    leaf: Vec<u32>,
    /// Lights at infinity.
    infinite: Vec<(Unit, Infinite)>,
    units: Vec<Unit>,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Prepared,
    /// Inner nodes: the second child (the first comes next); leaves: the emitter.
    link: u32,
    is_leaf: bool,
    parent: u32,
}

#[derive(Clone, Copy, Debug)]
enum Infinite {
    /// Direction towards it, irradiance.
    Parallel(Vec3, f32),
    /// Mean radiance.
    Environment(f32),
}

impl Infinite {
    /// On the scale of [`Prepared::importance`]: irradiance.
    fn importance(&self, at: &LitPoint) -> f32 {
        match self {
            Infinite::Parallel(towards, e) => e * at.n.map_or(1.0, |n| n.dot(*towards).max(0.0)),
            Infinite::Environment(radiance) => PI * radiance,
        }
    }
}

impl LightTree {
    /// The tree of a scene's lights.
    pub fn new(scene: &Scene) -> Self {
        let lights = &scene.lights;
        let mut tree = LightTree { leaf: vec![NONE; lights.emitter_count()], ..LightTree::default() };
        let mut finite = Vec::new();
        for i in 0..lights.emitter_count() as u32 {
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
            tree.nodes.reserve(2 * finite.len());
            tree.build(&mut finite, NONE);
        }
        tree
    }

    /// All lights that emit anything.
    pub fn units(&self) -> &[Unit] {
        &self.units
    }

    /// Adds the subtree over `list` and returns its bounds.
    fn build(&mut self, list: &mut [(Bounds, u32)], parent: u32) -> Bounds {
        let index = self.nodes.len() as u32;
        if let [(bounds, emitter)] = list {
            self.leaf[*emitter as usize] = index;
            let bounds_here = Prepared::new(bounds);
            self.nodes.push(Node { bounds: bounds_here, link: *emitter, is_leaf: true, parent });
            return *bounds;
        }
        let middle = split(list);
        let (left, right) = list.split_at_mut(middle);
        // Its bounds follow from the children's.
        self.nodes.push(Node { bounds: Prepared::new(&left[0].0), link: NONE, is_leaf: false, parent });
        let first = self.build(left, index);
        let second = self.nodes.len() as u32;
        let bounds = first.union(self.build(right, index));
        let node = &mut self.nodes[index as usize];
        (node.bounds, node.link) = (Prepared::new(&bounds), second);
        bounds
    }

    fn importance(&self, node: u32, at: &LitPoint) -> f32 {
        self.nodes[node as usize].bounds.importance(at)
    }

    /// Probability of the tree, and the sum of importances at infinity.
    fn tree_share(&self, at: &LitPoint) -> (f32, f32) {
        let infinite: f32 = self.infinite.iter().map(|(_, i)| i.importance(at)).sum();
        let tree = if self.nodes.is_empty() { 0.0 } else { self.importance(0, at) };
        let share = match (tree > 0.0, infinite > 0.0) {
            (false, _) => 0.0,
            (true, false) => 1.0,
            (true, true) => (tree / (tree + infinite)).clamp(LEAST_SHARE, 1.0 - LEAST_SHARE),
        };
        (share, infinite)
    }

    /// Probability of the first of two children; `None` if neither can contribute.
    fn first_share(&self, node: u32, at: &LitPoint) -> Option<f32> {
        let a = self.importance(node + 1, at);
        let b = self.importance(self.nodes[node as usize].link, at);
        (a + b > 0.0).then(|| if a == 0.0 { 0.0 } else { 1.0 / (1.0 + b / a) })
    }

    /// Draws a light for `u` in [0, 1): it and its probability. `None` if none can contribute, as far as bounds tell.
    pub fn sample(&self, at: &LitPoint, u: f64) -> Option<(Unit, f32)> {
        let (share, infinite) = self.tree_share(at);
        if u >= f64::from(share) {
            let mut rest = (u - f64::from(share)) / (1.0 - f64::from(share)) * f64::from(infinite);
            let mut chosen = None;
            for (unit, i) in &self.infinite {
                let importance = i.importance(at);
                if importance > 0.0 {
                    chosen = Some((*unit, (1.0 - share) * (importance / infinite)));
                    rest -= f64::from(importance);
                    if rest < 0.0 {
                        break;
                    }
                }
            }
            return chosen;
        }
        let (mut node, mut pmf) = (0, share);
        let mut u = u / f64::from(share);
        loop {
            let n = &self.nodes[node as usize];
            if n.is_leaf {
                return Some((Unit::Emitter(n.link), pmf));
            }
            let p = self.first_share(node, at)?;
            let first = f64::from(p);
            if u < first {
                (node, u, pmf) = (node + 1, u / first, pmf * p);
            } else {
                (node, u, pmf) = (n.link, (u - first) / (1.0 - first), pmf * (1.0 - p));
            }
        }
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
        let (share, infinite) = self.tree_share(at);
        let leaf = match unit {
            Unit::Emitter(i) => self.leaf[i as usize],
            Unit::Environment => NONE,
        };
        if leaf == NONE {
            let of = self.infinite.iter().find(|(other, _)| *other == unit).map_or(0.0, |(_, i)| i.importance(at));
            return if of > 0.0 { (1.0 - share) * (of / infinite) } else { 0.0 };
        }
        let (mut node, mut pmf) = (leaf, share);
        while pmf > 0.0 && self.nodes[node as usize].parent != NONE {
            let parent = self.nodes[node as usize].parent;
            let Some(p) = self.first_share(parent, at) else { return 0.0 };
            pmf *= if node == parent + 1 { p } else { 1.0 - p };
            node = parent;
        }
        pmf
    }
}
