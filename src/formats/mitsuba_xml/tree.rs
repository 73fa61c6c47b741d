//! The located object tree: what a scene file says before any plugin has looked at it.
//!
//! Property names are already in Mitsuba 3's spelling; every value knows where it was written, and whether some
//! plugin has read it.

use super::report::Loc;
use crate::math::{DMat4, DVec3};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Index into [`Tree::objects`].
pub type ObjectId = usize;

/// A spectrum as written.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// One value at all wavelengths.
    Uniform(f64),
    /// (nm, value), increasing.
    List(Vec<(f64, f64)>),
    /// A `.spd` file, not read yet.
    File(String),
}

/// Value of a property.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Value {
    Integer(i64),
    Float(f64),
    Boolean(bool),
    String(String),
    Vector(DVec3),
    Rgb([f64; 3]),
    Spectrum(Spectrum),
    Transform(DMat4),
}

impl Value {
    /// Word for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Integer(_) => "an integer",
            Self::Float(_) => "a float",
            Self::Boolean(_) => "a boolean",
            Self::String(_) => "a string",
            Self::Vector(_) => "a point or vector",
            Self::Rgb(_) => "a colour",
            Self::Spectrum(_) => "a spectrum",
            Self::Transform(_) => "a transform",
        }
    }
}

/// A named value of an object.
#[derive(Debug)]
pub struct Property {
    /// Name in Mitsuba 3's spelling.
    pub name: String,
    /// Name as written.
    pub written: String,
    /// The name in the file.
    pub name_loc: Loc,
    /// The value in the file.
    pub loc: Loc,
    /// The value.
    pub value: Value,
    /// Some plugin has read it.
    pub used: Cell<bool>,
}

/// What a child is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// An object written in place.
    Object(ObjectId),
    /// A reference by id.
    Ref(String),
}

/// A nested object or reference.
#[derive(Debug)]
pub struct Child {
    /// Its `name`, in Mitsuba 3's spelling.
    pub name: Option<String>,
    /// The object.
    pub target: Target,
    /// Where it is written.
    pub loc: Loc,
    /// Some plugin has read it.
    pub used: Cell<bool>,
}

/// An object: a tag with a type.
#[derive(Debug)]
pub struct Object {
    /// Tag, such as `bsdf`.
    pub tag: String,
    /// Plugin, such as `diffuse`.
    pub kind: String,
    /// Id, if written.
    pub id: Option<String>,
    /// The start of the element.
    pub loc: Loc,
    /// The value of `type`.
    pub kind_loc: Loc,
    /// Written in a file of version 0.x.
    pub legacy: bool,
    /// Values.
    pub properties: Vec<Property>,
    /// Nested objects and references.
    pub children: Vec<Child>,
}

/// All objects of a scene; number 0 is the scene itself.
#[derive(Debug, Default)]
pub struct Tree {
    /// The objects.
    pub objects: Vec<Object>,
    /// Ids of objects.
    pub ids: BTreeMap<String, (ObjectId, Loc)>,
    /// Further names of ids.
    pub aliases: BTreeMap<String, (String, Loc)>,
    /// Folders to search for files.
    pub folders: Vec<PathBuf>,
}

impl Tree {
    /// The object of an id, through aliases; `None` if there is none or the aliases go in circles.
    pub fn lookup(&self, id: &str) -> Option<ObjectId> {
        let mut id = id;
        for _ in 0..=self.aliases.len() {
            if let Some(&(object, _)) = self.ids.get(id) {
                return Some(object);
            }
            id = &self.aliases.get(id)?.0;
        }
        None
    }
}
