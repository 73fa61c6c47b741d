//! Surfels: places that stand for all gather-ray hits around them.
//!
//! A hit belongs to the surfel of its cell of a hash grid; it founds one if there is none that can represent it. The
//! edge of the cell is the footprint of the gather ray,
//!
//!   cell(d) = c d, c = [`CELL_PER_DISTANCE`], rounded to a power of two times the finest one and bounded by the coarsest
//!
//! so that hits in corners, which are close, get small cells, and distant ones share theirs. d is the length of the ray's last part,
//! after the last surface that has reflected or refracted it: a ball of glass gathers rays on the bright spot of its caustic, which so gets
//! cells smaller than itself. All records see those few cells, so that their error would be common to the whole picture.
//! A surfel represents a hit if the normals agree, the hit lies in its tangent plane, and nothing stands between the two:
//! at each new surfel some short rays along the surface find out whether anything rises within the cell, and if so every
//! hit of the cell has to see the surfel. So no light crosses a wall that stands on a floor, however thin it is.
//! Source      Yue, Onoue and Nishita (stored hits); surfels as in Christensen 2008, "Point-Based Approximate Color Bleeding"
//! Bias        the irradiance at a hit is that of the cell; goes to 0 with the cell
//! Not handled obstacles thinner than the gap between the probing rays, in all directions (they block little light)
//! Determinism places are added in order; searching changes nothing
//! Verified by tests/irradiance_cache.rs: dark rooms stay dark behind thin walls, furnace

use super::World;
use super::cache_file::{Stored, stored};
use crate::accel::Ray;
use crate::math::sampler::hash;
use crate::math::{Frame, Vec2, Vec3};
use crate::scene::SurfacePoint;
use std::collections::HashMap;
use std::f32::consts::TAU;
use std::hash::{BuildHasherDefault, Hasher};

/// Edge of a cell over the length of the last part of the gather ray: about the spacing of some 250 rays over a hemisphere.
pub const CELL_PER_DISTANCE: f32 = 0.1;
/// Levels of cells, each half as large as the one before.
const LEVELS: u32 = 3;
/// Least cosine between the normals of a surfel and of a hit.
const MIN_NORMAL_COS: f32 = 0.9;
/// Greatest distance of a hit from the plane of its surfel, in cells.
const MAX_PLANE_DISTANCE: f32 = 0.15;
/// Short rays along the surface that look for something rising within the cell.
const CLEARANCE_RAYS: u32 = 6;
/// Height of those rays over the surface, in cells.
const LIFT: f32 = 0.02;
/// Surfels of one cell. In hair or foliage any of so many stands for a further hit: the choice is as good as random.
const CROWD: u32 = 24;
/// Least cosine between normals within a crowd.
const CROWD_NORMAL_COS: f32 = 0.3;
/// Surfels beyond which cells are doubled, for the first time and each time over the number before, ...
const MANY: usize = 50_000;
const MORE: f32 = 1.5;
/// ... if there are more than this share of the gather rays of records: hardly any two rays share one then, ...
pub(super) const LONELY: f32 = 0.4;
/// ... or more than this whatever the rays: memory and rows have their price.
const TOO_MANY: usize = 20 * MANY;
/// Coarse cells over the largest ordinary ones, for places that are to be represented by what there is.
const COARSE: f32 = 4.0;
const NONE: u32 = u32::MAX;

/// A surface seen from one side: normals point to where light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// Position, world.
    pub p: Vec3,
    /// Bound on the error of `p` per axis.
    pub p_error: Vec3,
    /// Geometric normal, unit.
    pub n_geo: Vec3,
    /// Shading normal, unit.
    pub n_shade: Vec3,
    /// Index of the shape, for its material.
    pub shape: u32,
}

stored!(Facet { p, p_error, n_geo, n_shade, shape });

impl Facet {
    /// The side of a surface point that `wo` sees. Each normal is turned to `wo` by itself: materials reflect on the side of the *shading*
    /// normal that `wo` is on (`scene::bsdf`), and where that is not the side of the surface, smoothed meshes are dark for paths, too.
    pub fn seen_from(at: &SurfacePoint, wo: Vec3) -> Self {
        let [n_geo, n_shade] = [at.n_geo, at.n_shade].map(|n| if n.dot(wo) < 0.0 { -n } else { n });
        Facet { p: at.p, p_error: at.p_error, n_geo, n_shade, shape: at.shape }
    }

    /// The point as rays and shadow rays start from it.
    pub fn surface_point(&self) -> SurfacePoint {
        let Facet { p, p_error, n_geo, n_shade, shape } = *self;
        let flat = Vec2::ZERO;
        SurfacePoint { p, p_error, n_geo, n_shade, uv: flat, dp_du: Vec3::X, dp_dv: Vec3::Y, shape, prim: 0 }
    }
}

/// Keys are mixed already.
#[derive(Clone, Default)]
pub struct MixedKey(u64);

