//! Error against time, and how much faster one configuration reaches an error than another.
//!
//! Curve     at each number of passes that every run has reached, and at the end: the mean error over the runs at the
//!           mean time over the runs
//! Time to e the curve's time at error e, interpolated in log-log: at the *last* crossing, so that a lucky early point
//!           does not count as arrival
//! Speed-up  time to e of the baseline over time to e of the other, at the lowest error that both reach in the end; its
//!           95 % interval by bootstrap over the runs of both (Efron 1979, percentiles). With five runs or fewer such an
//!           interval is too narrow rather than too wide.
//! Not handled: errors that are not positive (noise-free forms may be) are not part of a curve.

use crate::math::sampler::hash;
use serde::Serialize;

/// Resamples of the bootstrap.
const RESAMPLES: u64 = 1000;

/// State of a run at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Point {
    /// Passes completed.
    pub passes: u64,
    /// CPU seconds, all threads, preparation included, measuring left out.
    pub cpu_seconds: f64,
    /// Wall clock seconds, likewise.
    pub wall_seconds: f64,
    /// Photons emitted.
    pub photons: u64,
    /// relMSE, untrimmed.
    pub relmse: f64,
}

/// How a time relates to a bound of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// The number itself.
    Exact,
    /// The truth is this or more: the faster curve starts below the error.
    AtLeast,
    /// The truth is this or less.
    AtMost,
}

/// Speed-up at equal error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpeedUp {
    /// Time of the baseline over time of the configuration.
    pub ratio: f64,
    /// Whether the ratio is exact.
    pub bound: Bound,
    /// The relMSE at which it was read.
    pub at_relmse: f64,
    /// 95 % interval of the ratio; `None` with fewer than two runs.
    pub interval: Option<[f64; 2]>,
}

/// The curve of the means of several runs.
pub fn mean_curve(runs: &[&[Point]]) -> Vec<Point> {
    // The end stands for itself: a run that time ended has a part of a pass more than its number of passes says.
    let Some(inner) = runs.iter().map(|r| r.split_last().map(|(_, inner)| inner)).collect::<Option<Vec<_>>>() else {
        return Vec::new();
    };
    let Some(first) = inner.first() else { return Vec::new() };
    let of_all = |p: &Point| -> Option<Vec<Point>> {
        inner.iter().map(|r| r.iter().find(|q| q.passes == p.passes).copied()).collect()
    };
    let mut curve: Vec<Point> = first.iter().filter_map(|p| Some(mean_point(&of_all(p)?))).collect();
    let last: Vec<Point> = runs.iter().filter_map(|r| r.last().copied()).collect();
    curve.push(mean_point(&last));
    curve
}

fn mean_point(points: &[Point]) -> Point {
    let n = points.len().max(1) as f64;
    let mean = |f: fn(&Point) -> f64| points.iter().map(f).sum::<f64>() / n;
    Point {
        passes: mean(|p| p.passes as f64).round() as u64,
        cpu_seconds: mean(|p| p.cpu_seconds),
        wall_seconds: mean(|p| p.wall_seconds),
        photons: mean(|p| p.photons as f64).round() as u64,
        relmse: mean(|p| p.relmse),
    }
}

/// Points that can be drawn and interpolated on logarithmic axes.
pub fn drawable(curve: &[Point], x: impl Fn(&Point) -> f64) -> Vec<(f64, f64)> {
    let ok = |v: f64| v > 0.0 && v.is_finite();
    curve.iter().map(|p| (x(p), p.relmse)).filter(|&(x, y)| ok(x) && ok(y)).collect()
}

