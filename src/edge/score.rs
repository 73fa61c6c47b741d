//! Recall, precision and cost of the detector against brute force.
//!
//! Footprints with an edge between their outermost rays and those of a neighbour are left out ([`oracle::sight_within`]): brute force
//! does not tell on which side it is. Intervals are Wilson's at 95 %. Cost: the time of `any` queries over that of plain rays (pixels: nearest hit through the centre;
//! lights: one shadow ray to the centre), both timed in runs of `RUN` neighbouring footprints on one thread; the median of the runs. Chains
//! differ from pixel to pixel: the time of each, over that of tracing plain rays along its segments; the median of the pixels.

use super::light::Receiver;
use super::map::Cell;
use super::pixel::{self, PixelFamily};
use super::unrolled::Unrolled;
use super::view::from_dual;
use super::{EdgeDetector, oracle};
use crate::accel::Ray;
use crate::math::Vec2;
use rayon::prelude::*;
use std::hint::black_box;
use std::time::Instant;

/// Footprints that are timed together.
const RUN: u32 = 64;
/// How often each of them is timed where it is timed by itself; the best counts.
const PASSES: usize = 4;
/// Runs that are timed, at most.
const MOST_RUNS: usize = 256;

/// One line of a score.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Score {
    /// `pixel`, `chain`, `light:K` or `emission:K`.
    pub family: String,
    /// `bounds`, `corners` or `corners4`.
    pub test: String,
    /// Order of expansions.
    pub order: usize,
    /// Footprints compared.
    pub footprints: usize,
    /// Of these, with an edge by brute force.
    pub edges: usize,
    /// Share of the edges that were predicted.
    pub recall: f64,
    /// Its interval.
    pub recall_interval: [f64; 2],
    /// Share of the predicted that are edges.
    pub precision: f64,
    /// Its interval.
    pub precision_interval: [f64; 2],
    /// Time of a query over that of one plain ray, median.
    pub cost_ratio: f64,
    /// Nanoseconds of a query, median.
    pub query_ns: f64,
    /// Rays per footprint that the oracle took.
    pub oracle_rays: usize,
}

/// Wilson's interval at 95 % of k out of n.
pub fn wilson(k: usize, n: usize) -> [f64; 2] {
    if n == 0 {
        return [0.0, 1.0];
    }
    let (k, n, z) = (k as f64, n as f64, 1.96);
    let p = k / n;
    let (c, d) = (p + z * z / (2.0 * n), 1.0 + z * z / n);
    let s = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    [(c - s) / d, (c + s) / d]
}

fn share(k: usize, n: usize) -> f64 {
    if n == 0 { 1.0 } else { k as f64 / n as f64 }
}

/// What brute force says of each pixel of a window; `None` where it does not tell.
pub fn pixel_truth(detector: &EdgeDetector, [x0, y0, w, h]: [u32; 4], n: usize) -> Vec<Option<bool>> {
    let one = |i: u32| {
        let centre = [f64::from(x0 + i % w) + 0.5, f64::from(y0 + i / w) + 0.5];
        match pixel::family(&detector.scene.camera, centre, [0.5; 2]) {
            Some(PixelFamily::Exact(view)) => oracle::sight_within(detector.scene, detector.accel, &view, n),
            // As many rays in all.
            Some(PixelFamily::Lens(family, t)) => {
                let n = (n as f64).sqrt().ceil() as usize;
                Some(oracle::sight4(detector.scene, detector.accel, &family, t, n.max(2), true))
            }
            None => None,
        }
    };
    (0..w * h).into_par_iter().map(one).collect()
}

/// What brute force says of what each pixel sees in mirrors and through glass; `None` where it sees none, or an edge of one.
pub fn chain_truth(detector: &EdgeDetector, [x0, y0, w, h]: [u32; 4], n: usize) -> Vec<Option<bool>> {
    let one = |i: u32| {
        let centre = [f64::from(x0 + i % w) + 0.5, f64::from(y0 + i / w) + 0.5];
        match pixel::family(&detector.scene.camera, centre, [0.5; 2])? {
            PixelFamily::Exact(view) => oracle::chain(detector, &view, n),
            PixelFamily::Lens(..) => None,
        }
    };
    (0..w * h).into_par_iter().map(one).collect()
}

