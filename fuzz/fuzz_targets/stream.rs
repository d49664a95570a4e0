//! Fuzz target: streams of frames (YUV4MPEG2, PGM, AVI, NPY, NPZ, TIFF).
#![no_main]

// The checks are one file for all targets and the tests; each target calls one of them.
#[allow(dead_code)]
#[path = "../../tests/suite/corpus/readers.rs"]
mod readers;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| readers::stream(bytes));
