//! Wavefront OBJ meshes.
//!
//! Reads `v`, `vt`, `vn` and `f` with triangles, quads and larger polygons (cut as a fan from the first corner), indices
//! from 1 or negative (relative to the end so far), lines continued by a backslash. Corners with the same (v, vt, vn)
//! share a vertex. Groups, objects, smoothing groups, materials, lines, points and curves are skipped: one file is one
//! shape. Where only some corners have a normal or uv, the others get zero (no normal: the face's own is used).
//! One pass over the bytes; memory is a small multiple of the file's size whatever the file says.
//! Not handled: concave polygons (the fan may leave them), `vt` beyond two and `v` beyond three coordinates (ignored).

use super::mesh_file::{Located, MeshError, Place, line_of, parse_f32, parse_i64, quote, read_with};
use crate::math::sampler::hash;
use crate::math::{Vec2, Vec3};
use crate::scene::mesh::MeshData;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::path::Path;

/// The mesh in an OBJ file. `flip_tex_coords` turns v into 1 - v (Mitsuba's default for OBJ is true).
pub fn read(path: &Path, flip_tex_coords: bool) -> Result<MeshData, MeshError> {
    read_with(path, |bytes| parse(bytes, flip_tex_coords))
}

/// Index of "no vt" or "no vn" in a corner.
const NONE: u32 = u32::MAX;

/// What a face corner refers to, each from 0: position, texture coordinate, normal.
type Corner = [u32; 3];

#[derive(Default)]
struct Parser {
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// Distinct corners in order of first use: the vertices of the mesh.
    corners: Vec<Corner>,
    numbers: HashMap<Corner, u32, BuildHasherDefault<CornerHasher>>,
    triangles: Vec<[u32; 3]>,
    /// Highest index of each kind that was beyond the elements so far, with its byte offset: checked at the end, since
    /// faces may come before their vertices.
    beyond: [Option<(u32, usize)>; 3],
}

/// Parses the bytes of an OBJ file.
pub(super) fn parse(bytes: &[u8], flip_tex_coords: bool) -> Result<MeshData, Located> {
    let mut parser = Parser::default();
    let mut start = 0;
    while start < bytes.len() {
        let end = logical_line_end(bytes, start);
        parser.line(bytes, start, end).map_err(|(offset, message)| (line_of(bytes, offset), message))?;
        start = end + 1;
    }
    parser.finish(bytes, flip_tex_coords)
}

/// Offset of the line feed that ends the line, continuations included, or of the end of the file.
fn logical_line_end(bytes: &[u8], start: usize) -> usize {
    let mut end = start;
    loop {
        end += bytes[end..].iter().position(|&b| b == b'\n').unwrap_or(bytes.len() - end);
        let text = bytes[start..end].strip_suffix(b"\r").unwrap_or(&bytes[start..end]);
        if end == bytes.len() || text.last() != Some(&b'\\') {
            return end;
        }
        end += 1;
    }
}

/// Words of a line with their offsets; a continuation's backslash is white.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    end: usize,
}

impl<'a> Iterator for Words<'a> {
    type Item = (usize, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let white = |b: u8| b <= b' ' || b == b'\\';
        while self.at < self.end && white(self.bytes[self.at]) {
            self.at += 1;
        }
        let start = self.at;
        while self.at < self.end && !white(self.bytes[self.at]) {
            self.at += 1;
        }
        (start < self.at).then(|| (start, &self.bytes[start..self.at]))
    }
}

/// Error at a byte offset.
type AtOffset = (usize, String);

impl Parser {
    fn line(&mut self, bytes: &[u8], start: usize, end: usize) -> Result<(), AtOffset> {
        let mut words = Words { bytes, at: start, end };
        let Some((offset, keyword)) = words.next() else {
            return Ok(());
        };
        match keyword {
            b"v" => self.positions.push(Vec3::from_array(numbers(&mut words, offset, 3)?)),
            b"vn" => self.normals.push(Vec3::from_array(numbers(&mut words, offset, 3)?)),
            b"vt" => {
                let [u, v] = numbers(&mut words, offset, 1)?;
                self.uvs.push(Vec2::new(u, v));
            }
            b"f" => self.face(words, offset)?,
            _ => {}
        }
        Ok(())
    }

