//! Reads the reference numbers, if they are available.

use serde_json::Value;

/// The cases of a reference file. `None`, with one printed line, if the file is absent.
pub(crate) fn reference(name: &str) -> Option<Vec<Value>> {
    let file = test_support::reference(name)?;
    Some(file["cases"].as_array().expect("cases").clone())
}

/// A number, or NaN for null.
pub(crate) fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or(f64::NAN)
}

/// A number, or `None` for null.
pub(crate) fn optional(v: &Value) -> Option<f64> {
    v.as_f64()
}
