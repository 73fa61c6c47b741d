//! Visibility cache: what a few cache points see of every virtual light.
//!
//! ```text
//! bit(j, i) = V(c_j, y_i),    kappa_j = Var_i(t_i v_i) / Mean_i(t_i v_i)^2     t_i as a white Lambertian surface at c_j has it
//! s_0(x)    = kappa (albedo mean)^2                                           averages over the k nearest cache points
//! ```
//!
//! Shading points are clustered by position and normal ([`mod@clusters`]); in each pass a random one of every cluster is its cache point, so that the
//! errors of one pass are not those of the next. The k = 3 nearest of a point (kd-tree over six dimensions) are asked; those below whose
//! horizon a light lies cannot tell and do not count. Of how the bits are read: [`posterior`].
//! Storage     blocks of 64 cache points; in each, one word of visible and one of telling points per light, side by side: the neighbours
//!             of a point mostly lie in one block (cache points are in the order of their clusters)
//! Source      Nabata et al., section 3.1 and eqs. 6, 11; METHODS 1.A b (coefficient of variation in place of the variance), g
//! Bias        none: everything here is a prediction
//! Verified by tests of the submodules and of `strategies` (bits against rays), tests/many_light.rs

pub mod clusters;
pub mod posterior;

use self::clusters::{Point6, clusters, point6, scale};
use self::posterior::{MOST_NEIGHBOURS, agreement, surrounding};
use super::World;
use super::surfels::Facet;
use super::vpl::{Vpls, mean};
use crate::formats::ply::points;
use crate::math::Vec3;
use crate::math::sampler::{hash, unit_f32};
use arrayvec::ArrayVec;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::num::NonZero;

/// Lights of one task: a fixed number, so that sums do not depend on threads.
const CHUNK: usize = 512;
/// Separates the choice of cache points from other random numbers.
const STREAM: u64 = 0x6361_6368_6570_7473; // "cachepts"

/// Shading points in clusters: the same for all passes.
#[derive(Clone, Debug, Default)]
pub struct ShadingClusters {
    points: Vec<Facet>,
    clusters: Vec<Vec<u32>>,
    scale: f32,
}

impl ShadingClusters {
    /// Up to `wanted` clusters of what is shaded.
    pub fn new(points: Vec<Facet>, wanted: usize) -> Self {
        let points: Vec<Facet> = points.into_iter().filter(|f| f.p.is_finite() && f.n_shade.is_finite()).collect();
        let scale = scale(points.iter().map(|f| f.p));
        let places: Vec<Point6> = points.iter().map(|f| point6(f.p, f.n_shade, scale)).collect();
        ShadingClusters { clusters: clusters(&places, wanted), points, scale }
    }

    /// One random point of each cluster.
    fn choose(&self, seed: u64, pass: u64) -> Vec<Facet> {
        let key = hash(hash(seed, STREAM), pass);
        let one = |(i, cluster): (usize, &Vec<u32>)| {
            let u = unit_f32(hash(key, i as u64));
            self.points[cluster[((u * cluster.len() as f32) as usize).min(cluster.len() - 1)] as usize]
        };
        self.clusters.iter().enumerate().map(one).collect()
    }
}

/// Words of a light in a block of 64 cache points.
#[derive(Clone, Copy, Debug, Default)]
struct Words {
    visible: u64,
    telling: u64,
}

/// What the cache points of a pass see.
#[derive(Debug)]
pub struct VisibilityCache {
    points: Vec<Facet>,
    tree: Option<ImmutableKdTree<f32, 6>>,
    scale: f32,
    /// Distance between cache points, typically, in six dimensions.
    spacing: f32,
    blocks: Vec<Vec<Words>>,
    /// Mean and squared coefficient of variation of what lights contribute at each point, white surfaces.
    spread: Vec<[f32; 2]>,
    /// Shadow rays traced.
    pub rays: u64,
}

/// The cache points that a shading point asks.
#[derive(Clone, Debug, Default)]
pub struct Neighbours {
    /// Block and mask of the points in it.
    masks: ArrayVec<(u32, u64), MOST_NEIGHBOURS>,
    /// Their indices.
    pub points: ArrayVec<u32, MOST_NEIGHBOURS>,
    /// Class of the place, for the posterior.
    pub surrounding: usize,
    /// Mean contribution of a light here to a white surface, and its squared coefficient of variation.
    pub mean: f32,
    /// See `mean`.
    pub kappa: f32,
}