    fn face(&mut self, words: Words, offset: usize) -> Result<(), AtOffset> {
        let (mut first, mut last, mut count) = (0, 0, 0);
        for (at, word) in words {
            if word[0] == b'#' {
                break;
            }
            let vertex = self.corner(word, at)?;
            count += 1;
            match count {
                1 => first = vertex,
                2 => {}
                _ => self.triangles.push([first, last, vertex]),
            }
            last = vertex;
        }
        if count < 3 {
            return Err((offset, format!("a face needs at least 3 corners, this one has {count}")));
        }
        Ok(())
    }

    /// The vertex for a corner written as v, v/vt, v//vn or v/vt/vn.
    fn corner(&mut self, word: &[u8], at: usize) -> Result<u32, AtOffset> {
        let mut corner = [NONE; 3];
        let lengths = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for (kind, part) in word.split(|&b| b == b'/').enumerate() {
            if part.is_empty() && (kind == 1 || kind == 2) {
                continue;
            }
            let index = parse_i64(part).filter(|_| kind < 3);
            let Some(index) = index else {
                return Err((at, format!("{} is no face corner (v, v/vt, v//vn or v/vt/vn)", quote(word))));
            };
            let absolute = match index {
                1.. => index - 1,
                _ => lengths[kind] as i64 + index,
            };
            if index == 0 || absolute < 0 {
                let (name, len) = (KINDS[kind], lengths[kind]);
                return Err((at, format!("index {index} in {}: there are {len} {name} so far", quote(word))));
            }
            // Beyond u32 is beyond any file; the report at the end names what was written.
            let absolute = absolute.min(NONE as i64 - 1) as u32;
            if absolute as usize >= lengths[kind] && self.beyond[kind].is_none_or(|(max, _)| max < absolute) {
                self.beyond[kind] = Some((absolute, at));
            }
            corner[kind] = absolute;
        }
        let next = self.corners.len() as u32;
        let number = *self.numbers.entry(corner).or_insert(next);
        if number == next {
            self.corners.push(corner);
        }
        Ok(number)
    }

    fn finish(self, bytes: &[u8], flip_tex_coords: bool) -> Result<MeshData, Located> {
        let lengths = [self.positions.len(), self.uvs.len(), self.normals.len()];
        for (kind, beyond) in self.beyond.iter().enumerate() {
            if let &Some((index, at)) = beyond
                && index as usize >= lengths[kind]
            {
                let (name, len) = (KINDS[kind], lengths[kind]);
                return Err((
                    line_of(bytes, at),
                    format!("index {} is beyond the file's {len} {name}", index as u64 + 1),
                ));
            }
        }
        if self.triangles.is_empty() {
            return Err((Place::File, "the file holds no faces (is it an OBJ file?)".into()));
        }
        let uses = |kind: usize| self.corners.iter().any(|c| c[kind] != NONE);
        let uv = |c: &Corner| {
            let uv = self.uvs.get(c[1] as usize).copied().unwrap_or_default();
            if flip_tex_coords { Vec2::new(uv.x, 1.0 - uv.y) } else { uv }
        };
        let normal = |c: &Corner| self.normals.get(c[2] as usize).copied().unwrap_or_default();
        Ok(MeshData {
            positions: self.corners.iter().map(|c| self.positions[c[0] as usize]).collect(),
            uvs: if uses(1) { self.corners.iter().map(uv).collect() } else { Vec::new() },
            normals: if uses(2) { self.corners.iter().map(normal).collect() } else { Vec::new() },
            triangles: self.triangles,
            ..MeshData::default()
        })
    }
}

const KINDS: [&str; 3] = ["vertices (v)", "texture coordinates (vt)", "normals (vn)"];

/// Up to N numbers, at least `needed` of them; the others are 0, later ones are ignored.
fn numbers<const N: usize>(words: &mut Words, offset: usize, needed: usize) -> Result<[f32; N], AtOffset> {
    let mut values = [0.0; N];
    for (i, value) in values.iter_mut().enumerate() {
        match words.next() {
            Some((at, word)) if i < needed || word[0] != b'#' => {
                *value = parse_f32(word).ok_or_else(|| (at, format!("{} is no number", quote(word))))?;
            }
            None if i < needed => return Err((offset, format!("{needed} numbers needed, {i} found"))),
            _ => break,
        }
    }
    Ok(values)
}

/// Mixes the three words of a corner; the table is only looked up, never iterated.
#[derive(Default)]
struct CornerHasher(u64);

impl Hasher for CornerHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for word in bytes.chunks(8) {
            let mut buffer = [0; 8];
            buffer[..word.len()].copy_from_slice(word);
            self.0 = hash(self.0, u64::from_le_bytes(buffer));
        }
    }

    fn write_u32(&mut self, word: u32) {
        self.0 = hash(self.0, word as u64);
    }
}

