//! Integrators: what the file says about light transport, and the parameters of Mitsuba 0.6's photon mappers.
//!
//! Which integrator runs is decided elsewhere; here all names are welcome and give depth, roulette, hidden emitters.

use super::props::Props;
use super::report::{Checked, Report};
use super::tree::{ObjectId, Tree};
use crate::formats::diagnostics::suggestion;
use crate::scene::description::{IntegratorDesc, PhotonDesc};

/// Integrators whose photon parameters are honoured.
const PHOTON: [&str; 5] = ["photonmapper", "ppm", "sppm", "photon", "many-light"];
/// Other integrators that are seen in files.
const OTHERS: [&str; 22] = [
    "path",
    "direct",
    "volpath",
    "volpathmis",
    "volpath_simple",
    "prb",
    "ptracer",
    "particle",
    "depth",
    "bdpt",
    "vpl",
    "vcm",
    "upm",
    "ptracer",
    "mlt",
    "pssmlt",
    "erpt",
    "guided_path",
    "ao",
    "field",
    "multichannel",
    "dppm",
];
/// Integrators around another one, which counts.
const WRAPPERS: [&str; 6] = ["aov", "adaptive", "irrcache", "moment", "stokes", "motion"];

/// Most passes, samples and the like.
const MANY: i64 = u32::MAX as i64 - 1;

/// Reads an integrator; wrappers give the one inside.
pub fn read(tree: &Tree, id: ObjectId, report: &Report, depth: usize) -> Checked<IntegratorDesc> {
    let props = Props::new(tree, id, report);
    let name = props.object.kind.trim().to_lowercase();
    if WRAPPERS.contains(&name.as_str()) {
        let nested = props.nested("integrator");
        if let Some(&(_, loc)) = nested.get(1) {
            report.warn(loc, format!("integrator type \"{name}\" holds several integrators; the first one counts"));
        }
        if depth > 8 {
            return Err(report.error(props.object.loc, "integrators are nested too deep"));
        }
        if name != "aov" && name != "moment" {
            report.unknown(
                props.object.kind_loc,
                format!("integrator type \"{name}\" is not supported; skipped"),
                None,
            );
        }
        return match nested.first() {
            Some(&(inner, _)) => read(tree, inner, report, depth + 1),
            None => Ok(IntegratorDesc::default()),
        };
    }
    let photon = PHOTON.contains(&name.as_str()) || name == "dppm";
    if !photon && !OTHERS.contains(&name.as_str()) {
        let near = suggestion(&name, OTHERS.into_iter().chain(PHOTON).chain(WRAPPERS));
        report.unknown(props.object.kind_loc, format!("unknown integrator type \"{name}\""), near);
    }
    let max_depth = match props.integer("max_depth")? {
        None if name == "direct" => Some(2),
        None | Some(-1) => None,
        Some(v) if v <= 0 || v > MANY => {
            return Err(props.error("max_depth", "max_depth must be -1 (unbounded) or at least 1"));
        }
        Some(v) => Some(v as u32),
    };
    let timeout = match props.float("timeout")? {
        Some(v) if v == 0.0 || (v < 0.0 && v != -1.0) => {
            return Err(props.error("timeout", "timeout must be -1 (none) or above 0 seconds"));
        }
        other => other.filter(|v| *v > 0.0),
    };
    let description = IntegratorDesc {
        max_depth,
        rr_depth: props.count("rr_depth", 1, MANY)?.map(|v| v as u32),
        hide_emitters: props.boolean_or("hide_emitters", false)?,
        timeout,
        photon: if photon { self::photon(&props)? } else { PhotonDesc::default() },
        name,
    };
    props.ignore(&["strict_normals", "samples_per_pass", "block_size", "rr_prob", "light_image", "sample_direct"]);
    if description.name == "direct" {
        props.ignore(&["shading_samples", "emitter_samples", "bsdf_samples", "luminaire_samples"]);
    }
    props.finish();
    Ok(description)
}

/// The parameters of photon integrators.
fn photon(props: &Props) -> Checked<PhotonDesc> {
    let small = |name: &'static str, low: i64| Ok(props.count(name, low, MANY)?.map(|v| v as u32));
    let photons = |name: &'static str| Ok(props.count(name, 0, 1 << 48)?.map(|v| v as u64));
    let radius = |name: &'static str| {
        let value = props.float(name)?;
        props.check(value.is_none_or(|v| v >= 0.0), name, "must not be negative")?;
        Ok(value)
    };
    let alpha = props.float("alpha")?;
    props.check(alpha.is_none_or(|a| a > 0.0 && a <= 1.0), "alpha", "must lie between 0 and 1")?;
    let unlimited = |name: &'static str| match props.integer(name)? {
        Some(-1) | None => Ok(None),
        Some(_) => small(name, 1),
    };
    let global_lookup = small("global_lookup_size", 1)?;
    let description = PhotonDesc {
        photon_count: photons("photon_count")?.or(photons("global_photons")?),
        caustic_photons: photons("caustic_photons")?,
        initial_radius: radius("initial_radius")?,
        global_lookup_radius: radius("global_lookup_radius")?,
        caustic_lookup_radius: radius("caustic_lookup_radius")?,
        lookup_size: small("lookup_size", 1)?.or(global_lookup),
        alpha,
        max_passes: unlimited("max_passes")?,
        step_snapshot: unlimited("step_snapshot")?,
        direct_samples: small("direct_samples", 0)?,
        max_specular_depth: small("max_specular_depth", 0)?,
    };
    // Volumes, and work-arounds of the old program that have no counterpart here.
    props.ignore(&["volume_photons", "volume_lookup_size", "volume_lookup_radius", "caustic_lookup_size"]);
    props.ignore(&["glossy_samples", "gather_locally", "auto_cancel_gathering", "granularity", "k_nn", "kNN"]);
    props.ignore(&["dual_buffer", "dualBuffer", "indirect_samples"]);
    Ok(description)
}
