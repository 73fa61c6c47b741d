//! What stands within the kernel of a photon: light must not be carried through it.
//!
//! Eight rays along the surface, close above it, from the photon to the border of its kernel. Where one meets something steep, the kernel
//! ends: a point in the sectors beside that ray that lies behind the steep surface is not lit by the photon ([`Obstacles::hides`]). Surfaces that
//! two neighbouring rays have met are borders as well, at which [`super::border`] folds back what is cut off: the foot of a wall that stands
//! in the middle of a floor is as bright as that of a wall at its end.
//! What has nothing behind it, such as the wall at the end of a floor, is a border only: no point would be asked for there.
//! Most photons have nothing around them. Cells as large as the kernels find that out for all their photons at once, by rays from
//! the first of them.
//! Source: Jensen 2001, section 7.3 (kernels leak at edges and through thin walls); METHODS 3.E.
//! Bias: kernels of photons for which obstacles are narrower than the gaps between the rays leak around them, the more rarely the
//! smaller kernels become.
//! Not handled: what begins above the surface, such as a board that hovers; nearest photons and their common radius.
//! Determinism: a function of the photons in their order. Verified by `tests/obstacles.rs`.

use super::World;
use super::footprint_kernel::Ellipsoid;
use super::photon::Photon;
use super::photon_map::NORMAL_CONE;
use super::riser::{Riser, SECTORS, sector};
use crate::accel::Ray;
use crate::math::{Frame, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::f32::consts::TAU;

/// Rays along the surface.
const RAYS: usize = 8;
/// Height of the rays above the surface, in short half axes of the kernel.
const LIFT: f32 = 0.02;
/// Sine of the least slope of what counts as steep.
const STEEP: f32 = 0.7;
/// Least cosine between the traces of what two neighbouring rays have met, for one straight obstacle.
const STRAIGHT: f32 = 0.9;
/// What lies less behind an obstacle, in half axes, counts as lying at its foot.
const FOOT: f32 = 1e-3;
/// Places behind an obstacle, from its foot to the border of the kernel, at which the surface is looked for.
const BEHIND: [f32; 2] = [0.25, 0.75];
/// Surfaces that may lie above the one that is looked for, such as what stands there itself if it slants, and one more.
const HITS: u32 = 4;
/// Where a ray goes on behind a hit, as a share of the length above the surface from which it starts.
const NEXT_HIT: f32 = 1e-4;
/// No obstacles: an index.
pub const NONE: u32 = u32::MAX;

/// What stands within one kernel.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle {
    p: Vec3,
    /// Axes of the kernel over their half lengths.
    rows: [Vec3; 2],
    /// What each ray has met, where the kernel is the unit disk.
    risers: [Riser; RAYS],
    /// Of these, as bits, the ones behind which the surface goes on: the others hide nothing.
    hiding: u8,
}

/// The obstacles of many kernels.
#[derive(Clone, Debug, Default)]
pub struct Obstacles {
    all: Vec<Obstacle>,
}

impl Obstacles {
    /// Those of the photons' kernels, and for each kernel the index of its own or [`NONE`].
    pub fn find(world: World, photons: &[Photon], kernels: &[Ellipsoid]) -> (Self, Vec<u32>) {
        let cells: Vec<Cell> =
            photons.par_iter().zip(kernels).with_min_len(1024).map(|(p, e)| Cell::of(p, e)).collect();
        let mut first: HashMap<Cell, u32> = HashMap::new();
        let mut examined = Vec::new();
        for (i, cell) in cells.iter().enumerate() {
            first.entry(*cell).or_insert_with(|| {
                examined.push(i);
                examined.len() as u32 - 1
            });
        }
        let clear: Vec<bool> =
            examined.into_par_iter().with_min_len(64).map(|i| cells[i].is_clear(world, &photons[i])).collect();
        let found: Vec<Option<Obstacle>> = photons
            .par_iter()
            .zip(kernels)
            .zip(&cells)
            .with_min_len(64)
            .map(|((photon, kernel), cell)| {
                let looked_at = !clear[first[cell] as usize];
                looked_at.then(|| Obstacle::around(world, photon, kernel)).flatten()
            })
            .collect();
        let mut obstacles = Obstacles::default();
        let index = found.into_iter().map(|o| match o {
            Some(o) => {
                obstacles.all.push(o);
                obstacles.all.len() as u32 - 1
            }
            None => NONE,
        });
        let index = index.collect();
        (obstacles, index)
    }