#[cfg(test)]
mod tests {
    use super::super::mesh_file::mutate::mutate;
    use super::*;

    const CUBE_CORNER: &str = "# two faces\nmtllib a.mtl\no thing\nv 0 0 0\nv 1 0 0 1.0\nv 1 1 0\nv 0 1 0\nv 0.5 2 1e0\n\
        vt 0 0\nvt 1 0 0\nvt 1 0.25\nvt 0\nvn 0 0 1\nvn 0 1 0\ng left\nusemtl red\ns 1\n\
        f 1/1/1 2/2/1 3/3/1 4/4/1\nf -3/3/2 4/4/2 5//2\n";

    fn error(text: &str) -> String {
        let (place, message) = parse(text.as_bytes(), true).expect_err("must be refused");
        format!("{place:?} {message}")
    }

    #[test]
    fn faces_become_triangles_with_shared_vertices() {
        let mesh = parse(CUBE_CORNER.as_bytes(), false).expect("a good file");
        // Vertices: four of the quad; (3/3/2), (4/4/2), (5//2).
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
        assert_eq!(mesh.positions.len(), 7);
        assert_eq!(mesh.positions[6], Vec3::new(0.5, 2.0, 1.0));
        assert_eq!(mesh.positions[4], Vec3::new(1.0, 1.0, 0.0));
        assert_eq!(mesh.normals[..4], [Vec3::Z; 4]);
        assert_eq!(mesh.normals[4..], [Vec3::Y; 3]);
        assert_eq!(mesh.uvs[2], Vec2::new(1.0, 0.25));
        assert_eq!(mesh.uvs[6], Vec2::ZERO);
        let flipped = parse(CUBE_CORNER.as_bytes(), true).expect("a good file");
        assert_eq!(flipped.uvs[2], Vec2::new(1.0, 0.75));
    }

    #[test]
    fn line_ends_continuations_and_forward_references_are_understood() {
        let plain = parse(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", false).expect("plain");
        assert!(plain.uvs.is_empty() && plain.normals.is_empty());
        for text in [
            "v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\n 2 \\\r\n 3",
            "\tf 1 2 3 # face\n\n  v 0 0 0\nv 1 0 0\nv 0 1 0",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nl 1 2\np 1\n",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/ 2// 3/",
        ] {
            assert_eq!(parse(text.as_bytes(), false).expect(text), plain, "{text}");
        }
        // A pentagon is a fan.
        let five = parse(b"v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5", false).expect("pentagon");
        assert_eq!(five.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn errors_name_line_and_cause() {
        assert_eq!(error("v 0 0 0\nv 1 x 0\n"), "Line(2) `x` is no number");
        assert_eq!(error("v 0 0\n"), "Line(1) 3 numbers needed, 2 found");
        assert_eq!(error("v 0 0 0\n\nf 1 1\n"), "Line(3) a face needs at least 3 corners, this one has 2");
        assert!(error("v 0 0 0\nf 1 1 2\n").starts_with("Line(2) index 2 is beyond the file's 1 vertices"));
        assert!(error("v 0 0 0\nf 1 1 -2\n").contains("there are 1 vertices (v) so far"));
        assert!(error("v 0 0 0\nf 0 1 1\n").contains("index 0"));
        assert!(error("v 0 0 0\nf 1/1 1/1 1/1\n").contains("the file's 0 texture coordinates"));
        assert!(error("v 0 0 0\nf 1/1/1/1 1 1\n").contains("no face corner"));
        assert!(error("v 0 0 0\nf 1 1 99999999999999999999\n").contains("no face corner"));
        assert!(error("v 0 0 0\nf 1 1 999999999999\n").contains("beyond"));
        assert!(error("").contains("no faces"));
        // The line of a continued line is where the word stands.
        assert!(error("v 0 0 0\nf 1 \\\n1 \\\nx\n").starts_with("Line(4)"));
    }

    #[test]
    fn damaged_files_never_panic() {
        let mut refused = 0;
        for seed in 0..4000 {
            let bytes = mutate(CUBE_CORNER.as_bytes(), seed);
            match parse(&bytes, true) {
                Ok(mesh) => assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len())),
                Err((_, message)) => {
                    refused += 1;
                    assert!(!message.is_empty());
                }
            }
        }
        assert!((400..3900).contains(&refused), "{refused} of 4000 refused: the damage is too light or too heavy");
    }
}
