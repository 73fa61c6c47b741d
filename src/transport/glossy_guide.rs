//! Where glossy lobes look for light: in the cells of a record's hemisphere that its gather rays have found bright.
//!
//! A lobe that spreads over half a room finds the window in it by chance, and light samples do not know of the walls around. The gather rays
//! of the nearest record have been there:
//!
//! ```text
//!   P_c  ~ f(wo, d_c) cos (L_c - L_o) Omega_c       of the bright cells c, d_c: their middles; L_o: mean radiance of all others
//!   p    = s P_c(d) p_c(d) + (1 - s) p_lobe(d)      p_c = n cos / pi: uniform in the measure in which a record has n cells
//!   s    = S / (S + albedo L_o),  S = sum f cos (L_c - L_o) Omega_c         at most 3/4: the share of what the lobe reflects
//! ```
//!
//! If the record is right, p goes with f cos L. Its radiances contain what a coat makes of them for the diffuse part (`coat.rs`).
//! Source      Jensen 1995, "Importance Driven Path Tracing using the Photon Map" (what was found before tells where to look); the mixture is the
//!             one-sample model of Veach & Guibas 1995
//! Bias        none: p > 0 wherever the lobe is. Where the record is wrong, by parallax or noise, variance grows
//! Not handled lobes much narrower than a cell (they find what they look at by themselves); surfaces without records; transmission
//! Verified by `tests`

use super::World;
use super::gather_cache::{GatherCache, GatherHit};
use super::gather_strata::Strata;
use super::surfel_light::SurfelLight;
use crate::math::{Frame, Rgb, Vec2, Vec3, luminance};
use crate::scene::description::MaterialId;
use crate::scene::material::has_sharp_lobe;
use crate::scene::{Bsdf, BsdfSample, LobeKind, Material, Transport};
use arrayvec::ArrayVec;
use rayon::prelude::*;
use std::f32::consts::{FRAC_1_PI, PI};

/// A cell is bright if its radiance is so many times the mean of all.
const BRIGHT: f32 = 2.0;
/// Most bright cells of a record.
const CELLS: usize = 64;
/// Greatest share of directions that the record decides.
const MOST: f32 = 0.75;
/// Share below which it is not asked.
const LEAST: f32 = 0.1;
/// Greatest density of a lobe over that within a cell.
const NARROW: f32 = 4.0;
/// Records of a task.
const CHUNK: usize = 64;

/// A bright cell.
#[derive(Clone, Copy, Debug)]
struct BrightCell {
    /// Its middle, world.
    direction: Vec3,
    /// Luminance beyond that of dim cells times solid angle.
    light: f32,
    index: u32,
}

/// The bright cells of all records.
#[derive(Clone, Debug, Default)]
pub struct GlossyGuides {
    cells: Vec<BrightCell>,
    /// Begin of each record's in `cells`, and the end.
    begins: Vec<u32>,
    /// Mean luminance of the other cells of each.
    dim: Vec<f32>,
    /// Mean luminance of all cells.
    level: Vec<f32>,
}

/// What a record tells a lobe.
#[derive(Clone, Debug)]
pub struct Guide<'a> {
    /// Number of directions that are drawn: what p counts against light samples.
    pub rays: u32,
    /// Luminance that the lobe reflects, and that of a white diffuse surface, if the record is right.
    pub reflected: [f32; 2],
    strata: &'a Strata,
    frame: Frame,
    cells: &'a [BrightCell],
    /// Sums of P over the cells, up to and with each.
    sums: ArrayVec<f32, CELLS>,
    /// s.
    share: f32,
}

/// The part of a material that is not diffuse, with what is known of the light that it reflects.
#[derive(Clone, Copy, Debug)]
pub struct Rest<'a> {
    /// The part.
    pub bsdf: &'a Bsdf,
    /// What is known.
    pub guide: Option<&'a Guide<'a>>,
}

/// Whether a scene has surfaces for which there may be records and which have a lobe to guide as well.
pub fn is_of_use(materials: &[Material]) -> bool {
    materials.iter().any(|m| matches!(m, Material::RoughPlastic { .. } | Material::Blend { .. }))
}