impl Hasher for MixedKey {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, _: &[u8]) {
        unreachable!("keys are u64");
    }
    fn write_u64(&mut self, key: u64) {
        self.0 = key;
    }
}

type Grid = HashMap<u64, u32, BuildHasherDefault<MixedKey>>;

/// All surfels and the grid that finds them.
#[derive(Clone, Debug)]
pub struct Surfels {
    /// Edge of the coarsest ordinary cell.
    cell: f32,
    places: Vec<Facet>,
    /// Whether nothing rises around the surfel within its cell.
    clear: Vec<bool>,
    /// Level of the surfel's cell: 0 is one of the largest.
    levels: Vec<u8>,
    /// Number of surfels at which cells are doubled.
    limit: usize,
    /// Next surfel of the same cell.
    next: Vec<u32>,
    first: Grid,
    coarse: Grid,
}

impl Surfels {
    /// No surfels yet; `cell` is the edge of the largest cells.
    pub fn new(cell: f32) -> Self {
        Surfels {
            cell,
            places: Vec::new(),
            clear: Vec::new(),
            levels: Vec::new(),
            limit: MANY,
            next: Vec::new(),
            first: Grid::default(),
            coarse: Grid::default(),
        }
    }

    /// The surfels, by index.
    pub fn places(&self) -> &[Facet] {
        &self.places
    }

    /// Whether surfel `k` stands for one of the largest cells, as those found at infinite distance do.
    pub fn is_large(&self, k: usize) -> bool {
        self.levels[k] == 0
    }

    /// Edge of the cell of surfel `k`.
    pub fn edge_of(&self, k: usize) -> f32 {
        self.edge(u32::from(self.levels[k]))
    }

    /// What surfel `k` has in common with those near it that face the same way.
    pub fn neighbourhood(&self, k: usize) -> u64 {
        self.coarse_key(&self.places[k])
    }

    /// Number of surfels.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Edge of the largest cells.
    pub fn cell(&self) -> f32 {
        self.cell
    }

    /// Level of the cell for a hit at the end of a gather ray of length `distance`.
    fn level(&self, distance: f32) -> u32 {
        let ratio = self.cell / (CELL_PER_DISTANCE * distance);
        // Comparisons, not logarithms: the same on every machine.
        (0..LEVELS).find(|&l| ratio <= (1u32 << l) as f32).unwrap_or(LEVELS)
    }

    fn edge(&self, level: u32) -> f32 {
        self.cell / (1u32 << level) as f32
    }

    fn key(edge: f32, level: u32, p: Vec3, n: Vec3) -> u64 {
        // The shift keeps planes at round coordinates off the borders of cells.
        let q = (p / edge + Vec3::new(0.347, 0.419, 0.281)).floor();
        let [x, y, z] = q.to_array().map(|c| c as i64 as u64);
        let a = n.abs();
        let axis = if a.x > a.y && a.x > a.z { 0 } else { 1 + u64::from(a.z >= a.y) };
        let side = u64::from(n[axis as usize] < 0.0);
        hash(hash(x, y), hash(z, u64::from(level) << 8 | axis << 1 | side))
    }

    fn unobstructed(world: &World, from: &Facet, to: Vec3, lift: f32) -> bool {
        let o = from.p + from.n_geo * lift;
        let d = to + from.n_geo * lift - o;
        !world.accel.occluded(&Ray { o, d, tmin: f32::MIN_POSITIVE, tmax: 1.0 })
    }

    /// The surfel that represents the hit `at`, `distance` away from where it is seen or from the last mirror or lens before it.
    pub fn find(&self, world: &World, at: &Facet, distance: f32) -> Option<u32> {
        let level = self.level(distance);
        let edge = self.edge(level);
        let mut k = *self.first.get(&Self::key(edge, level, at.p, at.n_geo))?;
        let (mut count, mut like) = (0, (CROWD_NORMAL_COS, None));
        while k != NONE {
            let s = &self.places[k as usize];
            let offset = s.p - at.p;
            let near = offset.length_squared() < 3.0 * edge * edge
                && offset.dot(s.n_geo).abs() < MAX_PLANE_DISTANCE * edge
                && s.n_geo.dot(at.n_geo) > MIN_NORMAL_COS
                && s.n_shade.dot(at.n_shade) > MIN_NORMAL_COS;
            if near && (self.clear[k as usize] || Self::unobstructed(world, at, s.p, LIFT * edge)) {
                return Some(k);
            }
            let cos = s.n_geo.dot(at.n_geo);
            if cos > like.0 {
                like = (cos, Some(k));
            }
            count += 1;
            k = self.next[k as usize];
        }
        if count >= CROWD { like.1 } else { None }
    }

