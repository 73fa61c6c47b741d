//! PLY files in every flavour, and damaged ones.

use super::super::mesh_file::mutate::mutate;
use super::*;

const HEADER: &str = "comment made by hand\nobj_info nothing\nelement vertex 5\nproperty float x\nproperty double y\n\
    property short z\nproperty uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float s\n\
    property float t\nelement edge 1\nproperty int a\nproperty list uchar float weights\nelement face 2\n\
    property uchar flags\nproperty list ushort uint vertex_indices\nproperty list uchar int other\nend_header\n";

/// x, y, z, red, normal, s, t.
type Vertex = (f32, f64, i16, u8, [f32; 3], [f32; 2]);

const VERTICES: [Vertex; 5] = [
    (0.0, 0.0, 0, 9, [0.0, 0.0, 1.0], [0.0, 0.0]),
    (1.0, 0.0, 0, 9, [0.0, 0.0, 1.0], [1.0, 0.0]),
    (1.0, 1.5, 0, 9, [0.0, 0.0, 1.0], [1.0, 0.25]),
    (0.0, 1.0, -3, 9, [0.0, 1.0, 0.0], [0.0, 1.0]),
    (-0.5, 0.5, 2, 9, [0.0, 0.0, 1.0], [0.5, 0.5]),
];
const FACES: [&[u32]; 2] = [&[0, 1, 2, 3], &[4, 0, 3]];

/// The test mesh in binary, each number through `order` (identity or reversal of its bytes).
fn binary(format: &str, order: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let mut out = format!("ply\nformat {format} 1.0\n{HEADER}").into_bytes();
    let mut put = |bytes: &[u8]| out.extend(order(bytes));
    for (x, y, z, red, n, st) in VERTICES {
        put(&x.to_le_bytes());
        put(&y.to_le_bytes());
        put(&z.to_le_bytes());
        put(&[red]);
        n.iter().chain(&st).for_each(|v| put(&v.to_le_bytes()));
    }
    put(&7i32.to_le_bytes());
    put(&[2]);
    put(&1f32.to_le_bytes());
    put(&2f32.to_le_bytes());
    for face in FACES {
        put(&[1]);
        put(&(face.len() as u16).to_le_bytes());
        face.iter().for_each(|i| put(&i.to_le_bytes()));
        put(&[1]);
        put(&5i32.to_le_bytes());
    }
    out
}

fn ascii() -> Vec<u8> {
    let mut out = format!("ply\nformat ascii 1.0\n{HEADER}");
    for (x, y, z, red, n, st) in VERTICES {
        out += &format!("{x} {y} {z} {red} {} {} {} {} {}\n", n[0], n[1], n[2], st[0], st[1]);
    }
    out += "7 2 1 2\n";
    for face in FACES {
        let indices: Vec<String> = face.iter().map(u32::to_string).collect();
        out += &format!("1 {} {} 1 5\n", face.len(), indices.join(" "));
    }
    out.into_bytes()
}

fn flavours() -> [Vec<u8>; 3] {
    [
        ascii(),
        binary("binary_little_endian", |b| b.to_vec()),
        binary("binary_big_endian", |b| b.iter().rev().copied().collect()),
    ]
}

#[test]
fn all_encodings_give_the_same_mesh() {
    for bytes in flavours() {
        let mesh = parse(&bytes, false).expect("a good file");
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 0, 3]]);
        assert_eq!(mesh.positions[3], Vec3::new(0.0, 1.0, -3.0));
        assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.5, 0.0));
        assert_eq!((mesh.normals[3], mesh.normals.len()), (Vec3::Y, 5));
        assert_eq!((mesh.uvs[2], mesh.uvs.len()), (Vec2::new(1.0, 0.25), 5));
        assert_eq!(parse(&bytes, true).expect("flipped").uvs[2], Vec2::new(1.0, 0.75));
    }
}

