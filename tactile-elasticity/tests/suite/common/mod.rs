//! Reads the golden numbers, where they are.
#![allow(clippy::print_stdout)]

use serde_json::Value;
use std::path::PathBuf;

/// The reference file, or None with one printed line.
pub(crate) fn reference(name: &str) -> Option<Vec<Value>> {
    let folder = std::env::var_os("TACTILE_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    );
    let path = folder.join("reference").join(name);
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: no {} (set TACTILE_DATA)", path.display());
        return None;
    };
    let file: Value = serde_json::from_str(&text).expect("the reference is JSON");
    for check in file["header"]["parse_check"]
        .as_array()
        .expect("parse checks")
    {
        let bits = check["bits"]
            .as_str()
            .expect("bits")
            .trim_start_matches("0x");
        let bits = u64::from_str_radix(bits, 16).expect("hexadecimal");
        assert_eq!(number(&check["value"]).to_bits(), bits, "the parser rounds");
    }
    Some(file["cases"].as_array().expect("cases").clone())
}

/// A number, NaN for null.
pub(crate) fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or(f64::NAN)
}

/// Some(number), None for null.
pub(crate) fn optional(v: &Value) -> Option<f64> {
    v.as_f64()
}
