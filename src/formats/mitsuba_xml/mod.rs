//! Mitsuba XML scenes: versions 0.4 to 0.6 by upgrade rules, and 3.x as written.
//!
//! The way of a file: `parser` makes a located object tree (`tree`) of the XML and its includes; one module per
//! family turns objects into the parts of a [`Description`], reading properties through `props`, which reports what
//! nobody read; `builder` collects the parts, and last of all the mesh and picture files are read in parallel.
//!
//! Not handled media, spectral and polarised modes; what a plugin does not support is said in a message

mod attrs;
mod bsdf;
mod builder;
mod emitter;
mod files;
mod film;
mod integrator;
mod legacy_bsdf;
mod optics;
mod params;
mod parser;
mod props;
mod report;
mod sensor;
mod shape;
mod texture;
mod transform;
mod tree;
mod upgrade;
mod values;

#[cfg(test)]
mod tests;

use super::diagnostics::{Diagnostic, Diagnostics, Severity, suggestion};
use super::{LoadOptions, Loaded};
use crate::scene::Description;
use crate::scene::description::IntegratorDesc;
use builder::Builder;
use report::{Checked, Report, Reported};
use std::collections::BTreeSet;
use std::path::Path;
use tree::{Target, Tree};

/// Reads a scene with its meshes and pictures.
///
/// # Errors
/// All problems found that make the file unusable, each with its position.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, Diagnostics> {
    match files::read_text(path) {
        Ok(text) => load_text(path, &text, options),
        Err(message) => {
            let message = format!("cannot read the scene: {message}");
            let diagnostic = Diagnostic::at(path.to_path_buf(), "", 0, 1, Severity::Error, message);
            Err(Diagnostics(vec![diagnostic]))
        }
    }
}

/// Reads a scene whose text is at hand; `path` is what other files are looked up against.
///
/// # Errors
/// As [`load`].
pub fn load_text(path: &Path, text: &str, options: &LoadOptions) -> Result<Loaded, Diagnostics> {
    let report = Report::new(options.strict);
    let tree = parser::parse(path, text.into(), &options.defines, &report);
    let description = tree.and_then(|tree| {
        // A broken tree is not built: its gaps would only make more errors.
        check_references(&tree, &report);
        if report.failed() { Err(Reported) } else { build(&tree, &report) }
    });
    let warnings = report.finish()?;
    match description {
        Ok(description) => Ok(Loaded { description, warnings }),
        Err(Reported) => unreachable_error(path, text),
    }
}

/// A failure without a message would be a mistake of this reader; it is reported like one, not by a panic.
fn unreachable_error(path: &Path, text: &str) -> Result<Loaded, Diagnostics> {
    let message = "the scene cannot be read (and the reader does not know why)".to_owned();
    let diagnostic = Diagnostic::at(path.to_path_buf(), text, 0, 1, Severity::Error, message);
    Err(Diagnostics(vec![diagnostic]))
}

/// Reports references to nothing.
fn check_references(tree: &Tree, report: &Report) {
    for (alias, (id, loc)) in &tree.aliases {
        if tree.lookup(alias).is_none() {
            let near = suggestion(id, tree.ids.keys().map(String::as_str));
            report.error_help(*loc, format!("there is no object with the id \"{id}\""), near);
        }
    }
    for child in tree.objects.iter().flat_map(|o| &o.children) {
        if let Target::Ref(id) = &child.target
            && tree.lookup(id).is_none()
        {
            let known = tree.ids.keys().chain(tree.aliases.keys()).map(String::as_str);
            let near = suggestion(id, known);
            report.error_help(child.loc, format!("there is no object with the id \"{id}\""), near);
        }
    }
}

/// Turns the tree into a scene.
fn build(tree: &Tree, report: &Report) -> Checked<Description> {
    let mut b = Builder::new(tree, report);
    let scene = b.props(0);
    let mut integrator = None;
    for (id, loc) in scene.nested("integrator") {
        if integrator.is_some() {
            report.warn(loc, "the scene has several integrators; the first one counts");
            continue;
        }
        integrator = Some(integrator::read(tree, id, report, 0));
    }
    let mut sensor = None;
    for (id, loc) in scene.nested("sensor") {
        if sensor.is_some() {
            report.warn(loc, "the scene has several sensors; the first one counts");
            continue;
        }
        sensor = Some(sensor::read(tree, id, report));
    }
    for (number, (id, _)) in scene.nested("shape").into_iter().enumerate() {
        let _ = shape::read(&mut b, id, number + 1);
        if report.flooded() {
            return Err(Reported);
        }
    }
    let children = tree.objects.iter().flat_map(|o| &o.children);
    let referenced: BTreeSet<_> = children
        .filter_map(|c| match &c.target {
            Target::Ref(id) => tree.lookup(id),
            Target::Object(_) => None,
        })
        .collect();
    for (id, _) in scene.nested("emitter") {
        // An area light may be written at the top and referred to by shapes.
        if tree.objects[id].kind != "area" || !referenced.contains(&id) {
            let _ = emitter::read(&mut b, id);
        }
    }
    // Materials and textures at the top are there to be referred to; so are parts of sensors, if they have an id.
    let _ = (scene.nested("bsdf"), scene.nested("texture"), scene.nested("spectrum"));
    for tag in ["film", "sampler", "rfilter"] {
        for (id, loc) in scene.nested(tag) {
            if !referenced.contains(&id) {
                report.unknown(loc, format!("<{tag}> has no use here; nest it in the sensor"), None);
            }
        }
    }
    scene.finish();
    let integrator = integrator.unwrap_or_else(|| Ok(IntegratorDesc::default()));
    let Some(sensor) = sensor else {
        return Err(report.error(scene.object.loc, "the scene has no sensor"));
    };
    let (integrator, sensor) = (integrator?, sensor?);
    if report.failed() {
        return Err(Reported);
    }
    let images = b.read_files()?;
    Ok(Description {
        camera: sensor.camera,
        film: sensor.film,
        integrator,
        sample_count: sensor.sample_count,
        seed: sensor.seed,
        images,
        textures: b.textures,
        materials: b.materials,
        shapes: b.shapes,
        lights: b.lights,
    })
}
