//! XML to the located object tree: tags, parameters, includes, aliases, search folders.
//!
//! Source      language rules of Mitsuba 3's XML reader
//! Limits      nesting 64, includes 16 deep and 1000 in all, 16 M nodes per file

use super::attrs::{Attrs, loc_of, tag_loc};
use super::params::Params;
use super::report::{Checked, Loc, Report, Reported};
use super::tree::{Child, Object, ObjectId, Target, Tree};
use super::{files, upgrade};
use crate::formats::diagnostics::suggestion;
use roxmltree::Node;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

const NESTING_LIMIT: usize = 64;
const INCLUDE_DEPTH: usize = 16;
const INCLUDE_LIMIT: usize = 1000;
const NODE_LIMIT: u32 = 16 << 20;

const OBJECTS: [&str; 13] = [
    "integrator",
    "sensor",
    "film",
    "sampler",
    "rfilter",
    "bsdf",
    "texture",
    "emitter",
    "shape",
    "medium",
    "phase",
    "volume",
    "subsurface",
];
const PROPERTIES: [&str; 12] = [
    "integer",
    "float",
    "boolean",
    "string",
    "point",
    "vector",
    "rgb",
    "srgb",
    "spectrum",
    "transform",
    "ref",
    "blackbody",
];
const COMMANDS: [&str; 4] = ["default", "include", "alias", "path"];

/// What is the same for all elements of a file.
#[derive(Clone, Copy)]
struct File {
    source: u32,
    legacy: bool,
}

mod property;

/// State of the reading of a scene's files.
pub struct Parser<'r> {
    report: &'r Report,
    params: Params,
    tree: Tree,
    /// Files being read, outermost first.
    open: Vec<PathBuf>,
    included: usize,
}

/// Position of an XML error.
fn xml_error(report: &Report, source: u32, text: &str, error: &roxmltree::Error) -> Reported {
    let pos = error.pos();
    let (row, column) = (pos.row.max(1) as usize, pos.col.max(1) as usize);
    let line_start: usize = text.split_inclusive('\n').take(row - 1).map(str::len).sum();
    let line = &text[line_start.min(text.len())..];
    let inside: usize = line.chars().take(column - 1).map(char::len_utf8).sum();
    // A file that ends too early is wrong at its end; the XML reader says 1:1.
    let cut = matches!(error, roxmltree::Error::UnclosedRootNode | roxmltree::Error::UnexpectedEndOfStream);
    let start = if cut { text.trim_end().len() } else { line_start + inside };
    // The position is said once, in front of the message.
    let message = error.to_string();
    let message = message.strip_suffix(&format!(" at {}:{}", pos.row, pos.col)).unwrap_or(&message);
    report.error(loc_of(source, start..start + 1), format!("XML: {message}"))
}

/// Reads the text of a scene file and its includes.
pub fn parse(path: &Path, text: Rc<str>, defines: &[(String, String)], report: &Report) -> Checked<Tree> {
    let folder = files::folder_of(path);
    let mut parser = Parser {
        report,
        params: Params::new(defines),
        tree: Tree { folders: vec![folder], ..Tree::default() },
        open: vec![path.to_path_buf()],
        included: 0,
    };
    let source = report.add_source(path.to_path_buf(), text.clone());
    parser.tree.objects.push(Object {
        tag: "scene".into(),
        kind: "scene".into(),
        id: None,
        loc: Loc { source, start: 0, len: 1 },
        kind_loc: Loc { source, start: 0, len: 1 },
        legacy: false,
        properties: Vec::new(),
        children: Vec::new(),
    });
    parser.file(source, &text, 0, None)?;
    if !report.failed() {
        parser.params.finish(parser.tree.objects[0].loc, report);
    }
    Ok(parser.tree)
}

