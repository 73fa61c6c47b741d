//! Emission that goes where photons of earlier passes have arrived: for lights that are not cut by what they see.
//!
//! ```text
//! cells c       boxes of primary-sample space (u0, u1, v0, v1), cut where arrived and lost photons part (`arrival_tree`)
//! photons       n_c = 1 + rounded (n - cells) (FLOOR volume_c + (1 - FLOOR) w_c / sum w),   w_c = volume_c sqrt(E_c)
//! flux          value / pdf x volume_c / n_c: its sum over a pass is the light's power, whatever was learned
//! width         of a photon's part: its cell's, divided so that all axes span alike on what is lit and the parts number n_c
//! ```
//!
//! An environment's photons are spread over all directions and a disk as wide as all shapes of interest: through the windows of a room
//! few in a thousand get where they are wanted. Which do is a property of small parts of primary-sample space, and these are learned: photons of
//! one pass teach the next ones, and none decides about its own weight, which would bias the estimate (METHODS 3.B, "pilot
//! reuse"). Every cell has a photon at least, and a [`FLOOR`] of them goes by flux: nothing starves, and with [`PER_CELL`] photons a cell none
//! carries more than 2 / FLOOR times that of uniform emission: where photons become few, cells are joined. Numbers are an Owen-scrambled Sobol sequence per cell, a new one whenever cells are cut anew.
//! Source: Jensen 1995 and Peter & Pietrek 1998 (emission where importance is found), with strata of Press & Farrar 1990 in place of their maps:
//! MISER, Neyman's allocation. Measure: volume of primary-sample space, whose natural density is that of the flux ([`Source`]).
//! Bias: none.
//! Not handled: whether the eye sees what is lit; maps whose value over pdf varies within a cell (each photon carries its own value).
//! Verified by `tests/learned.rs`.

use super::arrival_tree::{ArrivalTree, Root};
use super::source::{Kind, Source};
use super::targets::Target;
use super::uniform::{Sequence, numbers, spread};
use super::{Arrival, EmittedRay, MOST_PARAMETERS};
use crate::math::DVec3;
use crate::math::sampler::hash;

/// Part of the photons that goes by flux alone.
const FLOOR: f64 = 0.15;
/// Photons per cell, on average, and cells at most.
const PER_CELL: usize = 8;
const MOST_CELLS: usize = 8192;

/// Photons `first..first + count` of a pass.
#[derive(Clone, Copy, Debug)]
struct Stratum {
    first: usize,
    count: usize,
    /// Widths of a photon's part.
    width: [f64; MOST_PARAMETERS],
}

/// One light.
#[derive(Clone, Debug)]
pub(super) struct Learned<'a> {
    /// The light; if it is at infinity, once for each of the targets: its rays that meet the sphere.
    charts: Vec<Source<'a>>,
    targets: Vec<Target>,
    tree: ArrivalTree,
    strata: Vec<Stratum>,
    /// Photons asked for.
    wanted: usize,
    /// First pass of the present cells, and the seed of their numbers.
    since: u64,
    seed: u64,
    sequence: Sequence,
}

impl<'a> Learned<'a> {
    /// No photons yet. `targets`: what rays from infinity must meet, none: anything. `reach`: typical distance of what is lit.
    pub fn new(source: Source<'a>, targets: &[Target], reach: f64, sequence: Sequence, seed: u64) -> Self {
        let seed = hash(seed, u64::from(source.light));
        let targets = if matches!(source.kind, Kind::Infinity(_)) { targets.to_vec() } else { Vec::new() };
        let directions = if source.has_direction() { reach * source.directions().sqrt() } else { 0.0 };
        // Square roots of the measures of positions and directions (`allocate`, equation 1). Where surfaces turn, a way across them turns the
        // light to everywhere.
        let root = |source: &Source, curved: f64, share: f64| {
            let positions = if source.has_position() { source.area().sqrt() } else { 0.0 };
            let positions = positions.max(directions * curved.sqrt());
            Root { share, extent: [positions, positions, directions, directions] }
        };
        let (mut charts, mut roots) = (Vec::new(), Vec::new());
        for target in &targets {
            let mut chart = source.clone();
            chart.narrow((target.centre, target.radius));
            roots.push(root(&chart, target.curved, chart.area() / source.area()));
            charts.push(chart);
        }
        if charts.is_empty() {
            roots.push(root(&source, 0.0, 1.0));
            charts.push(source);
        }
        let (tree, strata) = (ArrivalTree::new(roots), Vec::new());
        Learned { charts, targets, tree, strata, wanted: 0, since: 0, seed, sequence }
    }

    /// Flux of all charts over that of the light as it came, more than what is emitted where they overlap.
    pub fn kept(&self) -> f64 {
        self.tree.roots().iter().map(|r| r.share).sum()
    }

    /// Whether the ray of the light through `o` along the unit vector `d` can be emitted.
    pub fn holds(&self, o: DVec3, d: DVec3) -> bool {
        self.targets.is_empty() || self.targets.iter().any(|t| t.meets(o, d))
    }

    /// About `wanted` photons in each pass from `pass` on; not fewer than there are cells.
    pub fn set_count(&mut self, wanted: usize, pass: u64) {
        self.wanted = wanted;
        self.allocate(pass);
    }

    /// The light.
    pub fn light(&self) -> u32 {
        self.charts[0].light
    }

    /// Cells.
    pub fn cells(&self) -> usize {
        self.strata.len()
    }

    /// Photons of a pass.
    pub fn count(&self) -> usize {
        self.strata.last().map_or(0, |s| s.first + s.count)
    }

