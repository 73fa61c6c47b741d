//! Mitsuba 0.6's `.serialized` meshes, versions 3 and 4.
//!
//! Layout, little endian: per mesh u16 0x041C, u16 version, then a zlib stream: u32 flags, in version 4 a zero-ended
//! UTF-8 name, u64 vertex count, u64 triangle count, positions, normals, texture coordinates, colours (each if its flag is
//! set, f32 or f64), u32 indices. The file ends in a table of the meshes' offsets (u32 in version 3, u64 in version 4)
//! and a u32 count of meshes.
//! Inflated data is read piece by piece, so a header that promises more than the stream holds costs no memory.
//! Not handled: version 5 (Mitsuba 3.9; an error says so), vertex colours (skipped).

use super::mesh_file::{Located, MeshError, Place, read_with};
use crate::math::{Vec2, Vec3};
use crate::scene::mesh::MeshData;
use flate2::bufread::ZlibDecoder;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

const MAGIC: u16 = 0x041c;
const HAS_NORMALS: u32 = 0x1;
const HAS_UVS: u32 = 0x2;
const HAS_COLORS: u32 = 0x8;
const FACE_NORMALS: u32 = 0x10;
const DOUBLE: u32 = 0x2000;

/// Longest name we read over; names are a few words.
const LONGEST_NAME: u64 = 1 << 16;

/// Mesh number `shape_index` (from 0) of a `.serialized` file.
pub fn read(path: &Path, shape_index: usize) -> Result<MeshData, MeshError> {
    read_with(path, |bytes| parse(bytes, shape_index))
}

/// Parses the bytes of a `.serialized` file.
pub(super) fn parse(bytes: &[u8], shape_index: usize) -> Result<MeshData, Located> {
    let version = version_at(bytes, 0)?;
    let (start, end) = mesh_range(bytes, version, shape_index)?;
    let version = version_at(bytes, start)?;
    let error = |message| (Place::Byte(start), message);
    // Deflate packs at best 1032 bytes into one.
    let most = (end - start) as u64 * 1032;
    let mut body =
        Body { stream: BufReader::new(ZlibDecoder::new(&bytes[start + 4..end])), buffer: Vec::new(), double: false };
    body.mesh(version, most).map_err(error)
}

fn version_at(bytes: &[u8], at: usize) -> Result<u16, Located> {
    let word = |k: usize| bytes.get(at + k..at + k + 2).map(|w| u16::from_le_bytes([w[0], w[1]]));
    match (word(0), word(2)) {
        (Some(MAGIC), Some(version @ (3 | 4))) => Ok(version),
        (Some(MAGIC), Some(version)) => Err((
            Place::Byte(at + 2),
            format!("version {version} is not supported, only 3 and 4 are: save the mesh as PLY"),
        )),
        _ => Err((Place::Byte(at), "this is no .serialized mesh (it does not start with 0x041C)".into())),
    }
}

/// Offsets of the first byte of a mesh and of what comes after it.
fn mesh_range(bytes: &[u8], version: u16, shape_index: usize) -> Result<(usize, usize), Located> {
    let entry = if version == 3 { 4 } else { 8 };
    let broken = || (Place::File, "the table of meshes at the end of the file is damaged".to_string());
    let table_end = bytes.len().checked_sub(4).ok_or_else(broken)?;
    let count = little_endian(&bytes[table_end..]) as usize;
    let table = count.checked_mul(entry).and_then(|n| table_end.checked_sub(n)).ok_or_else(broken)?;
    if shape_index >= count {
        return Err((Place::File, format!("shape_index {shape_index}: the file holds {count} meshes")));
    }
    let offset = |k: usize| usize::try_from(little_endian(&bytes[table + k * entry..][..entry])).ok();
    let start = offset(shape_index).ok_or_else(broken)?;
    let end = if shape_index + 1 < count { offset(shape_index + 1).ok_or_else(broken)? } else { table };
    if start.checked_add(4).is_some_and(|s| s <= end) && end <= table { Ok((start, end)) } else { Err(broken()) }
}

/// Up to eight bytes as a number.
fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, &b| value << 8 | b as u64)
}

/// The inflated part of one mesh.
struct Body<R> {
    stream: R,
    buffer: Vec<u8>,
    double: bool,
}

