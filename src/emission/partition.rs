//! The partition of emission: cells cut top-down where the detector says that something changes.
//!
//! Of all leaves those of largest weight are cut ([`Place`]), in batches, until there are as many as asked for. Each cell is
//! looked at once, by its centre's probe; cells that need no photons are dropped with their flux. See [`super::EdgeAdaptive`] for
//! weights. Determinism: batches depend on counts only, ties go to the older cell.

use super::cell::{Cell, Cutter};
use super::cut::{Cut, Place, margin};
use super::interest::Interest;
use super::linearisation;
use crate::accel::Ray;
use crate::edge::predicted::D1;
use crate::edge::{EdgeDetector, Facet, Linear, View};
use dualux_dual::Family;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Faces are cut to this width before they are probed: larger cells hold events anyway.
const COARSE: f64 = 0.51;
/// Cells that meet nothing at all: light that leaves the scene.
const LOST: f64 = 0.02;
/// Cells cut at a time, at most, and the part of all leaves that may be.
const BATCH: (usize, usize) = (512, 8);

/// A leaf of the partition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stratum {
    /// The cell.
    pub cell: Cell,
    /// Its flux, mean of the channels (an estimate where the light is textured).
    pub flux: f64,
    /// Whether an event was found in it.
    pub event: bool,
    /// Whether, without one, its rays do not land where derivatives say (`linearisation.rs`).
    pub bent: bool,
    /// Photons of a pass.
    pub photons: usize,
    /// First of them.
    pub first: usize,
    /// Photons drawn before the counts were changed for the last time.
    pub(super) drawn: u64,
    pub(super) weight: f64,
    /// What each axis contributes to what the cell spans, world units.
    pub(super) extent: [f64; 4],
    /// Widths of a photon's part, in the cell's coordinates.
    pub(super) width: [f64; 4],
    /// Where it is cut next.
    place: Place,
}

/// What cells are judged by.
pub(super) struct Builder<'a, 'b> {
    pub cutters: &'b [Option<Cutter<'a>>],
    pub detector: EdgeDetector<'b>,
    pub interest: Option<Interest<'b>>,
    /// See [`super::Settings`].
    pub smooth: f64,
    pub cut: Cut,
    pub linearity: f64,
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
        let front = shape.map(|s| (s, distance / length));
        let (found, edge) = if coarse { (true, None) } else { self.event(cutter, &cell, &family, front) };
        let event = coarse || found;
        let bent = !event && linearisation::fails(&self.detector, cutter, &cell, self.linearity);
        let span = |v: dualux_dual::Vec3<f64>| 2.0 * v.norm2().sqrt();
        let extent = std::array::from_fn(|k| match k {
            0 | 1 => span(family.o_p[k]),
            _ => span(family.d_p[k]) / length * distance,
        });
        let sigma = match (event || bent, shape) {
            (true, _) => (1.0 + self.smooth * self.smooth).sqrt(),
            (false, Some(_)) => self.smooth,
            (false, None) => LOST,
        };
        let weight = flux * sigma;
        let place = edge.map_or_else(|| Place::middle(&extent), |margin| Place::along(&margin, &extent));
        let (photons, first, drawn, width) = (0, 0, 0, [0.0; 4]);
        Some(Stratum { cell, flux, event, bent, photons, first, drawn, weight, extent, width, place })
    }

    /// What the centre ray meets, and where; the size of the scene if nothing.
    fn distance(&self, cutter: &Cutter, cell: &Cell) -> (f64, Option<u32>) {
        let far = f64::from(self.detector.scene.bounds.1);
        let Some((start, _)) = cutter.draw(cell, [0.5; 4]) else { return (far, None) };
        let ray = Ray { o: start.o, d: start.d.as_vec3(), tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
        self.detector.accel.closest(&ray).map_or((far, None), |hit| (f64::from(hit.t), Some(hit.shape)))
    }

    /// Whether there is an event, and if cells are cut along edges the margin of the nearest one.
    fn event(
        &self,
        cutter: &Cutter,
        cell: &Cell,
        family: &Family<f64, 4>,
        front: Option<(u32, f64)>,
    ) -> (bool, Option<Linear<4>>) {
        let aligned = self.cut == Cut::Edge;
        let t = [0.0, f64::INFINITY];
        let exclude = cutter.own(cell).map(|(shape, prim)| Facet { shape, prim });
        let (view, axes) = if !cutter.source.has_position() {
            (View::new(Family::fixed(family.o, family.d, [family.d_p[2], family.d_p[3]]), t), [2, 3])
        } else if !cutter.source.has_direction() {
            (View::new(Family::parallel(family.o, [family.o_p[0], family.o_p[1]], family.d), t), [0, 1])
        } else {
            let (verdict, nearest) = self.detector.predict_nearest(&family.ray::<D1<4>>(), t, exclude, front);
            return (verdict.needs_samples(), nearest.filter(|_| aligned));
        };
        let Some(view) = view else { return (true, None) };
        let verdict = if aligned { self.detector.all(&view, exclude) } else { self.detector.any(&view, exclude) };
        let chord = verdict.events().and_then(|e| e.chord).filter(|_| aligned);
        (verdict.needs_samples(), chord.map(|chord| margin(&chord, axes)))
    }
}

/// Cuts until there are `most` leaves; those and the number of cells evaluated.
pub(super) fn partition(builder: &Builder, most: usize) -> (Vec<Stratum>, usize) {
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
        let halves: Vec<Cell> = cut.iter().flat_map(|&i| all[i].place.parts(&all[i].cell)).collect();
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
