//! How a strategy treats one light at one point: (pi, q, u), without a random number.
//!
//! For pictures of the probabilities. Verified by `tests`: shares of many sums in which a light is looked at and checked.

use super::culling::{survival, two_epsilon};
use super::joint::Group;
use super::{ManyLights, Receiver, Strategy};
use crate::math::{ResidualRoulette, Rgb};
use crate::transport::visibility::Neighbours;
use crate::transport::vpl::mean;

impl ManyLights<'_> {
    /// The probabilities of the light with this index at the receiver; `None` where it cannot contribute, or does not exist.
    pub fn rule(&self, r: &Receiver, light: usize) -> Option<ResidualRoulette> {
        let of = self.vpls.lights.get(light)?;
        let near = self.cache.map_or_else(Neighbours::default, |cache| cache.neighbours(r.at.p, r.normal()));
        let t = r.tentative(self.vpls, of);
        if t == Rgb::ZERO || r.reach <= 0.0 {
            return None;
        }
        Some(match self.settings.strategy {
            Strategy::Culling | Strategy::Hierarchical => {
                let epsilon = two_epsilon(self.settings.epsilon, &self.price);
                let pi = survival(of, (of.p - r.at.p).length_squared(), epsilon);
                ResidualRoulette { pi, q: 0.0, u: 1.0 }
            }
            Strategy::Joint => {
                let known = self.posterior.predictions(near.surrounding);
                let pi = self.selection(r, &near, light)?;
                ResidualRoulette::residual(mean(t), pi, &known[self.agreement(&near, light)], &self.price)
            }
            _ => self.flat_rule(r, &near, light, mean(t)).0,
        })
    }

    /// Probability with which `joint` looks at the light.
    fn selection(&self, r: &Receiver, near: &Neighbours, light: usize) -> Option<f32> {
        let (seen, scale) = (self.tree.seen(near.points.first().copied()), self.selection_scale());
        let mut index = 0;
        loop {
            match self.group(index, r, seen, scale, true) {
                Group::Dark => return None,
                Group::Open => {
                    let [a, b] = self.tree.children(index);
                    index = if light < self.tree.nodes()[b as usize].first as usize { a } else { b };
                }
                Group::All => return Some(1.0),
                Group::Some(pi) => return Some(pi),
            }
        }
    }
}
