//! Writing a file so that its name holds either the old content or the whole new one.
//!
//! The bytes go to a temporary file in the same folder, which then takes the name. Nothing is left behind on
//! failure. Not handled: loss of power (the data is not forced to the disk).

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::ImageFileError;

/// Replaces the content of `path` by `bytes`, or leaves it as it was.
///
/// Devices and pipes (`/dev/null`, `/dev/stdout`) are written to as they are; a symbolic link is followed.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ImageFileError> {
    replace(path, bytes).map_err(|e| ImageFileError::io(path, e))
}

/// Finds out whether [`write_file`] will be able to write to `path`, and writes nothing that stays.
///
/// # Errors
/// If the folder does not exist or cannot be written to, or `path` is a folder.
pub fn check(path: &Path) -> Result<(), ImageFileError> {
    let probe = || match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(io::Error::other("is a folder, not a file")),
        Ok(there) if !there.is_file() => Ok(()),
        there => {
            let target = if there.is_ok() { fs::canonicalize(path)? } else { path.to_owned() };
            let temporary = temporary_beside(&target)?;
            OpenOptions::new().write(true).create_new(true).open(&temporary)?;
            fs::remove_file(&temporary)
        }
    };
    probe().map_err(|e| ImageFileError::io(path, e))
}

fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let target = match fs::metadata(path) {
        Ok(there) if there.is_dir() => return Err(io::Error::other("is a folder, not a file")),
        Ok(there) if !there.is_file() => return OpenOptions::new().write(true).open(path)?.write_all(bytes),
        Ok(_) => fs::canonicalize(path)?,
        Err(_) => path.to_owned(),
    };
    let temporary = temporary_beside(&target)?;
    let written = OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&temporary)
        .and_then(|mut file| file.write_all(bytes))
        .and_then(|()| fs::rename(&temporary, &target));
    if written.is_err() {
        // The first error is the one to report; the temporary file may not even exist.
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// A name in the folder of `target` that no other write of this or another process uses.
fn temporary_beside(target: &Path) -> io::Result<PathBuf> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let name =
        target.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not the name of a file"))?;
    let mut temporary = std::ffi::OsString::from(".");
    temporary.push(name);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    temporary.push(format!(".{}-{count}.tmp", std::process::id()));
    Ok(target.with_file_name(temporary))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn content_is_replaced_and_nothing_else_remains() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_file(&path, b"first, longer").unwrap();
        write_file(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names(folder.path()), ["a.bin"]);
    }

    #[test]
    fn failure_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        // The target is a folder: the rename must not happen, whatever the system thinks of it.
        let path = folder.path().join("sub");
        fs::create_dir(&path).unwrap();
        assert!(write_file(&path, b"x").is_err());
        assert_eq!(names(folder.path()), ["sub"]);
        let error = write_file(&folder.path().join("missing/a.bin"), b"x").unwrap_err();
        assert!(error.to_string().contains("missing"), "{error}");
        assert!(write_file(Path::new("/"), b"x").is_err());
        assert!(write_file(Path::new(""), b"x").is_err());
    }

    #[test]
    fn check_foretells_what_write_does_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        check(&path).unwrap();
        write_file(&path, b"content").unwrap();
        check(&path).unwrap();
        assert_eq!((fs::read(&path).unwrap(), names(folder.path())), (b"content".to_vec(), vec!["a.bin".to_owned()]));
        for bad in [folder.path().join("missing/a.bin"), folder.path().to_owned(), path.join("b.bin"), "".into()] {
            assert!(check(&bad).is_err() && write_file(&bad, b"x").is_err(), "{bad:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_devices_stay_devices() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());

        write_file(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
