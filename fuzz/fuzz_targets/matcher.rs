//! Fuzz target: every matcher on arbitrary points.
#![no_main]

#[path = "../../tactile-match/tests/suite/common/contract.rs"]
mod contract;
#[path = "../../tactile-match/tests/suite/corpus/points.rs"]
mod points;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| points::matcher(bytes));