    /// The obstacle of an index, if it is one.
    pub fn get(&self, index: u32) -> Option<&Obstacle> {
        self.all.get(index as usize)
    }

    /// Whether the obstacle of that index stands between its photon and `x`.
    #[inline]
    pub fn hides(&self, index: u32, x: Vec3) -> bool {
        index != NONE && self.all[index as usize].hides(x)
    }

    /// Those that hide anything, in the order in which `users` ask for them; their indices are renewed.
    pub fn that_hide<'u>(&self, users: impl Iterator<Item = &'u mut u32>) -> Obstacles {
        let (mut new, mut hide) = (vec![NONE; self.all.len()], Obstacles::default());
        for user in users.filter(|u| **u != NONE) {
            let old = *user as usize;
            if new[old] == NONE && self.all[old].hiding != 0 {
                new[old] = hide.all.len() as u32;
                hide.all.push(self.all[old].hiding_alone());
            }
            *user = new[old];
        }
        hide
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.all.as_slice())
    }
}

impl Obstacle {
    /// What stands within the kernel of `photon`; `None`: nothing.
    fn around(world: World, photon: &Photon, kernel: &Ellipsoid) -> Option<Self> {
        let axes = [kernel.rows[0], kernel.rows[1]].map(|row| row / row.length_squared());
        let lift = LIFT * kernel.radii[1];
        let (mut risers, mut hiding) = ([Riser::NONE; RAYS], 0);
        for (k, (direction, riser)) in directions().zip(&mut risers).enumerate() {
            let reach = axes[0] * direction.x + axes[1] * direction.y;
            let ray = along(photon, reach, lift);
            let Some(hit) = world.accel.closest(&ray) else { continue };
            let n = world.surface(&ray, &hit).n_geo;
            let trace = n - photon.n * n.dot(photon.n);
            let normal = Vec2::new(trace.dot(axes[0]), trace.dot(axes[1]));
            if let (true, Some(normal)) = (trace.length() >= STEEP, normal.try_normalize()) {
                let offset = normal.dot(direction) * hit.t;
                *riser =
                    if offset > 0.0 { Riser { normal: -normal, offset: -offset } } else { Riser { normal, offset } };
                let up = kernel.rows[2] / kernel.rows[2].length_squared();
                let goes_on =
                    BEHIND.iter().any(|s| is_surface(world, photon.p + reach * (hit.t + s * (1.0 - hit.t)), up, HITS));
                hiding |= u8::from(goes_on) << k;
            }
        }
        let nothing = risers.iter().all(|r| *r == Riser::NONE);
        (!nothing).then_some(Obstacle { p: photon.p, rows: [kernel.rows[0], kernel.rows[1]], risers, hiding })
    }

    /// The same without what hides nothing.
    fn hiding_alone(&self) -> Self {
        let risers = std::array::from_fn(|k| if self.hiding >> k & 1 == 1 { self.risers[k] } else { Riser::NONE });
        Obstacle { risers, ..*self }
    }

    /// q of the kernel from which on a point may be hidden.
    pub fn clear(&self) -> f32 {
        let hiding = self.hiding_alone();
        let nearest = hiding.risers.iter().map(|r| FOOT - r.offset).fold(f32::INFINITY, f32::min);
        // What rounding may do to q and to the offset.
        let safe = (nearest - 1e-4).max(0.0);
        safe * safe
    }