/// Where a curve of (x, error) falls to `error` for good. `None` if it ends above.
pub fn arrival(curve: &[(f64, f64)], error: f64) -> Option<(f64, Bound)> {
    let &(end, lowest) = curve.last()?;
    // The end itself is reached, whatever rounding says.
    if lowest > error * (1.0 + 1e-12) {
        return None;
    }
    let Some(i) = curve.iter().rposition(|&(_, e)| e > error * (1.0 + 1e-12)) else {
        return Some((curve[0].0, if curve[0].1 < error { Bound::AtMost } else { Bound::Exact }));
    };
    let ((x0, e0), (x1, e1)) = (curve[i], curve[i + 1]);
    let t = ((e0 / error).ln() / (e0 / e1).ln()).clamp(0.0, 1.0);
    Some(((x0.ln() + t * (x1 / x0).ln()).exp().min(end), Bound::Exact))
}

/// Speed-up of the runs `other` over the runs `baseline`; `x` is what counts as time. `None` where a curve is empty.
pub fn speed_up(baseline: &[&[Point]], other: &[&[Point]], x: impl Fn(&Point) -> f64 + Copy) -> Option<SpeedUp> {
    let whole = ratio(baseline, other, x)?;
    let mut interval = None;
    if baseline.len() > 1 && other.len() > 1 {
        let pick = |runs: &[&'_ [Point]], seed: u64| -> Vec<usize> {
            (0..runs.len()).map(|i| (hash(seed, i as u64) % runs.len() as u64) as usize).collect()
        };
        let mut ratios: Vec<f64> = (0..RESAMPLES)
            .filter_map(|k| {
                let a: Vec<&[Point]> = pick(baseline, 2 * k).into_iter().map(|i| baseline[i]).collect();
                let b: Vec<&[Point]> = pick(other, 2 * k + 1).into_iter().map(|i| other[i]).collect();
                ratio(&a, &b, x).map(|s| s.ratio)
            })
            .collect();
        ratios.sort_unstable_by(f64::total_cmp);
        if !ratios.is_empty() {
            let at = |share: f64| ratios[((ratios.len() - 1) as f64 * share).round() as usize];
            interval = Some([at(0.025), at(0.975)]);
        }
    }
    Some(SpeedUp { interval, ..whole })
}

