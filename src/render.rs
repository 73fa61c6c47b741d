//! The main loop: passes over tiles until enough samples are taken, time is up, or someone says stop.
//!
//! Pass i takes one sample in every pixel, or as many as the integrator wants there, a pure function of (scene, settings,
//! i) and of what the integrator prepared before it. The unit of work is (pass, tile);
//! tiles run in any order on any thread, but one tile's passes run in order, so that every sum is formed in one order and
//! the picture has the same bits for any number of threads. The first pass visits one pixel of every 8 x 8 block before
//! all others: however slow the scene, there is a coarse picture early.

use crate::image::film::{Film, FilmSample};
use crate::integrators::{Counts, Integrator};
use crate::math::filter::FilterSampler;
use crate::math::{Sampler, Vec2};
use crate::scene::Scene;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Side of a tile, pixels.
const TILE: u32 = 16;
/// Side of the blocks whose first pixel is sampled first, pixels.
pub const COARSE_BLOCK: u32 = 8;

/// When to stop, and what to keep.
#[derive(Clone, Debug)]
pub struct RenderSettings {
    /// Window (x, y, width, height) in pixels of the full image.
    pub window: [u32; 4],
    /// Number of passes (samples per pixel); `None` = until the deadline or a stop.
    pub passes: Option<u64>,
    /// Time at which to stop between two tiles; the coarse part of the first pass is always completed.
    pub deadline: Option<Instant>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Whether feature layers are recorded.
    pub features: bool,
}

/// A sample that was not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct InvalidSample {
    /// Column in the full image.
    pub x: u32,
    /// Row in the full image.
    pub y: u32,
    /// Index among the samples of the pixel.
    pub index: u64,
    /// Pass.
    pub pass: u64,
}

/// State of a render between passes.
#[derive(Clone, Debug)]
pub struct Progress {
    /// The picture so far.
    pub film: Film,
    /// Passes completed.
    pub passes: u64,
    /// What was counted.
    pub counts: Counts,
    /// The first few samples that were not finite.
    pub invalid: Vec<InvalidSample>,
}

/// Who is told how the render goes.
pub trait Observer: Sync {
    /// A tile of some pass is done; called from any thread.
    fn tile_done(&self) {}
    /// Share of a budget of its own that is spent; the render ends at 1, as at the deadline. Called from any thread.
    fn spent(&self) -> f64 {
        0.0
    }
    /// A pass is done. `film` assembles the picture so far, which costs a copy.
    fn pass_done(&mut self, passes: u64, counts: &Counts, film: &dyn Fn() -> Film) {
        let _ = (passes, counts, film);
    }
}

/// An observer that does nothing.
#[derive(Debug, Default)]
pub struct Silent;
impl Observer for Silent {}

/// Invalid samples kept by coordinate; beyond that they are only counted.
const KEPT_INVALID: usize = 16;

struct Tile {
    film: Film,
    /// Samples taken of each pixel.
    taken: Vec<u32>,
    /// Passes completed.
    passes: u64,
    counts: Counts,
    invalid: Vec<InvalidSample>,
}

/// Everything that the samples of a pass depend on.
struct Job<'a> {
    scene: &'a Scene,
    integrator: &'a (dyn Integrator + 'a),
    filter: &'a FilterSampler,
    seed: u64,
}

impl Job<'_> {
    /// Takes sample `index` of the pixel (x, y) of the full image, which belongs to `pass`.
    fn sample(&self, x: u32, y: u32, pass: u64, index: u64, counts: &mut Counts) -> FilmSample {
        let stream = (u64::from(y) << 32) | u64::from(x);
        let mut rng = Sampler::new(self.seed, stream, index);
        let (offset, weight) = self.filter.sample(rng.next_2d());
        let lens = if self.scene.camera.has_lens() { rng.next_2d() } else { Vec2::ZERO };
        let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) + offset;
        let ray = self.scene.camera.ray(at, lens);
        let before = counts.all_shadow_rays();
        let (radiance, mut features) = self.integrator.sample(&ray, pass, &mut rng, counts);
        features.makeup.shadow_rays = (counts.all_shadow_rays() - before) as f32;
        counts.samples += 1;
        FilmSample { radiance, weight, features }
    }

    /// Takes the samples of a pass in those pixels of the tile that `wanted` names by their place in the window.
    fn run(&self, tile: &mut Tile, window: [u32; 4], pass: u64, wanted: impl Fn(u32, u32) -> bool) {
        for y in 0..tile.film.height {
            for x in 0..tile.film.width {
                let (px, py) = (tile.film.x + x, tile.film.y + y);
                if !wanted(px - window[0], py - window[1]) {
                    continue;
                }
                for _ in 0..self.integrator.samples(px, py, pass) {
                    let taken = &mut tile.taken[(y * tile.film.width + x) as usize];
                    let index = u64::from(*taken);
                    *taken += 1;
                    let sample = self.sample(px, py, pass, index, &mut tile.counts);
                    if sample.radiance.is_finite() {
                        tile.film.add(x, y, &sample);
                        continue;
                    }
                    tile.counts.invalid += 1;
                    if tile.invalid.len() < KEPT_INVALID {
                        tile.invalid.push(InvalidSample { x: px, y: py, index, pass });
                    }
                }
            }
        }
    }
}

