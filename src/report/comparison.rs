//! What was compared, and the numbers that are reported of it: the same in the table, the page and the JSON file.

use super::curve::{Point, SpeedUp, mean_curve, speed_up};
use super::ensemble::{Interval, Split, image_mean, mean, mean_biases, standard_deviation};
use crate::image::metrics::{Errors, RELATIVE_EPSILON, Reference};
use crate::integrators::Counts;
use crate::math::Rgb;
use serde::Serialize;

/// One run of a configuration.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its seed.
    pub seed: u64,
    /// Its course; the last point is its end.
    pub points: Vec<Point>,
    /// What was counted.
    pub counts: Counts,
    /// Share of the pixels that have more samples than the least sampled ones.
    pub favoured_pixels: f64,
    /// The picture, as [`Reference::prepare`] makes it.
    pub picture: Vec<Rgb>,
    /// Errors of the picture.
    pub errors: Errors,
}

/// A value per pixel, to be shown in false colours.
#[derive(Clone, Debug)]
pub struct Map {
    /// What it shows.
    pub title: String,
    /// Values, row-major.
    pub values: Vec<f32>,
}

/// A configuration and its runs.
#[derive(Clone, Debug)]
pub struct Configuration {
    /// Its name.
    pub name: String,
    /// The flags that make it.
    pub flags: String,
    /// Name of the integrator.
    pub integrator: String,
    /// Runs with different seeds; at least one.
    pub runs: Vec<Run>,
    /// Densities of the first run.
    pub maps: Vec<Map>,
    /// What the integrator had to say.
    pub remarks: Vec<String>,
}

/// Everything that a report shows.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Name of the scene.
    pub scene: String,
    /// What is equal among the runs, such as "equal CPU time: 10 s".
    pub equal: String,
    /// What the reference is.
    pub reference_text: String,
    /// The reference.
    pub reference: Reference,
    /// Exposure of pictures, stops.
    pub exposure: f32,
    /// The configurations, the baseline first.
    pub configurations: Vec<Configuration>,
    /// Things the reader should know.
    pub notes: Vec<String>,
}

/// Mean and standard deviation over the runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Standard deviation; `None` of one run.
    pub sd: Option<f64>,
}

/// Course of one run.
#[derive(Clone, Debug, Serialize)]
pub struct Course {
    /// Seed.
    pub seed: u64,
    /// Points in time.
    pub points: Vec<Point>,
}

/// The numbers of one configuration; counts are means over the runs.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Name.
    pub name: String,
    /// Flags.
    pub flags: String,
    /// Integrator.
    pub integrator: String,
    /// relMSE, untrimmed, with bias and variance apart.
    pub relmse: Split,
    /// Bias of the image mean against the reference, per cent.
    pub bias: Interval,
    /// Image mean less the baseline's, per cent of the reference's; `None` for the baseline.
    pub difference: Option<Interval>,
    /// relMSE without the worst 0.1 % of the pixels.
    pub relmse_trimmed: f64,
    /// relMSE of 8 x 8 block means, free of the reference's noise where that is possible.
    pub blocks: f64,
    /// Mean FLIP.
    pub flip: f64,
    /// CPU seconds.
    pub cpu_seconds: Spread,
    /// Wall clock seconds.
    pub wall_seconds: Spread,
    /// relMSE times CPU seconds.
    pub relmse_seconds: f64,
    /// Passes.
    pub passes: f64,
    /// Camera samples.
    pub samples: f64,
    /// Closest-hit rays.
    pub rays: f64,
    /// Shadow rays.
    pub shadow_rays: f64,
    /// Photons emitted.
    pub photons: f64,
    /// All that the first run counted, by the integrator's own names.
    pub counts: Counts,
    /// Share of the pixels that have more samples than the least sampled ones, in the first run.
    pub favoured_pixels: f64,
    /// CPU time of the baseline over ours at equal error; `None` for the baseline and where it cannot be read.
    pub speed_up: Option<SpeedUp>,
    /// The same in photons.
    pub photon_gain: Option<SpeedUp>,
    /// Means over the runs.
    pub curve: Vec<Point>,
    /// Each run.
    pub runs: Vec<Course>,
    /// What the integrator had to say.
    pub remarks: Vec<String>,
}

