//! Numbers, lists and colours in attribute values. Errors are messages without position.

use super::tree::Spectrum;
use crate::formats::spectrum::{push_sample, srgb_to_linear};
use crate::math::DVec3;

/// Largest magnitude of a number: single precision must hold it, and its products a little longer.
const LARGEST: f64 = 1e37;

/// A finite number that single precision can hold, with nothing after it.
pub fn number(text: &str) -> Result<f64, String> {
    let trimmed = text.trim();
    match trimmed.parse::<f64>() {
        Ok(v) if v.is_nan() => Err("NaN is no number to render with".into()),
        Ok(v) if v.abs() > LARGEST => Err(format!("{trimmed} is too large")),
        Ok(v) => Ok(v),
        Err(_) => Err(format!("expected a number, got \"{}\"", brief(text))),
    }
}

/// A 64-bit integer with nothing after it.
pub fn integer(text: &str) -> Result<i64, String> {
    let trimmed = text.trim();
    trimmed.parse().map_err(|_| format!("expected an integer, got \"{}\"", brief(text)))
}

/// `true` or `false` in any case.
pub fn boolean(text: &str) -> Result<bool, String> {
    match text.trim().to_ascii_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        _ => Err(format!("expected \"true\" or \"false\", got \"{}\"", brief(text))),
    }
}

/// The words of a list separated by commas and blanks.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty())
}

/// Numbers separated by commas and blanks.
pub fn numbers(text: &str) -> Result<Vec<f64>, String> {
    words(text).map(number).collect()
}

/// Three numbers, or one for all three.
pub fn vector(text: &str) -> Result<DVec3, String> {
    match numbers(text)?[..] {
        [v] => Ok(DVec3::splat(v)),
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        ref list => Err(format!("expected 3 numbers (or 1), got {}", list.len())),
    }
}

/// One or three numbers, or `#rrggbb` (8 bits each, sRGB curve decoded).
pub fn rgb(text: &str) -> Result<[f64; 3], String> {
    let trimmed = text.trim();
    if let Some(hex) = trimmed.strip_prefix('#') {
        let digits = hex.len() == 6 && hex.bytes().all(|b| b.is_ascii_hexdigit());
        let bits = u32::from_str_radix(hex, 16).ok().filter(|_| digits);
        let bits = bits.ok_or_else(|| format!("expected a colour like #ff8000, got \"{}\"", brief(text)))?;
        return Ok([16, 8, 0].map(|shift| srgb_to_linear(f64::from(bits >> shift & 255) / 255.0)));
    }
    match numbers(text)?[..] {
        [v] => Ok([v; 3]),
        [r, g, b] => Ok([r, g, b]),
        ref list => Err(format!("expected 3 numbers (or 1) for a colour, got {}", list.len())),
    }
}

/// As [`rgb`], with the sRGB curve decoded in any case (the legacy tag `srgb`).
pub fn srgb(text: &str) -> Result<[f64; 3], String> {
    let value = rgb(text)?;
    Ok(if text.trim().starts_with('#') { value } else { value.map(|v| srgb_to_linear(v.max(0.0))) })
}

/// Value of `<spectrum value="...">`: a spectrum, or a legacy colour triple.
pub fn spectrum(text: &str) -> Result<Result<Spectrum, [f64; 3]>, String> {
    if text.contains(':') {
        let mut list = Vec::new();
        for pair in words(text) {
            let (nm, value) = pair
                .split_once(':')
                .ok_or_else(|| format!("expected \"wavelength:value\", got \"{}\"", brief(pair)))?;
            push_sample(&mut list, number(nm)?, number(value)?)?;
        }
        return Ok(Ok(Spectrum::List(list)));
    }
    if text.trim().starts_with('#') {
        return rgb(text).map(Err);
    }
    match numbers(text)?[..] {
        [v] => Ok(Ok(Spectrum::Uniform(v))),
        [r, g, b] => Ok(Err([r, g, b])),
        ref list => Err(format!("expected one number or \"wavelength:value\" pairs, got {} numbers", list.len())),
    }
}

/// The text if it is short, else its beginning.
pub fn brief(text: &str) -> String {
    let mut brief: String = text.chars().take(40).collect();
    if brief.len() < text.len() {
        brief.push_str("...");
    }
    brief
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_finite_and_whole() {
        assert_eq!(number(" -1.5e-3 ").unwrap(), -1.5e-3);
        for bad in ["nan", "inf", "-inf", "1e400", "1e39", "5f", "", "0x10", "1,2"] {
            assert!(number(bad).is_err(), "{bad}");
        }
        assert!(integer("3.0").is_err() && integer("7 apples").is_err());
        assert_eq!(integer(" 7 "), Ok(7));
        assert_eq!(boolean("True"), Ok(true));
        assert!(boolean("yes").is_err());
    }

    #[test]
    fn lists_take_commas_and_blanks() {
        assert_eq!(numbers("1, 2,3  4\n5").unwrap(), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(vector("2").unwrap(), DVec3::splat(2.0));
        assert!(vector("1 2").is_err());
    }

    #[test]
    fn colours() {
        assert_eq!(rgb("0.5").unwrap(), [0.5; 3]);
        let [r, g, b] = rgb("#ff8000").unwrap();
        assert!(r == 1.0 && (g - 0.215_861).abs() < 1e-5 && b == 0.0);
        assert!(rgb("#ff80").is_err() && rgb("#+f8000").is_err() && rgb("#ééé").is_err());
        assert_eq!(spectrum("0.25"), Ok(Ok(Spectrum::Uniform(0.25))));
        assert_eq!(spectrum("1, 2, 3"), Ok(Err([1.0, 2.0, 3.0])));
        assert_eq!(spectrum("400:1, 500:2"), Ok(Ok(Spectrum::List(vec![(400.0, 1.0), (500.0, 2.0)]))));
        assert!(spectrum("500:1 400:2").is_err() && spectrum("400:1 500").is_err() && spectrum("").is_err());
    }
}
