//! Edge-adaptive emission: photons dense where what a light sees changes, few where it does not.
//!
//! ```text
//! partition   cells c of the light's emission (`cell`), top-down: of all leaves the one of largest weight is cut, across the axis that
//!             contributes most to what it spans on the surface it lights, until there are as many as asked for
//! weight      w_c = flux_c sqrt(sigma_s^2 + sigma_e^2),  sigma_e = 1 if the detector finds an event in the cell, else 0
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
//! Not handled: cylinders, environments, large meshes (emitted as by [`Uniform`]); lights of less than [`LEAST`] photons.
//! Verified by `tests/adaptive.rs`.

use super::allocate::{Allocation, apportion, light_weights, powers};
use super::cell::{Cell, Cutter};
use super::interest::Interest;
use super::source::Source;
use super::uniform::{Sequence, Uniform, numbers};
use super::{DensityMap, EmissionDensity, EmittedRay};
use crate::accel::{Accel, Ray};
use crate::edge::predicted::D1;
use crate::edge::{EdgeDetector, Facet, View};
use crate::math::DVec3;
use crate::scene::Scene;
use dualux_dual::Family;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A light with fewer photons is not cut.
pub const LEAST: usize = 32;
/// Faces are cut to this width before they are probed: larger cells hold events anyway.
const COARSE: f64 = 0.51;
/// Cells that meet nothing at all: light that leaves the scene.
const LOST: f64 = 0.02;
/// Cells cut at a time, at most, and the part of all leaves that may be.
const BATCH: (usize, usize) = (512, 8);

/// Settings of [`EdgeAdaptive`].
#[derive(Clone, Copy)]
pub struct Settings<'s> {
    /// Shapes that photons are wanted on as their first hit; `None`: anywhere.
    pub interest: Option<&'s dyn Fn(u32) -> bool>,
    /// Cells, at most; 0: half as many as photons, 16384 at most.
    pub cells: usize,
    /// sigma_s: weight of flux in cells without event, relative to that in cells with one.
    pub smooth: f64,
    /// Numbers of photons inside of cells.
    pub sequence: Sequence,
}

/// Most cells unless asked for more.
pub const MOST_CELLS: usize = 16_384;

impl Default for Settings<'_> {
    fn default() -> Self {
        Settings { interest: None, cells: 0, smooth: 0.3, sequence: Sequence::OwenSobol }
    }
}

/// A leaf of the partition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stratum {
    /// The cell.
    pub cell: Cell,
    /// Its flux, mean of the channels (an estimate where the light is textured).
    pub flux: f64,
    /// Whether an event was found in it.
    pub event: bool,
    /// Photons of a pass.
    pub photons: usize,
    /// First of them.
    pub first: usize,
    /// Photons drawn before the counts were changed for the last time.
    drawn: u64,
    weight: f64,
    /// What each axis contributes to what the cell spans, world units.
    extent: [f64; 4],
    /// Widths of a photon's part, in the cell's coordinates.
    width: [f64; 4],
}

/// What a partition is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Leaves.
    pub cells: usize,
    /// Leaves with an event.
    pub events: usize,
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
    rest: Uniform<'a>,
    power: Vec<f64>,
    n: usize,
    /// First pass of the present counts.
    since: u64,
    seed: u64,
    sequence: Sequence,
    summary: Summary,
}

struct Builder<'a, 'b> {
    cutters: &'b [Option<Cutter<'a>>],
    detector: EdgeDetector<'b>,
    interest: Option<Interest<'b>>,
    smooth: f64,
}

impl Builder<'_, '_> {
    /// A cell with its weight; `None` if it needs no photons.
    fn evaluate(&self, cell: Cell) -> Option<Stratum> {
        let cutter = self.cutters[cell.light as usize].as_ref()?;
        let flux = cutter.flux(&cell);
        if !(flux > 0.0) {
            return None;
        }
        if let Some(interest) = &self.interest {
            let own = cutter.own(&cell).filter(|o| !interest.wants(o.0));
            let (first, second) = cutter.bundles(&cell);
            let reached = interest.reached(&first, own) || second.is_some_and(|b| interest.reached(&b, own));
            if !reached {
                return None;
            }
        }
        let family = cutter.family(&cell);
        let length = family.d.norm2().sqrt();
        let (distance, shape) = self.distance(cutter, &cell);
        let coarse = cell.width()[2..].iter().any(|w| *w > COARSE) && cutter.source.has_direction();
        let event = coarse || self.has_event(cutter, &cell, &family, shape.map(|s| (s, distance / length)));
        let span = |v: dualux_dual::Vec3<f64>| 2.0 * v.norm2().sqrt();
        let extent = std::array::from_fn(|k| match k {
            0 | 1 => span(family.o_p[k]),
            _ => span(family.d_p[k]) / length * distance,
        });
        let sigma = match (event, shape) {
            (true, _) => (1.0 + self.smooth * self.smooth).sqrt(),
            (false, Some(_)) => self.smooth,
            (false, None) => LOST,
        };
        let weight = flux * sigma;
        Some(Stratum { cell, flux, event, photons: 0, first: 0, drawn: 0, weight, extent, width: [0.0; 4] })
    }