    fn allocate(&mut self, pass: u64) {
        // With other counts a sequence that goes on would repeat itself.
        self.since = pass;
        self.seed = hash(self.seed, 1);
        self.strata.clear();
        if self.wanted == 0 {
            return;
        }
        // A photon for each cell must leave most of them free.
        if 2 * self.tree.leaves() > self.wanted {
            self.tree.join(self.wanted / PER_CELL);
        }
        let weights = self.tree.weights();
        let (sum, kept): (f64, f64) = (weights.iter().sum(), self.kept());
        let free = self.wanted.saturating_sub(weights.len()) as f64;
        let (mut run, mut given, mut first) = (0.0, 0, 0);
        for (leaf, weight) in weights.iter().enumerate() {
            let volume = self.tree.volume(leaf) / kept;
            run += if sum > 0.0 { FLOOR * volume + (1.0 - FLOOR) * weight / sum } else { volume };
            // Rounded as they add up: nobody is more than one photon off.
            let now = (run.min(1.0) * free).round() as usize;
            let count = 1 + now - given;
            given = now;
            let (root, [lo, hi]) = self.tree.bounds(leaf);
            let extent = self.tree.roots()[root].extent;
            let span = std::array::from_fn(|k| extent[k] * (hi[k] - lo[k]));
            let parts = parts(span, count as f64);
            let width = std::array::from_fn(|k| (hi[k] - lo[k]) / parts[k]);
            self.strata.push(Stratum { first, count, width });
            first += count;
        }
    }

    /// The cell of photon `index` of pass `pass`, its chart and its numbers.
    fn numbers(&self, index: usize, pass: u64) -> (usize, usize, [f64; 4]) {
        let leaf = self.strata.partition_point(|s| s.first <= index) - 1;
        let s = &self.strata[leaf];
        let j = pass.saturating_sub(self.since) * s.count as u64 + (index - s.first) as u64;
        let [a, b, c, d] = numbers(self.sequence, self.seed, leaf as u64, j);
        let (chart, [lo, hi]) = self.tree.bounds(leaf);
        // The first two, the best distributed ones, are the direction.
        let f = if self.charts[chart].has_direction() { [c, d, a, b] } else { [a, b, c, d] };
        (leaf, chart, std::array::from_fn(|k| lo[k] + f[k] * (hi[k] - lo[k])))
    }

    /// Photon `index`, which must be less than [`Self::count`], with the number of its cell as stratum.
    pub fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let (leaf, chart, u) = self.numbers(index, pass);
        let source = &self.charts[chart];
        let (start, flux) = source.emit(u)?;
        // Smaller spheres have rays of their own.
        if self.targets[..chart].iter().any(|t| t.meets(start.o.as_dvec3(), start.d)) {
            return None;
        }
        // Each chart is a light of its part of the flux.
        let share = self.tree.volume(leaf) / self.tree.roots()[chart].share;
        let Stratum { count, width, .. } = self.strata[leaf];
        Some(EmittedRay {
            o: start.o,
            d: start.d.as_vec3(),
            flux: flux * (share / count as f64) as f32,
            light: source.light,
            stratum: leaf as u32,
            spread: spread(&start, width, patch(source, width)),
        })
    }

    /// Takes note of what became of the photons of pass `pass`, all of which were traced; `arrived`: those that got where they were wanted.
    pub fn note(&mut self, arrived: impl Iterator<Item = Arrival>, pass: u64) {
        for (leaf, s) in self.strata.iter().enumerate() {
            self.tree.note_tries(leaf, s.count);
        }
        for Arrival { index, flux } in arrived {
            let (leaf, _, u) = self.numbers(index, pass);
            let y = f64::from(flux) * self.strata[leaf].count as f64 / self.tree.volume(leaf);
            if y.is_finite() && y > 0.0 {
                self.tree.note_arrival(leaf, u, y);
            }
        }
    }

    /// Follows what has been noted, from pass `pass` on.
    pub fn follow(&mut self, pass: u64) {
        self.tree.refine((self.wanted / PER_CELL).min(MOST_CELLS));
        self.allocate(pass);
    }
}

/// Side of the square that stands for positions on several triangles; 0 if there is one.
fn patch(source: &Source, width: [f64; MOST_PARAMETERS]) -> f64 {
    match &source.kind {
        Kind::Lamp(lamp) if width[0] * (lamp.cdf.len() - 1) as f64 > 1.0 && lamp.cdf.len() > 2 => {
            (source.area() * width[0] * width[1]).sqrt()
        }
        _ => 0.0,
    }
}

/// Into how many parts to divide the axes of a box of the given spans so that `n` parts are as nearly cubes as can be; an axis that does not
/// matter into one.
fn parts(span: [f64; MOST_PARAMETERS], n: f64) -> [f64; MOST_PARAMETERS] {
    // Axes shorter than the cubes stay whole, and the others share their part.
    let mut divided = span.map(|s| s > 0.0);
    loop {
        let axes = divided.iter().filter(|d| **d).count();
        let volume: f64 = (0..MOST_PARAMETERS).filter(|&k| divided[k]).map(|k| span[k]).product();
        let side = (volume / n).powf(1.0 / axes.max(1) as f64);
        let short = (0..MOST_PARAMETERS).filter(|&k| divided[k] && span[k] < side);
        match short.min_by(|&a, &b| span[a].total_cmp(&span[b])) {
            Some(k) => divided[k] = false,
            None => return std::array::from_fn(|k| if divided[k] { span[k] / side } else { 1.0 }),
        }
    }
}