impl VisibilityCache {
    /// Traces all shadow rays between the cache points of a pass and the lights. Without clusters nothing is known anywhere.
    pub fn build(world: World, clusters: &ShadingClusters, vpls: &Vpls, seed: u64, pass: u64) -> Self {
        let points = clusters.choose(seed, pass);
        let scale = clusters.scale;
        let places: Vec<Point6> = points.iter().map(|f| point6(f.p, f.n_shade, scale)).collect();
        // Building fails for points that are not finite only, and these are out.
        let tree = (!places.is_empty()).then(|| ImmutableKdTree::new_from_slice(&places).ok()).flatten();
        let n = vpls.lights.len();
        let tasks: Vec<(usize, usize)> = (0..points.len().div_ceil(64))
            .flat_map(|block| (0..n.div_ceil(CHUNK)).map(move |chunk| (block, chunk * CHUNK)))
            .collect();
        let done: Vec<_> =
            tasks.par_iter().map(|&(block, first)| Task { world, vpls }.run(&points, block, first)).collect();

        let mut cache = VisibilityCache {
            blocks: vec![Vec::with_capacity(n); points.len().div_ceil(64)],
            spread: Vec::new(),
            points,
            tree,
            scale,
            spacing: 1.0,
            rays: 0,
        };
        let mut sums = vec![[0.0f64; 2]; cache.points.len()];
        for ((block, _), (words, part, rays)) in tasks.into_iter().zip(done) {
            cache.blocks[block].extend(words);
            for (sum, p) in sums[block * 64..].iter_mut().zip(part) {
                sum[0] += p[0];
                sum[1] += p[1];
            }
            cache.rays += rays;
        }
        let spread = |[sum, squares]: [f64; 2]| {
            let count = n.max(1) as f64;
            let (mean, square) = (sum / count, squares / count);
            let kappa = if mean > 0.0 { (square / (mean * mean) - 1.0).max(0.0) } else { 0.0 };
            [mean as f32, kappa as f32]
        };
        cache.spread = sums.into_iter().map(spread).collect();
        cache.spacing = cache.typical_spacing(&places);
        cache
    }

    /// The cache points.
    pub fn points(&self) -> &[Facet] {
        &self.points
    }

    /// Memory of the bits, bytes.
    pub fn bytes(&self) -> usize {
        self.blocks.iter().map(|b| b.len() * size_of::<Words>()).sum()
    }

    /// Mean distance of a cache point to the nearest other one.
    fn typical_spacing(&self, places: &[Point6]) -> f32 {
        let Some(tree) = &self.tree else { return 1.0 };
        let two = NonZero::<usize>::MIN.saturating_add(1);
        let farther = |at: &Point6| {
            let found = tree.query(at).nearest_n::<SquaredEuclidean<f32>>(two).unsorted().execute();
            found.iter().map(|q| q.distance).fold(0.0, f32::max).sqrt()
        };
        let step = places.len().div_ceil(256).max(1);
        let (sum, count) =
            places.iter().step_by(step).map(farther).fold((0.0, 0), |(s, n): (f32, u32), d| (s + d, n + 1));
        if sum > 0.0 { sum / count as f32 } else { 1.0 }
    }

    /// The nearest cache points of a place with the unit normal `n`.
    pub fn neighbours(&self, p: Vec3, n: Vec3) -> Neighbours {
        let mut out = Neighbours::default();
        let Some(tree) = &self.tree else { return out };
        let k = NonZero::new(MOST_NEIGHBOURS).unwrap_or(NonZero::<usize>::MIN);
        let found = tree.query(&point6(p, n, self.scale)).nearest_n::<SquaredEuclidean<f32>>(k).unsorted().execute();
        // Ties are broken by index: the order of a query's answers is none of ours.
        let mut found: ArrayVec<(f32, u32), MOST_NEIGHBOURS> =
            found.iter().take(MOST_NEIGHBOURS).map(|q| (q.distance, q.item)).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut cos = 1.0f32;
        for &(_, point) in &found {
            let (block, bit) = (point / 64, 1u64 << (point % 64));
            match out.masks.iter_mut().find(|m| m.0 == block) {
                Some(mask) => mask.1 |= bit,
                None => out.masks.push((block, bit)),
            }
            out.points.push(point);
            let [mean, kappa] = self.spread[point as usize];
            out.mean += mean / found.len() as f32;
            out.kappa += kappa / found.len() as f32;
            cos = cos.min(self.points[point as usize].n_shade.dot(n));
        }
        let nearest = found.first().map_or(f32::INFINITY, |f| f.0.sqrt());
        out.surrounding = surrounding(nearest / self.spacing, cos);
        out
    }

