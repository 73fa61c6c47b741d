//! The tree as one point sees it: what is near is opened before anything is drawn.
//!
//! The importance of a node whose bounding sphere holds the point, or nearly so, says little: its lights may be anywhere around. Such
//! nodes are replaced by their children, from the root down, until all that is left is a light or far enough away; a draw takes one of
//! these in proportion to importance, and descends from it. So a lamp next to the point is drawn as often as it deserves,
//! and several draws at a point share the upper part of the tree.
//! Source      after Conty Estevez and Kulla 2018, section 5 (adaptive tree splitting), where nodes that are opened get a sample of their
//!             own; here they only sharpen the probabilities, and the number of samples is the caller's
//! Bias        none: the probabilities are a function of the point alone
//! Verified by `tests`: with those of the tree

use super::node::{Child, Lanes, Node, WIDTH};
use super::{LightTree, LitPoint, Unit};
use crate::math::prefetch;
use arrayvec::ArrayVec;

/// Nodes that are opened at most: bounds what a point costs in any tree.
const MOST_OPENED: usize = 24;
/// Distance, in radii of its bounding sphere, below which a node is opened.
const NEAR: f32 = 1.0;

/// A node that is opened.
#[derive(Clone, Copy, Debug)]
struct Opened {
    index: u32,
    /// Sum of what follows.
    sum: f32,
    /// Importance of its children; 0 of those that are opened themselves.
    importance: Lanes,
}

/// A draw on its way down.
#[derive(Clone, Copy, Debug)]
struct Draw {
    at: Child,
    /// What is left of its number.
    u: f64,
    pmf: f32,
}

impl Draw {
    /// A level down, by the importances of the children of `node`, in which the draw is, and their sum.
    #[inline]
    fn step(&self, node: &Node, (importances, sum): &(Lanes, f32)) -> Option<Draw> {
        let (lane, importance, u) = pick(importances.iter().copied(), self.u * f64::from(*sum))?;
        Some(Draw { at: node.child(lane), u, pmf: self.pmf * (importance / sum) })
    }

    /// The light that has been drawn.
    fn end(&self) -> Option<(Unit, f32)> {
        match self.at {
            Child::Emitter(e) => Some((Unit::Emitter(e), self.pmf)),
            _ => None,
        }
    }
}

/// The tree as seen from a point.
#[derive(Debug)]
pub struct Cut<'t> {
    tree: &'t LightTree,
    at: LitPoint,
    opened: ArrayVec<Opened, MOST_OPENED>,
    /// Sum over all that can be drawn.
    sum: f32,
    /// Sum of the importances at infinity.
    infinite: f32,
    /// Probability of the tree against lights at infinity.
    share: f32,
}

impl<'t> Cut<'t> {
    #[inline]
    pub(super) fn new(tree: &'t LightTree, at: LitPoint) -> Self {
        let infinite = tree.infinite.iter().map(|(_, i)| i.importance(&at)).sum();
        let mut cut = Cut { tree, at, opened: ArrayVec::new(), sum: 0.0, infinite, share: 0.0 };
        if tree.units.len() > 1 && !tree.nodes.is_empty() {
            cut.open();
        }
        cut.share = tree.share(cut.sum, infinite);
        cut
    }

    /// Opens nodes level by level, so that those left closed for want of room are the deepest.
    fn open(&mut self) {
        let closed = |index| Opened { index, sum: 0.0, importance: [0.0; WIDTH] };
        self.opened.push(closed(0));
        let mut next = 0;
        while next < self.opened.len() {
            let node = &self.tree.nodes[self.opened[next].index as usize];
            let (mut importance, distance2) = node.importance_and_distance2(&self.at);
            for lane in 0..WIDTH {
                let near = distance2[lane] < NEAR * NEAR * node.radius2(lane);
                if let Child::Node(inner) = node.child(lane)
                    && near
                    && importance[lane] > 0.0
                    && self.opened.len() < MOST_OPENED
                {
                    self.opened.push(closed(inner));
                    importance[lane] = 0.0;
                }
            }
            let sum = importance.iter().sum();
            self.sum += sum;
            (self.opened[next].sum, self.opened[next].importance) = (sum, importance);
            next += 1;
        }
    }

