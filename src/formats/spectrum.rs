//! Colours from spectra: what a wavelength list in a scene file means to an RGB renderer.
//!
//! Source      CIE 1931 2 degree observer; XYZ to linear sRGB by IEC 61966-2-1 (tables in `cie.rs`)
//! Computes    rgb = M * integral of s(w) (x, y, z)(w) dw / integral of y(w) dw, midpoint-like sums at 1000 wavelengths
//!             from 360 to 830 nm, s linear between its samples and zero outside of them; all but emission is seen under
//!             D65 of luminance 1. These are the conventions of Mitsuba 3 in RGB mode, down to the number of steps.
//! Not handled fluorescence, spectral rendering, binary `.spb` files

use super::cie;
use crate::math::Rgb;

/// What a colour is used for; decides whether D65 is applied and what range is legal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Usage {
    /// A factor on light: seen under D65, clamped to 0..1.
    Reflectance,
    /// Emitted light: no illuminant, not below 0.
    Emission,
    /// An optical constant (eta, k): under D65 as well (measured), any value.
    Constant,
}

/// Number of wavelengths of the sum.
const STEPS: usize = 1000;

/// Integral of y over the wavelengths, nm.
const Y_INTEGRAL: f64 = 106.857;

/// Linear interpolation in a 5 nm table.
fn table<const N: usize>(values: &[[f64; N]; 95], nm: f64) -> [f64; N] {
    let t = ((nm - cie::FIRST) / cie::STEP).clamp(0.0, 94.0);
    let i = (t as usize).min(93);
    let f = t - i as f64;
    std::array::from_fn(|c| values[i][c] * (1.0 - f) + values[i + 1][c] * f)
}

/// The colour matching functions at a wavelength, scaled so that y integrates to 1.
fn matching(nm: f64) -> [f64; 3] {
    table(&cie::XYZ, nm).map(|v| v / Y_INTEGRAL)
}

/// D65 at 560 nm where its luminance is 1: Mitsuba's constant, which sets white to 0.9989, so that both agree.
const D65_AT_560: f64 = 1.010_127_3;

/// D65 at a wavelength, scaled by [`D65_AT_560`].
fn d65(nm: f64) -> f64 {
    let t = ((nm - cie::FIRST) / cie::STEP).clamp(0.0, 94.0);
    let i = (t as usize).min(93);
    let f = t - i as f64;
    (cie::D65[i] * (1.0 - f) + cie::D65[i + 1] * f) * D65_AT_560 / 100.0
}

/// CIE XYZ to linear sRGB.
pub fn xyz_to_rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_479 * x - 1.537_150 * y - 0.498_535 * z,
        -0.969_256 * x + 1.875_991 * y + 0.041_556 * z,
        0.055_648 * x - 0.204_043 * y + 1.057_311 * z,
    ]
}

/// Integrates a spectrum given by a function of the wavelength.
fn integrate(spectrum: impl Fn(f64) -> f64, usage: Usage) -> [f64; 3] {
    let range = cie::LAST - cie::FIRST;
    let mut xyz = [0.0; 3];
    for i in 0..STEPS {
        let nm = cie::FIRST + range * i as f64 / (STEPS - 1) as f64;
        let mut value = spectrum(nm);
        if value == 0.0 {
            continue;
        }
        if usage != Usage::Emission {
            value *= d65(nm);
        }
        let m = matching(nm);
        for c in 0..3 {
            xyz[c] += value * m[c];
        }
    }
    xyz_to_rgb(xyz.map(|v| v * range / (STEPS - 1) as f64))
}

/// Brings a colour into the range its use allows.
fn clamp(rgb: [f64; 3], usage: Usage) -> [f64; 3] {
    rgb.map(|v| match usage {
        Usage::Reflectance => v.clamp(0.0, 1.0),
        Usage::Emission => v.max(0.0),
        Usage::Constant => v,
    })
}

/// Colour of a list of (wavelength in nm, value), wavelengths increasing, linear in between and zero outside.
pub fn list_to_rgb(list: &[(f64, f64)], usage: Usage) -> [f64; 3] {
    let rgb = integrate(
        |nm| {
            let after = list.partition_point(|&(w, _)| w < nm);
            match (after.checked_sub(1).and_then(|i| list.get(i)), list.get(after)) {
                (Some(&(w0, v0)), Some(&(w1, v1))) => v0 + (v1 - v0) * ((nm - w0) / (w1 - w0)),
                (None, Some(&(w, v))) if w == nm => v,
                _ => 0.0,
            }
        },
        usage,
    );
    clamp(rgb, usage)
}

/// Colour of a spectrum that has one value at all wavelengths. As emission that is equal-energy white (XYZ 1,1,1),
/// which is no grey in sRGB.
pub fn constant_to_rgb(value: f64, usage: Usage) -> [f64; 3] {
    match usage {
        Usage::Reflectance | Usage::Constant => [value; 3],
        Usage::Emission => xyz_to_rgb([value; 3]).map(|v| v.max(0.0)),
    }
}