impl Comparison {
    /// The numbers of all configurations.
    pub fn summaries(&self) -> Vec<Summary> {
        self.configurations.iter().enumerate().map(|(i, c)| self.summary(i, c)).collect()
    }

    /// relMSE of the reference itself, as far as two halves tell: that of their mean.
    pub fn self_error(&self) -> Option<f64> {
        let [a, b] = self.reference.halves.as_ref()?;
        let counted = || (0..a.len()).filter(|&i| self.reference.counted[i]);
        let one = |i: usize| {
            let (d, r) = (0.5 * (a[i] - b[i]), self.reference.mean[i]);
            (0..3).map(|c| f64::from(d[c]).powi(2) / (f64::from(r[c]).powi(2) + RELATIVE_EPSILON)).sum::<f64>() / 3.0
        };
        Some(counted().map(one).sum::<f64>() / counted().count().max(1) as f64)
    }

    fn summary(&self, index: usize, c: &Configuration) -> Summary {
        let pictures: Vec<Vec<Rgb>> = c.runs.iter().map(|r| r.picture.clone()).collect();
        let courses: Vec<&[Point]> = c.runs.iter().map(|r| r.points.as_slice()).collect();
        let relmse = Split::new(&pictures, &self.reference);
        let over = |f: &dyn Fn(&Run) -> f64| -> Vec<f64> { c.runs.iter().map(f).collect() };
        let end = |f: fn(&Point) -> f64| over(&|r| r.points.last().map_or(0.0, f));
        let spread = |v: Vec<f64>| Spread { mean: mean(&v), sd: standard_deviation(&v) };
        let count = |f: fn(&Counts) -> u64| mean(&over(&|r| f(&r.counts) as f64));
        let cpu_seconds = spread(end(|p| p.cpu_seconds));

        let baseline = &self.configurations[0];
        let other = index > 0;
        let base: Vec<&[Point]> = baseline.runs.iter().map(|r| r.points.as_slice()).collect();
        let means = |c: &Configuration| -> Vec<f64> {
            c.runs.iter().map(|r| image_mean(&r.picture, &self.reference)).collect()
        };
        let truth = image_mean(&self.reference.mean, &self.reference);
        Summary {
            name: c.name.clone(),
            flags: c.flags.clone(),
            integrator: c.integrator.clone(),
            bias: Interval::of_mean(&mean_biases(&pictures, &self.reference)),
            difference: (other && truth != 0.0).then(|| Interval::of_difference(&means(c), &means(baseline), truth)),
            relmse_trimmed: mean(&over(&|r| r.errors.relmse_trimmed)),
            blocks: mean(&over(&|r| r.errors.blocks_noise_free.unwrap_or(r.errors.blocks))),
            flip: mean(&over(&|r| r.errors.flip)),
            relmse_seconds: relmse.mean * cpu_seconds.mean,
            relmse,
            cpu_seconds,
            wall_seconds: spread(end(|p| p.wall_seconds)),
            passes: mean(&end(|p| p.passes as f64)),
            samples: count(|c| c.samples),
            rays: count(|c| c.rays),
            shadow_rays: count(Counts::all_shadow_rays),
            photons: count(|c| c.photons),
            counts: c.runs[0].counts,
            favoured_pixels: c.runs[0].favoured_pixels,
            speed_up: if other { speed_up(&base, &courses, |p| p.cpu_seconds) } else { None },
            photon_gain: if other { speed_up(&base, &courses, |p| p.photons as f64) } else { None },
            curve: mean_curve(&courses),
            runs: c.runs.iter().map(|r| Course { seed: r.seed, points: r.points.clone() }).collect(),
            remarks: c.remarks.clone(),
        }
    }
}
