//! PLY meshes: ASCII, binary little and big endian.
//!
//! Reads of the element `vertex` the properties x y z, nx ny nz, and the first of (u, v), (s, t), (texture_u, texture_v),
//! (texture_s, texture_t) that is there, each of any number type; of the element `face` the list `vertex_indices` or
//! `vertex_index`, whose count and items may be any integer type (polygons are cut as a fan). All other properties and
//! elements (colours, quality, edges ...) are skipped, whatever their order.
//! Counts of the header are checked against the size of the file before anything is allocated.
//! Not handled: triangle strips (an error), concave polygons (the fan may leave them).

use super::mesh_file::{Located, MeshError, Place, line_of, parse_f32, parse_i64, quote, read_with};
use crate::math::{Vec2, Vec3};
use crate::scene::mesh::MeshData;
use std::path::Path;

mod header;
pub mod points;
#[cfg(test)]
mod tests;

use header::{Element, Encoding, Header, Kind, Number, SLOTS};

/// The mesh in a PLY file. `flip_tex_coords` turns v into 1 - v (Mitsuba's default for PLY is false).
pub fn read(path: &Path, flip_tex_coords: bool) -> Result<MeshData, MeshError> {
    read_with(path, |bytes| parse(bytes, flip_tex_coords))
}

/// Parses the bytes of a PLY file.
pub(super) fn parse(bytes: &[u8], flip_tex_coords: bool) -> Result<MeshData, Located> {
    let header = header::parse(bytes)?;
    let data = match header.encoding {
        Encoding::Ascii => elements(&header, &mut Ascii { bytes, at: header.end }),
        Encoding::LittleEndian => elements(&header, &mut Binary::<false> { bytes, at: header.end }),
        Encoding::BigEndian => elements(&header, &mut Binary::<true> { bytes, at: header.end }),
    };
    let mut data = data.map_err(|(at, message)| match header.encoding {
        Encoding::Ascii => (line_of(bytes, at), message),
        _ => (Place::Byte(at), message),
    })?;
    if data.triangles.is_empty() {
        let strips = header.elements.iter().any(|e| e.name == "tristrips");
        let hint = if strips { ": triangle strips are not supported" } else { "" };
        return Err((Place::File, format!("the file holds no faces{hint}")));
    }
    if flip_tex_coords {
        data.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    Ok(data)
}

/// Error at a byte offset.
type AtOffset = (usize, String);

/// A body of numbers, one after the other.
trait Source {
    /// Where the next number starts, for messages.
    fn at(&self) -> usize;
    /// Bytes left.
    fn left(&self) -> usize;
    /// Fewest bytes a number of this type takes here.
    fn least_size(number: Number) -> usize;
    fn float(&mut self, number: Number) -> Result<f32, AtOffset>;
    fn integer(&mut self, number: Number) -> Result<i64, AtOffset>;
    /// Skips `count` numbers.
    fn skip(&mut self, number: Number, count: usize) -> Result<(), AtOffset>;
    /// Three indices, where the source can read them at once.
    fn triangle(&mut self, number: Number) -> Option<[u32; 3]>;
}

/// All elements of the body.
fn elements<S: Source>(header: &Header, source: &mut S) -> Result<MeshData, AtOffset> {
    let mut data = MeshData::default();
    let vertices = header.elements.iter().find(|e| e.name == "vertex").map_or(0, |e| e.count);
    for element in &header.elements {
        check_count::<S>(element, source)?;
        match element.name.as_str() {
            "vertex" => read_vertices(element, source, &mut data)?,
            "face" => read_faces(element, source, vertices, &mut data)?,
            _ => skip_element(element, source)?,
        }
    }
    Ok(data)
}

/// Refuses a count that the rest of the file cannot hold.
fn check_count<S: Source>(element: &Element, source: &S) -> Result<(), AtOffset> {
    let least: usize = element.properties.iter().map(|p| S::least_size(p.first_number())).sum();
    // One byte of grace: the last ASCII number needs no blank after it.
    if element.count.checked_mul(least).is_none_or(|needed| needed > source.left() + 1) {
        return Err((
            source.at(),
            format!(
                "the header announces {} elements `{}`, but the rest of the file has {} bytes only",
                element.count,
                element.name,
                source.left()
            ),
        ));
    }
    Ok(())
}

fn read_vertices<S: Source>(element: &Element, source: &mut S, data: &mut MeshData) -> Result<(), AtOffset> {
    let has = |slot: usize| element.properties.iter().any(|p| p.slot == Some(slot));
    let (normals, uvs) = ((3..6).all(has), (6..8).all(has));
    data.positions.reserve_exact(element.count);
    data.normals.reserve_exact(if normals { element.count } else { 0 });
    data.uvs.reserve_exact(if uvs { element.count } else { 0 });
    let mut values = [0.0f32; SLOTS];
    for _ in 0..element.count {
        for property in &element.properties {
            match (property.kind, property.slot) {
                (Kind::Scalar(number), Some(slot)) => values[slot] = source.float(number)?,
                (Kind::Scalar(number), None) => source.skip(number, 1)?,
                (Kind::List { count, item }, _) => skip_list(source, count, item)?,
            }
        }
        let [x, y, z, nx, ny, nz, u, v] = values;
        data.positions.push(Vec3::new(x, y, z));
        if normals {
            data.normals.push(Vec3::new(nx, ny, nz));
        }
        if uvs {
            data.uvs.push(Vec2::new(u, v));
        }
    }
    Ok(())
}

fn read_faces<S: Source>(
    element: &Element,
    source: &mut S,
    vertices: usize,
    data: &mut MeshData,
) -> Result<(), AtOffset> {
    data.triangles.reserve(element.count);
    for _ in 0..element.count {
        for property in &element.properties {
            match property.kind {
                Kind::List { count, item } if property.slot.is_some() => {
                    read_polygon(source, count, item, vertices, &mut data.triangles)?;
                }
                Kind::List { count, item } => skip_list(source, count, item)?,
                Kind::Scalar(number) => source.skip(number, 1)?,
            }
        }
    }
    Ok(())
}

/// One list of vertex indices, as a fan of triangles.
fn read_polygon<S: Source>(
    source: &mut S,
    count: Number,
    item: Number,
    vertices: usize,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), AtOffset> {
    let start = source.at();
    let corners = list_length::<S>(source, count, item)?;
    if corners == 3
        && let Some(t) = source.triangle(item)
    {
        if t.iter().any(|&i| i as usize >= vertices) {
            return Err((start, format!("face {t:?} refers to a vertex beyond the file's {vertices}")));
        }
        triangles.push(t);
        return Ok(());
    }
    if corners < 3 {
        return Err((start, format!("a face needs at least 3 corners, this one has {corners}")));
    }
    let (mut first, mut last) = (0, 0);
    for k in 0..corners {
        let at = source.at();
        let index = source.integer(item)?;
        let Some(index) = u32::try_from(index).ok().filter(|&i| (i as usize) < vertices) else {
            return Err((at, format!("a face refers to vertex {index}, but the file has {vertices} vertices")));
        };
        match k {
            0 => first = index,
            1 => {}
            _ => triangles.push([first, last, index]),
        }
        last = index;
    }
    Ok(())
}

/// The length of a list, checked against the bytes left.
fn list_length<S: Source>(source: &mut S, count: Number, item: Number) -> Result<usize, AtOffset> {
    let at = source.at();
    let length = source.integer(count)?;
    let fits = |n: &usize| n.checked_mul(S::least_size(item)).is_some_and(|bytes| bytes <= source.left() + 1);
    match usize::try_from(length).ok().filter(fits) {
        Some(length) => Ok(length),
        None => Err((at, format!("a list of {length} items, more than the rest of the file can hold"))),
    }
}

fn skip_list<S: Source>(source: &mut S, count: Number, item: Number) -> Result<(), AtOffset> {
    let length = list_length::<S>(source, count, item)?;
    source.skip(item, length)
}

fn skip_element<S: Source>(element: &Element, source: &mut S) -> Result<(), AtOffset> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for _ in 0..element.count {
        for property in &element.properties {
            match property.kind {
                Kind::Scalar(number) => source.skip(number, 1)?,
                Kind::List { count, item } => skip_list(source, count, item)?,
            }
        }
    }
    Ok(())
}

