//! Files beside the picture that show how it is made: photons, records, where photons go.

use super::Failure;
use super::output::write_map;
use super::render::RenderArgs;
use crate::emission::DensityMap;
use crate::image::{Window, atomic};
use crate::integrators::Integrator;
use crate::math::Vec3;
use crate::transport::{cache_inspect, photon_ply};
use std::path::Path;

/// Pixels along a face of the map of an emission density.
const FACE: usize = 256;
/// Most lights in one picture of densities.
const MOST_LIGHTS: usize = 16;

/// Whether the files that are asked for can be written, and the integrator has what they show; before anything is rendered.
pub fn check(args: &RenderArgs, integrator: &dyn Integrator) -> Result<(), Failure> {
    let flags = &args.photon;
    let all = [&flags.photons_ply, &flags.cache_ply, &flags.emission_density];
    all.into_iter().flatten().try_for_each(|path| atomic::check(path))?;
    if let Some(path) = &flags.emission_density {
        super::output::check_name(path)?;
    }
    if flags.cache_ply.is_some() && integrator.cache().is_none() && !integrator.has_cache_points() {
        return Err("--cache-ply: this render uses neither an irradiance cache nor one of visibility".into());
    }
    Ok(())
}

/// Writes what is known before the first pass.
pub fn before(args: &RenderArgs, integrator: &dyn Integrator) -> Result<(), Failure> {
    if let Some(path) = &args.photon.photons_ply {
        let photons = integrator.photons();
        if photons.is_empty() {
            return Err(format!(
                "{}: no photon is stored: caustics need nearly specular surfaces, the global map --indirect photons",
                path.display()
            )
            .into());
        }
        write(path, |out| photon_ply::write_ply(out, &photons))?;
    }
    if let Some(path) = &args.photon.emission_density {
        let maps = integrator.emission_densities(FACE, MOST_LIGHTS);
        if maps.is_empty() {
            return Err(format!(
                "{}: no light has a density of its own: photons are emitted adaptively towards nearly specular surfaces only",
                path.display()
            )
            .into());
        }
        write_densities(path, &maps)?;
    }
    Ok(())
}

/// Writes what is known in the end.
pub fn after(args: &RenderArgs, integrator: &dyn Integrator) -> Result<(), Failure> {
    if let Some(path) = &args.photon.cache_ply {
        match (integrator.cache(), integrator.cache_points_ply()) {
            (Some(cache), _) => write(path, |out| cache_inspect::write_ply(out, cache.records()))?,
            (None, Some(points)) => atomic::write_file(path, &points)?,
            (None, None) => {}
        }
    }
    Ok(())
}

fn write(path: &Path, content: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> Result<(), Failure> {
    let mut bytes = Vec::new();
    content(&mut bytes)?;
    Ok(atomic::write_file(path, &bytes)?)
}

/// One light below the other. PNG: v / (1 + v), the density of uniform emission is middle grey.
fn write_densities(path: &Path, maps: &[DensityMap]) -> Result<(), Failure> {
    let width = maps.iter().map(|m| m.width).max().unwrap_or(0);
    let mut values = Vec::new();
    for map in maps {
        for row in map.values.chunks(map.width) {
            values.extend_from_slice(row);
            values.resize(values.len() + width - map.width, 0.0);
        }
    }
    let height = values.len() / width.max(1);
    let codes: Vec<Vec3> = values.iter().map(|v| Vec3::splat(v / (1.0 + v))).collect();
    let window = Window { x: 0, y: 0, width, height };
    write_map(path, window, (width, height), &codes, &[("density", values)])
}