/// Cost of chains, for pixels that see one: (ratio to plain rays along the same segments, nanoseconds). They differ more than other
/// footprints do, so that each is timed by itself.
pub fn chain_cost(detector: &EdgeDetector, window: [u32; 4]) -> (f64, f64) {
    medians(runs(window).flat_map(|pixels| {
        let ray = |x: u32, y: u32| {
            let r = detector.scene.camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), Vec2::splat(0.5));
            Ray { o: r.o, d: r.d, tmin: r.tmin, tmax: r.tmax }
        };
        // The pixel's ray and each segment is a ray to be traced, and a query.
        let pixels: Vec<_> = pixels.into_iter().filter(|&(x, y)| !detector.follow(&ray(x, y)).is_empty()).collect();
        let queries = time_each(&pixels, |&(x, y)| {
            black_box(detector.pixel_chain(x, y, false));
        });
        let plain = time_each(&pixels, |&(x, y)| {
            black_box(detector.follow(&ray(x, y)));
        });
        queries.into_iter().zip(plain)
    }))
}

/// The same for a light.
pub fn light_truth(detector: &EdgeDetector, light: u32, [x0, y0, w, h]: [u32; 4], n: usize) -> Vec<Option<bool>> {
    let one = |i: u32| {
        let (ray, at) = detector.first_hit(x0 + i % w, y0 + i / w)?;
        oracle::light(detector.scene, detector.accel, light, &Receiver::new(&at, -ray.d), n)
    };
    (0..w * h).into_par_iter().map(one).collect()
}

/// The same for a light's emission. Rays start just off the light.
pub fn emission_truth(detector: &EdgeDetector, cells: &Unrolled, n: usize) -> Vec<Option<bool>> {
    let size = cells.size();
    let start = 1e-6 * f64::from(detector.scene.bounds.1);
    let one = |i: u32| {
        let mut views = cells.views(i % size, i / size).map(|(view, _)| view.within([start, f64::INFINITY])).peekable();
        views.peek()?;
        let seen: Vec<_> = views.map(|view| oracle::sight_within(detector.scene, detector.accel, &view, n)).collect();
        if seen.contains(&Some(true)) { Some(true) } else { (!seen.contains(&None)).then_some(false) }
    };
    (0..size * size).into_par_iter().map(one).collect()
}

/// Cost of emission queries: (ratio, nanoseconds).
pub fn emission_cost(detector: &EdgeDetector, cells: &Unrolled) -> (f64, f64) {
    let size = cells.size();
    medians(runs([0, 0, size, size]).filter_map(|pixels| {
        let views: Vec<_> = pixels.iter().flat_map(|&(x, y)| cells.views(x, y)).collect();
        if views.is_empty() {
            return None;
        }
        let query = time(&views, |(view, facet)| {
            black_box(detector.any(view, Some(*facet)));
        });
        let ray = time(&views, |(view, _)| {
            let r = view.ray_at([0.0; 2]);
            let (o, d) = (from_dual(r.o).as_vec3(), from_dual(r.d).as_vec3());
            black_box(detector.accel.closest(&Ray { o, d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY }));
        });
        Some((query, ray))
    }))
}

/// Compares a map with the truth. The cost is filled in by the caller.
pub fn compare(family: String, test: &str, order: usize, map: &[Cell], truth: &[Option<bool>], n: usize) -> Score {
    let count = |f: &dyn Fn(bool, bool) -> bool| {
        truth.iter().zip(map).filter(|(t, c)| t.is_some_and(|t| f(t, c.event))).count()
    };
    let (edges, flagged, both) = (count(&|t, _| t), count(&|_, e| e), count(&|t, e| t && e));
    Score {
        family,
        test: test.into(),
        order,
        footprints: count(&|_, _| true),
        edges,
        recall: share(both, edges),
        recall_interval: wilson(both, edges),
        precision: share(both, flagged),
        precision_interval: wilson(both, flagged),
        cost_ratio: f64::NAN,
        query_ns: f64::NAN,
        oracle_rays: n * n,
    }
}

