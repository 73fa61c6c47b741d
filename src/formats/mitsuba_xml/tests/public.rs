//! Every public scene and every reference scene loads.
//!
//! They are data beside the project; without them the test says so and passes.

use crate::formats::{LoadOptions, load};
use crate::math::Rgb;
use crate::scene::description::Projection;
use crate::scene::material::Material;
use crate::scene::texture::Color;
use std::path::{Path, PathBuf};

/// The scene files, or none.
pub fn scene_files() -> Vec<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let mut files = Vec::new();
    let mut folders = vec![shared.join("ref")];
    let scenes = std::fs::read_dir(shared.join("scenes")).into_iter().flatten();
    folders.extend(scenes.filter_map(Result::ok).map(|e| e.path()));
    for folder in folders {
        let entries = std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
        files.extend(entries.map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == "xml")));
    }
    files.sort();
    files
}

#[test]
fn public_scenes_load() {
    let files = scene_files();
    if files.is_empty() {
        println!("skipped: no scenes in ../shared");
    }
    for file in files {
        // This one names files that were never published with it.
        let broken = file.ends_with("scene_v0.5_asfound.xml");
        match load(&file, &LoadOptions::default()) {
            Ok(loaded) => {
                let d = &loaded.description;
                println!(
                    "{}: {} shapes, {} materials, {} textures, {} pictures, {} lights, {:?} {}x{}",
                    file.display(),
                    d.shapes.len(),
                    d.materials.len(),
                    d.textures.len(),
                    d.images.len(),
                    d.lights.len(),
                    d.integrator,
                    d.film.width,
                    d.film.height
                );
                loaded.warnings.iter().for_each(|w| println!("{w}"));
                assert!(!broken);
                assert!(!d.shapes.is_empty());
                // Files of the current version have nothing to warn of but the medium of one of them.
                let text = std::fs::read_to_string(&file).unwrap();
                let expected = usize::from(text.contains("<medium"));
                assert!(!text.contains("version=\"3.") || loaded.warnings.len() == expected);
            }
            Err(errors) => {
                println!("{errors}");
                assert!(broken, "{} does not load", file.display());
            }
        }
    }
}

/// The Cornell box of Mitsuba 0.4: spectra, legacy names and tags. The colours are Mitsuba 3.9.1's for its lists.
#[test]
fn legacy_cornell_box_agrees_with_mitsuba() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/cbox-legacy/scene.xml");
    if !file.is_file() {
        println!("skipped: no cbox-legacy in ../shared");
        return;
    }
    let loaded = load(&file, &LoadOptions::default()).unwrap();
    assert!(loaded.warnings.is_empty());
    let d = loaded.description;
    let close = |c: Rgb, r: f32, g: f32, b: f32| {
        let expected = Rgb::new(r, g, b);
        assert!(((c - expected) / expected).abs().max_element() < 5e-3, "{c} is not {expected}");
    };
    let albedo = |shape: usize| match d.materials[d.shapes[shape].material as usize] {
        Material::Diffuse { reflectance: Color::Constant(c) } => c,
        ref other => panic!("{other:?}"),
    };
    close(albedo(0), 0.776368, 0.779809, 0.776029);
    close(albedo(1), 0.735013, 0.735625, 0.736264);
    close(albedo(4), 0.0682821, 0.39776, 0.0862908);
    close(albedo(5), 0.49132, 0.049228, 0.0509219);
    let Some(Color::Constant(radiance)) = d.shapes[0].emission else { panic!() };
    close(radiance, 20.7108, 10.8546, 2.77115);
    assert_eq!((d.camera.near_clip, d.camera.far_clip, d.integrator.max_depth), (10.0, 2800.0, None));
    let Projection::Perspective { x_fov, .. } = d.camera.projection else { panic!() };
    assert!((x_fov.to_degrees() - 39.3077).abs() < 1e-9);
}