    fn hides(&self, x: Vec3) -> bool {
        let d = x - self.p;
        let q = Vec2::new(self.rows[0].dot(d), self.rows[1].dot(d));
        if q == Vec2::ZERO {
            return false;
        }
        let k = sector(q) * RAYS / SECTORS;
        let behind = |r: &Riser| q.dot(r.normal) < r.offset - FOOT;
        behind(&self.risers[k]) || behind(&self.risers[(k + 1) % RAYS])
    }

    /// Straight obstacles as half-planes in the world, (unit normal towards the other side, offset).
    pub fn borders(&self) -> impl Iterator<Item = (Vec3, f32)> {
        (0..RAYS).filter_map(|k| {
            let (a, b) = (&self.risers[k], &self.risers[(k + 1) % RAYS]);
            let straight = a.normal.dot(b.normal) > STRAIGHT;
            let nearer = if a.offset > b.offset { a } else { b };
            // q.normal >= offset, q = rows (x - p): a half-plane of the world, turned to point to the other side.
            let m = -(self.rows[0] * nearer.normal.x + self.rows[1] * nearer.normal.y);
            let length = m.length();
            straight.then(|| (m / length, (m.dot(self.p) - nearer.offset) / length))
        })
    }
}

/// Unit directions where the sectors meet.
fn directions() -> impl Iterator<Item = Vec2> {
    (0..RAYS).map(|k| Vec2::from_angle(TAU * k as f32 / RAYS as f32))
}

/// Whether there is a surface that faces like `up` within this length above or below `p`, among the first `hits` that a ray down onto it
/// meets.
pub fn is_surface(world: World, p: Vec3, up: Vec3, hits: u32) -> bool {
    let mut ray = Ray { o: p + up, d: -up, tmin: 0.0, tmax: 2.0 };
    for _ in 0..hits {
        let Some(hit) = world.accel.closest(&ray) else { return false };
        if world.surface(&ray, &hit).n_geo.dot(up).abs() >= NORMAL_CONE * up.length() {
            return true;
        }
        ray.tmin = hit.t + NEXT_HIT;
    }
    false
}

/// The ray along the surface from a photon, t = 1 at the end of `d`.
fn along(photon: &Photon, d: Vec3, lift: f32) -> Ray {
    Ray { o: photon.p + photon.n * lift, d, tmin: 0.0, tmax: 1.0 }
}

/// A cell of a grid as fine as kernels are, for one orientation of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Cell {
    level: i32,
    at: [i32; 3],
    side: u8,
}

impl Cell {
    fn of(photon: &Photon, kernel: &Ellipsoid) -> Self {
        let level = exponent(kernel.radii[0]);
        let at = (photon.p / 2f32.powi(level)).floor().to_array().map(|c| c as i32);
        let a = photon.n.abs();
        let axis = if a.x > a.y && a.x > a.z { 0 } else { 1 + u8::from(a.z >= a.y) };
        Cell { level, at, side: axis << 1 | u8::from(photon.n[usize::from(axis)] < 0.0) }
    }

    /// Whether rays from a photon of the cell, as far as the kernel of any other may reach, meet nothing.
    fn is_clear(&self, world: World, photon: &Photon) -> bool {
        let edge = 2f32.powi(self.level);
        // Diagonal of the cell and a kernel beyond.
        let reach = (1.0 + 3f32.sqrt()) * edge;
        let frame = Frame::from_normal(photon.n);
        directions().all(|q| {
            let ray = along(photon, (frame.s * q.x + frame.t * q.y) * reach, LIFT * edge);
            !world.accel.occluded(&ray)
        })
    }
}

/// The exponent of the least power of two not below x > 0.
fn exponent(x: f32) -> i32 {
    let below = (x.to_bits() >> 23) as i32 - 127;
    below + i32::from(x.to_bits() << 9 != 0)
}
