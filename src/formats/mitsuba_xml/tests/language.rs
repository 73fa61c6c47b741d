//! The language itself: parameters, includes, references, transforms, messages.

use super::*;
use crate::math::DVec3;
use crate::scene::description::GeometryDesc;
use std::fs;

#[test]
fn unknown_property_message_is_exact() {
    let text = scene(
        "<shape type=\"sphere\"><bsdf type=\"diffuse\">\n\t<rgb name=\"relfectance\" value=\"1\"/></bsdf></shape>",
    );
    let all = load(&text).warnings;
    assert_eq!(
        all[0].to_string(),
        "test.xml:4:13: warning: unknown property \"relfectance\" of bsdf type \"diffuse\"; did you mean \
         \"reflectance\"?\n    4 | <rgb name=\"relfectance\" value=\"1\"/></bsdf></shape>\n      |            ^^^^^^^^^^^"
    );
    let strict = LoadOptions { strict: true, ..LoadOptions::default() };
    assert_eq!(read_with(&text, &strict).unwrap_err().0.len(), 1);
}

#[test]
fn several_errors_are_collected() {
    let found = errors(&scene(
        "<shape type=\"sphere\"><float name=\"radius\" value=\"x\"/></shape>\n<ref id=\"nowhere\"/>\n<integer name=\"n\" value=\"1.5\"/>",
    ));
    assert_eq!(found.len(), 3, "{found:?}");
    assert!(found[0].starts_with("test.xml:3:") && found[1].starts_with("test.xml:5:"), "{found:?}");
}

#[test]
fn parameters() {
    let film = |define: &[(&str, &str)], text: &str| {
        let defines = define.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
        read_with(&format!("<scene version=\"3.0.0\">{text}</scene>"), &LoadOptions { strict: true, defines })
    };
    let text = "<default name=\"res\" value=\"32\"/><default name=\"resx\" value=\"${res}\"/>";
    assert!(film(&[], text).is_err(), "braces are no part of the language");
    let text =
        "<default name=\"res\" value=\"32\"/><default name=\"res\" value=\"7\"/><default name=\"res_x\" value=\"64\"/>
        <sensor type=\"perspective\"><film type=\"hdrfilm\"><integer name=\"width\" value=\"$res_x\"/>
        <integer name=\"height\" value=\"$res\"/></film></sensor>";
    let d = film(&[], text).unwrap().description;
    assert_eq!((d.film.width, d.film.height), (64, 32));
    let d = film(&[("res", "9")], text).unwrap().description;
    assert_eq!((d.film.width, d.film.height), (64, 9));
    let unused = film(&[("rez", "9")], text).unwrap_err().to_string();
    assert!(unused.contains("\"rez\"") && unused.contains("did you mean \"res\"?"), "{unused}");
    fails(&scene("<shape type=\"$kind\"/>"), "undefined parameter \"$kind\"");
    let price = clean(&scene("<default name=\"a\" value=\"b\"/><shape type=\"sphere\" id=\"\\$a$a\"/>"));
    assert_eq!(price.shapes[0].name, "$ab");
}

#[test]
fn doubling_defaults_are_bounded() {
    let mut text = "<default name=\"x0\" value=\"aaaaaaaaaaaaaaaa\"/>".to_owned();
    for i in 1..60 {
        text += &format!("<default name=\"x{i}\" value=\"$x{0}$x{0}\"/>", i - 1);
    }
    fails(&scene(&text), "expand to too much");
}

#[test]
fn includes_find_files_beside_them_and_share_parameters() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("sub")).unwrap();
    let write = |name: &str, text: &str| fs::write(dir.path().join(name), text).unwrap();
    write("sub/inner.xml", "<scene version=\"3.0.0\"><float name=\"radius\" value=\"$r\"/></scene>");
    write(
        "sub/parts.xml",
        "<scene version=\"3.0.0\"><default name=\"r\" value=\"2\"/><shape type=\"sphere\"><include filename=\"inner.xml\"/></shape></scene>",
    );
    write("main.xml", &scene("<default name=\"r\" value=\"3\"/><include filename=\"sub/parts.xml\"/>"));
    let loaded = crate::formats::load(&dir.path().join("main.xml"), &LoadOptions::default()).unwrap();
    assert!(matches!(loaded.description.shapes[0].geometry, GeometryDesc::Sphere { radius, .. } if radius == 3.0));
    write("self.xml", &scene("<include filename=\"self.xml\"/>"));
    let error = crate::formats::load(&dir.path().join("self.xml"), &LoadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("includes itself"), "{error}");
    // An included file's mistakes carry its own name.
    write("sub/inner.xml", "<scene version=\"3.0.0\">\n <float name=\"radius\" value=\"big\"/></scene>");
    let error = crate::formats::load(&dir.path().join("main.xml"), &LoadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("inner.xml:2:30: error: expected a number, got \"big\""), "{error}");
}