/// Words between blanks; line ends are blanks like others.
struct Ascii<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Ascii<'a> {
    fn word(&mut self) -> Result<(usize, &'a [u8]), AtOffset> {
        let bytes = self.bytes;
        while self.at < bytes.len() && bytes[self.at] <= b' ' {
            self.at += 1;
        }
        let start = self.at;
        while self.at < bytes.len() && bytes[self.at] > b' ' {
            self.at += 1;
        }
        if start == self.at {
            return Err((start, "the file ends too early".into()));
        }
        Ok((start, &bytes[start..self.at]))
    }
}

impl Source for Ascii<'_> {
    fn at(&self) -> usize {
        // Messages want the line of the next word, not of the blank before it.
        let blanks = self.bytes[self.at..].iter().take_while(|&&b| b <= b' ').count();
        if self.at + blanks < self.bytes.len() { self.at + blanks } else { self.at }
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn least_size(_: Number) -> usize {
        2
    }

    fn float(&mut self, _: Number) -> Result<f32, AtOffset> {
        let (at, word) = self.word()?;
        parse_f32(word).ok_or_else(|| (at, format!("{} is no number", quote(word))))
    }

    fn integer(&mut self, _: Number) -> Result<i64, AtOffset> {
        let (at, word) = self.word()?;
        parse_i64(word).ok_or_else(|| (at, format!("{} is no integer", quote(word))))
    }

    fn skip(&mut self, _: Number, count: usize) -> Result<(), AtOffset> {
        for _ in 0..count {
            self.word()?;
        }
        Ok(())
    }

    fn triangle(&mut self, _: Number) -> Option<[u32; 3]> {
        None
    }
}

