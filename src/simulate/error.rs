//! What can be wrong with the description of a scene.

/// A scene's description was rejected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// A value lies outside the range that has a meaning (NaN always does).
    #[error("{field} is {found}, expected a number in {minimum} to {maximum}")]
    OutOfRange {
        /// The field's name.
        field: &'static str,
        /// Smallest value allowed.
        minimum: f64,
        /// Largest value allowed.
        maximum: f64,
        /// The value given.
        found: f64,
    },
    /// A list has fewer entries than needed.
    #[error("{field} has {found} entries, expected at least {expected}")]
    TooFew {
        /// The field's name.
        field: &'static str,
        /// Entries needed.
        expected: usize,
        /// Entries given.
        found: usize,
    },
    /// A load is too great for the law to have an equilibrium.
    #[error("the force {force_n} N exceeds {limit_n} N, the largest the material law can carry")]
    Overload {
        /// The force asked for.
        force_n: f64,
        /// The largest force in equilibrium.
        limit_n: f64,
    },
}

/// Smallest value called positive: far below any length, modulus or count in use.
const TINY: f64 = f64::MIN_POSITIVE;

/// `found` if it lies in `minimum..=maximum`.
pub(super) fn within(
    field: &'static str,
    found: f64,
    minimum: f64,
    maximum: f64,
) -> Result<(), SimulateError> {
    if found >= minimum && found <= maximum {
        Ok(())
    } else {
        Err(SimulateError::OutOfRange { field, minimum, maximum, found })
    }
}

/// Positive and finite.
pub(super) fn positive(field: &'static str, found: f64) -> Result<(), SimulateError> {
    within(field, found, TINY, f64::MAX)
}

/// Zero or positive, and finite.
pub(super) fn not_negative(field: &'static str, found: f64) -> Result<(), SimulateError> {
    within(field, found, 0.0, f64::MAX)
}

/// Any finite number.
pub(super) fn finite(field: &'static str, found: f64) -> Result<(), SimulateError> {
    within(field, found, f64::MIN, f64::MAX)
}

/// At least `expected` entries.
pub(super) fn at_least(field: &'static str, found: usize, expected: usize) -> Result<(), SimulateError> {
    if found >= expected { Ok(()) } else { Err(SimulateError::TooFew { field, expected, found }) }
}