/// Decodes one sRGB component (0 to 1) to linear.
pub fn srgb_to_linear(v: f64) -> f64 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Single precision triple of the renderer.
pub fn to_rgb(c: [f64; 3]) -> Rgb {
    Rgb::new(c[0] as f32, c[1] as f32, c[2] as f32)
}

/// Reads the lines `nm value` of an `.spd` text; `#` starts a comment. The error is a message without position.
pub fn parse_spd(text: &str) -> Result<Vec<(f64, f64)>, String> {
    let mut list: Vec<(f64, f64)> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("").trim();
        if line.is_empty() {
            continue;
        }
        let numbers: Vec<f64> = line
            .split(|c: char| c.is_whitespace() || c == ',' || c == ':')
            .filter(|t| !t.is_empty())
            .map_while(|t| t.parse().ok())
            .collect();
        let [nm, value] = numbers[..] else {
            return Err(format!("line {}: expected \"wavelength value\"", number + 1));
        };
        push_sample(&mut list, nm, value).map_err(|m| format!("line {}: {m}", number + 1))?;
    }
    if list.len() < 2 {
        return Err("fewer than two wavelengths".into());
    }
    Ok(list)
}

/// Appends a sample to a list, which must stay finite and increasing.
pub fn push_sample(list: &mut Vec<(f64, f64)>, nm: f64, value: f64) -> Result<(), String> {
    if !nm.is_finite() || !value.is_finite() || value.abs() > 1e37 {
        return Err("a number is not finite or too large".into());
    }
    if list.last().is_some_and(|&(last, _)| nm <= last) {
        return Err(format!("wavelengths must increase, but {nm} follows {}", list[list.len() - 1].0));
    }
    list.push((nm, value));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f64; 3], b: [f64; 3], tolerance: f64) {
        for c in 0..3 {
            assert!((a[c] - b[c]).abs() <= tolerance * b[c].abs(), "{a:?} is not {b:?}");
        }
    }

    /// Values that Mitsuba 3.9.1 (`spectrum_list_to_srgb`) gives for the same lists.
    #[test]
    fn lists_agree_with_mitsuba() {
        let half = [(400.0, 0.5), (700.0, 0.5)];
        close(list_to_rgb(&half, Usage::Reflectance), [0.497671, 0.499878, 0.497455], 2e-4);
        close(list_to_rgb(&half, Usage::Emission), [0.599846, 0.474761, 0.451722], 2e-4);
        let lamp = [(400.0, 0.0), (500.0, 8.0), (600.0, 15.6), (700.0, 18.4)];
        close(list_to_rgb(&lamp, Usage::Emission), [20.7108, 10.8546, 2.77115], 2e-4);
        let light = [(400.0, 0.78), (500.0, 0.78), (600.0, 0.78), (700.0, 0.78)];
        close(list_to_rgb(&light, Usage::Reflectance), [0.776368, 0.779809, 0.776029], 2e-4);
        let constant = [(400.0, 1.0), (700.0, 2.0)];
        close(list_to_rgb(&constant, Usage::Constant), [1.79949, 1.47621, 1.13095], 2e-4);
        close(list_to_rgb(&constant, Usage::Emission), [2.14, 1.40424, 1.01714], 2e-4);
        // A deliberately different illuminant must not pass: the tolerance is meaningful.
        let wrong = list_to_rgb(&half, Usage::Emission);
        assert!((wrong[0] - 0.497671).abs() > 0.05);
    }

    #[test]
    fn normalisation() {
        let integral: f64 = cie::XYZ.iter().map(|v| v[1]).sum::<f64>() * cie::STEP;
        assert!((integral / Y_INTEGRAL - 1.0).abs() < 1e-5);
        close(list_to_rgb(&[(300.0, 1.0), (900.0, 1.0)], Usage::Reflectance), [0.99899, 0.99887, 0.99880], 1e-4);
    }

    #[test]
    fn constant_spectrum_as_emission_is_no_grey() {
        close(constant_to_rgb(1.0, Usage::Emission), [1.2048, 0.9483, 0.9089], 1e-3);
        assert_eq!(constant_to_rgb(0.3, Usage::Reflectance), [0.3; 3]);
    }

    #[test]
    fn one_nanometre_lines_are_clamped_to_their_use() {
        // Spectral green lies outside of sRGB: negative red.
        let line = [(519.0, 0.0), (520.0, 50.0), (521.0, 0.0)];
        assert!(list_to_rgb(&line, Usage::Constant)[0] < 0.0);
        assert_eq!(list_to_rgb(&line, Usage::Emission)[0], 0.0);
    }

    #[test]
    fn spd_text() {
        assert_eq!(parse_spd("# gold\n400 0.5\n\n500.0\t1 # x\n").unwrap(), [(400.0, 0.5), (500.0, 1.0)]);
        assert!(parse_spd("400 1\n300 1\n").unwrap_err().starts_with("line 2: wavelengths must increase"));
        assert!(parse_spd("400 1\n410 nan\n").unwrap_err().contains("line 2"));
        assert!(parse_spd("400 1 2\n").is_err());
        assert!(parse_spd("").is_err());
    }
}
