//! Numbers in messages.

use std::fmt::{self, Display};

/// A number formatted for a message: magnitudes below 10⁻⁴ and from 10⁷ on are written in powers of
/// ten, so that no number has hundreds of digits.
///
/// ```
/// use tactile_core::Readable;
/// assert_eq!(Readable(0.25).to_string(), "0.25");
/// assert_eq!(Readable(f64::MIN_POSITIVE).to_string(), "2.2250738585072014e-308");
/// assert_eq!(Readable(f64::NAN).to_string(), "NaN");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readable(pub f64);

impl Display for Readable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size == 0.0 || !size.is_finite() || (1e-4..1e7).contains(&size) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}
