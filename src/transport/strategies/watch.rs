//! How a strategy treats one light at one point: (pi, q, u), without a random number.
//!
//! For pictures of the probabilities. Verified by `tests`: shares of many sums in which a light is looked at and checked.

use super::culling::{survival, two_epsilon};
use super::joint::{Group, OPEN, group};
use super::{ManyLights, Receiver, Strategy};
use crate::math::{ResidualRoulette, Rgb};
use crate::transport::eight::{Eight, WIDTH, all};
use crate::transport::visibility::Neighbours;
use crate::transport::vpl::mean;
use crate::transport::vpl_tree::groups::Point;

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
        let groups = self.tree.groups();
        let at = Point::<Eight>::new(r.at.p, r.horizon, r.reach);
        let (seen, scale) = (groups.seen(near.points.first().copied()), self.selection_scale());
        let mut index = 0;
        loop {
            let node = groups.nodes().get(index)?;
            let holds =
                |lane: &usize| (node.first[*lane]..node.first[*lane] + node.count[*lane]).contains(&(light as u32));
            let lane = (0..WIDTH).find(holds)?;
            let sorted = node.sort(&at, &seen[index], all(scale), all(OPEN));
            match group(node, &sorted, lane, true) {
                Group::Open => index = node.within[lane] as usize,
                Group::All => return Some(1.0),
                Group::Some(pi) => return (sorted.lit >> lane & 1 == 1).then_some(pi),
            }
        }
    }
}