#[test]
fn files_are_found_by_path_and_in_any_case() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("Textures")).unwrap();
    fs::write(dir.path().join("Textures/DarkOak.spd"), "400 1\n700 1\n").unwrap();
    let bsdf = |name: &str| {
        format!(
            "<shape type=\"sphere\"><bsdf type=\"diffuse\"><spectrum name=\"reflectance\" filename=\"{name}\"/></bsdf></shape>"
        )
    };
    let try_load = |text: &str| super::super::load_text(&dir.path().join("main.xml"), text, &LoadOptions::default());
    assert!(try_load(&scene(&bsdf("Textures/DarkOak.spd"))).unwrap().warnings.is_empty());
    let with_path = format!("<path value=\"Textures\"/>{}", bsdf("DarkOak.spd"));
    assert!(try_load(&scene(&with_path)).unwrap().warnings.is_empty());
    let wrong_case = try_load(&scene(&bsdf("textures\\darkoak.SPD"))).unwrap();
    assert!(wrong_case.warnings[0].message.contains("there is no file"));
    let missing = try_load(&scene(&bsdf("pine.spd"))).unwrap_err();
    assert!(missing.0[0].message.contains("\"pine.spd\" not found"));
    let mesh =
        try_load(&scene("<shape type=\"ply\">\n<string name=\"filename\" value=\"a.ply\"/></shape>")).unwrap_err();
    assert_eq!((mesh.0[0].line, mesh.0[0].column), (4, 32));
}

#[test]
fn references_forward_alias_cycle() {
    let d = clean(&scene(
        "<shape type=\"sphere\"><ref id=\"b\"/></shape><shape type=\"cube\"><ref id=\"a\"/></shape>
        <bsdf type=\"null\" id=\"a\"/><alias id=\"a\" as=\"b\"/>",
    ));
    assert_eq!((d.materials.len(), d.shapes[0].material), (1, d.shapes[1].material));
    fails(
        &scene("<bsdf type=\"null\" id=\"glas\"/><shape type=\"sphere\"><ref id=\"glass\"/></shape>"),
        "no object with the id \"glass\"; did you mean \"glas\"?",
    );
    fails(&scene("<alias id=\"a\" as=\"b\"/><alias id=\"b\" as=\"a\"/>"), "no object");
    fails(&scene("<bsdf type=\"null\" id=\"a\"/><bsdf type=\"null\" id=\"a\"/>"), "used twice");
    let cycle = "<bsdf type=\"mask\" id=\"a\"><ref id=\"b\"/></bsdf><bsdf type=\"mask\" id=\"b\"><ref id=\"a\"/></bsdf>
        <shape type=\"sphere\"><ref id=\"a\"/></shape>";
    fails(&scene(cycle), "contains itself");
    let texture = "<texture type=\"scale\" id=\"t\"><ref id=\"t\"/></texture><shape type=\"sphere\"><bsdf type=\"diffuse\"><ref name=\"reflectance\" id=\"t\"/></bsdf></shape>";
    fails(&scene(texture), "contains itself");
}

