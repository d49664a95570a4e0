//! The errors of this crate, with the numbers that explain them.

use thiserror::Error;

/// The rule that an option's value has to satisfy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Requirement {
    /// Finite and greater than zero.
    Positive,
    /// Finite and not negative.
    NonNegative,
    /// Strictly between zero and one.
    OpenUnitInterval,
    /// Between zero and one, both included.
    UnitInterval,
    /// Finite.
    Finite,
    /// An odd whole number, at least one.
    Odd,
    /// A whole number, at least one.
    AtLeastOne,
}

/// The reason why an input was rejected.
///
/// No contact is a value, a fit that does not converge is a report, and a calibration used outside its range is a
/// flag: none of them is an error.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ForceError, ReferenceFrame};
///
/// let reference = ReferenceFrame::new(Array2::zeros((40, 50)).view())?;
/// let error = reference.compare(Array2::zeros((50, 40)).view(), 10).unwrap_err();
/// assert_eq!(error, ForceError::SizeMismatch { expected: (40, 50), found: (50, 40) });
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ForceError {
    /// Two images that belong together differ in size.
    #[error("image of {found:?} (rows, columns) where {expected:?} was expected")]
    SizeMismatch {
        /// Rows and columns of the first image.
        expected: (usize, usize),
        /// Rows and columns of the second.
        found: (usize, usize),
    },
    /// An image without pixels, or no image at all.
    #[error("an image needs at least one row and one column, found {rows} x {columns}")]
    EmptyImage {
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
    },
    /// An image with more rows or columns than the exact integer sums have room for.
    #[error("image side of {found} pixels exceeds the limit of {limit}")]
    ImageTooLarge {
        /// The longer side found.
        found: usize,
        /// The longest side allowed.
        limit: usize,
    },
    /// A reference frame too dark to show how evenly it is lit.
    #[error(
        "the reference's mean of {mean} grey levels is below the {required} needed to see its vignetting"
    )]
    ReferenceTooDark {
        /// Its mean grey level.
        mean: f64,
        /// The least mean that will do.
        required: f64,
    },
    /// Too much of the contact is saturated for its force to be known.
    #[error("{share} of the contact is saturated, more than the stated {limit}")]
    SaturatedContact {
        /// Saturated share of the contact's pixels.
        share: f64,
        /// The share stated in the options.
        limit: f64,
    },
    /// Fewer observations than a fit with an error estimate needs.
    #[error("{found} observations cannot determine {required} parameters with an error estimate")]
    TooFewPairs {
        /// The least number that can.
        required: usize,
        /// The number given.
        found: usize,
    },
    /// A calibration or shear observation with a NaN or an infinity in it.
    #[error("observation {index} is not finite")]
    NonFinitePair {
        /// Its place in the slice.
        index: usize,
    },
    /// All observations were taken at (nearly) the same input: the slope is unknown.
    #[error("the observations span too little ({span}) to determine a slope")]
    DegeneratePairs {
        /// Spread of the input.
        span: f64,
    },
    /// The fitted force falls where the pixel value rises, and a monotone calibration was asked for.
    #[error("the force falls from pixel value {from} to {to}")]
    NotMonotone {
        /// Pixel value at which the force starts to fall.
        from: f64,
        /// Pixel value at which it is lower.
        to: f64,
    },
    /// An option outside its domain.
    #[error("`{name}` is {found}, expected {expected}")]
    InvalidOption {
        /// The option's name.
        name: &'static str,
        /// The value given.
        found: f64,
        /// The rule it breaks.
        expected: &'static str,
    },
    /// A pixel of a floating-point image is NaN or infinite.
    #[error("pixel (row {row}, column {column}) is not finite")]
    NonFinitePixel {
        /// Its row.
        row: usize,
        /// Its column.
        column: usize,
    },
}

impl Requirement {
    fn text(self) -> &'static str {
        match self {
            Self::Positive => "a finite number above zero",
            Self::NonNegative => "a finite number that is not negative",
            Self::OpenUnitInterval => "a number above zero and below one",
            Self::UnitInterval => "a number from zero to one",
            Self::Finite => "a finite number",
            Self::Odd => "an odd whole number",
            Self::AtLeastOne => "a whole number of at least one",
        }
    }

    /// The value, if it satisfies the rule.
    pub(crate) fn check(self, name: &'static str, value: f64) -> Result<f64, ForceError> {
        let holds = match self {
            Self::Positive => value > 0.0 && value.is_finite(),
            Self::NonNegative => value >= 0.0 && value.is_finite(),
            Self::OpenUnitInterval => value > 0.0 && value < 1.0,
            Self::UnitInterval => (0.0..=1.0).contains(&value),
            Self::Finite => value.is_finite(),
            Self::Odd => value >= 1.0 && value % 2.0 == 1.0,
            Self::AtLeastOne => value >= 1.0 && value.is_finite(),
        };
        if holds {
            Ok(value)
        } else {
            Err(ForceError::InvalidOption {
                name,
                found: value,
                expected: self.text(),
            })
        }
    }
}
