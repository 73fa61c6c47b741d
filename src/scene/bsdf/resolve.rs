//! From a [`Material`] to lobes: a tree of materials flattened.
//!
//! `TwoSided` takes the side `wo` is on and mirrors the frame; `Blend` and `Mask` multiply weights; bump and normal maps
//! replace the frame.

use super::layer::Layer;
use super::view::{State, View, unit};
use crate::math::Vec3;
use crate::scene::material::Material;

/// Blend trees with more lobes keep the first ones found, the heavier branch of each node first, at the weight of all.
pub const MAX_LAYERS: usize = 8;

/// Walks down a tree of materials and collects its lobes.
pub struct Resolver<'a> {
    materials: &'a [Material],
    view: &'a View<'a>,
    layers: Vec<Layer>,
    /// Weight of the lobes that found no place.
    dropped: f32,
}

impl<'a> Resolver<'a> {
    pub fn new(materials: &'a [Material], view: &'a View<'a>) -> Self {
        Resolver { materials, view, layers: Vec::new(), dropped: 0.0 }
    }

    /// The lobes of material `id`.
    pub fn run(mut self, id: u32, state: State) -> Vec<Layer> {
        self.descend(id, state);
        if self.dropped > 0.0 {
            let kept: f32 = self.layers.iter().map(|l| l.weight).sum();
            let scale = (kept + self.dropped) / kept;
            self.layers.iter_mut().for_each(|l| l.weight *= scale);
        }
        self.layers
    }

    fn descend(&mut self, id: u32, state: State) {
        // A shared subtree could be walked through exponentially often: stop at once when there is no place left.
        if self.layers.len() >= MAX_LAYERS {
            self.dropped += state.weight;
            return;
        }
        let uv = self.view.at.uv;
        let textures = self.view.textures;
        match &self.materials[id as usize] {
            Material::TwoSided { front, back } => {
                let (is_front, state) = state.turned_to(self.view.wo);
                self.descend(if is_front { *front } else { *back }, state);
            }
            Material::Blend { weight, first, second, absorbed } => {
                let w = unit(textures.scalar(weight, uv));
                let kept = 1.0 - unit(*absorbed);
                let mut branches = [(*first, (1.0 - w) * kept), (*second, w * kept)];
                if branches[1].1 > branches[0].1 {
                    branches.swap(0, 1);
                }
                for (id, share) in branches.into_iter().filter(|b| b.1 > 0.0) {
                    self.descend(id, state.part(share));
                }
            }
            Material::Mask { opacity, nested } => {
                let opacity = unit(textures.scalar(opacity, uv));
                if opacity > 0.0 {
                    self.descend(*nested, state.part(opacity));
                }
                if opacity < 1.0 {
                    self.push(&state.part(1.0 - opacity), &Material::Null);
                }
            }
            Material::BumpMap { texture, scale, nested } => {
                let slope = textures.gradient(*texture, uv) * *scale;
                let normal = self.view.bumped(&state, slope.x, slope.y);
                self.descend(*nested, self.view.perturbed(state, normal));
            }
            Material::NormalMap { texture, nested } => {
                let normal = textures.eval(*texture, uv) * 2.0 - Vec3::ONE;
                self.descend(*nested, self.view.perturbed(state, normal));
            }
            leaf => self.push(&state, leaf),
        }
    }

    fn push(&mut self, state: &State, leaf: &Material) {
        if self.layers.len() >= MAX_LAYERS {
            self.dropped += state.weight;
        } else if let Some(lobe) = self.view.lobe(leaf) {
            self.layers.push(self.view.layer(state, leaf, lobe));
        }
    }
}
