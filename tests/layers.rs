//! The layers of the library hold: a file imports only from lower layers or from its own folder.

use std::fs;
use std::path::{Path, PathBuf};

/// Top-level modules from the bottom up. Modules of one line do not import each other, but for what `MAY` allows.
const LAYERS: &[&[&str]] = &[
    &["math"],
    &["image"],
    &["scene", "formats"],
    &["accel"],
    &["edge"],
    &["emission"],
    &["transport"],
    &["integrators"],
    &["report", "render"],
    &["cli"],
];
/// Readers produce descriptions, so `formats` sees `scene`.
const MAY: &[(&str, &str)] = &[("formats", "scene"), ("report", "render")];

fn rust_files(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("source folder").map(|e| e.expect("entry").path()) {
        if entry.is_dir() {
            rust_files(&entry, out);
        } else if entry.extension().is_some_and(|e| e == "rs") {
            out.push(entry);
        }
    }
}

fn layer(module: &str) -> Option<usize> {
    LAYERS.iter().position(|l| l.contains(&module))
}

/// Modules named behind `crate::` in a line of code.
fn named(line: &str) -> Vec<&str> {
    let code = line.split("//").next().unwrap_or_default();
    code.match_indices("crate::")
        .map(|(at, m)| {
            let rest = &code[at + m.len()..];
            &rest[..rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len())]
        })
        .collect()
}

fn violations(file: &str, text: &str) -> Vec<String> {
    let own = file.split(['/', '.']).next().unwrap_or_default();
    let Some(own_layer) = layer(own) else {
        let free = ["lib", "main"].contains(&own);
        return if free { vec![] } else { vec![format!("{file}: module `{own}` is in no layer")] };
    };
    let mut out = Vec::new();
    for (n, line) in text.lines().enumerate() {
        for module in named(line) {
            let Some(other) = layer(module) else {
                out.push(format!("{file}:{}: `crate::{module}` is in no layer", n + 1));
                continue;
            };
            if module != own && other >= own_layer && !MAY.contains(&(own, module)) {
                out.push(format!("{file}:{}: `{own}` imports `{module}`, which is not below it", n + 1));
            }
        }
    }
    out
}

#[test]
fn imports_point_downwards() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    assert!(files.len() > 20, "the source folder was found");
    let mut bad = Vec::new();
    for path in files {
        let name = path.strip_prefix(&src).expect("below src").to_string_lossy().replace('\\', "/");
        let text = fs::read_to_string(&path).expect("source file");
        bad.extend(violations(&name, &text));
    }
    assert!(bad.is_empty(), "\n{}", bad.join("\n"));
}

#[test]
fn a_wrong_import_is_seen() {
    assert_eq!(violations("math/warp.rs", "use crate::scene::Scene;").len(), 1);
    assert_eq!(violations("scene/build.rs", "use crate::formats::load;").len(), 1);
    assert!(violations("formats/obj.rs", "use crate::scene::mesh::MeshData; // crate::cli").is_empty());
    assert_eq!(violations("helpers/mod.rs", "").len(), 1);
}
