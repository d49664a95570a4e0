//! The error type of the crate.

use nalgebra::Point;
use std::error::Error;
use tactile_core::CustomError;

/// Why a match could not be attempted. A run that does not converge is not an error: see
/// [`StopReason`](crate::StopReason).
///
/// ```
/// use nalgebra::Point2;
/// use tactile_match::{MatchError, NearestNeighbour, PointMatcher, linear_assignment};
/// let points = [Point2::new(1.0, 2.0)];
/// let empty = NearestNeighbour::default().match_points(&[], &points).err();
/// assert_eq!(empty, Some(MatchError::Empty { set: "model" }));
/// let error = linear_assignment([1, 1], |_, _| f64::NAN).unwrap_err();
/// assert_eq!(error, MatchError::Cost { row: 0, column: 0 });
/// let error = NearestNeighbour::within(-1.0).unwrap_err();
/// assert_eq!(error.to_string(), "option max_distance = -1 is outside (0, ∞)");
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MatchError {
    /// A point set has no points.
    #[error("the {set} has no points")]
    Empty {
        /// Name of the empty set, "model" or "target".
        set: &'static str,
    },
    /// The points are neither in the plane nor in space, the only two dimensions supported.
    #[error("points have {dimension} coordinates, expected 2 or 3")]
    Dimension {
        /// Number of coordinates of a point.
        dimension: usize,
    },
    /// A coordinate is NaN, infinite or too large to be squared (above 10¹⁵³ in double precision,
    /// 10¹⁸ in single precision).
    #[error(
        "point {row} of the {set} has a coordinate that is not finite or too large to be squared"
    )]
    NotFinite {
        /// Name of the point's set, "model" or "target".
        set: &'static str,
        /// Row of the point.
        row: usize,
    },
    /// Too many points of a large set coincide: each is a candidate for each, so the table of
    /// candidates grows with the square of their number.
    #[error("{count} points of the {set} lie at one position, at most {limit} can be matched")]
    Coincident {
        /// Name of the set, "model" or "target".
        set: &'static str,
        /// Number of coincident points.
        count: usize,
        /// The maximum number allowed.
        limit: usize,
    },
    /// An option is outside its range or NaN.
    #[error("option {option} = {value} is outside {expected}")]
    InvalidOption {
        /// Name of the option.
        option: &'static str,
        /// The value given.
        value: f64,
        /// The range of valid values.
        expected: &'static str,
    },
    /// A method that compares each model point with each target has too many of them.
    #[error(
        "{model} model points and {target} targets make more than {limit} pairs, which this method \
         keeps in memory; the default matcher can match sets of this size"
    )]
    TooManyPairs {
        /// Number of model points.
        model: usize,
        /// Number of targets.
        target: usize,
        /// Maximum number of pairs.
        limit: usize,
    },
    /// A cost is NaN or `−∞`.
    #[error("the cost of row {row}, column {column} is NaN or minus infinity")]
    Cost {
        /// Row of the cost.
        row: usize,
        /// Column of the cost.
        column: usize,
    },
    /// A pair names a row that does not exist in its set, or a row of an earlier pair.
    #[error("pair {pair} has row {row} of the {set}, which does not exist or is used twice")]
    PairRow {
        /// Index of the pair.
        pair: usize,
        /// Name of the set, "model" or "target".
        set: &'static str,
        /// Row in that set.
        row: usize,
    },
    /// A user-defined matcher failed.
    #[error(transparent)]
    Custom(CustomError),
}

impl MatchError {
    /// Wraps the error of a user-defined matcher.
    ///
    /// ```
    /// use tactile_match::MatchError;
    /// assert_eq!(MatchError::custom("no descriptors").to_string(), "no descriptors");
    /// ```
    pub fn custom(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Custom(CustomError::new(error))
    }
}

/// Maximum number of pairs of a table: 2 GiB of double precision.
const MAX_PAIRS: usize = 1 << 28;

/// Rejects sets whose table of all pairs is too large for the memory.
///
/// # Errors
/// [`MatchError::TooManyPairs`].
pub(crate) fn all_pairs(model: usize, target: usize) -> Result<(), MatchError> {
    if model.saturating_mul(target) <= MAX_PAIRS {
        return Ok(());
    }
    Err(MatchError::TooManyPairs {
        model,
        target,
        limit: MAX_PAIRS,
    })
}

/// Rejects empty sets and coordinates that are NaN, infinite or too large to be squared.
/// `O(I + J)`.
///
/// # Errors
/// [`MatchError::Empty`] and [`MatchError::NotFinite`].
pub(crate) fn point_sets<const D: usize>(
    model: &[Point<f64, D>],
    target: &[Point<f64, D>],
) -> Result<(), MatchError> {
    point_set("model", model)?;
    point_set("target", target)
}

/// Whether a coordinate is small enough that sums of squared differences stay finite.
pub(crate) fn usable(coordinate: f64) -> bool {
    (coordinate * coordinate * 16.0).is_finite()
}

/// Like [`point_sets`], for one set.
pub(crate) fn point_set<const D: usize>(
    set: &'static str,
    points: &[Point<f64, D>],
) -> Result<(), MatchError> {
    if points.is_empty() {
        return Err(MatchError::Empty { set });
    }
    match points.iter().position(|p| p.iter().any(|&c| !usable(c))) {
        Some(row) => Err(MatchError::NotFinite { set, row }),
        None => Ok(()),
    }
}

/// Maximum number of coincident points in a large set. Their candidates take 5 MB.
const MAX_COINCIDENT: usize = 1000;

/// Rejects a set with too many coincident points: O(n log n). `rows` is working memory.
pub(crate) fn spread_out<const D: usize>(
    set: &'static str,
    points: &[Point<f64, D>],
    rows: &mut Vec<usize>,
) -> Result<(), MatchError> {
    rows.clear();
    rows.extend(0..points.len());
    let order = |&a: &usize, &b: &usize| {
        let axes = points[a].iter().zip(points[b].iter());
        axes.map(|(x, y)| x.total_cmp(y))
            .fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
    };
    rows.sort_unstable_by(order);
    let together = rows.chunk_by(|&a, &b| points[a] == points[b]);
    let count = together.map(<[_]>::len).max().unwrap_or(0);
    if count > MAX_COINCIDENT {
        return Err(MatchError::Coincident {
            set,
            count,
            limit: MAX_COINCIDENT,
        });
    }
    Ok(())
}

/// Checks the maximum distance of a pair, which must be positive and finite.
pub(crate) fn valid_distance(max_distance: f64) -> Result<f64, MatchError> {
    option_within(
        "max_distance",
        max_distance,
        f64::MIN_POSITIVE,
        f64::MAX,
        "(0, ∞)",
    )?;
    Ok(max_distance)
}

/// Rejects an option outside `[low, high]`, NaN included.
pub(crate) fn option_within(
    option: &'static str,
    value: f64,
    low: f64,
    high: f64,
    expected: &'static str,
) -> Result<(), MatchError> {
    if value.is_finite() && (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(MatchError::InvalidOption {
            option,
            value,
            expected,
        })
    }
}

/// Rejects a count of zero.
pub(crate) fn at_least_one(option: &'static str, value: usize) -> Result<(), MatchError> {
    option_within(option, value as f64, 1.0, f64::MAX, "[1, ∞)")
}
