//! Shapes, lamps and other lights of version 3.

use super::*;
use crate::math::{DVec3, Rgb};
use crate::scene::description::{GeometryDesc, LightDesc};
use crate::scene::texture::{Color, Texture};

#[test]
fn shapes_without_material_and_lamps() {
    let d = clean(&scene(
        "<shape type=\"cube\"/><shape type=\"disk\"><emitter type=\"area\"/></shape><shape type=\"disk\"/>",
    ));
    let albedo = |i: usize| d.materials[d.shapes[i].material as usize].clone();
    let grey = |v: f32| Material::Diffuse { reflectance: Color::Constant(Rgb::splat(v)) };
    assert_eq!((albedo(0), albedo(1), d.materials.len()), (grey(0.5), grey(0.0), 2));
    assert_eq!(d.shapes[1].emission, Some(Color::Constant(Rgb::ONE)));
    assert_eq!(d.shapes[1].name, "shape 2 (disk)");
    let lamp = |text: &str| scene(&format!("<shape type=\"cube\">{text}</shape>"));
    fails(&lamp("<emitter type=\"point\"/>"), "cannot be nested in a shape");
    fails(&lamp("<emitter type=\"area\"><transform name=\"to_world\"/></emitter>"), "no to_world of its own");
    fails(&lamp("<emitter type=\"area\"/><emitter type=\"area\"/>"), "one emitter only");
    fails(&scene("<emitter type=\"area\"/>"), "belongs to a shape");
    let textured = clean(&lamp("<emitter type=\"area\"><texture type=\"checkerboard\" name=\"radiance\"/></emitter>"));
    assert!(matches!(textured.shapes[0].emission, Some(Color::Texture(_))));
    // A spectrum of one number is equal-energy white; a float is grey.
    let d = clean(&lamp("<emitter type=\"area\"><spectrum name=\"radiance\" value=\"10\"/></emitter>"));
    let Some(Color::Constant(c)) = d.shapes[0].emission else { panic!() };
    assert!((c - Rgb::new(12.048, 9.483, 9.089)).length() < 0.01, "{c}");
    assert_eq!(material("<bsdf type=\"diffuse\"><spectrum name=\"reflectance\" value=\"0.25\"/></bsdf>"), grey(0.25));
}

#[test]
fn shape_rules() {
    let sphere = |text: &str| scene(&format!("<shape type=\"sphere\">{text}</shape>"));
    let d = clean(&sphere("<float name=\"radius\" value=\"-2\"/>"));
    assert!(d.shapes[0].flip_normals && matches!(d.shapes[0].geometry, GeometryDesc::Sphere { radius: 2.0, .. }));
    fails(&sphere("<float name=\"radius\" value=\"0\"/>"), "must not be 0");
    fails(&sphere("<transform name=\"to_world\"><scale x=\"2\"/></transform>"), "scaled unevenly");
    let rods = clean(&scene("<shape type=\"cylinder\"/>"));
    assert!(matches!(rods.shapes[0].geometry, GeometryDesc::Cylinder { p0: DVec3::ZERO, p1: DVec3::Z, radius: 1.0 }));
    assert!(warnings(&scene("<shape type=\"recangle\"/>"))[0].contains("did you mean \"rectangle\"?"));
    let medium = "<shape type=\"cube\"><medium name=\"interior\" type=\"homogeneous\"><rgb name=\"albedo\" value=\"1\"/></medium></shape>";
    let found = warnings(&scene(&medium.repeat(3)));
    assert!(found.len() == 1 && found[0].contains("participating media"), "{found:?}");
    let d = clean(&scene(
        "<shape type=\"shapegroup\" id=\"g\"><shape type=\"cube\"><transform name=\"to_world\"><scale value=\"2\"/></transform></shape><shape type=\"disk\"/></shape>
        <shape type=\"instance\"><ref id=\"g\"/></shape><shape type=\"instance\"><ref id=\"g\"/><transform name=\"to_world\"><translate x=\"5\"/></transform></shape>",
    ));
    assert_eq!(d.shapes.len(), 4);
    assert_eq!(d.shapes[2].to_world.transform_point3(DVec3::X), DVec3::new(7.0, 0.0, 0.0));
}

#[test]
fn lights() {
    let light = |text: &str| clean(&scene(text)).lights[0].clone();
    let d = "<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"-2\" z=\"0\"/></emitter>";
    assert!(
        matches!(light(d), LightDesc::Directional { direction, irradiance: Rgb::ONE } if direction == DVec3::NEG_Y)
    );
    assert!(
        matches!(light("<emitter type=\"directional\"/>"), LightDesc::Directional { direction, .. } if direction == DVec3::Z)
    );
    fails(
        &scene("<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"0\" z=\"0\"/></emitter>"),
        "direction of the light is zero",
    );
    let LightDesc::Spot { cutoff_angle, beam_width, .. } = light("<emitter type=\"spot\"/>") else { panic!() };
    assert!((cutoff_angle.to_degrees() - 20.0).abs() < 1e-9 && (beam_width.to_degrees() - 15.0).abs() < 1e-9);
    let p = "<emitter type=\"point\"><transform name=\"to_world\"><translate y=\"3\"/></transform></emitter>";
    assert!(matches!(light(p), LightDesc::Point { position, .. } if position == DVec3::new(0.0, 3.0, 0.0)));
    assert!(warnings(&scene("<emitter type=\"sunsky\"/>"))[0].contains("is not supported; skipped"));
    fails(&scene("<emitter type=\"envmap\"/>"), "needs the property \"filename\"");
    fails(
        &scene("<emitter type=\"constant\"><texture type=\"checkerboard\" name=\"radiance\"/></emitter>"),
        "not supported",
    );
}

