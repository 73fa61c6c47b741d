//! Edge-adaptive emission: photons dense where what a light sees changes, few where it does not.
//!
//! ```text
//! partition   cells c of the light's emission (`cell`), top-down: of all leaves the one of largest weight is cut, across the axis that
//!             contributes most to what it spans on the surface it lights, or along the edge (`cut`), until there are as many as asked for
//! weight      w_c = flux_c sqrt(sigma_s^2 + sigma_e^2),  sigma_e = 1 if the detector finds an event in the cell, or if its
//!             linearisation fails behind mirrors and glass (`linearisation`), else 0
//! photons     n_c = 1 + round(systematically) of the rest in proportion to w_c, jittered in the cell in proportion to flux
//! flux        value x measure(c) / n_c: the sum over a pass is the power, whatever the partition
//! ```
//!
//! One probe per cell: the detector asks whether a margin can vanish among the cell's rays (exactly from points and for parallel light, to
//! first order in four parameters for lamps), and the centre ray gives the distance. Centre rays are no photons, and no photon decides
//! about refinement: a stored sample that did would bias the estimate (METHODS 3.B, "pilot reuse"). The partition is
//! built once, from scene and settings alone; passes differ in their jitter (an Owen-scrambled Sobol sequence per cell).
//! With an *interest* (photons for a caustic map), cells that cannot reach such a shape first are left out with their flux
//! ([`Interest`]); lights at infinity start from the disk of its bounding sphere. The sum is then the flux of what is left.
//! Source: Namae and Makino (refinement by predicted neighbours), METHODS 3.B (strata, weights). Bias: none.
//! Not handled: cylinders, environments, large meshes (their density is learned instead, see [`Learned`]); lights of less than [`LEAST`]
//! photons (emitted as by [`Uniform`]).
//! Verified by `tests/adaptive.rs`.

use super::allocate::{Allocation, apportion, light_weights, powers};
use super::cell::{Cell, Cutter};
use super::cut::Cut;
use super::interest::Interest;
use super::learned::Learned;
use super::partition::{Builder, Stratum, partition};
use super::source::Source;
use super::uniform::{Sequence, Uniform, numbers};
use super::{Arrival, DensityMap, EmissionDensity, EmittedRay};
use crate::accel::Accel;
use crate::edge::EdgeDetector;
use crate::math::DVec3;
use crate::scene::Scene;
use std::ops::Range;

/// A light with fewer photons is not cut.
pub const LEAST: usize = 32;

/// Settings of [`EdgeAdaptive`].
#[derive(Clone, Copy)]
pub struct Settings<'s> {
    /// Shapes that photons are wanted on as their first hit; `None`: anywhere.
    pub interest: Option<&'s dyn Fn(u32) -> bool>,
    /// Photons that later passes may have; 0: as many as the first. A light is cut, or learns, if it may expect 32 of them.
    pub later: usize,
    /// Cells, at most; 0: half as many as photons, 16384 at most.
    pub cells: usize,
    /// sigma_s: weight of flux in cells without event, relative to that in cells with one.
    pub smooth: f64,
    /// Where cells are cut.
    pub cut: Cut,
    /// Error of a cell's linearisation, relative to what it spans, above which it weighs like one with an event; infinite: it is not asked for.
    pub linearity: f64,
    /// Numbers of photons inside of cells.
    pub sequence: Sequence,
}

/// Most cells unless asked for more.
pub const MOST_CELLS: usize = 16_384;

/// [`Settings::linearity`] if nothing is said. Error of the caustic layer over that without, one pass, AD kernels: cornell-spheres with 5,000
/// photons 0.75, with 32,768 photons 0.81 (16 and 20 seeds); caustic-ring 1.01. Thresholds of 0.5 and 0.2 came to 0.8, 0.97 and 1.02, cuts along
/// edges in place of middles to 0.97, 0.91 and 1.02: differences near the noise of these runs.
pub const LINEARITY: f64 = 1.0;

impl Default for Settings<'_> {
    fn default() -> Self {
        let (cut, linearity, sequence) = (Cut::default(), LINEARITY, Sequence::OwenSobol);
        Settings { interest: None, later: 0, cells: 0, smooth: 0.3, cut, linearity, sequence }
    }
}

