//! Errors, each with the numbers that locate it, and the checks of arguments that raise them.

use nalgebra::Point;
use tactile_core::CustomError;
use thiserror::Error;

use crate::Smoothing;

/// Everything that can go wrong in this crate.
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
    /// There is nothing to fit: no point at all, or none with a weight above zero.
    #[error("no {0} to fit")]
    Empty(&'static str),
    /// Two arguments that belong together differ in length.
    #[error("{input}: expected {expected} of them, found {found}")]
    Length {
        /// The argument of the wrong length.
        input: &'static str,
        /// How many there should be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{input}: number {index} (from zero) is not finite")]
    NotFinite {
        /// The argument that holds it.
        input: &'static str,
        /// Its position, counted from zero.
        index: usize,
    },
    /// A weight is negative, NaN or infinite.
    #[error("weight {index} (from zero) is {value}, expected a finite number of at least zero")]
    Weight {
        /// Its position, counted from zero.
        index: usize,
        /// What was found there.
        value: f64,
    },
    /// The smoothing parameter is negative, NaN or infinite.
    #[error("smoothing parameter {value}, expected a finite number of at least zero")]
    Lambda {
        /// What was given.
        value: f64,
    },
    /// The tolerance below which a direction counts as not spanned is outside `[0, 1)`.
    #[error("rank tolerance {value}, expected a number from 0 to below 1")]
    RankTolerance {
        /// What was given.
        value: f64,
    },
    /// The residual at which to stop iterating is outside `(0, 1)`.
    #[error("tolerance {value}, expected a number above 0 and below 1")]
    Tolerance {
        /// What was given.
        value: f64,
    },
    /// The caller's callback stopped the fit before there was a spline.
    #[error("stopped by the caller")]
    Stopped,
    /// Two source points coincide, their targets differ, and no smoothing was asked for.
    #[error(
        "source points {first} and {second} coincide but their targets differ: smooth, or drop one"
    )]
    Conflict {
        /// The earlier of the two.
        first: usize,
        /// The later of the two.
        second: usize,
    },
    /// Cross-validation needs more points than the polynomial has coefficients.
    #[error("cross-validation needs more than {needed} distinct points, found {found}")]
    TooFewForValidation {
        /// Coefficients of the polynomial.
        needed: usize,
        /// Distinct points of positive weight.
        found: usize,
    },
    /// The kernel's matrix is not positive definite on the complement of the affine functions.
    #[error("kernel is not conditionally positive definite on these points (column {column})")]
    NotDefinite {
        /// Column of the projected matrix whose pivot failed.
        column: usize,
    },
    /// A user's own model or warp failed.
    #[error(transparent)]
    Custom(CustomError),
}

impl TpsError {
    /// The failure of a user's own model, as an error or a message.
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

/// Names the first point with a coordinate that is not finite.
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

/// Arguments that belong together are equally long.
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

/// The output is as long as the input.
pub(crate) fn same_length(expected: usize, found: usize) -> Result<(), TpsError> {
    same_count("output slice", expected, found)
}

/// At least one pair, all finite, with weights that are valid where they are given.
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

/// One weight a point, finite and not negative, one of them positive.
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

/// A λ is finite and not negative.
pub(crate) fn validate_smoothing(smoothing: &Smoothing) -> Result<(), TpsError> {
    match *smoothing {
        Smoothing::Lambda(lambda) if !(lambda >= 0.0 && lambda.is_finite()) => {
            Err(TpsError::Lambda { value: lambda })
        }
        _ => Ok(()),
    }
}
