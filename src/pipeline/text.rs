//! Formatting of numbers and results.
use crate::core::Estimate;

/// Formats a value with its standard error, scaled to a unit. Two significant digits of the error
/// determine the decimals. An error of zero, or beyond the twelfth decimal, is not printed.
///
/// ```
/// use tactile_imaging::pipeline::with_error;
/// assert_eq!(with_error(3.27124e-3, 4.1e-8, 1e3), "3.271240 ± 0.000041");
/// assert_eq!(with_error(103_384.0, 140.0, 1e-3), "103.38 ± 0.14");
/// assert_eq!(with_error(0.7, 0.0, 1.0), "0.7000");
/// assert_eq!(with_error(0.7, 3e-17, 1.0), "0.7000");
/// ```
pub fn with_error(value: f64, error: f64, scale: f64) -> String {
    let (value, error) = (value * scale, error * scale);
    match decimals_of(error) {
        Some(decimals) => format!("{} ± {error:.decimals$}", fixed(value, decimals)),
        None => fixed(value, 4),
    }
}

/// Formats the ends of an interval, scaled to a unit, with the digits of the standard error:
/// `98.6 to 106.0`, or `above 98.6` without an upper end.
///
/// ```
/// use tactile_imaging::pipeline::interval_text;
/// assert_eq!(interval_text((81_314.0, Some(138_607.0)), 14e3, 1e-3), "81 to 139");
/// assert_eq!(interval_text((81_314.0, None), 140.0, 1e-3), "above 81.31");
/// ```
pub fn interval_text(ends: (f64, Option<f64>), error: f64, scale: f64) -> String {
    let decimals = decimals_of(error * scale).unwrap_or(4);
    let low = fixed(ends.0 * scale, decimals);
    match ends.1 {
        Some(high) => format!("{low} to {}", fixed(high * scale, decimals)),
        None => format!("above {low}"),
    }
}

/// Decimals that show two significant digits of an error. `None` if the error is unknown or beyond
/// the twelfth decimal, where it is rounding.
pub(super) fn decimals_of(error: f64) -> Option<usize> {
    let decimals = (1.0 - error.log10().floor()).max(0.0) as usize;
    (error > 0.0 && error.is_finite() && decimals <= 12).then_some(decimals)
}

/// Formats a number with this number of decimals. Zero has no sign.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|c| matches!(c, b'-' | b'.' | b'0'));
    if is_zero {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    }
}

/// Formats an estimate with its standard error, scaled to a unit.
pub(super) fn with_its_error(e: Estimate, scale: f64) -> String {
    with_error(e.value, e.standard_error, scale)
}

/// Serialises results that may be missing: the value, or `{"error": "…"}`.
#[cfg(feature = "serde")]
pub(super) mod outcome {
    use serde::{Serialize, Serializer};
    use std::fmt::Display;

    #[derive(Serialize)]
    #[serde(untagged)]
    enum Outcome<'a, T> {
        Value(&'a T),
        Error { error: String },
    }

    impl<'a, T, E: Display> From<&'a Result<T, E>> for Outcome<'a, T> {
        fn from(result: &'a Result<T, E>) -> Self {
            match result {
                Ok(value) => Self::Value(value),
                Err(error) => Self::Error {
                    error: error.to_string(),
                },
            }
        }
    }

    pub(crate) fn one<T: Serialize, E: Display, S: Serializer>(
        result: &Result<T, E>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        Outcome::from(result).serialize(serializer)
    }

    pub(crate) fn each<T: Serialize, E: Display, S: Serializer>(
        results: &[Result<T, E>],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(results.iter().map(Outcome::from))
    }

    /// Serialises a value by its name or message.
    pub(crate) fn text<S: Serializer>(
        value: &impl Display,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub(crate) fn texts<S: Serializer>(
        values: &[impl Display],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(values.iter().map(ToString::to_string))
    }
}
