//! Published data that are not part of the repository: in the folder named by `TACTILE_DATA`, else
//! beside the workspace. Where they are absent, a line says so.
use serde_json::Value;
use std::path::PathBuf;

/// A file or folder of the data.
pub fn published(name: &str) -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let folder =
        std::env::var_os("TACTILE_DATA").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    let path = folder.join(name);
    if !path.exists() {
        println!("skipped: no {} (set TACTILE_DATA)", path.display());
        return None;
    }
    Some(path)
}

/// A file of reference numbers of many digits, after a check that the parser rounds correctly.
pub fn reference(name: &str) -> Option<Value> {
    let text = std::fs::read_to_string(published(&format!("reference/{name}"))?).expect("readable");
    let file: Value = serde_json::from_str(&text).expect("the reference is JSON");
    for check in file["header"]["parse_check"].as_array().expect("checks") {
        let bits = check["bits"].as_str().expect("bits");
        let bits = u64::from_str_radix(bits.trim_start_matches("0x"), 16).expect("hexadecimal");
        let value = check["value"].as_f64().expect("a number");
        assert_eq!(value.to_bits(), bits, "numbers parse to the nearest double");
    }
    Some(file)
}