    /// Draws a light for `u` in [0, 1): it and its probability. `None` if none can contribute, as far as bounds tell.
    pub fn sample(&self, u: f64) -> Option<(Unit, f32)> {
        if let [unit] = self.tree.units[..] {
            return Some((unit, 1.0));
        }
        let share = f64::from(self.share);
        if u >= share {
            let mut rest = (u - share) / (1.0 - share) * f64::from(self.infinite);
            let mut chosen = None;
            for (unit, i) in &self.tree.infinite {
                let importance = i.importance(&self.at);
                if importance > 0.0 {
                    chosen = Some((*unit, (1.0 - self.share) * (importance / self.infinite)));
                    rest -= f64::from(importance);
                    if rest < 0.0 {
                        break;
                    }
                }
            }
            return chosen;
        }
        let mut draw = self.enter(u / share)?;
        while let Child::Node(index) = draw.at {
            let node = &self.tree.nodes[index as usize];
            draw = draw.step(node, &node.importance(&self.at))?;
        }
        draw.end()
    }

    /// Draws a light for each of `u` in turn, as [`Self::sample`] does. All go down the tree at the same time, so that they wait for memory
    /// together, and those in one node ask for its importance once. No more than N.
    pub fn sample_each<const N: usize>(&self, u: impl Iterator<Item = f64>) -> ArrayVec<Option<(Unit, f32)>, N> {
        let mut drawn: ArrayVec<Option<(Unit, f32)>, N> = ArrayVec::new();
        let mut open: ArrayVec<(usize, Draw), N> = ArrayVec::new();
        let share = f64::from(self.share);
        let far = self.tree.units.len() > 1;
        for u in u {
            let place = drawn.len();
            drawn.push(None);
            if far && u < share {
                open.extend(self.enter(u / share).map(|draw| (place, draw)));
            } else {
                drawn[place] = self.sample(u);
            }
        }
        let mut known: ArrayVec<(u32, (Lanes, f32)), N> = ArrayVec::new();
        while !open.is_empty() {
            known.clear();
            open.retain(|(place, draw)| {
                let Child::Node(index) = draw.at else {
                    drawn[*place] = draw.end();
                    return false;
                };
                let node = &self.tree.nodes[index as usize];
                let k = known.iter().position(|(other, _)| *other == index).unwrap_or_else(|| {
                    known.push((index, node.importance(&self.at)));
                    known.len() - 1
                });
                let next = draw.step(node, &known[k].1);
                if let Some(next) = next {
                    self.prefetch(next.at);
                    *draw = next;
                }
                next.is_some()
            });
        }
        drawn
    }

    /// The first choice of a draw within the tree, for `u` in [0, 1).
    #[inline]
    fn enter(&self, u: f64) -> Option<Draw> {
        let (k, of, u) = pick(self.opened.iter().map(|o| o.sum), u * f64::from(self.sum))?;
        let Opened { index, importance, .. } = self.opened[k];
        let (lane, importance, u) = pick(importance.into_iter(), u * f64::from(of))?;
        let at = self.tree.nodes[index as usize].child(lane);
        self.prefetch(at);
        Some(Draw { at, u, pmf: self.share * (importance / self.sum) })
    }

    #[inline(always)]
    fn prefetch(&self, child: Child) {
        if let Child::Node(index) = child {
            prefetch(&self.tree.nodes[index as usize]);
        }
    }

    /// Probability with which [`Self::sample`] draws the light.
    pub fn pmf(&self, unit: Unit) -> f32 {
        let tree = self.tree;
        if tree.units[..] == [unit] {
            return 1.0;
        }
        let leaf = match unit {
            Unit::Emitter(i) => tree.leaf[i as usize],
            Unit::Environment => None,
        };
        let Some(leaf) = leaf else {
            let of =
                tree.infinite.iter().find(|(other, _)| *other == unit).map_or(0.0, |(_, i)| i.importance(&self.at));
            return if of > 0.0 { (1.0 - self.share) * (of / self.infinite) } else { 0.0 };
        };
        let (mut place, mut pmf) = (leaf, self.share);
        loop {
            let (index, lane) = place;
            let node = &tree.nodes[index as usize];
            let (importance, mut sum) = node.importance(&self.at);
            let opened = self.opened.iter().any(|o| o.index == index);
            if opened {
                sum = self.sum;
            }
            pmf *= if sum > 0.0 { importance[lane as usize] / sum } else { 0.0 };
            match node.parent {
                Some(above) if !opened && pmf > 0.0 => place = above,
                _ => return pmf,
            }
        }
    }
}

/// The item in which the running sum exceeds `target`, its value, and where within it, in [0, 1). Items of 0 are never picked.
#[inline]
fn pick(values: impl Iterator<Item = f32>, target: f64) -> Option<(usize, f32, f64)> {
    let mut rest = target;
    let mut chosen = None;
    for (k, value) in values.enumerate().filter(|(_, v)| *v > 0.0) {
        chosen = Some((k, value, rest));
        if rest < f64::from(value) {
            break;
        }
        rest -= f64::from(value);
    }
    chosen.map(|(k, value, rest)| (k, value, (rest / f64::from(value)).min(1.0 - f64::EPSILON)))
}
