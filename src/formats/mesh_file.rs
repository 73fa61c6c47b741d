//! What the mesh readers share: located errors, whole-file reading, fast numbers.

use std::fmt;
use std::path::{Path, PathBuf};

/// Where in a mesh file an error lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// Line of a text file, from 1.
    Line(usize),
    /// Byte offset in a binary file, from 0.
    Byte(usize),
}

/// A mesh file that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshError {
    /// The file.
    pub path: PathBuf,
    /// Where in it.
    pub place: Place,
    /// What is wrong.
    pub message: String,
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match self.place {
            Place::File => write!(f, "{path}: {}", self.message),
            Place::Line(line) => write!(f, "{path}:{line}: {}", self.message),
            Place::Byte(byte) => write!(f, "{path}: at byte {byte}: {}", self.message),
        }
    }
}

impl std::error::Error for MeshError {}

/// An error before its file is known; parsers work on bytes.
pub(super) type Located = (Place, String);

/// Reads the file and parses its bytes.
pub(super) fn read_with<T>(path: &Path, parse: impl FnOnce(&[u8]) -> Result<T, Located>) -> Result<T, MeshError> {
    let error = |(place, message)| MeshError { path: path.to_path_buf(), place, message };
    let bytes = std::fs::read(path).map_err(|e| error((Place::File, format!("cannot read the file: {e}"))))?;
    parse(&bytes).map_err(error)
}

/// The line, from 1, of a byte offset.
pub(super) fn line_of(bytes: &[u8], offset: usize) -> Place {
    Place::Line(1 + bytes[..offset.min(bytes.len())].iter().filter(|&&b| b == b'\n').count())
}

/// A piece of the file for a message: printable and short.
pub(super) fn quote(token: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(&token[..token.len().min(40)]).escape_debug().collect();
    format!("`{text}{}`", if token.len() > 40 { "..." } else { "" })
}

/// A decimal number; also what `f64::from_str` takes (`nan`, `inf`). `None` if it is none.
///
/// The usual short numbers (up to 19 digits, value below 2^53, power of ten up to 22) are exact in f64 after one
/// multiplication or division; the rest goes through the standard library.
pub(super) fn parse_f32(token: &[u8]) -> Option<f32> {
    let (negative, digits) = match token {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        rest => (false, rest),
    };
    let mut mantissa = 0u64;
    let mut count = 0;
    let mut scale = 0i32;
    let mut i = 0;
    while let Some(d) = digits.get(i).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(d as u64);
        count += 1;
        i += 1;
    }
    if digits.get(i) == Some(&b'.') {
        i += 1;
        while let Some(d) = digits.get(i).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(d as u64);
            count += 1;
            scale -= 1;
            i += 1;
        }
    }
    if matches!(digits.get(i), Some(b'e' | b'E')) {
        match std::str::from_utf8(&digits[i + 1..]).ok().and_then(|e| e.parse::<i32>().ok()) {
            Some(e) => scale = scale.saturating_add(e),
            None => return None,
        }
        i = digits.len();
    }
    if i == digits.len() && (1..=19).contains(&count) && mantissa < 1 << 53 && scale.unsigned_abs() <= 22 {
        let power = POWERS[scale.unsigned_abs() as usize];
        let value = if scale < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
        return Some(if negative { -value } else { value } as f32);
    }
    std::str::from_utf8(token).ok()?.parse::<f64>().ok().map(|v| v as f32)
}

/// Powers of ten that f64 holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// A decimal integer with sign. `None` if it is none or beyond i64.
pub(super) fn parse_i64(token: &[u8]) -> Option<i64> {
    let (negative, digits) = match token {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        rest => (false, rest),
    };
    if digits.is_empty() || digits.len() > 18 {
        return None;
    }
    let mut value = 0i64;
    for &b in digits {
        if !b.is_ascii_digit() {
            return None;
        }
        value = value * 10 + (b - b'0') as i64;
    }
    Some(if negative { -value } else { value })
}

