//! Replays the inputs kept for the fuzz target `matcher`: regular, scattered and extreme points in
//! the plane and in space.
//!
//! `fuzz/README.md` describes how to search for more.
#![allow(clippy::print_stdout)] // the input that is checked, shown where a check fails

pub(crate) mod points;

use crate::common::contract;

#[test]
fn every_input_has_a_consistent_answer() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/corpus");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("the corpus")
        .map(|entry| entry.expect("an entry of the corpus").path())
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no input in {folder}");
    for file in files {
        println!("input {}", file.display());
        points::matcher(&std::fs::read(&file).expect("an input of the corpus"));
    }
}
