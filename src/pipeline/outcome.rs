//! How results that may be missing are written: `{"value": …}` or `{"error": "…"}`.
use super::error::PipelineError;
use serde::{Serialize, Serializer};

#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum Outcome<'a, T> {
    Value(&'a T),
    Error(String),
}

impl<'a, T> From<&'a Result<T, PipelineError>> for Outcome<'a, T> {
    fn from(result: &'a Result<T, PipelineError>) -> Self {
        match result {
            Ok(value) => Self::Value(value),
            Err(error) => Self::Error(error.to_string()),
        }
    }
}

pub(super) fn one<T: Serialize, S: Serializer>(
    result: &Result<T, PipelineError>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    Outcome::from(result).serialize(serializer)
}

pub(super) fn each<T: Serialize, S: Serializer>(
    results: &[Result<T, PipelineError>],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(results.iter().map(Outcome::from))
}

/// What has a name or a sentence, as that.
pub(super) fn text<S: Serializer>(
    value: &impl std::fmt::Display,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}

pub(super) fn texts<S: Serializer>(
    values: &[impl std::fmt::Display],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(ToString::to_string))
}
