//! Progress on stderr: a bar on a terminal, plain lines elsewhere; snapshots and error curves while rendering.

use super::output::Output;
use crate::image::Picture;
use crate::image::film::Film;
use crate::image::metrics::Reference;
use crate::integrators::Counts;
use crate::render::Observer;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Time between two plain progress lines.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// Error of the picture after some passes.
#[derive(Clone, Debug, serde::Serialize)]
pub struct ErrorPoint {
    /// Passes completed.
    pub passes: u64,
    /// Wall clock since the start of the process, seconds.
    pub seconds: f64,
    /// Untrimmed relMSE.
    pub relmse: f64,
}

/// The observer of the `render` command.
pub struct Reporter<'a> {
    bar: ProgressBar,
    lines: bool,
    start: Instant,
    /// The deadline, for the estimate of the time left; `None` where the number of passes ends the render.
    pub limit: Option<Duration>,
    /// Files to write now and then.
    pub output: &'a Output,
    /// Time between two snapshots.
    pub save_every: Option<Duration>,
    /// What to compare with.
    pub reference: Option<Reference>,
    /// Errors so far.
    pub curve: Vec<ErrorPoint>,
    last_save: Instant,
    last_line: Instant,
}

impl<'a> Reporter<'a> {
    /// A reporter for `tiles` tiles in all (0 = unknown); `quiet` shows nothing.
    pub fn new(start: Instant, tiles: u64, quiet: bool, output: &'a Output) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = if quiet || !terminal {
            ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden())
        } else if tiles > 0 {
            let style = ProgressStyle::with_template("{wide_bar} {percent}%  {elapsed} elapsed, {eta} left  {msg}");
            ProgressBar::new(tiles).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        } else {
            let style = ProgressStyle::with_template("{spinner} {elapsed} elapsed  {msg}");
            ProgressBar::new_spinner().with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()))
        };
        let now = Instant::now();
        Reporter {
            bar,
            lines: !quiet && !terminal,
            start,
            limit: None,
            output,
            save_every: None,
            reference: None,
            curve: Vec::new(),
            last_save: now,
            last_line: now,
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn say(&self, text: &str) {
        if self.lines {
            super::tell(text);
        } else {
            self.bar.println(text);
        }
    }

    /// Adds a point to the error curve, unless it ends with the same passes already.
    pub fn measure(&mut self, passes: u64, film: &Film) {
        if self.curve.last().is_some_and(|point| point.passes == passes) {
            return;
        }
        if let Some(reference) = &self.reference {
            let seconds = self.start.elapsed().as_secs_f64();
            let size = (film.width as usize, film.height as usize);
            let picture = Picture::new(size.0, size.1, self.output.picture(film, passes));
            // The reference was fitted to the film's size before.
            let relmse = reference.relmse(&picture).unwrap_or(f64::NAN);
            self.say(&format!("{passes:>8} passes  {seconds:>8.2} s  relMSE {relmse:.3e}"));
            self.curve.push(ErrorPoint { passes, seconds, relmse });
        }
    }
}

impl Observer for Reporter<'_> {
    fn tile_done(&self) {
        self.bar.inc(1);
    }

    fn pass_done(&mut self, passes: u64, counts: &Counts, film: &dyn Fn() -> Film) {
        if self.reference.is_some() && passes.is_power_of_two() {
            self.measure(passes, &film());
        }
        let now = Instant::now();
        let mut message = format!("pass {passes}");
        if let Some(limit) = self.limit {
            let left = limit.saturating_sub(now - self.start).as_secs();
            message = format!("{message}, {left} s left");
        }
        if self.lines && now - self.last_line >= LINE_INTERVAL {
            self.last_line = now;
            super::tell(format_args!("{message}, {:.1} M samples", counts.samples as f64 * 1e-6));
        }
        self.bar.set_message(message);
        if self.save_every.is_some_and(|every| now - self.last_save >= every) {
            if let Err(e) = self.output.write(&film(), passes, self.start.elapsed(), now - self.last_save) {
                self.say(&format!("warning: snapshot not written: {e}"));
            }
            self.last_save = Instant::now();
        }
    }
}