fn ratio(baseline: &[&[Point]], other: &[&[Point]], x: impl Fn(&Point) -> f64 + Copy) -> Option<SpeedUp> {
    let [a, b] = [baseline, other].map(|runs| drawable(&mean_curve(runs), x));
    let at_relmse = a.last()?.1.max(b.last()?.1);
    let ((ta, ba), (tb, bb)) = (arrival(&a, at_relmse)?, arrival(&b, at_relmse)?);
    let bound = match (ba, bb) {
        (Bound::Exact, Bound::AtMost) => Bound::AtLeast,
        (Bound::AtMost, Bound::Exact) => Bound::AtMost,
        _ => Bound::Exact,
    };
    Some(SpeedUp { ratio: ta / tb, bound, at_relmse, interval: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs whose error is `c` / time, scaled by 1 + wobble per run.
    fn runs(n: usize, c: f64, passes: u64, wobble: f64) -> Vec<Vec<Point>> {
        let run = |s: usize| {
            let factor = 1.0 + wobble * (s as f64 - 0.5 * (n - 1) as f64);
            let mut points = Vec::new();
            let mut p = 1;
            while p <= passes {
                let t = 0.1 * p as f64;
                points.push(Point {
                    passes: p,
                    cpu_seconds: t,
                    wall_seconds: t,
                    photons: 1000 * p,
                    relmse: factor * c / t,
                });
                p *= 2;
            }
            points
        };
        (0..n).map(run).collect()
    }

    fn views(runs: &[Vec<Point>]) -> Vec<&[Point]> {
        runs.iter().map(Vec::as_slice).collect()
    }

    #[test]
    fn a_known_speed_up_is_found_and_a_wrong_one_would_be_seen() {
        let (slow, fast) = (runs(5, 1.0, 256, 0.02), runs(5, 0.125, 64, 0.02));
        let s = speed_up(&views(&slow), &views(&fast), |p| p.cpu_seconds).unwrap();
        assert!((s.ratio - 8.0).abs() < 1e-9 && s.bound == Bound::Exact, "{s:?}");
        // The slow one ends at 1 / 25.6, which the fast one passes at 3.2 s.
        assert!((s.at_relmse - 1.0 / 25.6).abs() < 1e-12);
        let [low, high] = s.interval.unwrap();
        assert!(low < 8.0 && high > 8.0 && high - low < 1.0, "{low} {high}");
        assert!(!(low..high).contains(&7.0), "a wrong ratio is outside");
        // The other way round, and against itself.
        assert!((speed_up(&views(&fast), &views(&slow), |p| p.cpu_seconds).unwrap().ratio - 0.125).abs() < 1e-9);
        assert_eq!(speed_up(&views(&fast), &views(&fast), |p| p.cpu_seconds).unwrap().ratio, 1.0);
        // In photons the two emit alike.
        assert!((speed_up(&views(&slow), &views(&fast), |p| p.photons as f64).unwrap().ratio - 8.0).abs() < 1e-9);
    }

    #[test]
    fn arrival_is_interpolated_in_log_log_at_the_last_crossing() {
        let line = [(1.0, 1.0), (4.0, 0.25), (16.0, 0.0625)];
        let (t, bound) = arrival(&line, 0.1).unwrap();
        assert!((t - 10.0).abs() < 1e-12 && bound == Bound::Exact);
        assert!((arrival(&line, 0.0625).unwrap().0 - 16.0).abs() < 1e-12);
        assert_eq!(arrival(&line, 0.05), None);
        assert_eq!(arrival(&line, 2.0), Some((1.0, Bound::AtMost)));
        assert_eq!(arrival(&line, 1.0), Some((1.0, Bound::Exact)));
        assert_eq!(arrival(&[], 1.0), None);
        // A firefly undoes an early arrival.
        let spiky = [(1.0, 1.0), (2.0, 0.1), (4.0, 1.0), (16.0, 0.0625)];
        assert!(arrival(&spiky, 0.25).unwrap().0 > 4.0);
    }

    #[test]
    fn a_curve_that_starts_below_the_error_gives_a_bound() {
        let (slow, fast) = (runs(3, 1.0, 4, 0.0), runs(3, 0.001, 4, 0.0));
        let s = speed_up(&views(&slow), &views(&fast), |p| p.cpu_seconds).unwrap();
        assert!(s.bound == Bound::AtLeast && (s.ratio - 4.0).abs() < 1e-12, "{s:?}");
        assert_eq!(speed_up(&views(&fast), &views(&slow), |p| p.cpu_seconds).unwrap().bound, Bound::AtMost);
        assert_eq!(speed_up(&[], &views(&fast), |p| p.cpu_seconds), None);
    }

    #[test]
    fn runs_that_end_apart_share_an_end() {
        let mut two = runs(2, 1.0, 8, 0.0);
        for (run, passes) in two.iter_mut().zip([10, 12]) {
            let t = 0.1 * passes as f64;
            run.push(Point { passes, cpu_seconds: t, wall_seconds: t, photons: 0, relmse: 1.0 / t });
        }
        let curve = mean_curve(&views(&two));
        assert_eq!(curve.iter().map(|p| p.passes).collect::<Vec<_>>(), [1, 2, 4, 8, 11]);
        assert!((curve[4].cpu_seconds - 1.1).abs() < 1e-12);
        // A part of a pass at the end does not hide behind the whole pass before it.
        let mut cut = runs(2, 1.0, 4, 0.0);
        cut.iter_mut().for_each(|r| r.push(Point { passes: 4, cpu_seconds: 0.5, relmse: 2.0, ..r[2] }));
        assert_eq!(mean_curve(&views(&cut)).iter().map(|p| p.relmse).collect::<Vec<_>>(), [10.0, 5.0, 2.5, 2.0]);
        // Equal passes: nothing is doubled. No positive error: nothing to draw.
        assert_eq!(mean_curve(&views(&runs(2, 1.0, 8, 0.0))).len(), 4);
        assert!(
            drawable(&[Point { relmse: -1.0, cpu_seconds: 1.0, ..Point::default() }], |p| p.cpu_seconds).is_empty()
        );
    }
}
