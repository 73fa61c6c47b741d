//! Which way up: pictures on the four kinds of shapes that hold texture coordinates, the picture itself, mirrored
//! cameras, and the side on which lamps shine. From scene files to pixels; every value is exact.

use dualux::accel::Accel;
use dualux::formats::{LoadOptions, load};
use dualux::image::png_file::write_codes;
use dualux::integrators::path::{Path, PathSettings};
use dualux::math::Rgb;
use dualux::render::{RenderSettings, Silent, render};
use dualux::scene::Scene;
use dualux::transport::World;
use std::io::Write;
use std::sync::atomic::AtomicBool;

const RED: Rgb = Rgb::new(1.0, 0.0, 0.0);
const GREEN: Rgb = Rgb::new(0.0, 1.0, 0.0);
const BLUE: Rgb = Rgb::new(0.0, 0.0, 1.0);
const BLACK: Rgb = Rgb::ZERO;
/// The picture of the tests from the top left: red, green; blue, black.
const UPRIGHT: [Rgb; 4] = [RED, GREEN, BLUE, BLACK];
const UPSIDE_DOWN: [Rgb; 4] = [BLUE, BLACK, RED, GREEN];

/// A folder with `picture.png` and the square [-1,1]^2, facing +z, uv (0,0) at (-1,-1), as three kinds of mesh.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("scratch folder");
    let codes = [255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0];
    write_codes(&dir.path().join("picture.png"), 2, 2, &codes).expect("written");
    let corners = [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let uv = |c: [f32; 2]| c.map(|x| 0.5 * (x + 1.0));
    let mut obj = String::new();
    let mut ply = String::from("ply\nformat ascii 1.0\nelement vertex 4\n");
    for name in ["x", "y", "z", "u", "v"] {
        ply += &format!("property float {name}\n");
    }
    ply += "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    for c in corners {
        let [u, v] = uv(c);
        obj += &format!("v {} {} 0\nvt {u} {v}\n", c[0], c[1]);
        ply += &format!("{} {} 0 {u} {v}\n", c[0], c[1]);
    }
    std::fs::write(dir.path().join("mesh.obj"), obj + "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n").expect("written");
    std::fs::write(dir.path().join("mesh.ply"), ply + "3 0 1 2\n3 0 2 3\n").expect("written");
    // Serialized, version 4: single precision (0x1000) with texture coordinates (2), no name.
    let mut body = Vec::new();
    body.extend(0x1002u32.to_le_bytes());
    body.push(0);
    body.extend([4u64, 2].iter().flat_map(|n| n.to_le_bytes()));
    body.extend(corners.iter().flat_map(|c| [c[0], c[1], 0.0]).flat_map(f32::to_le_bytes));
    body.extend(corners.iter().flat_map(|&c| uv(c)).flat_map(f32::to_le_bytes));
    body.extend([0u32, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let mut file = [0x1cu8, 0x04, 4, 0].to_vec();
    let mut zlib = flate2::write::ZlibEncoder::new(&mut file, flate2::Compression::default());
    zlib.write_all(&body).expect("compressed");
    zlib.finish().expect("compressed");
    file.extend(0u64.to_le_bytes());
    file.extend(1u32.to_le_bytes());
    std::fs::write(dir.path().join("mesh.serialized"), file).expect("written");
    dir
}

/// The four pixels, from the top left, of what a camera at +z, +y up, sees of `shapes`.
fn pixels(dir: &tempfile::TempDir, before_lookat: &str, shapes: &str) -> [Rgb; 4] {
    let file = dir.path().join("scene.xml");
    let scene = format!(
        r#"<scene version="3.0.0"><sensor type="orthographic">
        <transform name="to_world">{before_lookat}<lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="2"/><integer name="height" value="2"/>
        <rfilter type="box"><float name="radius" value="0.1"/></rfilter></film></sensor>{shapes}</scene>"#
    );
    std::fs::write(&file, scene).expect("written");
    let loaded = load(&file, &LoadOptions { strict: true, defines: vec![] }).expect("a valid scene");
    let scene = Scene::new(loaded.description).expect("a valid scene");
    let accel = Accel::new(&scene.shapes);
    let mut path = Path::new(World::new(&scene, &accel), PathSettings::default());
    let settings =
        RenderSettings { window: scene.film.crop, passes: Some(1), deadline: None, seed: 1, features: false };
    let done = render(&scene, &mut path, &settings, &AtomicBool::new(false), &mut Silent);
    done.film.picture(1).try_into().expect("four pixels")
}

/// A lamp that shows the picture.
fn lamp(shape: &str) -> String {
    format!(
        r#"{shape}<emitter type="area"><texture type="bitmap" name="radiance"><string name="filename" value="picture.png"/>
        <string name="filter_type" value="nearest"/></texture></emitter></shape>"#
    )
}

fn mesh(kind: &str, more: &str) -> String {
    lamp(&format!(r#"<shape type="{kind}"><string name="filename" value="mesh.{kind}"/>{more}"#))
}

#[test]
fn pictures_stand_upright_on_obj_meshes_and_upside_down_on_all_others() {
    let dir = folder();
    let flip = |on: bool| format!(r#"<boolean name="flip_tex_coords" value="{on}"/>"#);
    for (shape, expected) in [
        (lamp(r#"<shape type="rectangle">"#), UPSIDE_DOWN),
        (mesh("obj", ""), UPRIGHT),
        (mesh("obj", &flip(false)), UPSIDE_DOWN),
        (mesh("ply", ""), UPSIDE_DOWN),
        (mesh("ply", &flip(true)), UPRIGHT),
        (mesh("serialized", ""), UPSIDE_DOWN),
    ] {
        assert_eq!(pixels(&dir, "", &shape), expected, "{shape}");
    }
}

#[test]
fn a_mirroring_camera_shows_a_mirror_image() {
    let [a, b, c, d] = UPRIGHT;
    assert_eq!(pixels(&folder(), r#"<scale x="-1"/>"#, &mesh("obj", "")), [b, a, d, c]);
}

#[test]
fn lamps_shine_on_their_normal_side_only_whatever_their_material() {
    let dir = folder();
    let turned = r#"<transform name="to_world"><rotate y="1" angle="180"/></transform>"#;
    let two_sided = r#"<bsdf type="twosided"><bsdf type="diffuse"/></bsdf>"#;
    let flip = r#"<boolean name="flip_normals" value="true"/>"#;
    for (more, dark) in [("", false), (turned, true), (flip, true)] {
        for material in ["", two_sided] {
            let seen = pixels(&dir, "", &lamp(&format!(r#"<shape type="rectangle">{more}{material}"#)));
            assert_eq!(seen == [BLACK; 4], dark, "{more} {material}: {seen:?}");
        }
    }
    // Turned round twice it shines again, left and right exchanged.
    let [a, b, c, d] = UPSIDE_DOWN;
    assert_eq!(pixels(&dir, "", &lamp(&format!(r#"<shape type="rectangle">{turned}{flip}"#))), [b, a, d, c]);
}
