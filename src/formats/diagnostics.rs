//! Messages about input files: position, the line with a caret, and the nearest valid name.
//!
//! Not handled: messages that span lines (the caret stops at the end of the first).

use std::fmt;
use std::path::PathBuf;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The file cannot be used.
    Error,
    /// The file can be used, but probably does not say what its author meant.
    Warning,
}

/// One message. Displayed as `file:line:column: severity: message; help`, then the source line with carets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// The file.
    pub file: PathBuf,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Error or warning.
    pub severity: Severity,
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
    /// The text of the line; of very long lines the part around the position.
    pub source_line: String,
    /// Number of characters the message is about, at least 1.
    pub span: usize,
    /// Characters of the line in front of `source_line`.
    skipped: usize,
}

/// Lines with more bytes are kept in part only: some files are one single line.
const LONG_LINE: usize = 4096;

/// Longest piece of a source line that is printed, characters.
const WINDOW: usize = 110;

impl Diagnostic {
    /// A message about `span` bytes at byte `offset` of `text`.
    pub fn at(file: PathBuf, text: &str, offset: usize, span: usize, severity: Severity, message: String) -> Self {
        let mut offset = offset.min(text.len());
        while !text.is_char_boundary(offset) {
            offset -= 1;
        }
        let before = &text[..offset];
        let start = before.rfind('\n').map_or(0, |i| i + 1);
        let end = text[offset..].find('\n').map_or(text.len(), |i| offset + i);
        let mut stop = (offset + span.max(1)).min(end);
        while !text.is_char_boundary(stop) {
            stop -= 1;
        }
        let column = text[start..offset].chars().count() + 1;
        let line = text[start..end].trim_end_matches('\r');
        let skipped = if line.len() > LONG_LINE { column.saturating_sub(LONG_LINE / 4) } else { 0 };
        Self {
            file,
            line: before.bytes().filter(|&b| b == b'\n').count() + 1,
            column,
            severity,
            message,
            help: None,
            source_line: line.chars().skip(skipped).take(LONG_LINE).collect(),
            skipped,
            span: text[offset..stop.max(offset)].chars().count().max(1),
        }
    }

    /// The piece of the line around the position, and the column of the position in it (from 0).
    fn window(&self) -> (String, usize) {
        let column = self.column - 1 - self.skipped;
        let length = self.source_line.chars().count();
        let skip = if length <= WINDOW { 0 } else { column.saturating_sub(WINDOW / 3) };
        let piece: String = self.source_line.chars().skip(skip).take(WINDOW).collect();
        let indent = if skip == 0 { piece.chars().take_while(|c| c.is_whitespace()).count() } else { 0 };
        let indent = indent.min(column);
        let piece = piece.chars().skip(indent).map(|c| if c.is_control() { ' ' } else { c });
        (piece.collect(), column - skip - indent)
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let (file, line, column) = (self.file.display(), self.line, self.column);
        write!(f, "{file}:{line}:{column}: {severity}: {}", self.message)?;
        if let Some(help) = &self.help {
            write!(f, "; {help}")?;
        }
        if !self.source_line.trim().is_empty() {
            let (piece, column) = self.window();
            let room = WINDOW.saturating_sub(column).max(1);
            let carets = "^".repeat(self.span.min(room));
            write!(f, "\n{line:>5} | {piece}\n      | {}{carets}", " ".repeat(column))?;
        }
        Ok(())
    }
}

/// Several messages: the error type of readers, which collect what they find before they give up.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Diagnostics(pub Vec<Diagnostic>);

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, diagnostic) in self.0.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            write!(f, "{diagnostic}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostics {}

/// Edit distance with transpositions of neighbours (optimal string alignment), case ignored.
fn distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.to_lowercase().chars().collect();
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut before = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let substitute = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = substitute.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

/// The candidate nearest to `word`, if it is near enough to be what was meant (a third of its length, at least 2
/// edits for words of 4 letters and more). The first of equals wins.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let length = word.chars().count();
    if length > 64 {
        return None;
    }
    let limit = if length < 4 { 1 } else { (length / 3).max(2) };
    let scored = candidates.into_iter().map(|c| (distance(word, c), c));
    scored.filter(|&(d, _)| d <= limit).min_by_key(|&(d, _)| d).map(|(_, c)| c)
}

/// `did you mean "reflectance"?`, if something is near.
pub fn suggestion<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    nearest(word, candidates).map(|c| format!("did you mean \"{c}\"?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_has_position_line_and_caret() {
        let text = "<scene>\n\t<rgb name=\"relfectance\" value=\"1\"/>\r\n</scene>";
        let offset = text.find("relf").unwrap();
        let mut d = Diagnostic::at("a.xml".into(), text, offset, 11, Severity::Warning, "unknown".into());
        d.help = suggestion("relfectance", ["alpha", "reflectance"]);
        assert_eq!(
            d.to_string(),
            "a.xml:2:13: warning: unknown; did you mean \"reflectance\"?\n    \
             2 | <rgb name=\"relfectance\" value=\"1\"/>\n      |            ^^^^^^^^^^^"
        );
    }

    #[test]
    fn any_offset_is_safe() {
        let text = "é\n\u{1F600} x\r\n";
        for offset in 0..30 {
            for span in 0..10 {
                let d = Diagnostic::at("a".into(), text, offset, span, Severity::Error, "m".into());
                assert!(d.to_string().starts_with("a:"));
            }
        }
        let long = "y".repeat(5000);
        let d = Diagnostic::at("a".into(), &long, 4000, 900, Severity::Error, "m".into());
        assert!(d.to_string().lines().all(|l| l.len() < 130));
        let endless = format!("{}here{}", "y".repeat(1_000_000), "z".repeat(1_000_000));
        let d = Diagnostic::at("a".into(), &endless, 1_000_000, 4, Severity::Error, "m".into());
        assert!(d.column == 1_000_001 && d.source_line.len() <= LONG_LINE);
        let text = d.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[2].find('^'), lines[1].find("here"));
    }

    #[test]
    fn nearest_names() {
        assert_eq!(nearest("relfectance", ["alpha", "reflectance"]), Some("reflectance"));
        assert_eq!(nearest("toWorld", ["to_world"]), Some("to_world"));
        assert_eq!(nearest("kNN", ["max_depth"]), None);
        assert_eq!(nearest("recangle", ["sphere", "rectangle"]), Some("rectangle"));
    }
}