impl<R: BufRead> Body<R> {
    fn mesh(&mut self, version: u16, most: u64) -> Result<MeshData, String> {
        let flags = little_endian(self.bytes(4, "flags")?) as u32;
        self.double = flags & DOUBLE != 0;
        if version == 4 {
            let mut name = Vec::new();
            let read = (&mut self.stream).take(LONGEST_NAME).read_until(0, &mut name);
            read.map_err(|e| inflate_error("name", &e))?;
            if name.last() != Some(&0) {
                return Err("the name of the mesh does not end".into());
            }
        }
        let vertices = little_endian(self.bytes(8, "vertex count")?);
        let triangles = little_endian(self.bytes(8, "triangle count")?);
        let has = |flag: u32| flags & flag != 0;
        let floats = 3 + 3 * has(HAS_NORMALS) as u64 + 2 * has(HAS_UVS) as u64 + 3 * has(HAS_COLORS) as u64;
        let size = if self.double { 8 } else { 4 };
        let needed = vertices.checked_mul(floats * size).and_then(|v| triangles.checked_mul(12)?.checked_add(v));
        if needed.is_none_or(|n| n > most) || vertices > u32::MAX as u64 {
            return Err(format!("{vertices} vertices and {triangles} triangles cannot fit into this file"));
        }
        let (vertices, triangles) = (vertices as usize, triangles as usize);
        if triangles == 0 {
            return Err("the mesh has no triangles".into());
        }

        let mut data = MeshData {
            face_normals: has(FACE_NORMALS),
            positions: self.vectors(vertices, "positions")?,
            ..MeshData::default()
        };
        if has(HAS_NORMALS) {
            data.normals = self.vectors(vertices, "normals")?;
        }
        if has(HAS_UVS) {
            let uvs = self.floats(2 * vertices, "texture coordinates")?;
            data.uvs = uvs.chunks_exact(2).map(|c| Vec2::new(c[0], c[1])).collect();
        }
        if has(HAS_COLORS) {
            self.floats(3 * vertices, "colours")?;
        }
        let raw = self.bytes(12 * triangles, "indices")?;
        data.triangles = raw.chunks_exact(12).map(|t| [0, 4, 8].map(|k| little_endian(&t[k..k + 4]) as u32)).collect();
        match data.triangles.iter().position(|t| t.iter().any(|&i| i as usize >= vertices)) {
            Some(t) => Err(format!("triangle {t} refers to a vertex beyond the mesh's {vertices}")),
            None => Ok(data),
        }
    }

    fn vectors(&mut self, count: usize, what: &str) -> Result<Vec<Vec3>, String> {
        let floats = self.floats(3 * count, what)?;
        Ok(floats.chunks_exact(3).map(Vec3::from_slice).collect())
    }

    fn floats(&mut self, count: usize, what: &str) -> Result<Vec<f32>, String> {
        let double = self.double;
        let raw = self.bytes(count * if double { 8 } else { 4 }, what)?;
        Ok(if double {
            raw.chunks_exact(8).map(|b| f64::from_bits(little_endian(b)) as f32).collect()
        } else {
            raw.chunks_exact(4).map(|b| f32::from_bits(little_endian(b) as u32)).collect()
        })
    }

    /// The next `count` bytes. The buffer grows with what really arrives.
    fn bytes(&mut self, count: usize, what: &str) -> Result<&[u8], String> {
        self.buffer.clear();
        let stream = (&mut self.stream).take(count as u64);
        let read = { stream }.read_to_end(&mut self.buffer).map_err(|e| inflate_error(what, &e))?;
        if read < count {
            return Err(format!("the data end in the {what}: {read} of {count} bytes are there"));
        }
        Ok(&self.buffer)
    }
}

fn inflate_error(what: &str, error: &std::io::Error) -> String {
    format!("the {what} cannot be decompressed: {error}")
}

#[cfg(test)]
mod tests {
    use super::super::mesh_file::mutate::mutate;
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use std::io::Write;

    /// The inflated body of a mesh of two triangles moved by `x`.
    fn body(version: u16, flags: u32, x: f32) -> Vec<u8> {
        let mut out = flags.to_le_bytes().to_vec();
        if version == 4 {
            out.extend(b"caf\xc3\xa9\0");
        }
        out.extend(4u64.to_le_bytes());
        out.extend(2u64.to_le_bytes());
        let mut put = |v: f32| {
            if flags & DOUBLE != 0 {
                out.extend((v as f64).to_le_bytes());
            } else {
                out.extend(v.to_le_bytes());
            }
        };
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        corners.iter().for_each(|c| [c[0] + x, c[1], 0.5].into_iter().for_each(&mut put));
        if flags & HAS_NORMALS != 0 {
            corners.iter().for_each(|_| [0.0, 0.0, 1.0].into_iter().for_each(&mut put));
        }
        if flags & HAS_UVS != 0 {
            corners.iter().for_each(|c| c.iter().copied().for_each(&mut put));
        }
        if flags & HAS_COLORS != 0 {
            corners.iter().for_each(|_| [0.1, 0.2, 0.3].into_iter().for_each(&mut put));
        }
        [0u32, 1, 2, 0, 2, 3].iter().for_each(|i| out.extend(i.to_le_bytes()));
        out
    }