#[test]
fn picture_flags_reach_the_reader() {
    let dir = tempfile::tempdir().unwrap();
    let picture = dir.path().join("a.png");
    std::fs::write(&picture, [137, 80, 78, 71]).unwrap();
    let bitmap = |extra: &str| {
        format!(
            "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"a.png\"/>{extra}</texture>"
        )
    };
    let shape = |texture: String| format!("<shape type=\"cube\"><bsdf type=\"diffuse\">{texture}</bsdf></shape>");
    let raw = "<boolean name=\"raw\" value=\"true\"/><string name=\"wrap_mode\" value=\"mirror\"/>";
    let text = scene(&(shape(bitmap("")) + &shape(bitmap(raw)) + &shape(bitmap(""))));
    let report = super::super::report::Report::new(false);
    let path = dir.path().join("main.xml");
    let tree = super::super::parser::parse(&path, text.as_str().into(), &[], &report).unwrap();
    let mut b = super::super::builder::Builder::new(&tree, &report);
    for (id, object) in tree.objects.iter().enumerate().filter(|(_, o)| o.tag == "shape") {
        super::super::shape::read(&mut b, id, 1).unwrap_or_else(|_| panic!("{object:?}"));
    }
    // Two requests for three uses: decoded and raw.
    assert_eq!(b.textures.len(), 3);
    let images: Vec<u32> = b
        .textures
        .iter()
        .map(|t| match t {
            Texture::Bitmap { image, .. } => *image,
            _ => 9,
        })
        .collect();
    assert_eq!(images, [0, 1, 0]);
    assert!(b.decodes_srgb(0) && !b.decodes_srgb(1));
}

/// OBJ flips v unless told otherwise, the other formats do not; facets and crease angles belong to the shape.
#[test]
fn mesh_flags_reach_the_reader() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.obj", "a.ply", "a.serialized"] {
        std::fs::write(dir.path().join(name), "").unwrap();
    }
    let shape = |kind: &str, extra: &str| {
        format!("<shape type=\"{kind}\"><string name=\"filename\" value=\"a.{kind}\"/>{extra}</shape>")
    };
    let flip = |v: bool| format!("<boolean name=\"flipTexCoords\" value=\"{v}\"/>");
    let parts = [
        shape("obj", ""),
        shape("obj", &flip(false)),
        shape("ply", ""),
        shape("ply", &flip(true)),
        shape("serialized", "<integer name=\"shapeIndex\" value=\"3\"/>"),
        shape("obj", "<boolean name=\"faceNormals\" value=\"true\"/>"),
        shape("ply", "<float name=\"maxSmoothAngle\" value=\"90\"/>"),
    ];
    let text = format!("<scene version=\"0.6.0\">{}</scene>", parts.concat());
    let report = super::super::report::Report::new(false);
    let path = dir.path().join("main.xml");
    let tree = super::super::parser::parse(&path, text.as_str().into(), &[], &report).unwrap();
    let mut b = super::super::builder::Builder::new(&tree, &report);
    for id in 1..tree.objects.len() {
        super::super::shape::read(&mut b, id, id).unwrap();
    }
    use crate::formats::assets::MeshKind::{Obj, Ply, Serialized};
    let kinds: Vec<_> = b.meshes.iter().map(|(_, kind, _)| *kind).collect();
    assert_eq!(kinds, [Obj(true), Obj(false), Ply(false), Ply(true), Serialized(3)]);
    let files: Vec<_> = b.pending.iter().map(|p| (p.file, p.face_normals)).collect();
    assert_eq!(files, [(0, false), (1, false), (2, false), (3, false), (4, false), (0, true), (2, false)]);
    let angle = b.pending[6].max_smooth_angle.unwrap();
    assert!((angle - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
}

#[test]
fn pixels_that_are_not_finite_are_black_and_said() {
    let dir = tempfile::tempdir().unwrap();
    let values = [1.0f32, 2.0, 3.0, f32::NAN, 0.0, 0.0, 4.0, f32::INFINITY, 4.0];
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    std::fs::write(dir.path().join("sky.pfm"), [b"PF\n3 1\n-1.0\n", &bytes[..]].concat()).unwrap();
    let text = scene("<emitter type=\"envmap\"><string name=\"filename\" value=\"sky.pfm\"/></emitter>");
    let path = dir.path().join("main.xml");
    let loaded = super::super::load_text(&path, &text, &LoadOptions::default()).unwrap();
    assert!(loaded.warnings[0].to_string().contains("2 pixels are not finite"), "{}", loaded.warnings[0]);
    let expected = [crate::math::Rgb::new(1.0, 2.0, 3.0), crate::math::Rgb::ZERO, crate::math::Rgb::ZERO];
    assert_eq!(loaded.description.images[0].pixels, expected);
}
