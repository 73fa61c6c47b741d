//! Where a cell is cut.
//!
//! ```text
//! middle   across the axis that spans most of the surface that is lit, into halves
//! edge     across the axis along which the margin of the nearest predicted edge changes most, where it vanishes:
//!          p_k = -m / (dm/dp_k), m the margin at the centre; within [1/8, 7/8] of the cell
//! ```
//!
//! Strata with the edge along their border have nothing to tell apart (METHODS 3.B, "edge-aligned strata"; boxes can follow an edge along an
//! axis only, in steps). Axes that span less than half of the longest one are not cut, so that cells do not become slivers; where the
//! margin vanishes along none of the axes within the cell it is halved. Any cut tiles the cell: no bias.
//! Verified by tests in this file and `tests/partition.rs`.

use super::cell::Cell;
use crate::edge::{Linear, chord::Chord};
use clap::ValueEnum;

/// How cells are cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Cut {
    /// In the middle of their longest axis.
    #[default]
    Middle,
    /// Where an edge is predicted.
    Edge,
}

/// Least and largest part of a cell that is cut off.
const ENDS: [f64; 2] = [0.125, 0.875];
/// An axis is cut if it spans at least this part of the longest one.
const SLIVER: f64 = 0.5;

/// A cut across `axis` at `at` in (0, 1) of the cell's width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Axis.
    pub axis: usize,
    /// Part of the width below the cut.
    pub at: f64,
}

impl Place {
    /// The middle of the longest of the axes that span `extent`; of equals the first.
    pub fn middle(extent: &[f64; 4]) -> Place {
        Place { axis: (0..4).fold(0, |best, k| if extent[k] > extent[best] { k } else { best }), at: 0.5 }
    }

    /// Where the margin vanishes (parameters run over [-1, 1] in the cell).
    pub fn along(margin: &Linear<4>, extent: &[f64; 4]) -> Place {
        let middle = Place::middle(extent);
        let wide = |k: &usize| extent[*k] >= SLIVER * extent[middle.axis] && margin.gradient[*k] != 0.0;
        let steepness = |k: usize| margin.gradient[k].abs();
        let Some(axis) = (0..4).filter(wide).max_by(|&a, &b| steepness(a).total_cmp(&steepness(b))) else {
            return middle;
        };
        let p = -margin.value / margin.gradient[axis];
        if p.abs() <= 1.0 { Place { axis, at: (0.5 * (p + 1.0)).clamp(ENDS[0], ENDS[1]) } } else { middle }
    }

    /// The two parts of a cell.
    pub fn parts(&self, cell: &Cell) -> [Cell; 2] {
        let (mut a, mut b) = (*cell, *cell);
        let (lo, hi) = (cell.lo[self.axis], cell.hi[self.axis]);
        // Halves to the bit.
        let border = if self.at == 0.5 { 0.5 * (lo + hi) } else { lo + self.at * (hi - lo) };
        a.hi[self.axis] = border;
        b.lo[self.axis] = border;
        [a, b]
    }
}

/// The margin of the line through a chord, of which the coordinates are the cell's parameters `axes`.
pub fn margin(chord: &Chord, axes: [usize; 2]) -> Linear<4> {
    let [a, b] = chord.p;
    let n = [b[1] - a[1], a[0] - b[0]];
    let mut gradient = [0.0; 4];
    (gradient[axes[0]], gradient[axes[1]]) = (n[0], n[1]);
    Linear { value: -(n[0] * a[0] + n[1] * a[1]), gradient, rest: 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: Cell = Cell { light: 0, face: 0, lo: [0.0, 0.25, -1.0, 0.5], hi: [0.5, 0.5, 1.0, 1.0] };

    #[test]
    fn parts_tile_the_cell_and_meet_on_the_edge() {
        let extent = [1.0, 0.6, 0.9, 0.1];
        // m = p_2 - 0.5 - 0.1 p_0: vanishes at p_2 = 0.5, three quarters of the width of axis 2.
        let margin = Linear { value: -0.5, gradient: [-0.1, 0.0, 1.0, 5.0], rest: 0.0 };
        let place = Place::along(&margin, &extent);
        assert_eq!(place, Place { axis: 2, at: 0.75 }, "axis 3 is steeper, and too short");
        let [a, b] = place.parts(&CELL);
        assert_eq!((a.hi[2], b.lo[2]), (0.5, 0.5));
        assert_eq!((a.lo, b.hi), (CELL.lo, CELL.hi));
        for k in [0, 1, 3] {
            assert_eq!((a.hi[k], b.lo[k]), (CELL.hi[k], CELL.lo[k]));
        }
    }

    #[test]
    fn cuts_keep_away_from_the_ends_and_edges_outside_are_ignored() {
        let extent = [1.0; 4];
        let at = |value: f64| Place::along(&Linear { value, gradient: [0.0, 1.0, 0.0, 0.0], rest: 0.0 }, &extent);
        assert_eq!(at(0.99), Place { axis: 1, at: 0.125 });
        assert_eq!(at(-0.99), Place { axis: 1, at: 0.875 });
        assert_eq!(at(1.01), Place::middle(&extent));
        let none = Linear { value: 0.1, gradient: [0.0; 4], rest: 0.0 };
        assert_eq!(Place::along(&none, &extent), Place { axis: 0, at: 0.5 });
        let nan = Linear { value: f64::NAN, ..none };
        assert_eq!(Place::along(&nan, &extent), Place { axis: 0, at: 0.5 });
    }

    #[test]
    fn a_chord_lies_where_its_margin_vanishes() {
        let chord = Chord { p: [[-1.0, 0.25], [1.0, 0.75]], key: [0.0; 2] };
        let m = margin(&chord, [2, 3]);
        for [x, y] in chord.p {
            assert!(m.at(&[0.0, 0.0, x, y]).abs() < 1e-12);
        }
        assert!(m.at(&[0.0; 4]).abs() > 0.1);
    }
}
