//! Errors with the values that locate them, and the argument checks that raise them.

use nalgebra::Point;
use tactile_core::CustomError;
use thiserror::Error;

use crate::Smoothing;

/// The errors of this crate.
///
/// ```
/// use nalgebra::Point2;
/// use tactile_tps::{FitOptions, ThinPlateSpline, TpsError};
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]].map(Point2::from);
/// let targets = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]].map(Point2::from);
/// let error = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default()).unwrap_err();
/// assert_eq!(error, TpsError::Conflict { first: 0, second: 2 });
/// assert_eq!(error.to_string(),
///     "source points 0 and 2 coincide but their targets differ: smooth, or drop one");
/// ```
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TpsError {
    /// There is nothing to fit: no point, or none with a positive weight.
    #[error("no {0} to fit")]
    Empty(&'static str),
    /// Two corresponding arguments differ in length.
    #[error("{input}: expected {expected} of them, found {found}")]
    Length {
        /// The argument of the wrong length.
        input: &'static str,
        /// Expected length.
        expected: usize,
        /// Length found.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{input}: number {index} (from zero) is not finite")]
    NotFinite {
        /// The argument that contains it.
        input: &'static str,
        /// Its index, counted from zero.
        index: usize,
    },
    /// A weight is negative, NaN or infinite.
    #[error("weight {index} (from zero) is {value}, expected a finite number of at least zero")]
    Weight {
        /// Its index, counted from zero.
        index: usize,
        /// The value found.
        value: f64,
    },
    /// The smoothing parameter is negative, NaN or infinite.
    #[error("smoothing parameter {value}, expected a finite number of at least zero")]
    Lambda {
        /// The value given.
        value: f64,
    },
    /// The rank tolerance, below which a direction counts as not spanned, is outside `[0, 1)`.
    #[error("rank tolerance {value}, expected a number from 0 to below 1")]
    RankTolerance {
        /// The value given.
        value: f64,
    },
    /// The residual at which iteration stops is outside `(0, 1)`.
    #[error("tolerance {value}, expected a number above 0 and below 1")]
    Tolerance {
        /// The value given.
        value: f64,
    },
    /// The caller's callback stopped the fit before a spline existed.
    #[error("stopped by the caller")]
    Stopped,
    /// Two source points coincide, their targets differ, and there is no smoothing.
    #[error(
        "source points {first} and {second} coincide but their targets differ: smooth, or drop one"
    )]
    Conflict {
        /// Index of the earlier point.
        first: usize,
        /// Index of the later point.
        second: usize,
    },
    /// Cross-validation needs more points than the polynomial has coefficients.
    #[error("cross-validation needs more than {needed} distinct points, found {found}")]
    TooFewForValidation {
        /// Number of coefficients of the polynomial.
        needed: usize,
        /// Number of distinct points of positive weight.
        found: usize,
    },
    /// The kernel matrix is not positive definite on the complement of the affine functions.
    #[error("kernel is not conditionally positive definite on these points (column {column})")]
    NotDefinite {
        /// Column of the projected matrix with the failed pivot.
        column: usize,
    },
    /// A user-defined model or warp failed.
    #[error(transparent)]
    Custom(CustomError),
}

impl TpsError {
    /// Wraps the error or message of a user-defined model.
    ///
    /// ```
    /// use tactile_tps::TpsError;
    /// let error = TpsError::custom("the network has no weights");
    /// assert_eq!(error.to_string(), "the network has no weights");
    /// ```
    pub fn custom(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        Self::Custom(CustomError::new(error))
    }
}

/// Reports the first point with a non-finite coordinate.
pub(crate) fn finite<const D: usize>(
    points: &[Point<f64, D>],
    input: &'static str,
) -> Result<(), TpsError> {
    let broken = |p: &Point<f64, D>| p.iter().any(|x| !x.is_finite());
    match points.iter().position(broken) {
        Some(index) => Err(TpsError::NotFinite { input, index }),
        None => Ok(()),
    }
}

/// Checks that corresponding arguments have equal lengths.
pub(crate) fn same_count(
    input: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), TpsError> {
    if expected == found {
        return Ok(());
    }
    Err(TpsError::Length {
        input,
        expected,
        found,
    })
}

/// Checks that output and input have equal lengths.
pub(crate) fn same_length(expected: usize, found: usize) -> Result<(), TpsError> {
    same_count("output slice", expected, found)
}

/// Checks that there is at least one pair, that all coordinates are finite, and that weights, if
/// given, are valid.
pub(crate) fn validate_pairs<const D: usize>(
    sources: &[Point<f64, D>],
    targets: &[Point<f64, D>],
    weights: Option<&[f64]>,
) -> Result<(), TpsError> {
    if sources.is_empty() {
        return Err(TpsError::Empty("source points"));
    }
    same_count("target points", sources.len(), targets.len())?;
    finite(sources, "source points")?;
    finite(targets, "target points")?;
    weights.map_or(Ok(()), |weights| validate_weights(weights, sources.len()))
}

/// Checks that there is one weight per point, finite and not negative, and that at least one is
/// positive.
pub(crate) fn validate_weights(weights: &[f64], points: usize) -> Result<(), TpsError> {
    same_count("weights", points, weights.len())?;
    let valid = |&w: &f64| w >= 0.0 && w.is_finite();
    if let Some(index) = weights.iter().position(|w| !valid(w)) {
        let value = weights[index];
        return Err(TpsError::Weight { index, value });
    }
    if weights.iter().all(|&w| w == 0.0) {
        return Err(TpsError::Empty("weights"));
    }
    Ok(())
}

/// Checks that λ is finite and not negative.
pub(crate) fn validate_smoothing(smoothing: &Smoothing) -> Result<(), TpsError> {
    match *smoothing {
        Smoothing::Lambda(lambda) if !(lambda >= 0.0 && lambda.is_finite()) => {
            Err(TpsError::Lambda { value: lambda })
        }
        _ => Ok(()),
    }
}