#[test]
fn transforms_apply_in_the_order_written() {
    let world = |content: &str| {
        clean(&scene(&format!("<shape type=\"cube\"><transform name=\"to_world\">{content}</transform></shape>")))
            .shapes[0]
            .to_world
    };
    let m = world("<translate x=\"1\"/><scale value=\"2\"/><rotate z=\"1\" angle=\"90\"/>");
    assert!((m.transform_point3(DVec3::ZERO) - DVec3::new(0.0, 2.0, 0.0)).length() < 1e-12);
    let m = world("<matrix value=\"1 2 3 4, 0 1 0 5  0 0 1 6  0 0 0 1\"/>");
    assert_eq!(m.transform_point3(DVec3::ONE), DVec3::new(10.0, 6.0, 7.0));
    let m = world("<matrix value=\"0 1 0 0 0 1 1 0 0\"/>");
    assert_eq!(m.transform_point3(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(2.0, 3.0, 1.0));
    let bad = |content: &str, part: &str| {
        fails(
            &scene(&format!("<shape type=\"cube\"><transform name=\"to_world\">{content}</transform></shape>")),
            part,
        );
    };
    bad("<rotate angle=\"3\"/>", "axis of the rotation is zero");
    bad("<matrix value=\"1 2\"/>", "16 or 9 numbers, this one 2");
    bad("<translate x=\"1\" value=\"1 1 1\"/>", "not both");
    bad("<lookat origin=\"1 1 1\" target=\"1 1 1\"/>", "same point");
    bad(&"<scale value=\"1e30\"/>".repeat(20), "too large");
}

#[test]
fn look_at_x_points_left() {
    let camera = |up: &str| {
        let text = format!(
            "<scene version=\"3.0.0\"><sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"0 0 5\" target=\"0 0 0\" {up}/></transform></sensor></scene>"
        );
        load(&text).description.camera.to_world
    };
    let m = camera("up=\"0 1 0\"");
    // Looking along -z with y up, the left of the picture is -x.
    assert_eq!(m.transform_vector3(DVec3::X), DVec3::NEG_X);
    assert_eq!(m.transform_vector3(DVec3::Y), DVec3::Y);
    assert_eq!(m.transform_point3(DVec3::Z), DVec3::new(0.0, 0.0, 4.0));
    // What Mitsuba 3.9.1 says of this one.
    let text = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><transform name=\"to_world\"><lookat origin=\"1,2,3\" target=\"0,0.5,0\" up=\"0,1,0\"/></transform></sensor></scene>";
    let m = load(text).description.camera.to_world;
    assert!((m.x_axis.truncate() - DVec3::new(-0.948683, 0.0, 0.316228)).length() < 1e-5);
    assert!((m.y_axis.truncate() - DVec3::new(-0.135526, 0.903508, -0.406579)).length() < 1e-5);
    for up in ["", "up=\"0 0 0\"", "up=\"0 0 1\""] {
        let m = camera(up);
        assert_eq!(m.transform_vector3(DVec3::Z), DVec3::NEG_Z);
        assert!((m.determinant() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn odd_documents() {
    fails("", "XML");
    fails("<scene", "XML");
    fails("<!DOCTYPE a [<!ENTITY x 'y'>]><scene version=\"3.0.0\">&x;</scene>", "XML");
    fails("<bsdf type=\"diffuse\"/>", "expected <scene>");
    fails("<scene version=\"3.0.0\"/>", "no sensor");
    fails("<scene version=\"0.3.0\"/>", "0.3 and older");
    fails("<scene version=\"three\"/>", "expected a version");
    let unversioned = warnings("<scene><sensor type=\"perspective\"/></scene>");
    assert!(unversioned[0].contains("no version"));
    let tags = warnings(&scene("<hide id=\"x\"/><shpe type=\"cube\"/>stray"));
    assert!(tags[0].contains("unknown tag <hide>") && tags[1].contains("did you mean \"shape\"?"), "{tags:?}");
    assert!(tags[2].contains("text outside"));
    let nested = format!("{}{}", "<shape type=\"cube\">".repeat(100_000), "</shape>".repeat(100_000));
    fails(&scene(&nested), "nested");
    fails(&scene("<shape/>"), "needs the attribute \"type\"");
    fails(&scene("<shape type=\"cube\"><float value=\"1\"/></shape>"), "needs the attribute \"name\"");
}

#[test]
fn a_file_that_ends_too_early_is_wrong_at_its_end() {
    for cut in ["<scene version=\"3.0.0\">\n<shape type=\"cube\">\n</shape>\n", "<scene version=\"3.0.0\">\n\n  <bsdf"]
    {
        let message = errors(cut).remove(0);
        assert!(message.starts_with("test.xml:3:"), "{message}");
    }
}
