//! Sensors: `perspective`, `thinlens`, `orthographic`, with their sampler.
//!
//! Source      field of view rules as in Mitsuba 3: `fov` is on `fov_axis` (x by default) of the full film;
//!             `focal_length` is the 35 mm equivalent on the diagonal
//! Not handled motion, shutter, distortion; other sensors are errors

use super::film;
use super::props::Props;
use super::report::{Checked, Report};
use super::tree::{ObjectId, Tree, Value};
use super::values;
use crate::formats::diagnostics::suggestion;
use crate::math::DMat4;
use crate::scene::description::{CameraDesc, FilmDesc, Projection};

const SENSORS: [&str; 3] = ["perspective", "thinlens", "orthographic"];

/// Everything a `<sensor>` says.
pub struct Sensor {
    /// Camera.
    pub camera: CameraDesc,
    /// Film.
    pub film: FilmDesc,
    /// Samples per pixel, if said.
    pub sample_count: Option<u32>,
    /// Seed, 0 if not said.
    pub seed: u64,
}

/// Reads a sensor with its film and sampler.
pub fn read(tree: &Tree, id: ObjectId, report: &Report) -> Checked<Sensor> {
    let props = Props::new(tree, id, report);
    let kind = props.object.kind.as_str();
    if !SENSORS.contains(&kind) {
        let help = suggestion(kind, SENSORS).or(Some(format!("there are {}", SENSORS.join(", "))));
        return Err(report.error_help(props.object.kind_loc, format!("unknown sensor type \"{kind}\""), help));
    }
    let film = match props.nested_count("film", 0, 1)?.first() {
        Some(&(film, _)) => film::read(tree, film, report),
        None => Ok(film::default()),
    };
    let sampler = props.nested_count("sampler", 0, 1)?.first().map(|&(s, _)| sampler(tree, s, report));
    let film = film?;
    let near_clip = props.float_or("near_clip", 0.01)?;
    let far_clip = props.float_or("far_clip", 10_000.0)?;
    props.check(near_clip > 0.0, "near_clip", "must be above 0")?;
    props.check(far_clip > near_clip, "far_clip", "must be above near_clip")?;
    let to_world = props.to_world()?;
    let projection = match kind {
        "orthographic" => Projection::Orthographic,
        _ => perspective(&props, &film, kind == "thinlens", far_clip)?,
    };
    if kind == "orthographic" {
        let flat = to_world.determinant().abs() < 1e-30;
        props.check(!flat, "to_world", "of the sensor cannot be inverted")?;
    } else if !rigid(to_world) {
        let help = Some("use fov to zoom; scale x=-1 to mirror is fine".into());
        let message = "to_world of the sensor must not scale or shear";
        return Err(report.error_help(props.loc("to_world"), message, help));
    }
    props.ignore(&["focus_distance", "shutter_open", "shutter_close", "kc", "srf"]);
    props.finish();
    let (sample_count, seed) = sampler.unwrap_or(Ok((None, 0)))?;
    let camera = CameraDesc { to_world, projection, near_clip, far_clip };
    Ok(Sensor { camera, film, sample_count, seed })
}

fn perspective(props: &Props, film: &FilmDesc, lens: bool, far_clip: f64) -> Checked<Projection> {
    let aspect = f64::from(film.width) / f64::from(film.height);
    let x_fov = horizontal_fov(props, aspect)?;
    let offset = ["principal_point_offset_x", "principal_point_offset_y"].map(|name| props.float_or(name, 0.0));
    let principal_point_offset = [offset[0]?, offset[1]?];
    let (mut aperture_radius, mut focus_distance) = (0.0, far_clip);
    if lens {
        let Some(radius) = props.float("aperture_radius")? else {
            return Err(props.error("", "sensor type \"thinlens\" needs the property \"aperture_radius\""));
        };
        props.check(radius >= 0.0, "aperture_radius", "must not be negative")?;
        aperture_radius = radius;
        // The documentation says 0, the program takes the far clip distance.
        focus_distance = props.float_or("focus_distance", far_clip)?;
        props.check(focus_distance > 0.0, "focus_distance", "must be above 0")?;
    }
    Ok(Projection::Perspective { x_fov, principal_point_offset, aperture_radius, focus_distance })
}

/// Horizontal field of view of the full film, radians.
fn horizontal_fov(props: &Props, aspect: f64) -> Checked<f64> {
    let axis = props.choice("fov_axis", &["x", "y", "diagonal", "smaller", "larger"])?;
    let fov = props.float("fov")?;
    let focal = props.get("focal_length");
    let (fov, axis) = match (fov, focal) {
        (Some(_), Some(_)) => return Err(props.error("focal_length", "give either fov or focal_length, not both")),
        (Some(degrees), None) => {
            let name = "fov";
            props.check(degrees > 0.0 && degrees < 180.0, name, "must lie between 0 and 180 degrees")?;
            (degrees.to_radians(), axis)
        }
        (None, focal) => {
            let mm = match focal.map(|p| &p.value) {
                Some(Value::String(text)) => {
                    let text = text.trim();
                    let number = values::number(text.strip_suffix("mm").unwrap_or(text));
                    number.map_err(|m| props.error("focal_length", m))?
                }
                _ => props.float_or("focal_length", 50.0)?,
            };
            props.check(mm > 1e-3, "focal_length", "must be above 0")?;
            (2.0 * (36f64.hypot(24.0) / (2.0 * mm)).atan(), "diagonal")
        }
    };
    let half = (0.5 * fov).tan();
    let from_y = 2.0 * (half * aspect).atan();
    Ok(match axis {
        "x" => fov,
        "y" => from_y,
        "smaller" if aspect > 1.0 => from_y,
        "larger" if aspect < 1.0 => from_y,
        "diagonal" => 2.0 * (half / (1.0 + 1.0 / (aspect * aspect)).sqrt()).atan(),
        _ => fov,
    })
}

/// Whether a transform keeps lengths and angles (mirroring is allowed).
fn rigid(m: DMat4) -> bool {
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(|a| a.truncate());
    (0..3).all(|i| {
        (0..=i).all(|j| {
            let expected = f64::from(u8::from(i == j));
            (axes[i].dot(axes[j]) - expected).abs() < 1e-3
        })
    })
}

/// Samples per pixel and seed of any sampler.
fn sampler(tree: &Tree, id: ObjectId, report: &Report) -> Checked<(Option<u32>, u64)> {
    let props = Props::new(tree, id, report);
    let count = props.count("sample_count", 1, 1 << 30)?.map(|v| v as u32);
    let seed = props.count("seed", 0, i64::MAX)?.unwrap_or(0) as u64;
    props.ignore(&["scramble", "dimension", "jitter", "wavefront_size", "samples_per_wavefront"]);
    props.finish();
    Ok((count, seed))
}
