//! The errors of this crate, with the values that explain them.

use tactile_core::{CustomError, InvalidOption};
use thiserror::Error;

/// Why an input was rejected.
///
/// Three results are not errors: the absence of contact is a value, a fit that does not converge is
/// a report, and a calibration used outside its range is a flag.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{ForceError, ForceMeter, ReferenceFrame};
///
/// let reference = ReferenceFrame::new(Array2::zeros((40, 50)).view())?;
/// let meter = ForceMeter::new([20e-6; 2], &Default::default())?;
/// let frame = Array2::zeros((50, 40));
/// let error = meter.detect_with(&mut Default::default(), frame.view(), &reference).unwrap_err();
/// assert_eq!(error, ForceError::SizeMismatch { expected: (40, 50), found: (50, 40) });
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ForceError {
    /// Two corresponding images differ in size.
    #[error("image of {found:?} (rows, columns), expected {expected:?}")]
    SizeMismatch {
        /// Rows and columns of the first image.
        expected: (usize, usize),
        /// Rows and columns of the second.
        found: (usize, usize),
    },
    /// An image has no pixels, or there is no image.
    #[error("an image needs at least one row and one column, found {rows} x {columns}")]
    EmptyImage {
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
    },
    /// An image has too many rows or columns for the exact integer sums.
    #[error("image side of {found} pixels exceeds the limit of {limit}")]
    ImageTooLarge {
        /// The longer side found.
        found: usize,
        /// The longest side allowed.
        limit: usize,
    },
    /// The reference frame is too dark to determine the uniformity of its light.
    #[error(
        "the reference's mean of {mean} grey levels is below the {required} needed to see its \
         vignetting"
    )]
    ReferenceTooDark {
        /// Mean grey level of the reference.
        mean: f64,
        /// Minimum mean grey level.
        required: f64,
    },
    /// Too much of the contact is saturated for a reliable force.
    #[error(
        "{:.2} % of the contact is saturated, more than the allowed {:.2} %",
        100.0 * share, 100.0 * limit
    )]
    SaturatedContact {
        /// Fraction of the contact's pixels that are saturated.
        share: f64,
        /// Limit in the options.
        limit: f64,
    },
    /// There are fewer observations than a fit with an error estimate needs.
    #[error("{found} observations cannot determine {required} parameters with an error estimate")]
    TooFewPairs {
        /// Minimum number of observations.
        required: usize,
        /// Number of observations given.
        found: usize,
    },
    /// A calibration or shear observation contains NaN or infinity.
    #[error("observation {index} is not finite")]
    NonFinitePair {
        /// Index in the slice.
        index: usize,
    },
    /// All observations have (nearly) the same input, so the slope is undetermined.
    #[error("the range of the observations ({span}) is too small to determine a slope")]
    DegeneratePairs {
        /// Spread of the input.
        span: f64,
    },
    /// The fitted force decreases with the pixel value, but a monotone calibration is required.
    #[error("the force falls from pixel value {from} to {to}")]
    NotMonotone {
        /// Pixel value at which the force starts to decrease.
        from: f64,
        /// Pixel value with a lower force.
        to: f64,
    },
    /// An option is outside its range.
    #[error(transparent)]
    InvalidOption(#[from] InvalidOption),
    /// A user-defined stage, such as a calibration, failed.
    #[error(transparent)]
    Custom(CustomError),
}

impl ForceError {
    /// Wraps the error or message of a user-defined stage.
    ///
    /// ```
    /// use tactile_force::ForceError;
    /// let error = ForceError::custom("the gauge is not connected");
    /// assert_eq!(error.to_string(), "the gauge is not connected");
    /// ```
    pub fn custom(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Custom(CustomError::new(error))
    }
}

/// Rejects observations that are not finite, or fewer than a fit requires.
pub(crate) fn check_observations<T, const N: usize>(
    observations: &[T],
    required: usize,
    numbers: impl Fn(&T) -> [f64; N],
) -> Result<(), ForceError> {
    let is_finite = |o: &T| numbers(o).iter().all(|number| number.is_finite());
    if let Some(index) = observations.iter().position(|o| !is_finite(o)) {
        return Err(ForceError::NonFinitePair { index });
    }
    let found = observations.len();
    if found < required {
        return Err(ForceError::TooFewPairs { required, found });
    }
    Ok(())
}
