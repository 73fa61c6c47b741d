//! The attributes of one XML element, with parameters replaced and positions kept.

use super::params::Params;
use super::report::{Checked, Loc, Report};
use crate::formats::diagnostics::{nearest, suggestion};
use std::cell::Cell;

/// One attribute.
#[derive(Debug)]
pub struct Attr {
    /// Name.
    pub name: String,
    /// Value after replacement.
    pub value: String,
    /// Where the value is.
    pub loc: Loc,
    name_loc: Loc,
    used: Cell<bool>,
}

/// All attributes of an element.
#[derive(Debug)]
pub struct Attrs {
    /// The tag, with the opening bracket.
    pub loc: Loc,
    tag: String,
    list: Vec<Attr>,
}

/// Position of a byte range.
pub fn loc_of(source: u32, range: std::ops::Range<usize>) -> Loc {
    let (start, len) = (range.start as u32, range.len() as u32);
    Loc { source, start, len }
}

/// Position of the opening of an element: `<tag`.
pub fn tag_loc(source: u32, node: roxmltree::Node) -> Loc {
    let start = node.range().start;
    loc_of(source, start..start + 1 + node.tag_name().name().len())
}

impl Attrs {
    /// Reads the attributes of an element.
    pub fn new(node: roxmltree::Node, source: u32, params: &mut Params, report: &Report) -> Checked<Self> {
        let mut list = Vec::new();
        for attribute in node.attributes() {
            let loc = loc_of(source, attribute.range_value());
            list.push(Attr {
                name: attribute.name().to_owned(),
                value: params.substitute(attribute.value(), loc, report)?,
                loc,
                name_loc: loc_of(source, attribute.range_qname()),
                used: Cell::new(false),
            });
        }
        let (loc, tag) = (tag_loc(source, node), node.tag_name().name().to_owned());
        Ok(Self { loc, tag, list })
    }

    /// The attribute of a name, if it is there.
    pub fn get(&self, name: &str) -> Option<&Attr> {
        let attr = self.list.iter().find(|a| a.name == name)?;
        attr.used.set(true);
        Some(attr)
    }

    /// The attribute of a name, which must be there.
    pub fn need(&self, name: &str, report: &Report) -> Checked<&Attr> {
        self.get(name).ok_or_else(|| {
            let unused = self.list.iter().filter(|a| !a.used.get()).map(|a| a.name.as_str());
            let help = nearest(name, unused).map(|found| format!("found \"{found}\""));
            report.error_help(self.loc, format!("<{}> needs the attribute \"{name}\"", self.tag), help)
        })
    }

    /// Reports attributes nobody asked for; `known` are the ones there are.
    pub fn finish(&self, known: &[&str], report: &Report) {
        for attr in self.list.iter().filter(|a| !a.used.get()) {
            let message = format!("unexpected attribute \"{}\" of <{}>", attr.name, self.tag);
            report.unknown(attr.name_loc, message, suggestion(&attr.name, known.iter().copied()));
        }
    }

    /// Applies a value parser and adds the position to its error.
    pub fn parse<T>(attr: &Attr, parser: impl Fn(&str) -> Result<T, String>, report: &Report) -> Checked<T> {
        parser(&attr.value).map_err(|message| report.error(attr.loc, message))
    }
}
