//! Validation of options.

use crate::Readable;
use thiserror::Error;

/// An option outside its range.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[error("`{name}` is {}, expected {expected}", Readable(*found))]
#[non_exhaustive]
pub struct InvalidOption {
    /// Name of the option.
    pub name: &'static str,
    /// The given value.
    pub found: f64,
    /// The allowed values.
    pub expected: &'static str,
}

impl InvalidOption {
    /// Creates an error for a rule that [`Requirement`] does not contain.
    #[must_use]
    pub const fn new(name: &'static str, found: f64, expected: &'static str) -> Self {
        Self {
            name,
            found,
            expected,
        }
    }
}

/// A rule for the value of an option. NaN satisfies none.
///
/// ```
/// use tactile_core::Requirement;
/// assert_eq!(Requirement::Positive.check("radius_m", 3e-3), Ok(3e-3));
/// let error = Requirement::Positive.check("radius_m", f64::NAN).unwrap_err();
/// assert_eq!(error.to_string(), "`radius_m` is NaN, expected a finite number above zero");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Requirement {
    /// The value is finite.
    Finite,
    /// The value is finite and greater than zero.
    Positive,
    /// The value is finite and not negative.
    NonNegative,
    /// The value lies strictly between zero and one.
    OpenUnitInterval,
    /// The value lies between zero and one, both included.
    UnitInterval,
    /// The value is an integer of at least one.
    AtLeastOne,
    /// The value is an odd integer of at least one.
    Odd,
}

impl Requirement {
    /// Returns the value if it satisfies the rule.
    ///
    /// # Errors
    /// [`InvalidOption`] with the name, the value and the rule.
    pub fn check(self, name: &'static str, value: f64) -> Result<f64, InvalidOption> {
        let (holds, expected) = match self {
            Self::Finite => (value.is_finite(), "a finite number"),
            Self::Positive => (
                value > 0.0 && value.is_finite(),
                "a finite number above zero",
            ),
            Self::NonNegative => (
                value >= 0.0 && value.is_finite(),
                "a finite number that is not negative",
            ),
            Self::OpenUnitInterval => (
                value > 0.0 && value < 1.0,
                "a number above zero and below one",
            ),
            Self::UnitInterval => ((0.0..=1.0).contains(&value), "a number from zero to one"),
            Self::AtLeastOne => (
                value >= 1.0 && value.is_finite() && value.fract() == 0.0,
                "a whole number of at least one",
            ),
            // The remainder of an infinity is NaN, so that this rule needs no test for finite
            // values.
            Self::Odd => (value >= 1.0 && value % 2.0 == 1.0, "an odd whole number"),
        };
        if holds {
            Ok(value)
        } else {
            Err(InvalidOption::new(name, value, expected))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rule_accepts_nan_or_infinity() {
        use Requirement::*;
        let rules = [
            Finite,
            Positive,
            NonNegative,
            OpenUnitInterval,
            UnitInterval,
            AtLeastOne,
            Odd,
        ];
        for rule in rules {
            for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                assert!(rule.check("x", value).is_err(), "{rule:?} {value}");
            }
        }
    }

    #[test]
    fn ends_of_ranges() {
        use Requirement::*;
        assert!(Positive.check("x", 0.0).is_err() && NonNegative.check("x", 0.0).is_ok());
        assert!(OpenUnitInterval.check("x", 1.0).is_err() && UnitInterval.check("x", 1.0).is_ok());
        assert!(AtLeastOne.check("x", 1.5).is_err() && AtLeastOne.check("x", 2.0).is_ok());
        assert!(Odd.check("x", 2.0).is_err() && Odd.check("x", 3.0).is_ok());
    }
}
