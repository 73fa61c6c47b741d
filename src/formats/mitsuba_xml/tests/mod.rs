//! Tests of the reader: language, quirks of each family, messages, robustness, public scenes.

mod fuzz;
mod language;
mod legacy;
mod plugins;
mod public;
mod shapes;

use crate::formats::{Diagnostics, LoadOptions, Loaded};
use crate::scene::Description;
use crate::scene::material::Material;
use std::path::Path;

/// Reads a scene from a text; `-D` definitions as given.
fn read_with(text: &str, options: &LoadOptions) -> Result<Loaded, Diagnostics> {
    super::load_text(Path::new("test.xml"), text, options)
}

/// A version 3 scene with a sensor and the given content.
fn scene(content: &str) -> String {
    format!("<scene version=\"3.0.0\">\n<sensor type=\"perspective\"/>\n{content}\n</scene>")
}

/// Reads a text that has to be right.
fn load(text: &str) -> Loaded {
    match read_with(text, &LoadOptions::default()) {
        Ok(loaded) => loaded,
        Err(errors) => panic!("{errors}\n{text}"),
    }
}

/// Reads a text that has to be right and free of warnings.
fn clean(text: &str) -> Description {
    let loaded = load(text);
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings.iter().map(|w| w.to_string()).collect::<Vec<_>>());
    loaded.description
}

/// The messages of a text that has to be wrong, first lines only.
fn errors(text: &str) -> Vec<String> {
    match read_with(text, &LoadOptions::default()) {
        Ok(_) => panic!("no error in {text}"),
        Err(errors) => errors.0.iter().map(|e| e.to_string().lines().next().unwrap_or("").to_owned()).collect(),
    }
}

/// The first error has to contain a text.
fn fails(text: &str, part: &str) {
    let errors = errors(text);
    assert!(errors[0].contains(part), "{errors:?} does not contain {part}");
}

/// The warnings of a text that has to be right, first lines only.
fn warnings(text: &str) -> Vec<String> {
    load(text).warnings.iter().map(|w| w.to_string().lines().next().unwrap_or("").to_owned()).collect()
}

/// The material of the only shape, whose bsdf is given.
fn material(bsdf: &str) -> Material {
    let d = clean(&scene(&format!("<shape type=\"sphere\">{bsdf}</shape>")));
    d.materials[d.shapes[0].material as usize].clone()
}
