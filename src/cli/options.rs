//! Values on the command line: durations, counts, windows, definitions.

use crate::render::InvalidSample;
use crate::transport::photon_map::Kernel;
use std::time::Duration;

/// Longest time limit: a year is as good as none, and keeps the arithmetic of instants in range.
pub const LONGEST: Duration = Duration::from_secs(32_000_000);

/// `90`, `90s`, `500ms`, `2m`, `1.5h`; seconds where no unit is given.
pub fn duration(text: &str) -> Result<Duration, String> {
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let scale = match unit {
        "" | "s" => 1.0,
        "ms" => 1e-3,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("unknown unit \"{unit}\"; use ms, s, m or h")),
    };
    let value: f64 = number.trim().parse().map_err(|_| format!("\"{number}\" is no number"))?;
    let seconds = value * scale;
    if !(0.0..=LONGEST.as_secs_f64()).contains(&seconds) {
        return Err("must lie between 0 and one year".into());
    }
    Ok(Duration::from_secs_f64(seconds))
}

/// A count with an optional suffix: `250000`, `250K`, `1.5M`.
pub fn count(text: &str) -> Result<u64, String> {
    let (number, scale) = match text.char_indices().last() {
        Some((i, 'k' | 'K')) => (&text[..i], 1e3),
        Some((i, 'm' | 'M')) => (&text[..i], 1e6),
        Some((i, 'g' | 'G')) => (&text[..i], 1e9),
        _ => (text, 1.0),
    };
    if scale == 1.0
        && let Ok(n) = number.parse::<u64>()
    {
        return Ok(n);
    }
    let value: f64 = number.parse().map_err(|_| format!("\"{text}\" is no count"))?;
    let value = value * scale;
    if !(0.0..=1e15).contains(&value) || (value - value.round()).abs() > 1e-6 * value.max(1.0) {
        return Err(format!("\"{text}\" is no whole number between 0 and 1e15"));
    }
    Ok(value.round() as u64)
}

/// A count of at least one.
pub fn positive(text: &str) -> Result<u64, String> {
    match count(text)? {
        0 => Err("must be at least 1".into()),
        n => Ok(n),
    }
}

/// Photons of `knn` where no number is given.
const NEAREST: u32 = 50;

/// A kernel of photons: `ad`, `ad:1.4`, `knn`, `knn:200`, `fixed`, `fixed:0.1`, `progressive`, `progressive:0.1`.
pub fn kernel(text: &str) -> Result<Kernel, String> {
    let (name, number) = text.split_once(':').map_or((text, None), |(name, number)| (name, Some(number)));
    let scale = || match number.map(str::parse::<f32>) {
        None => Ok(1.0),
        Some(Ok(s @ 1e-3..=64.0)) => Ok(s),
        Some(_) => Err(format!("\"{}\" is no factor between 0.001 and 64", number.unwrap_or_default())),
    };
    let radius = || match number.map(str::parse::<f32>) {
        None => Ok(None),
        Some(Ok(r)) if r > 0.0 && r.is_finite() => Ok(Some(r)),
        Some(_) => Err(format!("\"{}\" is no radius above 0", number.unwrap_or_default())),
    };
    match name {
        "ad" => Ok(Kernel::Footprint { scale: scale()? }),
        "knn" => match number.map(count) {
            None => Ok(Kernel::Nearest { k: NEAREST }),
            Some(Ok(k @ 2..=1_000_000)) => Ok(Kernel::Nearest { k: k as u32 }),
            Some(_) => Err(format!("\"{}\" is no number of photons between 2 and 1M", number.unwrap_or_default())),
        },
        "fixed" => Ok(Kernel::Fixed { radius: radius()? }),
        "progressive" => Ok(Kernel::Progressive { radius: radius()? }),
        _ => Err("expected ad[:FACTOR], knn[:K], fixed[:R] or progressive[:R]".into()),
    }
}

/// `x,y,width,height` in pixels.
pub fn window(text: &str) -> Result<[u32; 4], String> {
    let parts: Vec<u32> = text
        .split(',')
        .map(|t| t.trim().parse::<u32>().map_err(|_| format!("\"{t}\" is no whole number")))
        .collect::<Result<_, _>>()?;
    let window: [u32; 4] = parts.try_into().map_err(|_| "expected four numbers: x,y,width,height".to_string())?;
    if window[2] == 0 || window[3] == 0 {
        return Err("the window is empty".into());
    }
    Ok(window)
}

