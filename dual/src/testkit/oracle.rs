//! The oracle: n x n real rays through a footprint.

use super::features::View;
use super::scene::Scene;

/// What one ray sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Label {
    /// It starts below the horizon.
    Below,
    /// Nothing before `t_max`.
    Nothing,
    /// A part of a shape.
    Shape(usize, u32),
}

/// What a footprint's rays saw.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Truth {
    /// Different labels, sorted.
    pub labels: Vec<Label>,
}

impl Truth {
    /// True if the rays saw more than one thing.
    pub fn has_edge(&self) -> bool {
        self.labels.len() > 1
    }
}

impl Scene {
    /// Label of the ray at `p`.
    pub fn label(&self, view: &View, p: [f64; 2]) -> Label {
        let ray = view.family.at(p);
        if view.horizon.is_some_and(|n| n.dot(ray.d) <= 0.0) {
            return Label::Below;
        }
        match self.hit(&ray, view.t_max, view.exclude) {
            Some((shape, hit)) => Label::Shape(shape, hit.part),
            None => Label::Nothing,
        }
    }

    /// Traces n x n rays at the centres of the footprint's sub-squares.
    pub fn oracle(&self, view: &View, n: usize) -> Truth {
        let at = |i: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
        let mut labels = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let label = self.label(view, [at(i), at(j)]);
                if let Err(place) = labels.binary_search(&label) {
                    labels.insert(place, label);
                }
            }
        }
        Truth { labels }
    }
}