#[test]
fn plain_files_carriage_returns_and_other_names_work() {
    let text = "ply\r\nformat ascii 1.0\r\nelement vertex 3\r\nproperty float32 x\r\nproperty float32 y\r\n\
        property float32 z\r\nproperty float texture_u\r\nproperty float texture_v\r\nelement face 1\r\n\
        property list uint8 int32 vertex_index\r\nend_header\r\n0 0 0 0 0\r\n1 0 0 1 0\r\n0 1 0 0 1\r\n3 0 1 2";
    let mesh = parse(text.as_bytes(), false).expect("a good file");
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.uvs[2], Vec2::Y);
    assert!(mesh.normals.is_empty());
    // Faces may come before vertices.
    let text = "ply\nformat ascii 1.0\nelement face 1\nproperty list char short vertex_indices\nelement vertex 3\n\
        property int x\nproperty int y\nproperty int z\nend_header\n3 2 1 0\n0 0 0 1 0 0 0 1 0\n";
    assert_eq!(parse(text.as_bytes(), false).expect("a good file").triangles, [[2, 1, 0]]);
}

fn error(bytes: &[u8]) -> String {
    let (place, message) = parse(bytes, false).expect_err("must be refused");
    format!("{place:?} {message}")
}

#[test]
fn errors_name_line_or_byte_and_cause() {
    assert!(error(b"").contains("end_header"));
    assert!(error(b"solid\n").starts_with("Line(1) this is no PLY file"));
    let with = |header: &str| error(format!("ply\nformat ascii 1.0\n{header}").as_bytes());
    assert!(with("end_header\n").contains("no element `vertex`"));
    assert!(with("element vertex 3\nproperty float x\nend_header\n").contains("no property `y`"));
    assert!(with("element vertex many\n").starts_with("Line(3) `many` is no count"));
    assert!(with("property float x\n").contains("after the element"));
    assert!(with("element vertex 3\nproperty real x\n").starts_with("Line(4) `real` is no number type"));
    assert!(with("elephant 3\n").contains("`elephant` has no meaning"));
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    assert!(with(&format!("element vertex 1\n{xyz}end_header\n0 zero 0\n")).starts_with("Line(8) `zero` is no number"));
    assert!(with(&format!("element vertex 1\n{xyz}end_header\n0 0 0\n")).contains("no faces"));
    let face = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let two = format!("element vertex 2\n{xyz}{face}0 0 0\n0 0 0\n");
    assert!(with(&format!("{two}3 0 1 2\n")).starts_with("Line(12) a face refers to vertex 2, but the file has 2"));
    assert!(with(&format!("{two}3 0 1 -1\n")).contains("vertex -1"));
    assert!(with(&format!("{two}2 0 1\n")).contains("at least 3"));
    assert!(with(&format!("{two}3 0 1")).contains("a list of 3 items, more than the rest"));
    assert!(with(&format!("{two}3 0 11 ")).contains("vertex 11"));
    assert!(with(&format!("{two}3 000 1")).contains("ends too early"));
    assert!(with(&format!("{two}9999 0 1")).contains("more than the rest"));
    // Huge counts are refused before anything is allocated.
    for count in ["18446744073709551615", "999999999999"] {
        assert!(with(&format!("element vertex {count}\n{xyz}{face}")).contains("the header announces"));
        let binary = format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{xyz}{face}");
        assert!(error(binary.as_bytes()).starts_with("Byte("), "{count}");
    }
    // Every prefix of a good file is an error, and a located one.
    for bytes in flavours() {
        for end in 0..bytes.len() - 1 {
            error(&bytes[..end]);
        }
    }
}

#[test]
fn damaged_files_never_panic() {
    for (flavour, good) in flavours().iter().enumerate() {
        let mut refused = 0;
        for seed in 0..1500 {
            match parse(&mutate(good, seed + 10_000 * flavour as u64), true) {
                Ok(mesh) => {
                    assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
                    assert!(mesh.normals.is_empty() || mesh.normals.len() == mesh.positions.len());
                }
                Err((_, message)) => {
                    refused += 1;
                    assert!(!message.is_empty());
                }
            }
        }
        assert!((150..1490).contains(&refused), "{refused} of 1500 refused");
    }
}
