//! Published data that are not part of the repository, in the folder named by `TACTILE_DATA`
//! (`docs/data.md`). A line is printed for each file that is absent.
use serde_json::Value;
use std::path::PathBuf;

/// A file or folder of the published data. `None` if it is absent.
pub fn published(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("TACTILE_DATA").map(PathBuf::from);
    let path = folder.map(|folder| folder.join(name));
    let found = path.filter(|path| path.exists());
    if found.is_none() {
        println!("skipped: no {name} in the folder TACTILE_DATA");
    }
    found
}

/// A file of high-precision reference numbers, after a check that the parser rounds correctly.
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
