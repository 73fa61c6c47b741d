//! Plugins of version 3: defaults, quirks, wrong values.

use super::*;
use crate::math::filter::PixelFilter;
use crate::math::{DMat4, DVec3, Rgb};
use crate::scene::Color;
use crate::scene::description::Projection;
use crate::scene::material::Distribution;
use crate::scene::texture::Scalar;

/// Horizontal field of view, degrees, of a 800 x 400 (or 400 x 800) film.
fn x_fov(content: &str, size: (u32, u32)) -> f64 {
    let (w, h) = size;
    let d = clean(&format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\">{content}<film type=\"hdrfilm\">
        <integer name=\"width\" value=\"{w}\"/><integer name=\"height\" value=\"{h}\"/></film></sensor></scene>"
    ));
    match d.camera.projection {
        Projection::Perspective { x_fov, .. } => x_fov.to_degrees(),
        Projection::Orthographic => panic!("perspective expected"),
    }
}

#[test]
fn field_of_view_axes() {
    let fov = |axis: &str, size| {
        x_fov(&format!("<float name=\"fov\" value=\"40\"/><string name=\"fov_axis\" value=\"{axis}\"/>"), size)
    };
    let wide = (800, 400);
    let tall = (400, 800);
    let from_y = |aspect: f64| 2.0 * ((20f64).to_radians().tan() * aspect).atan().to_degrees();
    let diagonal =
        |aspect: f64| 2.0 * ((20f64).to_radians().tan() / (1.0 + 1.0 / aspect / aspect).sqrt()).atan().to_degrees();
    for (axis, on_wide, on_tall) in [
        ("x", 40.0, 40.0),
        ("y", from_y(2.0), from_y(0.5)),
        ("smaller", from_y(2.0), 40.0),
        ("larger", 40.0, from_y(0.5)),
        ("diagonal", diagonal(2.0), diagonal(0.5)),
    ] {
        assert!((fov(axis, wide) - on_wide).abs() < 1e-9, "{axis}");
        assert!((fov(axis, tall) - on_tall).abs() < 1e-9, "{axis}");
    }
    // 50 mm on 36 x 24 mm: 46.79 degrees on the diagonal, 39.6 on the long side.
    let normal = x_fov("<string name=\"focal_length\" value=\"50mm\"/>", (900, 600));
    assert!((normal - 39.5978).abs() < 1e-3, "{normal}");
    assert!((normal - x_fov("", (900, 600))).abs() < 1e-12);
    // Mitsuba 3.9.1.
    let wide = x_fov("<string name=\"focal_length\" value=\"35mm\"/>", (768, 576));
    assert!((wide - 52.622_543).abs() < 1e-4, "{wide}");
}

fn sensor(kind: &str, content: &str) -> String {
    format!("<scene version=\"3.0.0\"><sensor type=\"{kind}\">{content}</sensor></scene>")
}

#[test]
fn sensor_rules() {
    let moved = |m: &str| sensor("perspective", &format!("<transform name=\"to_world\">{m}</transform>"));
    fails(&moved("<scale value=\"2\"/>"), "must not scale");
    // A mirrored camera is fine and stays mirrored.
    let d = clean(&moved("<scale x=\"-1\"/><rotate y=\"1\" angle=\"30\"/>"));
    assert!((d.camera.to_world.determinant() + 1.0).abs() < 1e-12);
    fails(&sensor("perspective", "<float name=\"fov\" value=\"180\"/>"), "fov must lie between");
    fails(&sensor("perspective", "<float name=\"near_clip\" value=\"0\"/>"), "near_clip must be above 0");
    fails(&sensor("perspective", "<float name=\"far_clip\" value=\"0.001\"/>"), "far_clip must be above");
    fails(&sensor("perspectve", ""), "did you mean \"perspective\"?");
    fails(&sensor("thinlens", ""), "aperture_radius");
    // Without a focus distance the far clip plane is in focus.
    let d = clean(&sensor(
        "thinlens",
        "<float name=\"aperture_radius\" value=\"0.1\"/><float name=\"far_clip\" value=\"77\"/>",
    ));
    assert!(matches!(d.camera.projection, Projection::Perspective { aperture_radius: 0.1, focus_distance: 77.0, .. }));
    let d = clean(&sensor("orthographic", "<transform name=\"to_world\"><scale x=\"3\" y=\"3\"/></transform>"));
    assert!(matches!(d.camera.projection, Projection::Orthographic));
    assert_eq!(d.camera.to_world, DMat4::from_scale(DVec3::new(3.0, 3.0, 1.0)));
    let d = clean(&sensor("perspective", "<float name=\"principal_point_offset_x\" value=\"0.25\"/>"));
    assert!(matches!(d.camera.projection, Projection::Perspective { principal_point_offset: [0.25, 0.0], .. }));
    assert!(
        warnings("<scene version=\"3.0.0\"><sensor type=\"orthographic\"/><sensor type=\"perspective\"/></scene>")[0]
            .contains("several sensors")
    );
}