/// What a partition is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Leaves.
    pub cells: usize,
    /// Leaves with an event.
    pub events: usize,
    /// Leaves without one whose linearisation fails.
    pub bent: usize,
    /// Cells that were looked at.
    pub probes: usize,
    /// Power of the lights, mean of the channels.
    pub power: f64,
    /// Part of it that is emitted (all without interest).
    pub kept: f64,
}

/// Strata by the edges that a light sees.
#[derive(Clone, Debug)]
pub struct EdgeAdaptive<'a> {
    cutters: Vec<Option<Cutter<'a>>>,
    strata: Vec<Stratum>,
    /// Lights that are not cut, after the cells.
    learned: Vec<Learned<'a>>,
    /// Where each of these begins among them: its photons and its cells.
    begins: Vec<[usize; 2]>,
    /// Lights of few photons, after these.
    rest: Uniform<'a>,
    power: Vec<f64>,
    n: usize,
    /// What lights have achieved, once that is known.
    achieved: Option<Vec<f32>>,
    /// First pass of the present counts.
    since: u64,
    seed: u64,
    sequence: Sequence,
    summary: Summary,
}

impl<'a> EdgeAdaptive<'a> {
    /// The partition for about `n` photons a pass.
    pub fn new(scene: &'a Scene, accel: &'a Accel, n: usize, settings: &Settings, seed: u64) -> Self {
        let interest = settings.interest.map(|wanted| Interest::new(scene, accel, wanted));
        let mut power = powers(scene);
        let total: f64 = power.iter().sum();
        let mut sources = Source::all(scene);
        if let Some(interest) = &interest {
            for (source, power) in sources.iter_mut().zip(&mut power) {
                let area = source.area();
                match interest.sphere() {
                    Some(sphere) => source.narrow(sphere),
                    None => *power = 0.0,
                }
                *power *= if area > 0.0 { source.area() / area } else { 1.0 };
            }
        }
        // Photons are shared by what is left of the lights.
        let (left, most) = (power.iter().sum::<f64>(), n.max(settings.later) as f64);
        let cut = |light: usize| power[light] * most >= LEAST as f64 * left && left > 0.0;
        let cutters: Vec<_> =
            sources.iter().enumerate().map(|(i, s)| cut(i).then(|| Cutter::new(scene, s.clone())).flatten()).collect();
        let reach = f64::from(scene.bounds.1);
        let learned = sources.iter().enumerate().filter(|(i, _)| cut(*i) && cutters[*i].is_none());
        let targets = learned.clone().next().and(interest.as_ref()).map_or(Vec::new(), Interest::targets);
        let learned: Vec<Learned> =
            learned.map(|(_, s)| Learned::new(s.clone(), &targets, reach, settings.sequence, seed ^ 2)).collect();
        learned.iter().for_each(|l| power[l.light() as usize] *= l.kept().min(1.0));
        let most = if settings.cells > 0 { settings.cells } else { (n / 2).min(MOST_CELLS) };
        let Settings { smooth, cut, linearity, .. } = *settings;
        let detector = EdgeDetector::new(scene, accel);
        let builder = Builder { cutters: &cutters, detector, interest, smooth, cut, linearity };
        let (mut strata, probes) = partition(&builder, most);
        strata.sort_by(|a, b| order(&a.cell, &b.cell));
        for (light, power) in power.iter_mut().enumerate().filter(|(l, _)| cutters[*l].is_some()) {
            *power = strata.iter().filter(|s| s.cell.light as usize == light).map(|s| s.flux).sum();
        }
        let summary = Summary {
            cells: strata.len(),
            events: strata.iter().filter(|s| s.event).count(),
            bent: strata.iter().filter(|s| s.bent).count(),
            probes,
            power: total,
            kept: power.iter().sum(),
        };
        let rest = Uniform::with(scene, sources, settings.sequence, seed ^ 1);
        let sequence = settings.sequence;
        let mut adaptive = EdgeAdaptive {
            cutters,
            strata,
            learned,
            begins: Vec::new(),
            rest,
            power,
            n,
            achieved: None,
            since: 0,
            seed,
            sequence,
            summary,
        };
        adaptive.allocate();
        adaptive
    }

