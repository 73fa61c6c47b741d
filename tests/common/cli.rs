//! The program as a user starts it.
#![allow(dead_code)] // not every test file uses every function

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A scene of the project.
pub fn scene(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).to_string_lossy().into_owned()
}

/// Runs the program.
pub fn dualux(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dualux")).args(args).output().expect("the program starts")
}

/// Runs the program in a folder.
pub fn dualux_in(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dualux")).args(args).current_dir(folder).output().expect("the program starts")
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A file in a fresh folder that goes away with the guard.
pub fn scratch(name: &str) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("scratch folder");
    let path = dir.path().join(name);
    (dir, path)
}
