//! Collects messages about the files of a scene, with their positions.
//!
//! Errors do not end the reading at once: the one who finds a mistake reports it, returns [`Reported`], and the
//! reader goes on elsewhere, so that several mistakes are shown together. Their number is limited.

use crate::formats::diagnostics::{Diagnostic, Diagnostics, Severity};
use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::rc::Rc;

/// Messages kept of each severity; the rest is counted.
const LIMIT: usize = 200;

/// A mistake that the report already holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reported;

/// Result of a reading step whose mistakes are in the report.
pub type Checked<T> = Result<T, Reported>;

/// A range of bytes in one of the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loc {
    /// Index of the file in the report.
    pub source: u32,
    /// First byte.
    pub start: u32,
    /// Number of bytes.
    pub len: u32,
}

/// A file that was read.
#[derive(Debug)]
pub struct Source {
    /// As given, or found by an include.
    pub path: PathBuf,
    /// Content.
    pub text: Rc<str>,
}

/// The messages so far.
#[derive(Debug, Default)]
pub struct Report {
    strict: bool,
    sources: RefCell<Vec<Source>>,
    list: RefCell<Vec<Diagnostic>>,
    counts: [Cell<usize>; 2],
    media_noted: Cell<bool>,
}

impl Report {
    /// An empty report; `strict` turns what [`Report::unknown`] gets into errors.
    pub fn new(strict: bool) -> Self {
        Self { strict, ..Self::default() }
    }

    /// Adds a file and returns its index.
    pub fn add_source(&self, path: PathBuf, text: Rc<str>) -> u32 {
        let mut sources = self.sources.borrow_mut();
        sources.push(Source { path, text });
        (sources.len() - 1) as u32
    }

    /// Path of a file.
    pub fn path(&self, source: u32) -> PathBuf {
        self.sources.borrow()[source as usize].path.clone()
    }

    fn push(&self, loc: Loc, severity: Severity, message: String, help: Option<String>) {
        let count = &self.counts[usize::from(severity == Severity::Warning)];
        count.set(count.get() + 1);
        if count.get() > LIMIT {
            return;
        }
        let sources = self.sources.borrow();
        let source = &sources[loc.source as usize];
        let (start, len) = (loc.start as usize, loc.len as usize);
        let mut diagnostic = Diagnostic::at(source.path.clone(), &source.text, start, len, severity, message);
        diagnostic.help = help;
        self.list.borrow_mut().push(diagnostic);
    }

    /// Reports an error.
    pub fn error(&self, loc: Loc, message: impl Into<String>) -> Reported {
        self.push(loc, Severity::Error, message.into(), None);
        Reported
    }

    /// Reports an error with advice.
    pub fn error_help(&self, loc: Loc, message: impl Into<String>, help: Option<String>) -> Reported {
        self.push(loc, Severity::Error, message.into(), help);
        Reported
    }

    /// Reports a warning.
    pub fn warn(&self, loc: Loc, message: impl Into<String>) {
        self.push(loc, Severity::Warning, message.into(), None);
    }

    /// Reports a word that this reader does not know: a warning, or an error if strict.
    pub fn unknown(&self, loc: Loc, message: impl Into<String>, help: Option<String>) {
        let severity = if self.strict { Severity::Error } else { Severity::Warning };
        self.push(loc, severity, message.into(), help);
    }

    /// Says once that participating media are ignored.
    pub fn media_ignored(&self, loc: Loc) {
        if !self.media_noted.replace(true) {
            self.warn(loc, "participating media are not supported; all of them are ignored");
        }
    }

    /// Whether there are errors.
    pub fn failed(&self) -> bool {
        self.counts[0].get() > 0
    }

    /// Whether so many errors were found that going on is of no use.
    pub fn flooded(&self) -> bool {
        self.counts[0].get() > LIMIT
    }

    /// The warnings, or everything if there are errors.
    pub fn finish(self) -> Result<Vec<Diagnostic>, Diagnostics> {
        let mut list = self.list.into_inner();
        for (count, name) in self.counts.iter().zip(["errors", "warnings"]) {
            if let (true, Some(last)) = (count.get() > LIMIT, list.last_mut()) {
                let more = format!("{} more {name} are not shown", count.get() - LIMIT);
                last.help = Some(last.help.take().map_or(more.clone(), |h| format!("{h}; {more}")));
            }
        }
        if self.counts[0].get() > 0 { Err(Diagnostics(list)) } else { Ok(list) }
    }
}
