//! The inputs kept for the fuzz targets of the readers, once more: valid files of every kind,
//! broken ones, and what once failed.
//!
//! `fuzz/README.md` says how to look for more.
#![allow(clippy::print_stdout)] // the input that is checked, shown where a check fails

pub(crate) mod readers;

use std::path::Path;

/// Reads all files of a folder of `tests/data/corpus`.
fn replay(folder: &str, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/corpus")
        .join(folder);
    let mut files: Vec<_> = std::fs::read_dir(&folder)
        .expect("the corpus")
        .map(|entry| entry.expect("an entry of the corpus").path())
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no input in {}", folder.display());
    for file in files {
        println!("input {}", file.display());
        check(&std::fs::read(&file).expect("an input of the corpus"));
    }
}

#[test]
fn tables() {
    replay("table", readers::table);
}

#[test]
fn cases() {
    replay("case", readers::case);
}

#[test]
fn images() {
    replay("image", readers::image);
}

#[test]
fn streams() {
    replay("stream", readers::stream);
}

#[test]
fn scenes_and_sensors() {
    replay("toml", readers::toml);
}
