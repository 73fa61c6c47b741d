//! Every public scene and every reference scene loads.
//!
//! They are data beside the project; without them the test says so and passes.

use crate::formats::{LoadOptions, load};
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
                // Files of the current version have nothing to warn of.
                let text = std::fs::read_to_string(&file).unwrap();
                assert!(!text.contains("version=\"3.") || loaded.warnings.is_empty());
            }
            Err(errors) => {
                println!("{errors}");
                assert!(broken, "{} does not load", file.display());
            }
        }
    }
}