    /// What the centre ray meets, and where; the size of the scene if nothing.
    fn distance(&self, cutter: &Cutter, cell: &Cell) -> (f64, Option<u32>) {
        let far = f64::from(self.detector.scene.bounds.1);
        let Some((start, _)) = cutter.draw(cell, [0.5; 4]) else { return (far, None) };
        let ray = Ray { o: start.o, d: start.d.as_vec3(), tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
        self.detector.accel.closest(&ray).map_or((far, None), |hit| (f64::from(hit.t), Some(hit.shape)))
    }

    fn has_event(&self, cutter: &Cutter, cell: &Cell, family: &Family<f64, 4>, front: Option<(u32, f64)>) -> bool {
        let t = [0.0, f64::INFINITY];
        let exclude = cutter.own(cell).map(|(shape, prim)| Facet { shape, prim });
        let view = if !cutter.source.has_position() {
            View::new(Family::fixed(family.o, family.d, [family.d_p[2], family.d_p[3]]), t)
        } else if !cutter.source.has_direction() {
            View::new(Family::parallel(family.o, [family.o_p[0], family.o_p[1]], family.d), t)
        } else {
            return self.detector.predict(&family.ray::<D1<4>>(), t, exclude, front).needs_samples();
        };
        view.is_none_or(|view| self.detector.any(&view, exclude).needs_samples())
    }
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
        let cut = |light: usize| power[light] * n as f64 >= LEAST as f64 * total;
        let cutters: Vec<_> =
            sources.iter().enumerate().map(|(i, s)| cut(i).then(|| Cutter::new(scene, s.clone())).flatten()).collect();
        let most = if settings.cells > 0 { settings.cells } else { (n / 2).min(MOST_CELLS) };
        let builder =
            Builder { cutters: &cutters, detector: EdgeDetector::new(scene, accel), interest, smooth: settings.smooth };
        let (mut strata, probes) = partition(&builder, most);
        strata.sort_by(|a, b| order(&a.cell, &b.cell));
        for (light, power) in power.iter_mut().enumerate().filter(|(l, _)| cutters[*l].is_some()) {
            *power = strata.iter().filter(|s| s.cell.light as usize == light).map(|s| s.flux).sum();
        }
        let summary = Summary {
            cells: strata.len(),
            events: strata.iter().filter(|s| s.event).count(),
            probes,
            power: total,
            kept: power.iter().sum(),
        };
        let rest = Uniform::with(scene, sources, settings.sequence, seed ^ 1);
        let sequence = settings.sequence;
        let mut adaptive = EdgeAdaptive { cutters, strata, rest, power, n, since: 0, seed, sequence, summary };
        adaptive.allocate(None);
        adaptive
    }

    /// As [`Uniform::set_light_weights`], from pass `pass` on: lights are given photons by what they achieved, cells keep their part of
    /// their light and go on with their own sequence.
    pub fn set_light_weights(&mut self, learned: &[f32], pass: u64) {
        for s in &mut self.strata {
            s.drawn += pass.saturating_sub(self.since) * s.photons as u64;
        }
        self.since = pass;
        self.rest.renew_numbers();
        self.allocate(Some(learned));
    }

    fn allocate(&mut self, learned: Option<&[f32]>) {
        let weights = light_weights(self.power.clone(), learned);
        let mut allocation = Allocation::new(&weights, self.n);
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
        self.rest.set_allocation(allocation);
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
            None => self.power[light as usize] > 0.0 && self.rest.source(light).invert(o, d).is_some(),
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

/// Cuts until there are `most` leaves; those and the number of cells evaluated.
fn partition(builder: &Builder, most: usize) -> (Vec<Stratum>, usize) {
    let roots: Vec<Cell> = builder.cutters.iter().flatten().flat_map(Cutter::roots).collect();
    let mut probes = roots.len();
    let mut all: Vec<Stratum> = roots.into_par_iter().filter_map(|c| builder.evaluate(c)).collect();
    // Weights are not negative: their bits sort as they do. Ties: the older first.
    let key = |all: &[Stratum], i: usize| (all[i].weight.to_bits(), Reverse(i));
    let mut heap: BinaryHeap<_> = (0..all.len()).map(|i| key(&all, i)).collect();
    let mut dead = vec![false; all.len()];
    let mut leaves = all.len();
    while leaves < most && !heap.is_empty() {
        let batch = (heap.len() / BATCH.1).clamp(1, BATCH.0).min(most - leaves);
        let cut: Vec<usize> = (0..batch).filter_map(|_| heap.pop()).map(|(_, Reverse(i))| i).collect();
        let halves: Vec<Cell> = cut
            .iter()
            .flat_map(|&i| {
                let s = &all[i];
                // The first of the longest.
                let axis = (0..4).fold(0, |best, k| if s.extent[k] > s.extent[best] { k } else { best });
                s.cell.halves(axis)
            })
            .collect();
        probes += halves.len();
        let children: Vec<Option<Stratum>> = halves.into_par_iter().map(|c| builder.evaluate(c)).collect();
        for i in cut {
            dead[i] = true;
            leaves -= 1;
        }
        for child in children.into_iter().flatten() {
            all.push(child);
            dead.push(false);
            heap.push(key(&all, all.len() - 1));
            leaves += 1;
        }
    }
    (all.into_iter().zip(dead).filter(|(_, dead)| !dead).map(|(s, _)| s).collect(), probes)
}

impl EmissionDensity for EdgeAdaptive<'_> {
    fn count(&self) -> usize {
        self.in_cells() + self.rest.count()
    }

    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let cells = self.in_cells();
        if index >= cells {
            let ray = self.rest.emit(index - cells, pass)?;
            return Some(EmittedRay { stratum: ray.stratum + self.strata.len() as u32, ..ray });
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

    fn set_light_weights(&mut self, learned: &[f32], pass: u64) {
        EdgeAdaptive::set_light_weights(self, learned, pass);
    }

    fn density_map(&self, light: u32, size: usize) -> Option<DensityMap> {
        EdgeAdaptive::density_map(self, light, size)
    }
}
