//! Replays the inputs kept for the fuzz targets of the readers: valid files of every kind, damaged
//! files, and inputs that once caused a failure.
//!
//! `fuzz/README.md` describes how to search for more.
#![allow(clippy::print_stdout)] // the input that is checked, shown where a check fails

mod readers;

use std::path::{Path, PathBuf};

/// A folder of `tests/data/corpus` and the check of its inputs.
type Reader = (&'static str, fn(&[u8]));

pub(crate) const READERS: [Reader; 5] = [
    ("table", readers::table),
    ("case", readers::case),
    ("image", readers::image),
    ("stream", readers::stream),
    ("toml", readers::toml),
];

/// The inputs of a folder, by name.
pub(crate) fn inputs(folder: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/corpus");
    let files = std::fs::read_dir(corpus.join(folder)).expect("the corpus");
    let read = |path: PathBuf| (path.clone(), std::fs::read(path).expect("an input"));
    let mut inputs: Vec<_> = files.map(|file| read(file.unwrap().path())).collect();
    inputs.sort();
    inputs
}

#[test]
fn every_input_ends_as_it_should() {
    for (folder, check) in READERS {
        let inputs = inputs(folder);
        assert!(!inputs.is_empty(), "no input in {folder}");
        for (path, bytes) in inputs {
            println!("input {}", path.display());
            check(&bytes);
        }
    }
}
