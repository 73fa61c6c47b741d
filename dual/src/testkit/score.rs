//! Comparing prediction and truth: one call for a single footprint, one for many.

use std::fmt;
use std::ops::AddAssign;

use super::features::{Kind, View};
use super::scene::Scene;
use crate::footprint::Test;

/// Counts over many footprints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Score {
    /// Edge predicted and seen.
    pub hits: usize,
    /// Edge seen, not predicted.
    pub misses: usize,
    /// Edge predicted, not seen by the oracle's rays (it may be thinner than their grid).
    pub false_alarms: usize,
    /// Neither.
    pub clear: usize,
}

impl Score {
    /// Share of the true edges that were predicted; 1 if there are none.
    pub fn recall(&self) -> f64 {
        ratio(self.hits, self.misses)
    }

    /// Share of the predictions that were true; 1 if there are none.
    pub fn precision(&self) -> f64 {
        ratio(self.hits, self.false_alarms)
    }

    /// Counts one footprint.
    pub fn count(&mut self, predicted: bool, seen: bool) {
        let place = match (predicted, seen) {
            (true, true) => &mut self.hits,
            (false, true) => &mut self.misses,
            (true, false) => &mut self.false_alarms,
            (false, false) => &mut self.clear,
        };
        *place += 1;
    }

    /// Footprints in all.
    pub fn total(&self) -> usize {
        self.hits + self.misses + self.false_alarms + self.clear
    }
}

fn ratio(good: usize, bad: usize) -> f64 {
    if bad == 0 { 1.0 } else { good as f64 / (good + bad) as f64 }
}

impl AddAssign for Score {
    fn add_assign(&mut self, o: Self) {
        self.hits += o.hits;
        self.misses += o.misses;
        self.false_alarms += o.false_alarms;
        self.clear += o.clear;
    }
}

impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(
            f,
            "{} footprints, {} with edges: recall {:.4} ({} missed), precision {:.4} ({} false alarms)",
            self.total(),
            self.hits + self.misses,
            self.recall(),
            self.misses,
            self.precision(),
            self.false_alarms
        )
    }
}

impl Scene {
    /// Scores a test against the oracle with n x n rays per footprint.
    pub fn score(&self, views: &[View], test: Test, order: usize, n: usize) -> Score {
        self.scores(views, &[(test, order)], n)[0]
    }

    /// Scores several tests (each with its order) on the same rays.
    pub fn scores(&self, views: &[View], tests: &[(Test, usize)], n: usize) -> Vec<Score> {
        let mut scores = vec![Score::default(); tests.len()];
        for view in views {
            let truth = self.oracle(view, n).has_edge();
            for (score, (test, order)) in scores.iter_mut().zip(tests) {
                score.count(!self.detect(view, *test, *order).is_empty(), truth);
            }
        }
        scores
    }

    /// Asserts that `bounds` in second order predicts exactly these kinds of events (in any order, repeats ignored), and that 32 x 32
    /// real rays agree: they see an edge if and only if one is expected.
    ///
    /// # Panics
    ///
    /// With a report of the events and of what the rays saw, if not.
    #[track_caller]
    pub fn expect(&self, view: &View, kinds: &[Kind]) {
        let sorted = |mut kinds: Vec<Kind>| {
            kinds.sort_unstable();
            kinds.dedup();
            kinds
        };
        let events = self.detect(view, Test::Bounds, 2);
        let found = sorted(events.iter().map(|e| e.kind).collect());
        let wanted = sorted(kinds.to_vec());
        let truth = self.oracle(view, 32);
        let report = || format!("predicted events: {events:#?}\nrays saw: {:?}", truth.labels);
        assert!(found == wanted, "expected {wanted:?}, predicted {found:?}\n{}", report());
        assert!(truth.has_edge() != wanted.is_empty(), "rays disagree with the expectation {wanted:?}\n{}", report());
    }
}