/// Ratio and nanoseconds of a query, medians over runs.
fn medians(runs: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (mut ratios, mut ns): (Vec<f64>, Vec<f64>) = runs.map(|(query, ray)| (query / ray, query)).unzip();
    let median = |v: &mut Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v.get(v.len() / 2).copied().unwrap_or(f64::NAN)
    };
    (median(&mut ratios), median(&mut ns))
}

/// Nanoseconds per call of `f` over a run of pixels.
fn time<T>(pixels: &[T], mut f: impl FnMut(&T)) -> f64 {
    // The better of two: the first also warms the caches.
    let mut best = f64::INFINITY;
    for _ in 0..2 {
        let start = Instant::now();
        pixels.iter().for_each(&mut f);
        best = best.min(start.elapsed().as_secs_f64() * 1e9 / pixels.len() as f64);
    }
    best
}

/// Nanoseconds of a call of `f` for each pixel, without what the clock takes.
fn time_each<T>(pixels: &[T], mut f: impl FnMut(&T)) -> Vec<f64> {
    let mut once = |pixel: Option<&T>| {
        let start = Instant::now();
        pixel.map(&mut f);
        start.elapsed().as_secs_f64() * 1e9
    };
    let clock = (0..MOST_RUNS).map(|_| once(None)).fold(f64::INFINITY, f64::min);
    let mut best = vec![f64::INFINITY; pixels.len()];
    // One pixel after the other, as in a picture: the caches and predictions of branches are those of the pixel before.
    for _ in 0..PASSES {
        best.iter_mut().zip(pixels).for_each(|(best, pixel)| *best = best.min(once(Some(pixel)) - clock));
    }
    best
}

fn runs([x0, y0, w, h]: [u32; 4]) -> impl Iterator<Item = Vec<(u32, u32)>> {
    let per_row = w.div_ceil(RUN);
    let total = (per_row * h) as usize;
    (0..total).step_by(total.div_ceil(MOST_RUNS).max(1)).map(move |i| {
        let (row, part) = (i as u32 / per_row, i as u32 % per_row);
        (part * RUN..((part + 1) * RUN).min(w)).map(|x| (x0 + x, y0 + row)).collect()
    })
}

/// Cost of pixel queries: (ratio, nanoseconds).
pub fn pixel_cost(detector: &EdgeDetector, window: [u32; 4]) -> (f64, f64) {
    medians(runs(window).map(|pixels| {
        let query = time(&pixels, |&(x, y)| {
            black_box(detector.pixel(x, y, false));
        });
        let ray = time(&pixels, |&(x, y)| {
            let r = detector.scene.camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), Vec2::splat(0.5));
            black_box(detector.accel.closest(&Ray { o: r.o, d: r.d, tmin: r.tmin, tmax: r.tmax }));
        });
        (query, ray)
    }))
}

/// Cost of light queries from the first hits of pixels: (ratio, nanoseconds).
pub fn light_cost(detector: &EdgeDetector, light: u32, window: [u32; 4]) -> (f64, f64) {
    let (lo, hi) = detector.scene.shapes[light as usize].bounds();
    let centre = 0.5 * (lo + hi);
    medians(runs(window).filter_map(|pixels| {
        let from: Vec<_> = pixels.iter().filter_map(|&(x, y)| detector.first_hit(x, y)).collect();
        if from.is_empty() {
            return None;
        }
        let query = time(&from, |(ray, at)| {
            black_box(detector.light(light, &Receiver::new(at, -ray.d), false));
        });
        let ray = time(&from, |(_, at)| {
            let o = at.spawn_origin(centre - at.p);
            black_box(detector.accel.occluded(&Ray { o, d: centre - o, tmin: f32::MIN_POSITIVE, tmax: 0.9999 }));
        });
        Some((query, ray))
    }))
}
