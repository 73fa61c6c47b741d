//! A tree of boxes over primary-sample space that remembers which of a light's photons arrived.
//!
//! ```text
//! E_c = mean over cell c of y^2          y: stored flux of a photon per measure of primary-sample space, 0 if it was lost
//! cut of a leaf                          greatest gain sqrt(E) - sum_i f_i sqrt(E_i), f_i: shares of the volume (the weight that it saves)
//! weight of a leaf                       volume sqrt(E~),  E~_c = (tries E_c + PRIOR E~_parent) / (tries + PRIOR)
//! ```
//!
//! With n_c photons in cell c the squared error of a pass goes with sum_c volume_c^2 E_c / n_c, which is least for n_c in proportion to
//! volume_c sqrt(E_c) (Neyman 1934); the tree is cut where that sum becomes least, as MISER cuts by variance. Estimates are shrunk towards
//! those of the parent, so that a cell of which few photons were tried is not taken for empty because none of them arrived. Photons are
//! uniform within a leaf, so that a part of its volume has had that part of the tries. Leaves are joined only where there are too few photons for them.
//! Source: Press & Farrar 1990 (MISER); Vorba et al. 2014 and Mueller et al. 2017 for densities that are learned while rendering.
//! Not handled: the covariance of places on what is lit: a photon counts alike wherever it arrives.
//! Verified by `tests/learned.rs`.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Tries that the parent's estimate counts for.
const PRIOR: f64 = 8.0;
/// A leaf in which fewer photons arrived is not cut.
const LEAST_ARRIVALS: f64 = 12.0;
/// A leaf of which a greater part arrives is not cut: little is left to be saved.
const MOST_ARRIVE: f64 = 0.5;
/// Arrivals of a leaf that are remembered one by one; they stand for the rest.
const REMEMBERED: usize = 128;
/// Places where an axis may be cut, parts of its width.
const PLACES: [f64; 3] = [0.25, 0.5, 0.75];
/// Cuts whose gain, as part of the leaf's weight, is below this over the number of arrivals are noise.
const NOISE: f64 = 1.0;

/// A photon that arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Arrived {
    u: [f64; 4],
    /// y^2.
    energy: f64,
}

/// A whole unit cube of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Root {
    /// Its measure.
    pub share: f64,
    /// What each axis spans on what is lit, world units; 0: the axis does not matter.
    pub extent: [f64; 4],
}

/// A box with what became of its photons.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    root: usize,
    /// Of the root's measure.
    share: f64,
    lo: [f64; 4],
    hi: [f64; 4],
    /// The first of two children; 0: a leaf.
    children: usize,
    /// Photons tried, stored, and the sum of y^2 over the latter; for leaves only.
    tries: f64,
    stored: f64,
    energy: f64,
    arrived: Vec<Arrived>,
}

impl Node {
    fn volume(&self) -> f64 {
        (0..4).map(|k| self.hi[k] - self.lo[k]).product::<f64>() * self.share
    }
}

/// The tree.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ArrivalTree {
    nodes: Vec<Node>,
    /// Nodes that are leaves, neighbours near to each other.
    leaves: Vec<usize>,
    roots: Vec<Root>,
}

impl ArrivalTree {
    /// One cell per root.
    pub fn new(roots: Vec<Root>) -> Self {
        let node = |(root, &Root { share, .. })| Node {
            root,
            share,
            lo: [0.0; 4],
            hi: [1.0; 4],
            children: 0,
            tries: 0.0,
            stored: 0.0,
            energy: 0.0,
            arrived: Vec::new(),
        };
        let nodes: Vec<Node> = roots.iter().enumerate().map(node).collect();
        ArrivalTree { leaves: (0..nodes.len()).collect(), nodes, roots }
    }

    /// What it began with.
    pub fn roots(&self) -> &[Root] {
        &self.roots
    }

    /// Number of leaves.
    pub fn leaves(&self) -> usize {
        self.leaves.len()
    }

    /// Root and corners of a leaf.
    pub fn bounds(&self, leaf: usize) -> (usize, [[f64; 4]; 2]) {
        let node = &self.nodes[self.leaves[leaf]];
        (node.root, [node.lo, node.hi])
    }