    /// A file of such bodies.
    fn file(version: u16, bodies: &[Vec<u8>]) -> Vec<u8> {
        let mut out = Vec::new();
        let mut offsets = Vec::new();
        for body in bodies {
            offsets.push(out.len());
            out.extend(MAGIC.to_le_bytes());
            out.extend(version.to_le_bytes());
            let mut zlib = ZlibEncoder::new(out, Compression::default());
            zlib.write_all(body).expect("memory");
            out = zlib.finish().expect("memory");
        }
        for &offset in &offsets {
            match version {
                3 => out.extend((offset as u32).to_le_bytes()),
                _ => out.extend((offset as u64).to_le_bytes()),
            }
        }
        out.extend((offsets.len() as u32).to_le_bytes());
        out
    }

    #[test]
    fn both_versions_precisions_and_every_flag_are_read() {
        for version in [3, 4] {
            for precision in [0x1000, DOUBLE] {
                for flags in [0, HAS_NORMALS, HAS_UVS, HAS_NORMALS | HAS_UVS | HAS_COLORS, HAS_COLORS | FACE_NORMALS] {
                    let flags = flags | precision;
                    let bodies = [0.0, 2.5, 5.0].map(|x| body(version, flags, x));
                    let bytes = file(version, &bodies);
                    for (index, x) in [0.0, 2.5, 5.0].into_iter().enumerate() {
                        let mesh = parse(&bytes, index).expect("a good file");
                        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
                        assert_eq!(mesh.positions[2], Vec3::new(1.0 + x, 1.0, 0.5));
                        let count = |flag: u32| if flags & flag != 0 { 4 } else { 0 };
                        assert_eq!(mesh.normals, vec![Vec3::Z; count(HAS_NORMALS)]);
                        assert_eq!(mesh.uvs.len(), count(HAS_UVS));
                        assert!(mesh.uvs.is_empty() || mesh.uvs[3] == Vec2::Y);
                        assert_eq!(mesh.face_normals, flags & FACE_NORMALS != 0);
                    }
                }
            }
        }
    }

    fn error(bytes: &[u8], index: usize) -> String {
        let (place, message) = parse(bytes, index).expect_err("must be refused");
        format!("{place:?} {message}")
    }

    #[test]
    fn errors_name_place_and_cause() {
        let good = body(4, 0x1000, 0.0);
        assert!(error(b"", 0).contains("no .serialized mesh"));
        assert!(error(b"ply\nformat", 0).starts_with("Byte(0)"));
        assert!(error(&file(5, std::slice::from_ref(&good)), 0).contains("version 5 is not supported"));
        assert!(error(&file(4, std::slice::from_ref(&good)), 1).contains("the file holds 1 meshes"));
        // After the flags and the name.
        let counts = 4 + "caf\u{e9}\0".len();
        let mut huge = good.clone();
        huge[counts..counts + 8].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(error(&file(4, &[huge]), 0).contains("cannot fit"));
        let mut more = good.clone();
        more[counts] = 5;
        assert!(error(&file(4, &[more]), 0).contains("data end in the indices"));
        let mut beyond = good.clone();
        let last = beyond.len() - 4;
        beyond[last] = 4;
        assert!(error(&file(4, &[beyond]), 0).contains("triangle 1 refers to a vertex beyond"));
        assert!(error(&file(4, &[good[..60].to_vec()]), 0).contains("data end in the positions"));
        let mut damaged = file(4, std::slice::from_ref(&good));
        damaged[20] ^= 0xff;
        assert!(error(&damaged, 0).starts_with("Byte(0)"));
        let mut table = file(3, &[body(3, 0, 0.0)]);
        let end = table.len();
        table[end - 8..end - 4].fill(0xff);
        assert!(error(&table, 0).contains("table of meshes"));
    }

    #[test]
    fn damaged_files_never_panic() {
        // Damage to the file itself, and to the body before it is compressed (which zlib's checksum would hide).
        for version in [3, 4] {
            let good = body(version, 0x1000 | HAS_NORMALS | HAS_UVS, 0.0);
            let packed = file(version, &[good.clone(), good.clone()]);
            let mut refused = 0;
            for seed in 0..1000 {
                let outside = mutate(&packed, seed);
                let inside = file(version, &[mutate(&good, seed)]);
                for result in [parse(&outside, 1), parse(&inside, 0)] {
                    match result {
                        Ok(mesh) => {
                            assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()))
                        }
                        Err((_, message)) => {
                            refused += 1;
                            assert!(!message.is_empty());
                        }
                    }
                }
            }
            assert!((200..1990).contains(&refused), "{refused} of 2000 refused");
        }
    }
}
