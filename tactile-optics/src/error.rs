//! The errors of this crate.

use core::fmt::{self, Display};

/// Reason why an input is invalid.
///
/// ```
/// use tactile_optics::{OpticsError, critical_angle};
///
/// let error = critical_angle(-1.4_f64, 1.0).unwrap_err();
/// assert!(matches!(
///     error,
///     OpticsError::OutOfRange { quantity: "refractive index", found, .. } if found == -1.4
/// ));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OpticsError {
    /// A quantity lies outside its valid range (NaN always does).
    #[error("{quantity} is {found}, expected {}", Between(*minimum, *maximum))]
    OutOfRange {
        /// Name of the quantity.
        quantity: &'static str,
        /// Smallest allowed value.
        minimum: f64,
        /// Largest allowed value.
        maximum: f64,
        /// The given value.
        found: f64,
    },
    /// A list is empty.
    #[error("{quantity} is empty")]
    Empty {
        /// Name of the list.
        quantity: &'static str,
    },
}

/// The numbers from one to another, in words if an end is the extreme of all numbers.
struct Between(f64, f64);

impl Display for Between {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self(f64::MIN_POSITIVE, f64::MAX) => f.write_str("a positive number"),
            Self(f64::MIN_POSITIVE, most) => write!(f, "a positive number up to {most}"),
            Self(least, f64::MAX) => write!(f, "a number of at least {least}"),
            Self(least, most) => write!(f, "a number from {least} to {most}"),
        }
    }
}

/// Returns `found` if it lies in `minimum..=maximum`.
pub(crate) fn within(
    quantity: &'static str,
    found: f64,
    minimum: f64,
    maximum: f64,
) -> Result<f64, OpticsError> {
    if (minimum..=maximum).contains(&found) {
        Ok(found)
    } else {
        Err(OpticsError::OutOfRange {
            quantity,
            minimum,
            maximum,
            found,
        })
    }
}

/// A refractive index: positive and finite.
pub(crate) fn index(n: f64) -> Result<f64, OpticsError> {
    within("refractive index", n, f64::MIN_POSITIVE, f64::MAX)
}