/// `x,y,index` or `x,y,index,pass`; the pass is the index where it is not given.
pub fn sample_address(text: &str) -> Result<InvalidSample, String> {
    let parts: Vec<u64> = text
        .split(',')
        .map(|t| t.trim().parse::<u64>().map_err(|_| format!("\"{t}\" is no whole number")))
        .collect::<Result<_, _>>()?;
    match parts[..] {
        [x, y, index, ref rest @ ..] if x.max(y) <= u64::from(u32::MAX) && rest.len() < 2 => {
            Ok(InvalidSample { x: x as u32, y: y as u32, index, pass: rest.first().copied().unwrap_or(index) })
        }
        _ => Err("expected three or four numbers: x,y,index,pass".into()),
    }
}

/// A factor above zero.
pub fn factor(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("\"{text}\" is no number"))?;
    if value > 0.0 && value <= 64.0 { Ok(value) } else { Err("must be above 0 and at most 64".into()) }
}

/// A number that is not negative.
pub fn not_negative(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("\"{text}\" is no number"))?;
    if (0.0..1e30).contains(&value) { Ok(value) } else { Err("must be 0 or above".into()) }
}

/// A radiance above 0.
pub fn radiance(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("\"{text}\" is no number"))?;
    if value > 0.0 && value <= 1e30 { Ok(value) } else { Err("must be above 0".into()) }
}

/// An exposure in stops, within what 32-bit numbers can be scaled by.
pub fn stops(text: &str) -> Result<f32, String> {
    let value: f32 = text.parse().map_err(|_| format!("\"{text}\" is no number"))?;
    if value.abs() <= 100.0 { Ok(value) } else { Err("must lie between -100 and 100".into()) }
}

/// `key=value`.
pub fn definition(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.is_empty() => Ok((key.into(), value.into())),
        _ => Err("expected key=value".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_have_a_name_and_perhaps_a_number() {
        assert_eq!(kernel("ad"), Ok(Kernel::FOOTPRINT));
        assert_eq!(kernel("ad:1.5"), Ok(Kernel::Footprint { scale: 1.5 }));
        assert_eq!(kernel("knn"), Ok(Kernel::Nearest { k: 50 }));
        assert_eq!(kernel("knn:2K"), Ok(Kernel::Nearest { k: 2000 }));
        assert_eq!(kernel("fixed"), Ok(Kernel::Fixed { radius: None }));
        assert_eq!(kernel("progressive:0.5"), Ok(Kernel::Progressive { radius: Some(0.5) }));
        for wrong in [
            "",
            "AD",
            "ad:0",
            "ad:x",
            "ad:inf",
            "ad:NaN",
            "ad:1e-40",
            "knn:1",
            "knn:x",
            "knn:",
            "fixed:0",
            "fixed:-1",
            "fixed:inf",
            "fixed:NaN",
            "cone",
        ] {
            assert!(kernel(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn durations() {
        assert_eq!(duration("90"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("0.5s"), Ok(Duration::from_millis(500)));
        assert_eq!(duration("250ms"), Ok(Duration::from_millis(250)));
        assert_eq!(duration("1.5h"), Ok(Duration::from_secs(5400)));
        for bad in ["", "s", "-1s", "1d", "nan", "inf", "1e99s", "1 2s", "é"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn counts() {
        assert_eq!(count("250K"), Ok(250_000));
        assert_eq!(count("1.5M"), Ok(1_500_000));
        assert_eq!(count("7"), Ok(7));
        for bad in ["", "K", "-3", "1.5", "1e99", "x", "né", "é"] {
            assert!(count(bad).is_err(), "{bad}");
        }
        assert!(positive("0").is_err());
    }

    #[test]
    fn windows_and_addresses() {
        assert_eq!(window("1,2, 3,4"), Ok([1, 2, 3, 4]));
        for bad in ["", "1,2,3", "1,2,0,4", "1,2,3,4,5", "-1,0,1,1", "1;2;3;4"] {
            assert!(window(bad).is_err(), "{bad}");
        }
        assert_eq!(sample_address("5,6,7"), Ok(InvalidSample { x: 5, y: 6, index: 7, pass: 7 }));
        assert_eq!(sample_address("5,6,7,1"), Ok(InvalidSample { x: 5, y: 6, index: 7, pass: 1 }));
        assert!(sample_address("5,6,7,1,2").is_err());
        assert!(sample_address("5,6").is_err() && sample_address("9999999999,0,0").is_err());
        assert_eq!(definition("spp=64"), Ok(("spp".into(), "64".into())));
        assert!(definition("=1").is_err() && definition("spp").is_err());
        assert_eq!(stops("-2.5"), Ok(-2.5));
        assert!(["nan", "inf", "-101", "x", ""].iter().all(|t| stops(t).is_err()));
        assert!(factor("0").is_err() && factor("nan").is_err() && factor("0.25").is_ok());
    }
}
