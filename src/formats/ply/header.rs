//! The text header of a PLY file: encoding, elements and their properties.

use super::super::mesh_file::{Located, line_of, quote};

/// Number of vertex values we read: x y z nx ny nz u v.
pub(super) const SLOTS: usize = 8;

/// Names of each slot; texture coordinates go by several.
const SLOT_NAMES: [&[&str]; SLOTS] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx"],
    &["ny"],
    &["nz"],
    &["u", "s", "texture_u", "texture_s"],
    &["v", "t", "texture_v", "texture_t"],
];

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A number type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn from_name(name: &[u8]) -> Option<Number> {
        Some(match name {
            b"char" | b"int8" => Number::I8,
            b"uchar" | b"uint8" => Number::U8,
            b"short" | b"int16" => Number::I16,
            b"ushort" | b"uint16" => Number::U16,
            b"int" | b"int32" => Number::I32,
            b"uint" | b"uint32" => Number::U32,
            b"float" | b"float32" => Number::F32,
            b"double" | b"float64" => Number::F64,
            _ => return None,
        })
    }

    /// Bytes in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::F64 => 8,
        }
    }

    fn is_float(self) -> bool {
        matches!(self, Number::F32 | Number::F64)
    }
}

/// One number, or a counted list of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Number),
    List { count: Number, item: Number },
}

/// A property of an element.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) kind: Kind,
    /// What we read it as: a slot of a vertex, or 0 for a face's corners; `None` is skipped.
    pub(super) slot: Option<usize>,
}

impl Property {
    /// The number that is always there: the value, or the length of the list.
    pub(super) fn first_number(&self) -> Number {
        match self.kind {
            Kind::Scalar(number) | Kind::List { count: number, .. } => number,
        }
    }
}

/// A kind of element and how many there are.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

/// The header.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Offset of the body.
    pub(super) end: usize,
}

/// Parses the header of the file.
pub(super) fn parse(bytes: &[u8]) -> Result<Header, Located> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut start = 0;
    let mut first = true;
    while start < bytes.len() {
        let end = start + bytes[start..].iter().position(|&b| b == b'\n').unwrap_or(bytes.len() - start);
        let words: Vec<&[u8]> =
            bytes[start..end].split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).take(6).collect();
        let error = |message: String| (line_of(bytes, start), message);
        if first {
            if words.as_slice() != [b"ply"] {
                return Err(error("this is no PLY file: its first line is not `ply`".into()));
            }
            first = false;
        } else {
            match words.as_slice() {
                [] | [b"comment" | b"obj_info", ..] => {}
                [b"format", name, ..] => encoding = Some(format(name).map_err(error)?),
                [b"element", name, count] => elements.push(element(name, count, &elements).map_err(error)?),
                [b"property", rest @ ..] => {
                    let element = elements
                        .last_mut()
                        .ok_or_else(|| error("a property must come after the element it belongs to".into()))?;
                    let property = property(rest, element).map_err(error)?;
                    element.properties.push(property);
                }
                [b"end_header"] => {
                    let encoding = encoding.ok_or_else(|| error("the header has no `format` line".into()))?;
                    check(&elements).map_err(error)?;
                    let end = (end + 1).min(bytes.len());
                    return Ok(Header { encoding, elements, end });
                }
                [word, ..] => return Err(error(format!("{} has no meaning in a PLY header", quote(word)))),
            }
        }
        start = end + 1;
    }
    Err((line_of(bytes, bytes.len()), "the header has no `end_header` line".into()))
}

fn format(name: &[u8]) -> Result<Encoding, String> {
    match name {
        b"ascii" => Ok(Encoding::Ascii),
        b"binary_little_endian" => Ok(Encoding::LittleEndian),
        b"binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(format!("format {} is none of ascii, binary_little_endian, binary_big_endian", quote(name))),
    }
}

fn element(name: &[u8], count: &[u8], before: &[Element]) -> Result<Element, String> {
    let name = String::from_utf8_lossy(name).into_owned();
    if before.iter().any(|e| e.name == name) {
        return Err(format!("element `{name}` is declared twice"));
    }
    let parsed = std::str::from_utf8(count).ok().and_then(|c| c.parse::<usize>().ok());
    let count = parsed.ok_or_else(|| format!("{} is no count of elements", quote(count)))?;
    Ok(Element { name, count, properties: Vec::new() })
}

/// `words` are what follows `property`.
fn property(words: &[&[u8]], element: &Element) -> Result<Property, String> {
    let number = |name: &[u8]| Number::from_name(name).ok_or_else(|| format!("{} is no number type", quote(name)));
    let (kind, name) = match *words {
        [b"list", count, item, name] => {
            let (count, item) = (number(count)?, number(item)?);
            if count.is_float() {
                return Err("the length of a list must be an integer".into());
            }
            (Kind::List { count, item }, name)
        }
        [scalar, name] => (Kind::Scalar(number(scalar)?), name),
        _ => return Err("a property is `property TYPE NAME` or `property list TYPE TYPE NAME`".into()),
    };
    let name = std::str::from_utf8(name).unwrap_or("");
    let slot = match (element.name.as_str(), kind) {
        ("vertex", Kind::Scalar(_)) => SLOT_NAMES.iter().position(|names| names.contains(&name)),
        ("face", Kind::List { item, .. }) if name == "vertex_indices" || name == "vertex_index" => {
            if item.is_float() {
                return Err("vertex indices must be integers".into());
            }
            Some(0)
        }
        _ => None,
    };
    // The first property of a meaning counts.
    let taken = slot.is_some() && element.properties.iter().any(|p| p.slot == slot);
    Ok(Property { kind, slot: slot.filter(|_| !taken) })
}

/// What a mesh needs.
fn check(elements: &[Element]) -> Result<(), String> {
    let vertex = elements.iter().find(|e| e.name == "vertex").ok_or("the file has no element `vertex`")?;
    for (slot, axis) in ["x", "y", "z"].iter().enumerate() {
        if !vertex.properties.iter().any(|p| p.slot == Some(slot)) {
            return Err(format!("the element `vertex` has no property `{axis}`"));
        }
    }
    match elements.iter().find(|e| e.name == "face") {
        Some(face) if face.count > 0 && face.properties.iter().all(|p| p.slot.is_none()) => {
            Err("the element `face` has no list `vertex_indices`".into())
        }
        _ => Ok(()),
    }
}
