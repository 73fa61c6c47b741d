//! Named refractive indices and metals.
//!
//! Source      indices: the list of the format's documentation; metals: eta and k as Mitsuba 3.9.1 gives them in RGB

use super::props::Props;
use super::report::Checked;
use super::tree::Value;
use crate::formats::diagnostics::suggestion;

/// Refractive indices by name.
const INDICES: [(&str, f64); 23] = [
    ("vacuum", 1.0),
    ("helium", 1.000_036),
    ("hydrogen", 1.000_132),
    ("air", 1.000_277),
    ("carbon dioxide", 1.000_45),
    ("water", 1.333),
    ("acetone", 1.36),
    ("ethanol", 1.361),
    ("carbon tetrachloride", 1.461),
    ("glycerol", 1.4729),
    ("benzene", 1.501),
    ("silicone oil", 1.520_45),
    ("bromine", 1.661),
    ("water ice", 1.31),
    ("fused quartz", 1.458),
    ("pyrex", 1.47),
    ("acrylic glass", 1.49),
    ("polypropylene", 1.49),
    ("bk7", 1.5046),
    ("sodium chloride", 1.544),
    ("amber", 1.55),
    ("pet", 1.575),
    ("diamond", 2.419),
];

/// Complex indices of metals (eta, k), linear RGB.
#[rustfmt::skip]
const METALS: [(&str, [f64; 3], [f64; 3]); 14] = [
    ("none", [0.0; 3], [1.0; 3]),
    ("Ag", [0.1553, 0.1167, 0.1384], [4.8284, 3.1222, 2.1469]),
    ("Al", [1.6575, 0.8804, 0.5212], [9.2238, 6.2695, 4.8370]),
    ("Au", [0.1430, 0.3753, 1.4420], [3.9830, 2.3856, 1.6034]),
    ("Cr", [4.3697, 2.9165, 1.6549], [5.2065, 4.2313, 3.7547]),
    ("Cu", [0.2010, 0.9237, 1.1022], [3.9133, 2.4530, 2.1421]),
    ("W", [4.3708, 3.3002, 2.9984], [3.5006, 2.6049, 2.2732]),
    ("Hg", [2.3989, 1.4400, 0.9096], [6.3276, 4.3719, 3.4218]),
    ("Ni_palik", [2.3673, 1.6634, 1.4671], [4.4988, 3.0502, 2.3454]),
    ("Be", [4.1850, 3.1850, 2.7841], [3.8355, 3.0101, 2.8690]),
    ("Ir", [3.0863, 2.0822, 1.6179], [5.5922, 4.0671, 3.2673]),
    ("Mo", [4.4840, 3.5251, 2.7763], [4.1114, 3.4208, 3.1506]),
    ("Rh", [2.5858, 1.8602, 1.5543], [6.7823, 4.7030, 3.9761]),
    ("TiN", [1.6484, 1.1505, 1.3798], [3.3683, 1.9435, 1.1021]),
];

/// A refractive index: a positive number or a name.
pub fn index(props: &Props, name: &'static str, default: &str) -> Checked<f64> {
    let text = match props.get(name).map(|p| &p.value) {
        Some(Value::String(text)) => text.as_str(),
        Some(_) => {
            let value = props.float_or(name, 1.0)?;
            props.check(value > 0.0 && value < 1e6, name, "must be above 0")?;
            return Ok(value);
        }
        None => default,
    };
    let lower = text.trim().to_lowercase();
    match INDICES.iter().find(|(n, _)| *n == lower) {
        Some(&(_, value)) => Ok(value),
        None => {
            let help = suggestion(&lower, INDICES.iter().map(|(n, _)| *n));
            let message = format!("no refractive index is known for \"{text}\"");
            Err(props.report.error_help(props.loc(name), message, help))
        }
    }
}

/// Interior over exterior index of a dielectric.
pub fn relative_index(props: &Props, interior: &str) -> Checked<f32> {
    Ok((index(props, "int_ior", interior)? / index(props, "ext_ior", "air")?) as f32)
}

/// eta and k of the property `material`.
pub fn metal(props: &Props, default: &str) -> Checked<([f64; 3], [f64; 3])> {
    let name = props.string("material")?.unwrap_or(default).trim();
    match METALS.iter().find(|(n, ..)| n.eq_ignore_ascii_case(name)) {
        Some(&(_, eta, k)) => Ok((eta, k)),
        None => {
            let near = suggestion(name, METALS.iter().map(|(n, ..)| *n));
            let names: Vec<&str> = METALS.iter().map(|(n, ..)| *n).collect();
            let help = near.unwrap_or_else(|| format!("known are {}; or give eta and k", names.join(", ")));
            let message = format!("no optical constants are known for \"{name}\"");
            Err(props.report.error_help(props.loc("material"), message, Some(help)))
        }
    }
}