/// One sample again, as the render takes it: (radiance, filter weight). For samples that were not finite.
pub fn replay(scene: &Scene, integrator: &mut dyn Integrator, seed: u64, at: InvalidSample) -> FilmSample {
    (0..=at.pass).for_each(|p| integrator.prepare(p, &|| false));
    let filter = FilterSampler::new(scene.film.filter);
    let job = Job { scene, integrator, filter: &filter, seed };
    job.sample(at.x, at.y, at.pass, at.index, &mut Counts::default())
}

/// Number of tiles of a pass over `window`.
pub fn tiles_per_pass(window: [u32; 4]) -> u64 {
    u64::from(window[2].div_ceil(TILE)) * u64::from(window[3].div_ceil(TILE))
}

/// Renders until the settings, `stop` or the deadline end it.
pub fn render(
    scene: &Scene,
    integrator: &mut dyn Integrator,
    settings: &RenderSettings,
    stop: &AtomicBool,
    observer: &mut dyn Observer,
) -> Progress {
    let window = settings.window;
    let filter = FilterSampler::new(scene.film.filter);
    let mut tiles = make_tiles(window, settings.features);
    // What is prepared for the first pass may take half of the time.
    let begin = Instant::now();
    let middle = settings.deadline.map(|d| begin + d.saturating_duration_since(begin) / 2);
    let past = |time: Option<Instant>| time.is_some_and(|t| Instant::now() >= t);
    let coarse = |x: u32, y: u32| x.is_multiple_of(COARSE_BLOCK) && y.is_multiple_of(COARSE_BLOCK);

    let mut passes = 0;
    while settings.passes.is_none_or(|n| passes < n) {
        let watcher: &dyn Observer = observer;
        let over = || stop.load(Ordering::Relaxed) || past(settings.deadline) || watcher.spent() >= 1.0;
        let hurry = || stop.load(Ordering::Relaxed) || past(middle) || watcher.spent() >= 0.5;
        if passes > 0 && over() {
            break;
        }
        integrator.prepare(passes, if passes == 0 { &hurry } else { &over });
        let job = Job { scene, integrator: &*integrator, filter: &filter, seed: settings.seed };
        if passes == 0 {
            tiles.par_iter_mut().for_each(|tile| job.run(tile, window, 0, coarse));
        }
        tiles.par_iter_mut().for_each(|tile| {
            if over() {
                return;
            }
            match passes {
                0 => job.run(tile, window, 0, |x, y| !coarse(x, y)),
                _ => job.run(tile, window, passes, |_, _| true),
            }
            tile.passes += 1;
            watcher.tile_done();
        });
        if tiles.iter().any(|t| t.passes <= passes) {
            break;
        }
        passes += 1;
        observer.pass_done(passes, &counts(&tiles, integrator), &|| assemble(&tiles, window));
        let is_last = settings.passes == Some(passes) || stop.load(Ordering::Relaxed) || past(settings.deadline);
        if passes.is_power_of_two() && integrator.learns() && !is_last {
            integrator.learn(&assemble(&tiles, window));
        }
    }
    let invalid = tiles.iter().flat_map(|t| &t.invalid).copied().take(KEPT_INVALID).collect();
    Progress { film: assemble(&tiles, window), passes, counts: counts(&tiles, integrator), invalid }
}

fn make_tiles([x0, y0, width, height]: [u32; 4], features: bool) -> Vec<Tile> {
    let starts = |n: u32| (0..n).step_by(TILE as usize);
    starts(height)
        .flat_map(|y| starts(width).map(move |x| (x, y)))
        .map(|(x, y)| (x, y, TILE.min(width - x), TILE.min(height - y)))
        .map(|(x, y, w, h)| Tile {
            film: Film::new([x0 + x, y0 + y, w, h], features),
            taken: vec![0; (w * h) as usize],
            passes: 0,
            counts: Counts::default(),
            invalid: Vec::new(),
        })
        .collect()
}

/// What samples and preparations have counted so far.
fn counts(tiles: &[Tile], integrator: &dyn Integrator) -> Counts {
    let mut sum = integrator.prepared();
    tiles.iter().for_each(|t| sum += t.counts);
    sum
}

fn assemble(tiles: &[Tile], window: [u32; 4]) -> Film {
    let mut film = Film::new(window, tiles.first().is_some_and(|t| t.film.has_features()));
    tiles.iter().for_each(|t| film.put(&t.film));
    film
}
