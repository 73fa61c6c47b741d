//! How plugins read their object: one accessor that supplies defaults, checks types, marks what was read, and
//! reports the rest with the nearest name the plugin knows.

use super::report::{Checked, Loc, Report, Reported};
use super::tree::{Child, Object, ObjectId, Property, Target, Tree, Value};
use crate::formats::diagnostics::suggestion;
use crate::math::{DMat4, DVec3};
use std::cell::RefCell;

/// The properties and children of one object.
pub struct Props<'t> {
    /// The object.
    pub object: &'t Object,
    /// Where messages go.
    pub report: &'t Report,
    tree: &'t Tree,
    known: RefCell<Vec<&'static str>>,
}

impl<'t> Props<'t> {
    /// Access to an object.
    pub fn new(tree: &'t Tree, id: ObjectId, report: &'t Report) -> Self {
        let (object, known) = (&tree.objects[id], RefCell::default());
        Self { object, report, tree, known }
    }

    /// `bsdf type "diffuse"`, for messages.
    pub fn title(&self) -> String {
        match self.object.tag.as_str() {
            "scene" => "the scene".into(),
            tag => format!("{tag} type \"{}\"", self.object.kind),
        }
    }

    /// The property of a name.
    pub fn get(&self, name: &'static str) -> Option<&'t Property> {
        self.known.borrow_mut().push(name);
        let property = self.object.properties.iter().rev().find(|p| p.name == name)?;
        property.used.set(true);
        Some(property)
    }

    /// Where a property is written, or the object if it is not.
    pub fn loc(&self, name: &str) -> Loc {
        let property = self.object.properties.iter().find(|p| p.name == name);
        let child = self.object.children.iter().find(|c| c.name.as_deref() == Some(name));
        property.map(|p| p.loc).or(child.map(|c| c.loc)).unwrap_or(self.object.loc)
    }

    /// Whether a property or named child is there.
    pub fn has(&self, name: &'static str) -> bool {
        self.known.borrow_mut().push(name);
        let child = self.object.children.iter().any(|c| c.name.as_deref() == Some(name));
        child || self.object.properties.iter().any(|p| p.name == name)
    }

    /// Reads and forgets properties that mean nothing to this renderer.
    pub fn ignore(&self, names: &[&'static str]) {
        for name in names {
            self.get(name);
        }
    }

    /// An error about a property.
    pub fn error(&self, name: &str, message: impl Into<String>) -> Reported {
        self.report.error(self.loc(name), message)
    }

    /// An error about a property unless a condition holds.
    pub fn check(&self, holds: bool, name: &str, message: &str) -> Checked<()> {
        if holds { Ok(()) } else { Err(self.error(name, format!("{name} {message}"))) }
    }

    /// Error for a value of the wrong type.
    pub fn mismatch(&self, property: &Property, expected: &str) -> Reported {
        let (name, found) = (&property.written, property.value.kind());
        self.report.error(property.loc, format!("\"{name}\" should be {expected}, but is {found}"))
    }

    /// A number.
    pub fn float(&self, name: &'static str) -> Checked<Option<f64>> {
        self.get(name).map_or(Ok(None), |p| match p.value {
            Value::Float(v) => Ok(Some(v)),
            Value::Integer(v) => Ok(Some(v as f64)),
            _ => Err(self.mismatch(p, "a float")),
        })
    }

    /// A number with a default.
    pub fn float_or(&self, name: &'static str, default: f64) -> Checked<f64> {
        Ok(self.float(name)?.unwrap_or(default))
    }

    /// An integer; a float without fraction is taken with a warning.
    pub fn integer(&self, name: &'static str) -> Checked<Option<i64>> {
        self.get(name).map_or(Ok(None), |p| match p.value {
            Value::Integer(v) => Ok(Some(v)),
            Value::Float(v) if v.fract() == 0.0 && v.abs() < 1e15 => {
                self.report.warn(p.loc, format!("\"{}\" is an integer, written as a float", p.written));
                Ok(Some(v as i64))
            }
            _ => Err(self.mismatch(p, "an integer")),
        })
    }

    /// An integer within bounds.
    pub fn count(&self, name: &'static str, low: i64, high: i64) -> Checked<Option<i64>> {
        let value = self.integer(name)?;
        match value {
            Some(v) if v < low => Err(self.error(name, format!("{name} must be at least {low}"))),
            Some(v) if v > high => Err(self.error(name, format!("{name} must be at most {high}"))),
            _ => Ok(value),
        }
    }

    /// A truth value with a default.
    pub fn boolean_or(&self, name: &'static str, default: bool) -> Checked<bool> {
        self.get(name).map_or(Ok(default), |p| match p.value {
            Value::Boolean(v) => Ok(v),
            _ => Err(self.mismatch(p, "a boolean")),
        })
    }

    /// A text.
    pub fn string(&self, name: &'static str) -> Checked<Option<&'t str>> {
        self.get(name).map_or(Ok(None), |p| match &p.value {
            Value::String(v) => Ok(Some(v.as_str())),
            _ => Err(self.mismatch(p, "a string")),
        })
    }

    /// One of some words (case ignored), the first by default.
    pub fn choice(&self, name: &'static str, words: &[&'static str]) -> Checked<&'static str> {
        let Some(text) = self.string(name)? else {
            return Ok(words[0]);
        };
        let lower = text.trim().to_lowercase();
        words.iter().copied().find(|w| *w == lower).ok_or_else(|| {
            let help = suggestion(&lower, words.iter().copied());
            let help = help.unwrap_or_else(|| format!("there are {}", words.join(", ")));
            self.report.error_help(self.loc(name), format!("unknown {name} \"{text}\""), Some(help))
        })
    }

    /// A point or vector.
    pub fn vector(&self, name: &'static str) -> Checked<Option<DVec3>> {
        self.get(name).map_or(Ok(None), |p| match p.value {
            Value::Vector(v) => Ok(Some(v)),
            _ => Err(self.mismatch(p, "a point or vector")),
        })
    }

    /// A transform.
    pub fn transform(&self, name: &'static str) -> Checked<Option<DMat4>> {
        self.get(name).map_or(Ok(None), |p| match p.value {
            Value::Transform(v) => Ok(Some(v)),
            _ => Err(self.mismatch(p, "a transform")),
        })
    }

    /// The transform `to_world`, which must not flatten anything it is applied to.
    pub fn to_world(&self) -> Checked<DMat4> {
        Ok(self.transform("to_world")?.unwrap_or(DMat4::IDENTITY))
    }

    /// The object behind a child.
    pub fn resolve(&self, child: &Child) -> Option<ObjectId> {
        match &child.target {
            Target::Object(id) => Some(*id),
            Target::Ref(id) => self.tree.lookup(id),
        }
    }

    /// The nested object of a name, if it is there, whatever its tag.
    pub fn named(&self, name: &'static str) -> Checked<Option<(ObjectId, &'t Object, Loc)>> {
        self.known.borrow_mut().push(name);
        let Some(child) = self.object.children.iter().rev().find(|c| c.name.as_deref() == Some(name)) else {
            return Ok(None);
        };
        child.used.set(true);
        let id = self.resolve(child).ok_or(Reported)?;
        Ok(Some((id, &self.tree.objects[id], child.loc)))
    }

    /// The nested objects of a tag that nobody has read by name, in order; they count as read.
    pub fn nested(&self, tag: &str) -> Vec<(ObjectId, Loc)> {
        let mut found = Vec::new();
        for child in self.object.children.iter().filter(|c| !c.used.get()) {
            if let Some(id) = self.resolve(child).filter(|&id| self.tree.objects[id].tag == tag) {
                child.used.set(true);
                found.push((id, child.loc));
            }
        }
        found
    }

    /// Lets nested objects of some tags be read again.
    pub fn reopen(&self, tags: &[&str]) {
        for child in &self.object.children {
            let tag = self.resolve(child).map(|id| self.tree.objects[id].tag.as_str());
            child.used.set(child.used.get() && !tag.is_some_and(|tag| tags.contains(&tag)));
        }
    }

    /// The nested objects of a tag, as many as `low..=high`.
    pub fn nested_count(&self, tag: &str, low: usize, high: usize) -> Checked<Vec<(ObjectId, Loc)>> {
        let found = self.nested(tag);
        let title = self.title();
        if found.len() < low {
            let many = if low == 1 { format!("a nested <{tag}>") } else { format!("{low} nested <{tag}>s") };
            return Err(self.report.error(self.object.loc, format!("{title} needs {many}")));
        }
        if let Some(&(_, loc)) = found.get(high) {
            return Err(self.report.error(loc, format!("{title} takes at most {high} nested <{tag}>")));
        }
        Ok(found)
    }

    /// Reports everything nobody has read.
    pub fn finish(&self) {
        let known = self.known.borrow();
        let title = self.title();
        for property in self.object.properties.iter().filter(|p| !p.used.get()) {
            if known.iter().any(|k| *k == property.name) {
                continue;
            }
            // Instances read their shapes several times: say it once.
            property.used.set(true);
            let near = suggestion(&property.name, known.iter().copied());
            let message = format!("unknown property \"{}\" of {title}", property.written);
            self.report.unknown(property.name_loc, message, near);
        }
        for child in self.object.children.iter().filter(|c| !c.used.get()) {
            let Some(id) = self.resolve(child) else { continue };
            let tag = &self.tree.objects[id].tag;
            if matches!(tag.as_str(), "medium" | "phase" | "volume") {
                self.report.media_ignored(child.loc);
                continue;
            }
            child.used.set(true);
            match &child.name {
                Some(name) => {
                    let near = suggestion(name, known.iter().copied());
                    self.report.unknown(child.loc, format!("unknown property \"{name}\" of {title}"), near);
                }
                None => self.report.unknown(child.loc, format!("{title} has no use for a nested <{tag}>"), None),
            }
        }
    }
}
