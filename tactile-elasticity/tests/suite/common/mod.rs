//! Reads the golden numbers, where they are.

use serde_json::Value;

/// The cases of a reference file, or None with one printed line.
pub(crate) fn reference(name: &str) -> Option<Vec<Value>> {
    let file = test_support::reference(name)?;
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
