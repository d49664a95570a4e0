//! Errors in the description of a scene.

use std::fmt;

/// The description of a scene was rejected.
///
/// ```
/// use tactile_simulate::{
///     PressOptions, PressScene, SimulateError, UniaxialOptions, UniaxialScene,
/// };
/// let none = PressScene::new(PressOptions {
///     loads: vec![],
///     ..PressOptions::default()
/// })
/// .unwrap_err();
/// assert_eq!(
///     none,
///     SimulateError::TooFew {
///         field: "loads",
///         expected: 1,
///         found: 0
///     }
/// );
/// let crushed = UniaxialOptions {
///     forces_n: vec![5.0],
///     ..UniaxialOptions::default()
/// };
/// let Err(SimulateError::Overload { limit_n, .. }) = UniaxialScene::new(crushed) else {
///     unreachable!()
/// };
/// assert!(
///     (limit_n - 103e3 * 144e-6 / 27f64.sqrt()).abs() < 1e-9,
///     "E A₀/(3√3)"
/// );
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// A value is outside its valid range, or NaN.
    #[error(
        "{field} is {}, expected a number in {} to {}",
        Short(*found), Short(six_digits(*minimum)), Short(six_digits(*maximum))
    )]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// Smallest value allowed.
        minimum: f64,
        /// Largest value allowed.
        maximum: f64,
        /// The value given.
        found: f64,
    },
    /// There are no finite-element contacts for this ball or waveguide.
    #[error(
        "finite-element contacts exist only for balls of 3 mm radius of CL2000X or CL2003X on the \
         default waveguide: give others as tabulated states"
    )]
    NoFiniteElements,
    /// A list has fewer entries than needed.
    #[error("{field} has {found} entries, expected at least {expected}")]
    TooFew {
        /// Name of the field.
        field: &'static str,
        /// Minimum number of entries.
        expected: usize,
        /// Number of entries given.
        found: usize,
    },
    /// The length of a column differs from that of the other columns.
    #[error("{field} has {found} entries, expected {expected}")]
    LengthMismatch {
        /// Name of the field.
        field: &'static str,
        /// Number of entries of the other columns.
        expected: usize,
        /// Number of entries given.
        found: usize,
    },
    /// A frame of the calibration is too bright for the camera, so its sum would not be
    /// proportional to the force.
    #[error(
        "at {force_n} N the indenter of the calibration saturates pixels of the camera: use a \
         larger indenter or a smaller force"
    )]
    CalibrationSaturates {
        /// The smallest force of the calibration at which pixels saturate.
        force_n: f64,
    },
    /// A load is too large for an equilibrium under the material law.
    #[error("the force {force_n} N exceeds {limit_n} N, the largest force of the material law")]
    Overload {
        /// The requested force.
        force_n: f64,
        /// The largest force with an equilibrium.
        limit_n: f64,
    },
}

/// Rounds a limit to six significant digits for a message.
fn six_digits(limit: f64) -> f64 {
    format!("{limit:.5e}").parse().unwrap_or(limit)
}

/// Formats a number without hundreds of zeros.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0.0 || (1e-6..1e9).contains(&self.0.abs()) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

/// Checks that `found` is in `minimum..=maximum`.
pub(crate) fn within(
    field: &'static str,
    found: f64,
    minimum: f64,
    maximum: f64,
) -> Result<(), SimulateError> {
    // Both comparisons are false for NaN.
    if found >= minimum && found <= maximum {
        Ok(())
    } else {
        Err(SimulateError::OutOfRange {
            field,
            minimum,
            maximum,
            found,
        })
    }
}

/// Checks that a value is positive and finite.
pub(crate) fn positive(field: &'static str, found: f64) -> Result<(), SimulateError> {
    // Smallest value that counts as positive: far below any length, modulus or count in use.
    let tiny = f64::MIN_POSITIVE;
    within(field, found, tiny, f64::MAX)
}

/// Checks that a value is not negative and finite.
pub(crate) fn not_negative(field: &'static str, found: f64) -> Result<(), SimulateError> {
    within(field, found, 0.0, f64::MAX)
}

/// Checks that a value is finite.
pub(crate) fn finite(field: &'static str, found: f64) -> Result<(), SimulateError> {
    within(field, found, f64::MIN, f64::MAX)
}

/// Checks that there are at least `expected` entries.
pub(crate) fn at_least(
    field: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), SimulateError> {
    if found >= expected {
        Ok(())
    } else {
        Err(SimulateError::TooFew {
            field,
            expected,
            found,
        })
    }
}