    /// As [`Uniform::set_light_weights`], from pass `pass` on: lights are given photons by what they achieved, cells keep their part of
    /// their light and go on with their own sequence.
    pub fn set_light_weights(&mut self, learned: &[f32], pass: u64) {
        self.achieved = Some(learned.to_vec());
        self.renew(pass);
    }

    /// About `n` photons a pass from pass `pass` on, one in each cell at least. The partition stays as it is.
    pub fn set_count(&mut self, n: usize, pass: u64) {
        self.n = n;
        self.renew(pass);
    }

    /// Other counts from pass `pass` on.
    fn renew(&mut self, pass: u64) {
        for s in &mut self.strata {
            s.drawn += pass.saturating_sub(self.since) * s.photons as u64;
        }
        self.since = pass;
        self.rest.renew_numbers();
        self.allocate();
    }

    fn allocate(&mut self) {
        let weights = light_weights(self.power.clone(), self.achieved.as_deref());
        // What has photons of its own must not share those of the tail: it would be emitted twice.
        let mut own: Vec<bool> = self.cutters.iter().map(Option::is_some).collect();
        self.learned.iter().for_each(|l| own[l.light() as usize] = true);
        let mut allocation = Allocation::keeping(&weights, self.n, |light| own[light]);
        let mut first = 0;
        let mut begin = 0;
        while begin < self.strata.len() {
            let light = self.strata[begin].cell.light;
            let len = self.strata[begin..].partition_point(|s| s.cell.light == light);
            let cells = &mut self.strata[begin..begin + len];
            let count = allocation.counts[light as usize].max(len);
            allocation.counts[light as usize] = 0;
            let total: f64 = cells.iter().map(|s| s.weight).sum();
            let shares: Vec<f64> = cells.iter().map(|s| s.weight / total).collect();
            for (s, photons) in cells.iter_mut().zip(apportion(&shares, count)) {
                s.photons = photons;
                s.first = first;
                s.width = photon_width(s);
                first += photons;
            }
            begin += len;
        }
        for learned in &mut self.learned {
            let count = &mut allocation.counts[learned.light() as usize];
            learned.set_count(std::mem::take(count), self.since);
        }
        self.begin_learned();
        self.rest.set_allocation(allocation);
    }

    /// To be called when cells of lights that learn have changed.
    fn begin_learned(&mut self) {
        let mut end = [0; 2];
        let add = |l: &Learned| {
            let begin = end;
            end = [end[0] + l.count(), end[1] + l.cells()];
            begin
        };
        self.begins = self.learned.iter().map(add).collect();
    }

    /// The cells.
    pub fn strata(&self) -> &[Stratum] {
        &self.strata
    }

    pub(super) fn cutter(&self, light: u32) -> Option<&Cutter<'a>> {
        self.cutters.get(light as usize)?.as_ref()
    }

    /// Figures of the partition.
    pub fn summary(&self) -> Summary {
        self.summary
    }

    /// Whether the density can emit the ray of light `light` from `o` (on the lamp) along `d`: false where it was left out.
    pub fn holds(&self, light: u32, o: DVec3, d: DVec3) -> bool {
        match &self.cutters[light as usize] {
            Some(cutter) => {
                cutter.coordinates(o, d).is_some_and(|(face, at)| self.stratum_at(light, face, at).is_some())
            }
            None => {
                let learned = self.learned.iter().find(|l| l.light() == light);
                let kept = learned.is_none_or(|l| l.holds(o, d));
                kept && self.power[light as usize] > 0.0 && self.rest.source(light).invert(o, d).is_some()
            }
        }
    }

    /// The cell of the ray of light `light` from `o` along `d`, and the numbers in [0, 1)^4 that it is drawn by.
    pub fn invert(&self, light: u32, o: DVec3, d: DVec3) -> Option<(usize, [f64; 4])> {
        let cutter = self.cutters[light as usize].as_ref()?;
        let (face, at) = cutter.coordinates(o, d)?;
        let id = self.stratum_at(light, face, at)?;
        Some((id, cutter.invert(&self.strata[id].cell, at)))
    }

    /// Walks over all cells of the light.
    fn stratum_at(&self, light: u32, face: u8, at: [f64; 4]) -> Option<usize> {
        let holds = |s: &Stratum| s.cell.light == light && s.cell.face == face && s.cell.holds(at, 1e-4);
        self.strata.iter().position(holds)
    }

    fn in_cells(&self) -> usize {
        self.strata.last().map_or(0, |s| s.first + s.photons)
    }

    /// Photons and cells of the lights that learn.
    fn in_learned(&self) -> [usize; 2] {
        self.begins.last().zip(self.learned.last()).map_or([0; 2], |(b, l)| [b[0] + l.count(), b[1] + l.cells()])
    }

    /// Photon `index` of those behind the cells.
    fn emit_uncut(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let [photons, cells] = self.in_learned();
        let (ray, before) = if index < photons {
            let k = self.begins.partition_point(|b| b[0] <= index) - 1;
            (self.learned[k].emit(index - self.begins[k][0], pass)?, self.begins[k][1])
        } else {
            (self.rest.emit(index - photons, pass)?, cells)
        };
        Some(EmittedRay { stratum: ray.stratum + (self.strata.len() + before) as u32, ..ray })
    }
}