/// Packed numbers in one byte order.
struct Binary<'a, const BIG: bool> {
    bytes: &'a [u8],
    at: usize,
}

impl<const BIG: bool> Binary<'_, BIG> {
    #[inline]
    fn take<const N: usize>(&mut self) -> Result<[u8; N], AtOffset> {
        let Some(&raw) = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>()) else {
            return Err((self.at, "the file ends too early".into()));
        };
        self.at += N;
        let mut raw = raw;
        if BIG {
            raw.reverse();
        }
        Ok(raw)
    }
}

impl<const BIG: bool> Source for Binary<'_, BIG> {
    fn at(&self) -> usize {
        self.at
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    fn least_size(number: Number) -> usize {
        number.size()
    }

    #[inline]
    fn float(&mut self, number: Number) -> Result<f32, AtOffset> {
        match number {
            Number::F32 => Ok(f32::from_le_bytes(self.take()?)),
            Number::F64 => Ok(f64::from_le_bytes(self.take()?) as f32),
            _ => Ok(self.integer(number)? as f32),
        }
    }

    #[inline]
    fn integer(&mut self, number: Number) -> Result<i64, AtOffset> {
        Ok(match number {
            Number::I8 => i8::from_le_bytes(self.take()?).into(),
            Number::U8 => u8::from_le_bytes(self.take()?).into(),
            Number::I16 => i16::from_le_bytes(self.take()?).into(),
            Number::U16 => u16::from_le_bytes(self.take()?).into(),
            Number::I32 => i32::from_le_bytes(self.take()?).into(),
            Number::U32 => u32::from_le_bytes(self.take()?).into(),
            // The header allows no list of floats; scalars that are integers elsewhere may be floats here.
            Number::F32 => f32::from_le_bytes(self.take()?) as i64,
            Number::F64 => f64::from_le_bytes(self.take()?) as i64,
        })
    }

    fn skip(&mut self, number: Number, count: usize) -> Result<(), AtOffset> {
        match number.size().checked_mul(count).filter(|&n| n <= self.left()) {
            Some(bytes) => {
                self.at += bytes;
                Ok(())
            }
            None => Err((self.at, "the file ends too early".into())),
        }
    }

    #[inline]
    fn triangle(&mut self, number: Number) -> Option<[u32; 3]> {
        // Negative indices of signed types turn into huge ones here, which the range check refuses.
        if !matches!(number, Number::I32 | Number::U32) {
            return None;
        }
        let raw = self.bytes.get(self.at..)?.first_chunk::<12>()?;
        let index = |k: usize| {
            let word = [raw[k], raw[k + 1], raw[k + 2], raw[k + 3]];
            if BIG { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) }
        };
        self.at += 12;
        Some([index(0), index(4), index(8)])
    }
}