fn film(content: &str) -> String {
    sensor("perspective", &format!("<film type=\"hdrfilm\">{content}</film>"))
}

#[test]
fn film_rules() {
    let d = clean(&sensor("perspective", ""));
    assert_eq!((d.film.width, d.film.height, d.film.crop), (768, 576, [0, 0, 768, 576]));
    assert_eq!((d.film.filter, d.sample_count, d.seed), (PixelFilter::Gaussian { stddev: 0.5 }, None, 0));
    let int = |name: &str, value: i64| format!("<integer name=\"{name}\" value=\"{value}\"/>");
    let d = clean(&film(&(int("crop_offset_x", 8) + &int("crop_width", 700) + &int("crop_height", 1))));
    assert_eq!(d.film.crop, [8, 0, 700, 1]);
    fails(&film(&int("crop_offset_x", 8)), "outside of the film");
    fails(&film(&(int("crop_offset_y", -1) + &int("crop_height", 5))), "outside of the film");
    fails(&film(&int("crop_offset_x", i64::MAX)), "outside of the film");
    fails(&film(&int("width", 1_000_000_000)), "at most 65536");
    fails(&film(&(int("width", 65_536) + &int("height", 65_536))), "too many");
    fails(&film(&int("width", 0)), "at least 1");
    let filter = |text: &str| clean(&film(text)).film.filter;
    assert_eq!(filter("<rfilter type=\"box\"/>"), PixelFilter::Box { radius: 0.5 });
    assert_eq!(filter("<rfilter type=\"tent\"/>"), PixelFilter::Tent { radius: 1.0 });
    assert_eq!(filter("<rfilter type=\"catmullrom\"/>"), PixelFilter::CatmullRom);
    assert_eq!(filter("<rfilter type=\"lanczos\"/>"), PixelFilter::Lanczos { lobes: 3 });
    let third = (1.0f64 / 3.0) as f32;
    let mitchell = filter("<rfilter type=\"mitchell\"><float name=\"B\" value=\"0.25\"/></rfilter>");
    assert_eq!(mitchell, PixelFilter::Mitchell { b: 0.25, c: third });
    let sampler = "<sampler type=\"independent\"><integer name=\"sample_count\" value=\"0\"/></sampler>";
    fails(&sensor("perspective", sampler), "at least 1");
}

#[test]
fn integrator_rules() {
    let read = |text: &str| clean(&scene(text)).integrator;
    let path =
        |depth: i64| format!("<integrator type=\"path\"><integer name=\"max_depth\" value=\"{depth}\"/></integrator>");
    assert_eq!(read(&path(-1)).max_depth, None);
    assert_eq!(read(&path(2)).max_depth, Some(2));
    for bad in [0, -2, i64::MAX] {
        fails(&scene(&path(bad)), "max_depth must be");
    }
    let none = read("");
    assert!(none.name.is_empty() && none.rr_depth.is_none() && !none.hide_emitters);
    let aov = read(
        "<integrator type=\"aov\"><string name=\"aovs\" value=\"d:depth\"/><integrator type=\"Path\"><boolean name=\"hide_emitters\" value=\"True\"/><float name=\"timeout\" value=\"-1\"/></integrator></integrator>",
    );
    assert!(aov.name == "path" && aov.hide_emitters && aov.timeout.is_none());
}

