//! `$name` parameters: `-D` on the command line, `<default>` in the file, replacement in attribute values.

use super::report::{Checked, Loc, Report};
use crate::formats::diagnostics::suggestion;

/// Bytes that all replacements of a scene may produce together; keeps doubling defaults harmless.
const EXPANSION_LIMIT: usize = 16 << 20;

#[derive(Debug)]
struct Param {
    name: String,
    value: String,
    /// Given on the command line and not used yet.
    waiting: bool,
}

/// The parameters known so far.
#[derive(Debug, Default)]
pub struct Params {
    /// Longest names first, so that `$spp_max` is not taken for `$spp`.
    list: Vec<Param>,
    expanded: usize,
}

impl Params {
    /// The parameters of the command line; of two with one name the last counts.
    pub fn new(defines: &[(String, String)]) -> Self {
        let mut params = Self::default();
        for (name, value) in defines {
            params.list.retain(|p| p.name != *name);
            params.insert(name, value, true);
        }
        params
    }

    fn insert(&mut self, name: &str, value: &str, waiting: bool) {
        let at = self.list.partition_point(|p| p.name.len() >= name.len());
        let (name, value) = (name.to_owned(), value.to_owned());
        self.list.insert(at, Param { name, value, waiting });
    }

    /// Takes a `<default>`: it counts only if nothing has defined the name before.
    pub fn set_default(&mut self, name: &str, value: &str) {
        if !self.list.iter().any(|p| p.name == name) {
            self.insert(name, value, false);
        }
    }

    /// Replaces `$name` in an attribute value; `\$` is a plain dollar sign.
    pub fn substitute(&mut self, text: &str, loc: Loc, report: &Report) -> Checked<String> {
        if !text.contains('$') {
            return Ok(text.to_owned());
        }
        let mut out = String::new();
        let mut rest = text;
        while let Some(dollar) = rest.find('$') {
            let (before, after) = (&rest[..dollar], &rest[dollar + 1..]);
            if let Some(before) = before.strip_suffix('\\') {
                out.push_str(before);
                out.push('$');
                rest = after;
                continue;
            }
            out.push_str(before);
            let found = self.list.iter_mut().find(|p| !p.name.is_empty() && after.starts_with(&p.name));
            let Some(param) = found else {
                let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
                let help = suggestion(&after[..end], self.list.iter().map(|p| p.name.as_str()));
                let help = help.or_else(|| Some("give it a <default> before its use, or -D name=value".into()));
                return Err(report.error_help(loc, format!("undefined parameter \"${}\"", &after[..end]), help));
            };
            param.waiting = false;
            self.expanded += param.value.len();
            if self.expanded > EXPANSION_LIMIT {
                return Err(report.error(loc, "parameters expand to too much text"));
            }
            out.push_str(&param.value);
            rest = &after[param.name.len()..];
        }
        out.push_str(rest);
        Ok(out)
    }

    /// Reports definitions of the command line that nothing used: most likely a slip that would go unseen.
    pub fn finish(&self, loc: Loc, report: &Report) {
        for param in self.list.iter().filter(|p| p.waiting) {
            let names = self.list.iter().filter(|p| !p.waiting).map(|p| p.name.as_str());
            let message = format!("parameter \"{}\" of the command line is not used in the scene", param.name);
            report.error_help(loc, message, suggestion(&param.name, names));
        }
    }
}