/// For each material: whether it is anything but diffuse.
fn has_lobes(materials: &[Material]) -> Vec<bool> {
    (0..materials.len()).map(|id| has_sharp_lobe(materials, id as MaterialId, f32::INFINITY)).collect()
}

impl GlossyGuides {
    /// Of the records of `gather` under the light of the surfels.
    pub fn new(world: &World, gather: &GatherCache, light: &SurfelLight) -> Self {
        let records: Vec<usize> = (0..gather.len()).collect();
        let scene = world.scene;
        let has_lobes = has_lobes(&scene.materials);
        let asks = |record: usize| {
            let shape = scene.shapes.get(gather.places()[record].shape as usize);
            shape.is_some_and(|s| has_lobes[s.material as usize])
        };
        let of = |chunk: &[usize]| {
            let mut radiance = vec![Rgb::ZERO; gather.strata.len()];
            let one = |&record: &usize| {
                if !asks(record) {
                    return ([0.0; 2], Vec::new());
                }
                gather.radiance(record, light, &mut radiance);
                let mut levels: Vec<f32> = radiance.iter().map(|l| luminance(*l)).collect();
                add_sky(world, gather, record, &mut levels);
                bright_cells(&gather.strata, &gather.frame(record), &levels)
            };
            chunk.iter().map(one).collect::<Vec<_>>()
        };
        let found: Vec<Vec<([f32; 2], Vec<BrightCell>)>> = records.par_chunks(CHUNK).map(of).collect();
        let mut guides = GlossyGuides { begins: vec![0], ..GlossyGuides::default() };
        for ([dim, level], cells) in found.into_iter().flatten() {
            guides.dim.push(dim);
            guides.level.push(level);
            guides.cells.extend(cells);
            guides.begins.push(guides.cells.len() as u32);
        }
        guides
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// What the record says to the lobes of `bsdf`, seen from the unit vector `wo`; `None` if that is of little use.
    pub fn guide<'a>(&'a self, gather: &'a GatherCache, record: usize, bsdf: &Bsdf, wo: Vec3) -> Option<Guide<'a>> {
        let &[begin, end] = self.begins.get(record..record + 2)? else { return None };
        let cells = &self.cells[begin as usize..end as usize];
        if cells.is_empty() {
            return None;
        }
        let (frame, n) = (gather.frame(record), gather.strata.len() as f32);
        // Where there is none light comes from below as well.
        let normal = bsdf.upper_normal()?;
        let peak = bsdf.pdf_dir(wo, (-wo).reflect(normal));
        if peak * PI > NARROW * n * normal.dot(wo) || bsdf.has_dirac_lobe() {
            return None;
        }
        let mut sum = 0.0;
        let sums: ArrayVec<f32, CELLS> = cells
            .iter()
            .map(|cell| {
                sum += luminance(bsdf.eval(wo, cell.direction, Transport::Radiance)) * cell.light;
                sum
            })
            .collect();
        let reflected = sum + luminance(bsdf.albedo(wo)) * self.dim[record];
        // Nothing is reflected from behind, and where a coat is black.
        if !(sum > 0.0 && reflected.is_finite() && sum >= LEAST * reflected) {
            return None;
        }
        let share = (sum / reflected).min(MOST);
        Some(Guide {
            rays: 1,
            reflected: [reflected, self.level[record]],
            strata: &gather.strata,
            frame,
            cells,
            sums,
            share,
        })
    }
}

/// Adds the luminance of an environment that is not gathered to the cells whose gather rays have left the scene: the median for all, without a sun, which
/// light samples find.
fn add_sky(world: &World, gather: &GatherCache, record: usize, levels: &mut [f32]) {
    if !gather.sky(record).is_empty() {
        return;
    }
    let scene = world.scene;
    let outside = |hit: &GatherHit| hit.inverse_distance == 0.0;
    let radiance = |hit: &GatherHit| luminance(scene.lights.environment(scene.textures(), hit.direction));
    let hits = gather.hits(record);
    let mut sky: Vec<f32> = hits.iter().filter(|hit| outside(hit)).map(radiance).collect();
    sky.sort_by(f32::total_cmp);
    let median = sky.get(sky.len() / 2).copied().unwrap_or(0.0);
    levels.iter_mut().zip(hits).filter(|(_, hit)| outside(hit)).for_each(|(level, _)| *level += median);
}

/// Means of the dim cells and of all, and the bright ones in the order of their indices.
fn bright_cells(strata: &Strata, frame: &Frame, levels: &[f32]) -> ([f32; 2], Vec<BrightCell>) {
    let n = levels.len() as f32;
    let mean = levels.iter().sum::<f32>() / n;
    let mut bright: Vec<usize> = (0..levels.len()).filter(|&i| levels[i] > BRIGHT * mean).collect();
    if bright.len() > CELLS {
        bright.sort_by(|&a, &b| levels[b].total_cmp(&levels[a]).then(a.cmp(&b)));
        bright.truncate(CELLS);
        bright.sort_unstable();
    }
    let rest = mean * n - bright.iter().map(|&i| levels[i]).sum::<f32>();
    let dim = (rest / (n - bright.len() as f32)).max(0.0);
    let cell = |i: usize| {
        let middle = strata.direction(i, Vec2::splat(0.5));
        let solid_angle = PI / (n * middle.z);
        BrightCell { direction: frame.to_world(middle), light: (levels[i] - dim) * solid_angle, index: i as u32 }
    };
    ([dim, mean], bright.into_iter().map(cell).collect())
}

impl Guide<'_> {
    /// A direction in which `bsdf` scatters, drawn with the density p by the numbers `u`, and the density that the lobe itself has there.
    pub fn sample(&self, bsdf: &Bsdf, wo: Vec3, u: Vec3) -> Option<(BsdfSample, f32)> {
        let (at, share) = (u.truncate(), self.share);
        let wi = if u.z < share {
            self.direction(u.z / share, at)
        } else {
            bsdf.sample(wo, (u.z - share) / (1.0 - share), at, Transport::Radiance)?.wi
        };
        let (f, of_lobe) = bsdf.eval_pdf(wo, wi, Transport::Radiance);
        let pdf_dir = self.mixed(self.of_record(wi), of_lobe);
        let weight = f / pdf_dir;
        let usable = weight.is_finite() && weight.max_element() > 0.0;
        usable.then_some((BsdfSample { wi, weight, pdf_dir, lobe: LobeKind::Glossy, eta: 1.0, pmf: 1.0 }, of_lobe))
    }