    /// How many of the neighbours see the light, and how many can tell.
    #[inline]
    pub fn votes(&self, neighbours: &Neighbours, light: usize) -> (u32, u32) {
        let (mut visible, mut telling) = (0, 0);
        for &(block, mask) in &neighbours.masks {
            let words = &self.blocks[block as usize][light];
            visible += (words.visible & mask).count_ones();
            telling += (words.telling & mask).count_ones();
        }
        (visible, telling)
    }

    /// The case of a light, for the posterior.
    #[inline]
    pub fn agreement(&self, neighbours: &Neighbours, light: usize) -> usize {
        let (visible, telling) = self.votes(neighbours, light);
        agreement(visible, telling)
    }

    /// Words of all lights in the block of cache point `point`: (visible, telling) of that point, light by light.
    pub fn bits(&self, point: usize) -> impl Iterator<Item = (bool, bool)> + '_ {
        let bit = point % 64;
        self.blocks[point / 64].iter().map(move |w| (w.visible >> bit & 1 == 1, w.telling >> bit & 1 == 1))
    }
}

/// The cache points of one cache after the other as a point cloud, binary PLY, little-endian: position x y z, normal nx ny nz, mean contribution of a
/// light to a white surface there (W/(m^2 sr)), and its squared coefficient of variation kappa.
pub fn write_ply(caches: &[&VisibilityCache]) -> Vec<u8> {
    const FLOATS: [&str; 8] = ["x", "y", "z", "nx", "ny", "nz", "mean", "kappa"];
    let count: usize = caches.iter().map(|c| c.points.len()).sum();
    let mut out = points::header("cache points of visibility", count, &[("float", &FLOATS)]);
    for cache in caches {
        for (point, spread) in cache.points.iter().zip(&cache.spread) {
            let values = [point.p.to_array(), point.n_shade.to_array()];
            values.as_flattened().iter().chain(spread).for_each(|v| out.extend(v.to_le_bytes()));
        }
    }
    out
}

/// A block of cache points and a chunk of lights.
struct Task<'a> {
    world: World<'a>,
    vpls: &'a Vpls,
}

impl Task<'_> {
    /// Words of the lights, sums of contributions and of their squares by cache point, rays.
    fn run(&self, points: &[Facet], block: usize, first: usize) -> (Vec<Words>, Vec<[f64; 2]>, u64) {
        let points = &points[block * 64..points.len().min(block * 64 + 64)];
        let lights = &self.vpls.lights[first..self.vpls.lights.len().min(first + CHUNK)];
        let mut words = vec![Words::default(); lights.len()];
        let mut sums = vec![[0.0; 2]; points.len()];
        let mut rays = 0;
        for (bit, point) in points.iter().enumerate() {
            let at = point.surface_point();
            for (words, light) in words.iter_mut().zip(lights) {
                let d = light.p - point.p;
                let (d2, cos) = (d.length_squared(), d.dot(point.n_shade));
                if !(cos > 0.0 && d2 > 0.0) {
                    continue;
                }
                let arriving = self.vpls.arriving(light, -d, d2);
                let t = mean(arriving) * cos / d2.sqrt() * FRAC_1_PI;
                if !(t > 0.0) {
                    // Behind the light: nobody will ask.
                    continue;
                }
                rays += 1;
                let distance = d2.sqrt();
                let share = self.world.transmittance(self.world.shadow_ray(&at, d / distance, distance), false).share;
                words.telling |= 1 << bit;
                words.visible |= u64::from(share > 0.5) << bit;
                let contribution = f64::from(t * share);
                sums[bit][0] += contribution;
                sums[bit][1] += contribution * contribution;
            }
        }
        (words, sums, rays)
    }
}