    /// Measure of a leaf: a part of its root's.
    pub fn volume(&self, leaf: usize) -> f64 {
        self.nodes[self.leaves[leaf]].volume()
    }

    /// Notes that `tries` photons, uniform in the leaf, have been traced.
    pub fn note_tries(&mut self, leaf: usize, tries: usize) {
        self.nodes[self.leaves[leaf]].tries += tries as f64;
    }

    /// Notes that the photon with the numbers `u` in the leaf was stored with `y` flux per measure.
    pub fn note_arrival(&mut self, leaf: usize, u: [f64; 4], y: f64) {
        let node = &mut self.nodes[self.leaves[leaf]];
        let energy = y * y;
        node.stored += 1.0;
        node.energy += energy;
        if node.arrived.len() < REMEMBERED {
            node.arrived.push(Arrived { u, energy });
        }
    }

    /// Cuts leaves until there are `most`, or nothing more is known. Those with the greatest weight that has no photons go first.
    pub fn refine(&mut self, most: usize) {
        let key = |node: &Node, i: usize| {
            let rate = node.stored / node.tries.max(1.0);
            let ripe = node.stored >= LEAST_ARRIVALS && rate < MOST_ARRIVE && node.arrived.len() > 1;
            let weight = node.volume() * (node.energy / node.tries).sqrt() * (1.0 - rate.sqrt());
            // Weights are not negative: their bits sort as they do. Ties: the older first.
            ripe.then(|| (weight.to_bits(), Reverse(i)))
        };
        let mut heap: BinaryHeap<_> = self.leaves.iter().filter_map(|&i| key(&self.nodes[i], i)).collect();
        let mut leaves = self.leaves.len();
        while leaves < most {
            let Some((_, Reverse(i))) = heap.pop() else { break };
            let (axis, at) = self.best_cut(&self.nodes[i]);
            let first = self.nodes.len();
            let halves = halves(&mut self.nodes[i], axis, at);
            self.nodes[i].children = first;
            self.nodes.extend(halves);
            leaves += 1;
            heap.extend((first..first + 2).filter_map(|child| key(&self.nodes[child], child)));
        }
        self.collect_leaves();
    }

    fn collect_leaves(&mut self) {
        self.leaves.clear();
        let mut waiting: Vec<usize> = (0..self.roots.len()).rev().collect();
        while let Some(i) = waiting.pop() {
            match self.nodes[i].children {
                0 => self.leaves.push(i),
                first => waiting.extend([first + 1, first]),
            }
        }
    }

    /// Joins leaves until there are `most`, or one for each root: those that were cut last first.
    pub fn join(&mut self, most: usize) {
        let mut leaves = self.leaves.len();
        // Children come behind their parents: the last node with children has leaves for children.
        for i in (0..self.nodes.len()).rev() {
            if leaves <= most {
                break;
            }
            let first = std::mem::take(&mut self.nodes[i].children);
            if first == 0 {
                continue;
            }
            let part = self.nodes[first].volume() / self.nodes[i].volume();
            let [a, b] = [first, first + 1].map(|child| {
                let node = &mut self.nodes[child];
                // Photons of the two are not of one density: what cuts are made by has to be found anew.
                node.arrived = Vec::new();
                [node.tries, node.stored, node.energy]
            });
            // Means over the volume, as if the tries had been spread evenly.
            let tries = a[0] + b[0];
            let mean = |k: usize| part * a[k] / a[0].max(1.0) + (1.0 - part) * b[k] / b[0].max(1.0);
            let node = &mut self.nodes[i];
            (node.tries, node.stored, node.energy) = (tries, tries * mean(1), tries * mean(2));
            leaves -= 1;
        }
        self.collect_leaves();
    }

