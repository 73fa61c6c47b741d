//! Which light a path vertex samples: one interface to all strategies, so that they can be compared in one integrator.
//!
//! `Tree`     one light of the [`LightTree`], in proportion to what it may contribute
//! `Power`    one light in proportion to its power, wherever it is
//! `Uniform`  one light, all alike
//! `Culling`  stochastic light culling ([`LightCulling`]); lights at infinity, which it leaves out, are drawn besides
//!
//! Every strategy yields samples whose weights add up to an unbiased estimate, and knows the density of a direction found otherwise.
//! Bias        none
//! Verified by `light_cull/tests.rs` and tests/many_lights.rs: one mean for all

use super::World;
use super::light_cull::{CullingSettings, LightCulling};
use super::light_tree::{LightTree, LitPoint, Unit};
use crate::math::sampler::{hash, refine, unit_f32};
use crate::math::{Sampler, Vec2, Vec3};
use crate::scene::{LightSample, SurfacePoint};
use std::borrow::Cow;

/// Strategies by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LightStrategy {
    /// Light tree: in proportion to what a light may contribute.
    #[default]
    Tree,
    /// In proportion to power.
    Power,
    /// All lights alike.
    Uniform,
    /// Stochastic light culling: random ranges, a reservoir of the lights in range.
    Culling,
}

/// A strategy with its settings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SelectionSettings {
    /// The strategy.
    pub strategy: LightStrategy,
    /// Of `Culling`.
    pub culling: CullingSettings,
    /// Seed of random ranges.
    pub seed: u64,
}

/// A strategy, ready for a scene.
#[derive(Debug)]
pub enum LightSelection<'a> {
    /// See [`LightStrategy::Tree`].
    Tree(Cow<'a, LightTree>),
    /// See [`LightStrategy::Power`].
    Power,
    /// See [`LightStrategy::Uniform`]; of the tree only its units matter.
    Uniform(Cow<'a, LightTree>),
    /// See [`LightStrategy::Culling`].
    Culling {
        /// Lights that are somewhere.
        finite: Box<LightCulling<'a>>,
        /// The others.
        infinite: Box<LightTree>,
    },
}

impl<'a> LightSelection<'a> {
    /// The strategy for `world`. `probes` are lit points of the scene, which tell culling its scale.
    pub fn new(world: World<'a>, settings: &SelectionSettings, probes: impl FnOnce() -> Vec<LitPoint>) -> Self {
        let tree = || world.lights.map_or_else(|| Cow::Owned(LightTree::new(world.scene)), Cow::Borrowed);
        match settings.strategy {
            LightStrategy::Tree => LightSelection::Tree(tree()),
            LightStrategy::Power => LightSelection::Power,
            LightStrategy::Uniform => LightSelection::Uniform(tree()),
            LightStrategy::Culling => {
                let tree = tree();
                let infinite = Box::new(tree.at_infinity());
                let probes = if settings.culling.error.is_none() { probes() } else { Vec::new() };
                LightSelection::Culling {
                    finite: Box::new(LightCulling::new(tree, settings.culling, &probes, settings.seed)),
                    infinite,
                }
            }
        }
    }

    /// What changes from pass to pass: the ranges of culling.
    pub fn set_pass(&mut self, pass: u64) {
        if let LightSelection::Culling { finite, .. } = self {
            finite.set_pass(pass);
        }
    }

    /// Samples of lights towards a point. Their weights, divided by all probabilities, add up; densities include the probabilities and the
    /// number of draws.
    pub fn sample(&self, world: &World, at: &LitPoint, rng: &mut Sampler, mut each: impl FnMut(LightSample)) {
        let scene = world.scene;
        if let LightSelection::Culling { finite, infinite } = self {
            finite.sample(scene, at, rng, &mut each);
            if infinite.units().is_empty() {
                return;
            }
        }
        let [ux, uy, u_light, _] = rng.next_4d();
        let u = Vec2::new(ux, uy);
        let sample = match self {
            LightSelection::Tree(tree) => tree.sample_light(scene, at, u_light, u),
            LightSelection::Power => scene.lights.sample(&scene.shapes, scene.textures(), at.p, u_light, u),
            LightSelection::Uniform(tree) => uniform(world, tree.units(), at, u_light, u),
            LightSelection::Culling { infinite, .. } => infinite.sample_light(scene, at, u_light, u),
        };
        sample.into_iter().for_each(each);
    }

    /// Density per solid angle with which [`Self::sample`] finds the point `lamp` of a lamp.
    pub fn pdf_dir_surface(&self, world: &World, at: &LitPoint, lamp: &SurfacePoint) -> f32 {
        let scene = world.scene;
        match self {
            LightSelection::Tree(tree) => tree.pdf_dir_surface(scene, at, lamp),
            LightSelection::Power => scene.lights.pdf_dir_surface(&scene.shapes, at.p, lamp),
            LightSelection::Uniform(tree) => scene
                .lights
                .emitter_at(lamp)
                .map_or(0.0, |e| scene.lights.pdf_dir_of(&scene.shapes, e, at.p, lamp) / tree.units().len() as f32),
            LightSelection::Culling { finite, .. } => finite.pdf_dir_surface(scene, at, lamp),
        }
    }

    /// Density per solid angle with which [`Self::sample`] finds the unit direction `w` into the environment.
    pub fn pdf_dir_environment(&self, world: &World, at: &LitPoint, w: Vec3) -> f32 {
        let scene = world.scene;
        match self {
            LightSelection::Tree(tree) => tree.pdf_dir_environment(scene, at, w),
            LightSelection::Power => scene.lights.pdf_dir_environment(w),
            LightSelection::Uniform(tree) => scene.lights.pdf_dir_infinity(w) / tree.units().len() as f32,
            LightSelection::Culling { infinite, .. } => infinite.pdf_dir_environment(scene, at, w),
        }
    }
}

/// One of the units, all alike.
fn uniform(world: &World, units: &[Unit], at: &LitPoint, u_light: f32, u: Vec2) -> Option<LightSample> {
    let scene = world.scene;
    let n = units.len();
    let s = match *units.get(((refine(u_light, u) * n as f64) as usize).min(n.saturating_sub(1)))? {
        Unit::Emitter(e) => scene.lights.view(&scene.shapes, scene.textures(), e, at.p)?.sample(u)?,
        Unit::Environment => {
            let u_map = unit_f32(hash(u64::from(u_light.to_bits()), u64::from(u.x.to_bits())));
            scene.lights.sample_environment(scene.textures(), u_map, u)?
        }
    };
    Some(LightSample { weight: s.weight * n as f32, pdf_dir: s.pdf_dir / n as f32, ..s })
}