    /// p.
    fn mixed(&self, of_record: f32, of_lobe: f32) -> f32 {
        self.share * of_record + (1.0 - self.share) * of_lobe
    }

    /// sum P_c p_c, the density per solid angle with which the record alone chooses the unit vector `d`.
    fn of_record(&self, d: Vec3) -> f32 {
        let local = self.frame.to_local(d);
        if local.z <= 0.0 {
            return 0.0;
        }
        let index = self.strata.cell(local) as u32;
        let in_cell = |k: usize| {
            let before = if k > 0 { self.sums[k - 1] } else { 0.0 };
            let of_cell = (self.sums[k] - before) / self.sums[self.sums.len() - 1];
            of_cell * self.strata.len() as f32 * local.z * FRAC_1_PI
        };
        self.cells.binary_search_by_key(&index, |c| c.index).map_or(0.0, in_cell)
    }

    /// One by the record, by the number `u` in [0, 1), which chooses the cell, and those of `at` within it.
    fn direction(&self, u: f32, at: Vec2) -> Vec3 {
        let last = self.sums.len() - 1;
        let target = u * self.sums[last];
        let k = self.sums.partition_point(|sum| *sum <= target).min(last);
        self.frame.to_world(self.strata.direction(self.cells[k].index as usize, at))
    }
}

impl<'a> From<&'a Bsdf> for Rest<'a> {
    fn from(bsdf: &'a Bsdf) -> Self {
        Rest { bsdf, guide: None }
    }
}

impl Rest<'_> {
    /// f |cos| and what counts against light samples: p times the number of rays, without a guide the density of the lobe.
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Rgb, f32) {
        let (f, of_lobe) = self.bsdf.eval_pdf(wo, wi, Transport::Radiance);
        (f, self.guide.map_or(of_lobe, |guide| guide.rays as f32 * guide.mixed(guide.of_record(wi), of_lobe)))
    }
}

#[cfg(test)]
mod tests;