    /// Axis and part of its width of the cut that saves most; the middle of the widest axis where arrivals do not tell.
    fn best_cut(&self, node: &Node) -> (usize, f64) {
        let extent = self.roots[node.root].extent;
        let total: f64 = node.arrived.iter().map(|a| a.energy).sum();
        let mean = total / node.arrived.len() as f64;
        // In units of the leaf's own: tries that `arrived` stands for.
        let tries = node.tries * node.arrived.len() as f64 / node.stored;
        let root = |energy: f64, part: f64| {
            let whole = total / tries;
            ((energy + PRIOR * whole) / (tries * part + PRIOR)).sqrt()
        };
        let mut best = (0.0, 0, 0.5);
        for axis in (0..4).filter(|&k| extent[k] > 0.0) {
            let (lo, width) = (node.lo[axis], node.hi[axis] - node.lo[axis]);
            for at in PLACES {
                let below: f64 = node.arrived.iter().filter(|a| a.u[axis] < lo + at * width).map(|a| a.energy).sum();
                let cut = at * root(below, at) + (1.0 - at) * root((total - below).max(0.0), 1.0 - at);
                let gain = 1.0 - cut / root(total, 1.0);
                if gain > best.0 {
                    best = (gain, axis, at);
                }
            }
        }
        let independent = total * total / node.arrived.iter().map(|a| a.energy * a.energy).sum::<f64>().max(1e-300);
        if mean > 0.0 && best.0 * independent > NOISE {
            return (best.1, best.2);
        }
        let span = |k: usize| extent[k] * (node.hi[k] - node.lo[k]);
        let widest = (1..4).fold(0, |best, k| if span(k) > span(best) { k } else { best });
        (widest, 0.5)
    }

    /// Weights of the leaves, in any unit; all 0 if nothing has arrived.
    pub fn weights(&self) -> Vec<f64> {
        // Children come behind their parents: means from the last node to the first, estimates the other way.
        let n = self.nodes.len();
        let (mut mean, mut tries) = (vec![0.0; n], vec![0.0; n]);
        for (i, node) in self.nodes.iter().enumerate().rev() {
            (mean[i], tries[i]) = match node.children {
                0 => (node.energy / node.tries.max(1.0), node.tries),
                first => {
                    let part = self.nodes[first].volume() / node.volume();
                    let [a, b] = [first, first + 1];
                    (part * mean[a] + (1.0 - part) * mean[b], tries[a] + tries[b])
                }
            };
        }
        // Roots lean on all of them together.
        let whole: f64 = self.roots.iter().map(|r| r.share).sum();
        let all = self.roots.iter().zip(&mean).map(|(r, m)| r.share * m).sum::<f64>() / whole;
        let shrunk = |i: usize, to: f64| (tries[i] * mean[i] + PRIOR * to) / (tries[i] + PRIOR);
        let mut estimate: Vec<f64> = (0..n).map(|i| shrunk(i, all)).collect();
        for (i, node) in self.nodes.iter().enumerate().filter(|(_, node)| node.children > 0) {
            for child in node.children..node.children + 2 {
                estimate[child] = shrunk(child, estimate[i]);
            }
        }
        self.leaves.iter().map(|&i| self.nodes[i].volume() * estimate[i].sqrt()).collect()
    }
}

/// The parts of a leaf below and above a place of an axis; it forgets what is its children's from now on.
fn halves(node: &mut Node, axis: usize, at: f64) -> [Node; 2] {
    let place = node.lo[axis] + at * (node.hi[axis] - node.lo[axis]);
    let (below, above): (Vec<_>, Vec<_>) =
        std::mem::take(&mut node.arrived).into_iter().partition(|a| a.u[axis] < place);
    let sum = |a: &[Arrived]| a.iter().map(|a| a.energy).sum::<f64>();
    let (count, energy) = ((below.len() + above.len()).max(1) as f64, sum(&below) + sum(&above));
    let part = |arrived: Vec<Arrived>, share: f64| Node {
        root: node.root,
        share: node.share,
        lo: node.lo,
        hi: node.hi,
        children: 0,
        tries: node.tries * share,
        stored: node.stored * arrived.len() as f64 / count,
        energy: node.energy * sum(&arrived) / energy.max(f64::MIN_POSITIVE),
        arrived,
    };
    let mut parts = [part(below, at), part(above, 1.0 - at)];
    parts[0].hi[axis] = place;
    parts[1].lo[axis] = place;
    parts
}
