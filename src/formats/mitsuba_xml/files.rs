//! Finding and opening the files a scene refers to.

use super::report::{Checked, Loc, Report};
use std::fs;
use std::path::{Path, PathBuf};

/// Largest text file that is read (scene or spectrum), bytes.
const TEXT_LIMIT: u64 = 256 << 20;

/// Looks for `name` in the folders, in order; then without regard to case and with `\` taken for `/`, with a
/// warning. Only regular files count.
pub fn find(name: &str, folders: &[PathBuf], loc: Loc, what: &str, report: &Report) -> Checked<PathBuf> {
    if name.is_empty() {
        return Err(report.error(loc, format!("the {what} has no file name")));
    }
    let exact = folders.iter().map(|folder| folder.join(name)).find(|p| p.is_file());
    if let Some(path) = exact {
        return Ok(path);
    }
    let slashed = name.replace('\\', "/");
    if let Some(path) = folders.iter().find_map(|folder| find_any_case(folder, Path::new(&slashed))) {
        report.warn(loc, format!("there is no file \"{name}\"; taking \"{}\"", path.display()));
        return Ok(path);
    }
    if folders.iter().any(|folder| folder.join(name).exists()) {
        return Err(report.error(loc, format!("\"{name}\" is not a file")));
    }
    let places: Vec<String> = folders.iter().map(|f| f.join("").display().to_string()).collect();
    let help = Some(format!("looked in {}", places.join(", ")));
    Err(report.error_help(loc, format!("{what} file \"{name}\" not found"), help))
}

/// `folder/name`, each part in any case; of several matches the first by name.
fn find_any_case(folder: &Path, name: &Path) -> Option<PathBuf> {
    let mut path = if name.is_absolute() { PathBuf::new() } else { folder.to_path_buf() };
    for part in name.components() {
        let next = path.join(part);
        if next.exists() {
            path = next;
            continue;
        }
        let wanted = part.as_os_str().to_string_lossy().to_lowercase();
        let here = if path.as_os_str().is_empty() { Path::new(".") } else { &path };
        let entries = fs::read_dir(here).ok()?.filter_map(Result::ok).map(|e| e.file_name());
        path = path.join(entries.filter(|e| e.to_string_lossy().to_lowercase() == wanted).min()?);
    }
    path.is_file().then_some(path)
}

/// Reads a text file of bounded size; the error is a message without position.
pub fn read_text(path: &Path) -> Result<String, String> {
    let metadata = fs::metadata(path).map_err(|e| e.to_string())?;
    if !metadata.is_file() {
        return Err("not a file".into());
    }
    if metadata.len() > TEXT_LIMIT {
        return Err(format!("larger than {} MiB", TEXT_LIMIT >> 20));
    }
    let bytes = fs::read(path).map_err(|e| e.to_string())?;
    Ok(decode(bytes))
}

/// UTF-8; UTF-16 by its mark; anything else is taken for Latin-1, which old files on Windows are.
fn decode(bytes: Vec<u8>) -> String {
    let little = match bytes[..] {
        [0xFF, 0xFE, ..] => Some(true),
        [0xFE, 0xFF, ..] => Some(false),
        _ => None,
    };
    if let Some(little) = little {
        let pairs = bytes[2..].chunks_exact(2).map(|p| [p[0], p[1]]);
        let units: Vec<u16> =
            pairs.map(|p| if little { u16::from_le_bytes(p) } else { u16::from_be_bytes(p) }).collect();
        return String::from_utf16_lossy(&units);
    }
    match String::from_utf8(bytes) {
        Ok(mut text) => {
            if text.starts_with('\u{FEFF}') {
                text.remove(0);
            }
            text
        }
        Err(error) => error.into_bytes().into_iter().map(char::from).collect(),
    }
}

/// The folder of a file, `.` if it has none.
pub fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encodings() {
        assert_eq!(decode("a\u{e9}".into()), "a\u{e9}");
        assert_eq!(decode(b"\xEF\xBB\xBFa".to_vec()), "a");
        assert_eq!(decode(b"a\xE9".to_vec()), "a\u{e9}");
        assert_eq!(decode(b"\xFF\xFEa\0\xE9\0".to_vec()), "a\u{e9}");
        assert_eq!(decode(b"\xFE\xFF\0a\0".to_vec()), "a");
        assert_eq!(decode(Vec::new()), "");
    }
}