#[cfg(test)]
pub(super) mod mutate {
    //! Seeded damage for robustness tests: flips, cuts, copies, numbers made huge.

    use crate::math::sampler::hash;

    /// Mutation number `seed` of `good`.
    pub fn mutate(good: &[u8], seed: u64) -> Vec<u8> {
        let mut bytes = good.to_vec();
        let mut draw = 0;
        let mut random = |n: usize| {
            draw += 1;
            (hash(seed, draw) % n.max(1) as u64) as usize
        };
        for _ in 0..1 + random(4) {
            let at = random(bytes.len());
            if bytes.is_empty() {
                break;
            }
            match random(8) {
                0 => bytes[at] = random(256) as u8,
                1 => bytes[at] ^= 1 << random(8),
                2 => bytes.truncate(at),
                3 => {
                    let end = (at + random(20)).min(bytes.len());
                    bytes.drain(at..end);
                }
                4 => {
                    let end = (at + random(40)).min(bytes.len());
                    let copy = bytes[at..end].to_vec();
                    let to = random(bytes.len());
                    bytes.splice(to..to, copy);
                }
                5 => {
                    let word: [&[u8]; 8] =
                        [b"999999999999", b"-1", b"4294967296", b"nan", b"1e999", b"\n", b" / ", b"0"];
                    bytes.splice(at..at, word[random(8)].iter().copied());
                }
                6 => {
                    let end = (at + 4).min(bytes.len());
                    bytes[at..end].fill(0xff);
                }
                _ => {
                    let other = random(bytes.len());
                    bytes.swap(at, other);
                }
            }
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::hash;

    #[test]
    fn numbers_agree_with_the_standard_library() {
        for text in
            ["0", "-0", "1", "+1.5", ".5", "5.", "1e3", "1E-3", "-2.5e+10", "123456789012345678901", "1e-45", "inf"]
        {
            assert_eq!(parse_f32(text.as_bytes()), text.parse::<f64>().ok().map(|v| v as f32), "{text}");
        }
        for i in 0..20_000u64 {
            let v = f32::from_bits(hash(i, 1) as u32);
            for text in
                [format!("{v}"), format!("{v:e}"), format!("{:.6}", (hash(i, 2) % 2_000_000) as f64 * 1e-3 - 1e3)]
            {
                let want = text.parse::<f64>().map(|v| v as f32).expect("a number");
                let got = parse_f32(text.as_bytes()).expect("a number");
                assert!(got == want || (got.is_nan() && want.is_nan()), "{text}: {got}");
            }
        }
        assert!(parse_f32(b"nan").is_some_and(f32::is_nan));
        for text in ["", "-", ".", "e5", "1e", "1e+", "1.2.3", "0x10", "1,5", "1 ", "--1", "\u{e9}", "1e5x"] {
            assert_eq!(parse_f32(text.as_bytes()), None, "{text:?}");
        }
    }

    #[test]
    fn integers_have_bounds() {
        assert_eq!(parse_i64(b"-12"), Some(-12));
        assert_eq!(parse_i64(b"999999999999999999"), Some(999_999_999_999_999_999));
        for text in ["", "-", "1.0", "9999999999999999999", "a"] {
            assert_eq!(parse_i64(text.as_bytes()), None, "{text:?}");
        }
    }

    #[test]
    fn errors_name_the_place() {
        let at = |place| {
            let message = "wrong".to_string();
            MeshError { path: "a.obj".into(), place, message }.to_string()
        };
        assert_eq!(at(line_of(b"a\nb\nc", 4)), "a.obj:3: wrong");
        assert_eq!(at(Place::Byte(8)), "a.obj: at byte 8: wrong");
        assert_eq!(at(Place::File), "a.obj: wrong");
        let missing = read_with(Path::new("/nonexistent/a.obj"), |_| Ok(())).expect_err("no such file");
        assert!(missing.to_string().starts_with("/nonexistent/a.obj: cannot read the file"));
    }
}