    /// The surfel that represents the hit, a new one if need be.
    pub fn find_or_insert(&mut self, world: &World, at: &Facet, distance: f32) -> u32 {
        if let Some(k) = self.find(world, at, distance) {
            return k;
        }
        let level = self.level(distance);
        let edge = self.edge(level);
        let frame = Frame::from_normal(at.n_geo);
        let clear = (0..CLEARANCE_RAYS).all(|i| {
            let (sin, cos) = (TAU * (i as f32 + 0.5) / CLEARANCE_RAYS as f32).sin_cos();
            // Farther than the farthest hit of the cell, also between two of the rays.
            let reach = 1.7 * edge;
            Self::unobstructed(world, at, at.p + (frame.s * cos + frame.t * sin) * reach, LIFT * edge)
        });
        let k = self.places.len() as u32;
        let before = self.first.insert(Self::key(edge, level, at.p, at.n_geo), k);
        self.places.push(*at);
        self.clear.push(clear);
        self.levels.push(level as u8);
        self.next.push(before.unwrap_or(NONE));
        self.coarse.entry(self.coarse_key(at)).or_insert(k);
        k
    }

    fn coarse_key(&self, at: &Facet) -> u64 {
        Self::key(COARSE * self.cell, LEVELS + 1, at.p, at.n_geo)
    }

    /// A place in the cell of surfel `k`, uniform in the tangent plane for `u` in `[0,1)^2`, and the surfel's own place where
    /// the surface does not go on: what varies within the cell, such as light close to a lamp, is to be averaged over it.
    pub fn spread(&self, world: &World, k: usize, u: Vec2) -> Facet {
        let own = self.places[k];
        let edge = self.edge_of(k);
        let (frame, lift) = (Frame::from_normal(own.n_geo), MAX_PLANE_DISTANCE * edge);
        let q = own.p + (frame.s * (u.x - 0.5) + frame.t * (u.y - 0.5)) * edge;
        let down = Ray { o: q + own.n_geo * lift, d: -own.n_geo, tmin: f32::MIN_POSITIVE, tmax: 2.0 * lift };
        let Some(hit) = world.accel.closest(&down) else { return own };
        let at = Facet::seen_from(&world.surface(&down, &hit), own.n_geo);
        let alike = at.n_geo.dot(own.n_geo) > MIN_NORMAL_COS && at.n_shade.dot(own.n_shade) > MIN_NORMAL_COS;
        let seen = || self.clear[k] || Self::unobstructed(world, &own, at.p, LIFT * edge);
        if alike && seen() { at } else { own }
    }

    /// Doubles the cells if there are too many surfels for the `rays` gather rays that have looked for one: geometry that fills space, such as
    /// hair. What found its surfel before keeps it, but places look for theirs anew: where surfels are shared as they should be, doubled
    /// cells would add to their number, and to the noise and the bias of small bright spots.
    pub fn coarsen(&mut self, rays: usize) {
        if self.places.len() < self.limit.max(((LONELY * rays as f32) as usize).min(TOO_MANY)) {
            return;
        }
        self.limit = (self.limit as f32 * MORE) as usize;
        self.cell *= 2.0;
        // What was clear within the old cell need not be within the new one.
        self.clear.fill(false);
        self.rehash();
    }

    /// Builds the grids over the places as they are.
    fn rehash(&mut self) {
        (self.first, self.coarse) = (Grid::default(), Grid::default());
        for k in 0..self.places.len() {
            let (at, level) = (&self.places[k], u32::from(self.levels[k]));
            let key = Self::key(self.edge(level), level, at.p, at.n_geo);
            self.next[k] = self.first.insert(key, k as u32).unwrap_or(NONE);
            self.coarse.entry(self.coarse_key(at)).or_insert(k as u32);
        }
    }

    /// Some surfel in the neighbourhood that faces the same way, for light of so high an order that it hardly varies, or where there are too
    /// many; a new one where there is none that sees the place. `None` if that would make more than `most` surfels.
    pub fn find_or_insert_coarse(&mut self, world: &World, at: &Facet, most: usize) -> Option<u32> {
        if let Some(&k) = self.coarse.get(&self.coarse_key(at)) {
            let s = &self.places[k as usize];
            if s.n_geo.dot(at.n_geo) > 0.5 && Self::unobstructed(world, at, s.p, LIFT * self.cell) {
                return Some(k);
            }
        }
        if self.len() < most {
            return Some(self.find_or_insert(world, at, f32::INFINITY));
        }
        self.find(world, at, f32::INFINITY)
    }
}

impl Stored for Surfels {
    fn put(&self, out: &mut Vec<u8>) {
        self.cell.put(out);
        self.limit.put(out);
        self.places.put(out);
        self.clear.put(out);
        self.levels.put(out);
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        let (cell, limit) = (f32::take(from)?, usize::take(from)?);
        let (places, clear, levels) = (Vec::take(from)?, Vec::take(from)?, Vec::take(from)?);
        let next = vec![NONE; places.len()];
        let (first, coarse) = (Grid::default(), Grid::default());
        let mut surfels = Surfels { cell, limit, places, clear, levels, next, first, coarse };
        surfels.rehash();
        Some(surfels)
    }
}
