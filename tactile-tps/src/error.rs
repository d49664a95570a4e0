//! Errors, each with the numbers that say where.

use thiserror::Error;

/// Everything that can go wrong in this crate.
///
/// ```
/// # use nalgebra::Point2;
/// # use tactile_tps::{FitOptions, ThinPlateSpline, TpsError};
/// let sources = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]].map(Point2::from);
/// let targets = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]].map(Point2::from);
/// let error = ThinPlateSpline::fit(&sources, &targets, &FitOptions::default()).unwrap_err();
/// assert_eq!(error, TpsError::Conflict { first: 0, second: 2 });
/// assert_eq!(error.to_string(), "source points 0 and 2 coincide but their targets differ: smooth, or drop one");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Error)]
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
    /// Influences need a factor, and the iterative solver has none.
    #[error("the iterative solver has no factor: use the direct one")]
    NoFactor,
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
    /// The spline is no linear map of its targets: cross-validation chooses λ from them.
    #[error("cross-validation lets λ follow the targets: hold λ at what it chose")]
    DependsOnTargets,
    /// The kernel's matrix is not positive definite on the complement of the affine functions.
    #[error("kernel is not conditionally positive definite on these points (column {column})")]
    NotDefinite {
        /// Column of the projected matrix whose pivot failed.
        column: usize,
    },
}
