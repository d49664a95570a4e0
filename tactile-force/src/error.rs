//! The errors of this crate, with the numbers that explain them.

use tactile_core::{CustomError, InvalidOption};
use thiserror::Error;

/// The reason why an input was rejected.
///
/// No contact is a value, a fit that does not converge is a report, and a calibration used outside
/// its range is a flag: none of them is an error.
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
        "the reference's mean of {mean} grey levels is below the {required} needed to see its \
         vignetting"
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
    /// The fitted force falls where the pixel value rises, and a monotone calibration was asked
    /// for.
    #[error("the force falls from pixel value {from} to {to}")]
    NotMonotone {
        /// Pixel value at which the force starts to fall.
        from: f64,
        /// Pixel value at which it is lower.
        to: f64,
    },
    /// An option outside its domain.
    #[error(transparent)]
    InvalidOption(#[from] InvalidOption),
    /// The failure of a user's own stage, such as a calibration.
    #[error(transparent)]
    Custom(CustomError),
}

impl ForceError {
    /// The failure of a user's own stage: an error, or a message.
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
