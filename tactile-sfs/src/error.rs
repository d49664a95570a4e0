//! Errors with the expected and the found values.

use tactile_core::{CustomError, InvalidOption};
use thiserror::Error;

/// Why a surface, a slope field or a set of control points cannot be computed.
///
/// ```
/// use tactile_sfs::{DepthTable, Domain, SfsError};
/// let error = DepthTable::new(&[(0.0, 0.0), (5.0, 1e-3), (3.0, 2e-3)]).unwrap_err();
/// assert_eq!(error, SfsError::TableNotIncreasing { index: 2 });
/// let error = Domain::new([-1.0, 1.0]).unwrap_err();
/// assert_eq!(error.to_string(), "`pixel width` is -1, expected a finite number above zero");
/// ```
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SfsError {
    /// The image has no pixels.
    #[error("the image has no pixels ({rows} rows, {columns} columns)")]
    EmptyImage {
        /// Rows of the image.
        rows: usize,
        /// Columns of the image.
        columns: usize,
    },
    /// The mask selects no pixels, or no pixels with data.
    #[error("the mask selects no usable pixel")]
    EmptyMask,
    /// Two inputs of one call have different shapes.
    #[error("the {input} has shape {found:?} but {expected:?} (rows, columns) is needed")]
    ShapeMismatch {
        /// The input with the wrong shape.
        input: &'static str,
        /// Expected rows and columns.
        expected: [usize; 2],
        /// Found rows and columns.
        found: [usize; 2],
    },
    /// An option is outside its range.
    #[error(transparent)]
    InvalidOption(#[from] InvalidOption),
    /// A user-defined stage failed.
    #[error(transparent)]
    Custom(CustomError),
    /// The contact of a calibration press is as large as the ball, or its radius is not finite.
    #[error(
        "the contact radius is {found_m} m, which is not below the ball's radius of \
         {ball_radius_m} m"
    )]
    ContactBeyondBall {
        /// Radius of the contact in metres.
        found_m: f64,
        /// Radius of the ball in metres.
        ball_radius_m: f64,
    },
    /// The light comes from behind the surface or grazes it (z ≤ 0). The shading then contains no
    /// information on the shape.
    #[error(
        "the light direction ({x}, {y}, {z}) does not come from the viewer's side (z must be \
         positive)"
    )]
    LightFromBelow {
        /// x of the given direction.
        x: f64,
        /// y of the given direction.
        y: f64,
        /// z of the given direction.
        z: f64,
    },
    /// The eikonal equation needs at least one height to start from.
    #[error("no height is known: give known heights or a height at the boundary")]
    NoKnownHeight,
    /// A slope is NaN or infinite, and the integrator cannot leave it out.
    #[error(
        "the slope at row {row}, column {column} is not finite; a masked integrator can leave it \
         out"
    )]
    NonFiniteSlope {
        /// Row of the slope.
        row: usize,
        /// Column of the slope.
        column: usize,
    },
    /// A calibration table has fewer than two entries.
    #[error("a calibration table needs at least 2 entries, found {found}")]
    TableTooShort {
        /// Number of entries.
        found: usize,
    },
    /// A calibration table is not sorted or not finite.
    #[error("entry {index} of the calibration table is not finite or does not increase")]
    TableNotIncreasing {
        /// Index of the invalid entry.
        index: usize,
    },
    /// A calibration table does not determine the depth at zero signal.
    #[error(
        "the table does not determine its depth at zero signal: it has {entries} entries above the \
         threshold of contact (4 are needed), and a parabola deviates from them by {misfit:.3} of \
         their range (0.010 is allowed)"
    )]
    TableZero {
        /// Number of entries above the threshold of contact.
        entries: usize,
        /// Root mean square of the distances to the parabola over the range of the depths.
        misfit: f64,
    },
    /// More control points were requested than the surface has pixels.
    #[error(
        "{requested} control points requested, but the surface has only {available} usable pixels"
    )]
    TooManyPoints {
        /// Requested points.
        requested: usize,
        /// Available pixels.
        available: usize,
    },
    /// Too few data to estimate a parameter.
    #[error("{available} usable pixels are too few, {needed} are needed")]
    TooFewPixels {
        /// Required pixels.
        needed: usize,
        /// Available pixels.
        available: usize,
    },
}

impl SfsError {
    /// The failure of a user-defined stage, from an error or a message.
    ///
    /// ```
    /// use tactile_sfs::SfsError;
    /// assert_eq!(SfsError::custom("no weights loaded").to_string(), "no weights loaded");
    /// ```
    pub fn custom(error: impl Into<Box<dyn core::error::Error + Send + Sync>>) -> Self {
        Self::Custom(CustomError::new(error))
    }
}