/// Order of cells: neighbours near to each other.
fn order(a: &Cell, b: &Cell) -> std::cmp::Ordering {
    let key = |c: &Cell| (c.light, c.face);
    key(a).cmp(&key(b)).then_with(|| {
        let pairs = a.lo.iter().zip(&b.lo).map(|(x, y)| x.total_cmp(y));
        pairs.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
    })
}

/// A photon's part of its cell: positions and directions each divided so that both contribute alike, if they can (`allocate`, equation 1).
fn photon_width(s: &Stratum) -> [f64; 4] {
    let n = s.photons.max(1) as f64;
    let w = s.cell.width();
    let (position, direction) = (s.extent[0].max(s.extent[1]), s.extent[2].max(s.extent[3]));
    let k = if position <= 0.0 {
        1.0
    } else if direction <= 0.0 {
        n
    } else {
        (n.sqrt() * position / direction).clamp(1.0, n)
    };
    let (a, b) = (k.sqrt(), (n / k).sqrt());
    [w[0] / a, w[1] / a, w[2] / b, w[3] / b]
}

impl EmissionDensity for EdgeAdaptive<'_> {
    fn count(&self) -> usize {
        self.in_cells() + self.in_learned()[0] + self.rest.count()
    }

    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let cells = self.in_cells();
        if index >= cells {
            return self.emit_uncut(index - cells, pass);
        }
        let id = self.strata.partition_point(|s| s.first <= index) - 1;
        let s = &self.strata[id];
        let cutter = self.cutters[s.cell.light as usize].as_ref()?;
        let j = s.drawn + pass.saturating_sub(self.since) * s.photons as u64 + (index - s.first) as u64;
        let v = numbers(self.sequence, self.seed, id as u64, j);
        let f = if cutter.source.has_direction() { [v[2], v[3], v[0], v[1]] } else { v };
        let (start, factor) = cutter.draw(&s.cell, f)?;
        Some(EmittedRay {
            o: start.o,
            d: start.d.as_vec3(),
            flux: start.value * (factor / s.photons as f64) as f32,
            light: s.cell.light,
            stratum: id as u32,
            spread: start.spread(s.width.map(|w| 0.5 * w)),
        })
    }

    fn learners(&self) -> Range<usize> {
        self.in_cells()..self.in_cells() + self.in_learned()[0]
    }

    fn note(&mut self, arrived: &[Arrival], pass: u64) {
        let mut first = self.in_cells();
        for learned in &mut self.learned {
            // They come in order of their indices.
            let end = first + learned.count();
            let own = arrived.partition_point(|a| a.index < first)..arrived.partition_point(|a| a.index < end);
            learned.note(arrived[own].iter().map(|a| Arrival { index: a.index - first, ..*a }), pass);
            first = end;
        }
    }

    fn follow(&mut self, pass: u64) {
        self.learned.iter_mut().for_each(|learned| learned.follow(pass));
        self.begin_learned();
    }

    fn set_light_weights(&mut self, learned: &[f32], pass: u64) {
        EdgeAdaptive::set_light_weights(self, learned, pass);
    }

    fn set_count(&mut self, n: usize, pass: u64) {
        EdgeAdaptive::set_count(self, n, pass);
    }

    fn density_map(&self, light: u32, size: usize) -> Option<DensityMap> {
        EdgeAdaptive::density_map(self, light, size)
    }
}