#[test]
fn dielectric_names_and_sides() {
    let Material::Dielectric { eta, .. } = material("<bsdf type=\"dielectric\"/>") else { panic!() };
    assert!((eta - (1.5046 / 1.000_277) as f32).abs() < 1e-6);
    let Material::ThinDielectric { eta, .. } = material(
        "<bsdf type=\"thindielectric\"><string name=\"int_ior\" value=\"Water\"/><float name=\"ext_ior\" value=\"1\"/></bsdf>",
    ) else {
        panic!()
    };
    assert_eq!(eta, 1.333);
    let shape = |text: &str| scene(&format!("<shape type=\"sphere\">{text}</shape>"));
    fails(
        &shape("<bsdf type=\"dielectric\"><string name=\"int_ior\" value=\"watre\"/></bsdf>"),
        "did you mean \"water\"?",
    );
    fails(&shape("<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"-1\"/></bsdf>"), "above 0");
}

#[test]
fn conductors() {
    let Material::Conductor { eta, k, .. } = material("<bsdf type=\"conductor\"/>") else { panic!() };
    assert_eq!((eta, k), (Color::Constant(Rgb::ZERO), Color::Constant(Rgb::ONE)));
    let Material::RoughConductor { eta, roughness, .. } = material(
        "<bsdf type=\"roughconductor\"><string name=\"material\" value=\"Au\"/><float name=\"alpha_u\" value=\"0.2\"/><float name=\"alpha_v\" value=\"0.3\"/></bsdf>",
    ) else {
        panic!()
    };
    assert_eq!(eta, Color::Constant(Rgb::new(0.1430, 0.3753, 1.4420)));
    let Material::Conductor { eta, k, .. } = material(
        "<bsdf type=\"conductor\"><texture type=\"checkerboard\" name=\"eta\"/><rgb name=\"k\" value=\"2\"/></bsdf>",
    ) else {
        panic!()
    };
    assert_eq!((eta, k), (Color::Texture(0), Color::Constant(Rgb::splat(2.0))));
    assert_eq!(
        (roughness.distribution, roughness.alpha_u, roughness.alpha_v),
        (Distribution::Beckmann, Scalar::Constant(0.2), Scalar::Constant(0.3))
    );
    let shape =
        |text: &str| scene(&format!("<shape type=\"sphere\"><bsdf type=\"roughconductor\">{text}</bsdf></shape>"));
    fails(&shape("<float name=\"alpha_u\" value=\"0.2\"/>"), "alpha_u needs alpha_v");
    fails(
        &shape(
            "<float name=\"alpha_u\" value=\"0.2\"/><float name=\"alpha_v\" value=\"0.2\"/><float name=\"alpha\" value=\"0.2\"/>",
        ),
        "not both",
    );
    fails(&shape("<float name=\"alpha\" value=\"-0.2\"/>"), "not be negative");
    fails(&shape("<string name=\"distribution\" value=\"gxg\"/>"), "did you mean \"ggx\"?");
    fails(&shape("<rgb name=\"eta\" value=\"1\"/>"), "needs \"k\"");
    fails(&shape("<string name=\"material\" value=\"Unobtainium\"/>"), "no optical constants");
}

#[test]
fn nested_materials() {
    let d = clean(&scene("<shape type=\"sphere\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>"));
    assert!(matches!(d.materials[d.shapes[0].material as usize], Material::TwoSided { front, back } if front == back));
    let shape = |text: &str| scene(&format!("<shape type=\"sphere\">{text}</shape>"));
    fails(
        &shape("<bsdf type=\"twosided\"><bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf></bsdf>"),
        "lets light through",
    );
    fails(&shape("<bsdf type=\"twosided\"/>"), "needs a nested <bsdf>");
    fails(
        &shape("<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.5\"/><bsdf type=\"null\"/></bsdf>"),
        "needs 2 nested",
    );
    fails(
        &shape("<bsdf type=\"blendbsdf\"><bsdf type=\"null\"/><bsdf type=\"null\"/></bsdf>"),
        "needs the property \"weight\"",
    );
    assert!(matches!(
        material("<bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf>"),
        Material::Mask { opacity: Scalar::Constant(0.5), .. }
    ));
    let bump = material(
        "<bsdf type=\"bumpmap\"><texture type=\"checkerboard\" name=\"anything\"/><float name=\"scale\" value=\"3\"/><bsdf type=\"diffuse\"/></bsdf>",
    );
    assert!(matches!(bump, Material::BumpMap { scale: 3.0, .. }));
    let unknown = warnings(&shape("<bsdf type=\"difuse\"/>"));
    assert!(
        unknown[0].contains("bsdf type \"difuse\" is unknown; using diffuse; did you mean \"diffuse\"?"),
        "{unknown:?}"
    );
}