impl Parser<'_> {
    /// Reads one file into the object `parent`; `name` replaces the name of an only object in it.
    fn file(&mut self, source: u32, text: &str, parent: ObjectId, name: Option<String>) -> Checked<()> {
        let options = roxmltree::ParsingOptions { nodes_limit: NODE_LIMIT, ..roxmltree::ParsingOptions::default() };
        let document = roxmltree::Document::parse_with_options(text, options)
            .map_err(|e| xml_error(self.report, source, text, &e))?;
        let root = document.root_element();
        let loc = tag_loc(source, root);
        if parent == 0 && self.open.len() == 1 {
            self.tree.objects[0].loc = loc;
        }
        if root.tag_name().name() != "scene" {
            if self.open.len() > 1 && OBJECTS.contains(&root.tag_name().name()) {
                // An include may hold a single object instead of a scene.
                let file = File { source, legacy: self.tree.objects[parent].legacy };
                return self.element(root, file, parent, self.open.len(), name);
            }
            let message = format!("expected <scene>, found <{}>", root.tag_name().name());
            return Err(self.report.error(loc, message));
        }
        let attrs = Attrs::new(root, source, &mut self.params, self.report)?;
        let legacy = match attrs.get("version") {
            None => {
                self.report.warn(loc, "the scene has no version; reading names of old and new versions");
                true
            }
            Some(attr) => {
                let version = Attrs::parse(attr, upgrade::version, self.report)?;
                if version < [0, 4, 0] {
                    let message = "scene files of version 0.3 and older are not supported";
                    let help = Some("open and save it with Mitsuba 0.6, which upgrades it".into());
                    return Err(self.report.error_help(attr.loc, message, help));
                }
                if version[0] > 3 {
                    self.report.warn(attr.loc, "this version is newer than what is known here (3.x)");
                }
                version[0] < 2
            }
        };
        let _ = (attrs.get("id"), attrs.get("type"), attrs.get("name"));
        attrs.finish(&["version"], self.report);
        let file = File { source, legacy };
        if self.open.len() == 1 {
            self.tree.objects[0].legacy = legacy;
        }
        let only =
            root.children().filter(Node::is_element).filter(|n| OBJECTS.contains(&n.tag_name().name())).count() == 1;
        self.children(root, file, parent, self.open.len(), name.filter(|_| only));
        Ok(())
    }

    /// Reads the elements inside of `node`; mistakes in one do not keep the others from being read.
    fn children(&mut self, node: Node, file: File, parent: ObjectId, depth: usize, name: Option<String>) {
        for child in node.children() {
            if self.report.flooded() {
                return;
            }
            if child.is_element() {
                let _ = self.element(child, file, parent, depth + 1, name.clone());
            } else if child.is_text() && child.text().is_some_and(|t| !t.trim().is_empty()) {
                let range = child.range();
                let skipped = child.text().map_or(0, |t| t.len() - t.trim_start().len());
                let start = (range.start + skipped).min(range.end);
                let loc = loc_of(file.source, start..range.end);
                self.report.unknown(loc, "text outside of attributes means nothing", None);
            }
        }
    }

    /// Reads one element into the object `parent`.
    fn element(&mut self, node: Node, file: File, parent: ObjectId, depth: usize, name: Option<String>) -> Checked<()> {
        let tag = node.tag_name().name();
        let loc = tag_loc(file.source, node);
        if depth > NESTING_LIMIT + INCLUDE_DEPTH {
            return Err(self.report.error(loc, format!("elements are nested more than {NESTING_LIMIT} deep")));
        }
        if matches!(tag, "camera" | "luminaire") {
            let help = Some("open and save it with Mitsuba 0.6, which upgrades it".into());
            return Err(self.report.error_help(loc, format!("<{tag}> of version 0.3 is not supported"), help));
        }
        let object = OBJECTS.contains(&tag) || (tag == "spectrum" && node.has_attribute("type"));
        if !object && !PROPERTIES.contains(&tag) && !COMMANDS.contains(&tag) {
            let near = suggestion(tag, OBJECTS.into_iter().chain(PROPERTIES).chain(COMMANDS));
            self.report.unknown(loc, format!("unknown tag <{tag}>; skipped"), near);
            return Ok(());
        }
        let attrs = Attrs::new(node, file.source, &mut self.params, self.report)?;
        if object {
            return self.object(node, &attrs, file, parent, depth, name);
        }
        match tag {
            "default" => {
                let (name, value) = (attrs.need("name", self.report)?, attrs.need("value", self.report)?);
                self.params.set_default(&name.value, &value.value);
                attrs.finish(&["name", "value"], self.report);
            }
            "include" => self.include(&attrs, parent, file)?,
            "alias" => {
                let (id, alias) = (attrs.need("id", self.report)?, attrs.need("as", self.report)?);
                attrs.finish(&["id", "as"], self.report);
                let taken = self.tree.ids.contains_key(&alias.value) || self.tree.aliases.contains_key(&alias.value);
                if taken {
                    return Err(self.report.error(alias.loc, format!("the id \"{}\" is used twice", alias.value)));
                }
                self.tree.aliases.insert(alias.value.clone(), (id.value.clone(), id.loc));
            }
            "path" => {
                let value = attrs.need("value", self.report)?;
                attrs.finish(&["value"], self.report);
                if parent != 0 {
                    return Err(self.report.error(loc, "<path> is allowed at the top of the scene only"));
                }
                let relative = files::folder_of(&self.report.path(file.source)).join(&value.value);
                let folder = if relative.is_dir() { relative } else { PathBuf::from(&value.value) };
                if !folder.is_dir() {
                    self.report.warn(value.loc, format!("there is no folder \"{}\"", value.value));
                }
                self.tree.folders.push(folder);
            }
            "ref" => {
                let id = attrs.need("id", self.report)?;
                let name = attrs.get("name").map(|a| self.property_name(&a.value, parent, file)).or(name);
                attrs.finish(&["id", "name"], self.report);
                let target = Target::Ref(id.value.clone());
                self.add_child(parent, Child { name, target, loc: id.loc, used: Cell::new(false) });
            }
            _ => self.property(node, tag, &attrs, file, parent)?,
        }
        if tag != "transform"
            && let Some(child) = node.children().find(Node::is_element)
        {
            let message = format!("<{tag}> holds no other elements, found <{}>", child.tag_name().name());
            self.report.unknown(tag_loc(file.source, child), message, None);
        }
        Ok(())
    }

    /// Today's name of a property of `parent`.
    fn property_name(&self, written: &str, parent: ObjectId, file: File) -> String {
        if !file.legacy {
            return written.to_owned();
        }
        let object = &self.tree.objects[parent];
        upgrade::property(&object.tag, &object.kind, upgrade::snake_case(written))
    }

    fn object(
        &mut self,
        node: Node,
        attrs: &Attrs,
        file: File,
        parent: ObjectId,
        depth: usize,
        name: Option<String>,
    ) -> Checked<()> {
        let tag = node.tag_name().name();
        let kind = attrs.need("type", self.report)?;
        let id = attrs.get("id").map(|a| (a.value.clone(), a.loc));
        let name = name.or_else(|| attrs.get("name").map(|a| self.property_name(&a.value, parent, file)));
        let _ = attrs.get("version");
        attrs.finish(&["type", "id", "name"], self.report);
        let index = self.tree.objects.len();
        self.tree.objects.push(Object {
            tag: tag.to_owned(),
            kind: if file.legacy { upgrade::plugin(tag, &kind.value) } else { kind.value.clone() },
            id: id.as_ref().map(|(id, _)| id.clone()),
            loc: attrs.loc,
            kind_loc: kind.loc,
            legacy: file.legacy,
            properties: Vec::new(),
            children: Vec::new(),
        });
        if let Some((id, loc)) = id {
            let taken = self.tree.ids.contains_key(&id) || self.tree.aliases.contains_key(&id);
            if taken {
                self.report.error(loc, format!("the id \"{id}\" is used twice"));
            } else {
                self.tree.ids.insert(id, (index, loc));
            }
        }
        let target = Target::Object(index);
        self.add_child(parent, Child { name, target, loc: attrs.loc, used: Cell::new(false) });
        self.children(node, file, index, depth, None);
        Ok(())
    }

    fn include(&mut self, attrs: &Attrs, parent: ObjectId, file: File) -> Checked<()> {
        let filename = attrs.need("filename", self.report)?;
        let name = attrs.get("name").map(|a| self.property_name(&a.value, parent, file));
        attrs.finish(&["filename", "name"], self.report);
        self.included += 1;
        if self.open.len() > INCLUDE_DEPTH || self.included > INCLUDE_LIMIT {
            return Err(self.report.error(filename.loc, "too many includes"));
        }
        let mut folders = vec![files::folder_of(&self.report.path(file.source))];
        folders.extend(self.tree.folders.iter().cloned());
        folders.dedup();
        let path = files::find(&filename.value, &folders, filename.loc, "included", self.report)?;
        let canonical = |p: &Path| p.canonicalize().unwrap_or_else(|_| p.to_path_buf());
        if self.open.iter().any(|p| canonical(p) == canonical(&path)) {
            return Err(self.report.error(filename.loc, "the file includes itself"));
        }
        let text: Rc<str> = match files::read_text(&path) {
            Ok(text) => text.into(),
            Err(e) => return Err(self.report.error(filename.loc, format!("{}: {e}", path.display()))),
        };
        let source = self.report.add_source(path.clone(), text.clone());
        self.open.push(path);
        let result = self.file(source, &text, parent, name);
        self.open.pop();
        result
    }

    fn add_child(&mut self, parent: ObjectId, child: Child) {
        if let Some(name) = &child.name {
            self.drop_double(parent, name, child.loc);
        }
        self.tree.objects[parent].children.push(child);
    }

    /// A name that is given twice: the last one counts, as real scenes rely on it.
    fn drop_double(&mut self, parent: ObjectId, name: &str, loc: Loc) {
        if parent == 0 {
            return;
        }
        let object = &mut self.tree.objects[parent];
        let before = object.properties.len() + object.children.len();
        object.properties.retain(|p| p.name != name);
        object.children.retain(|c| c.name.as_deref() != Some(name));
        if object.properties.len() + object.children.len() < before {
            self.report.warn(loc, format!("\"{name}\" is given twice; the last one counts"));
        }
    }
}
