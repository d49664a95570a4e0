//! What every matcher asks of its input: at least one point in each set, every coordinate finite and not too
//! large to be squared.

use crate::MatchError;
use nalgebra::Point;

/// Rejects empty sets and coordinates that are NaN, infinite or too large to be squared; `O(I + J)`.
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

/// The same for one set.
pub(crate) fn point_set<const D: usize>(
    set: &'static str,
    points: &[Point<f64, D>],
) -> Result<(), MatchError> {
    if points.is_empty() {
        return Err(MatchError::Empty { set });
    }
    // Sixteen: room for differences, and for the sum of their squares.
    let usable = |c: f64| (c * c * 16.0).is_finite();
    match points.iter().position(|p| p.iter().any(|&c| !usable(c))) {
        Some(row) => Err(MatchError::NotFinite { set, row }),
        None => Ok(()),
    }
}

/// The largest distance of a pair, which must be positive and finite.
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    #[test]
    fn empty_and_not_finite_sets_are_typed_errors() {
        let good = [Point2::new(0.0, 1.0)];
        assert_eq!(
            point_sets(&[], &good),
            Err(MatchError::Empty { set: "model" })
        );
        assert_eq!(
            point_sets(&good, &[]),
            Err(MatchError::Empty { set: "target" })
        );
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let set = [Point2::new(0.0, 1.0), Point2::new(bad, 0.0)];
            let expected = |set| Err(MatchError::NotFinite { set, row: 1 });
            assert_eq!(point_sets(&set, &good), expected("model"));
            assert_eq!(point_sets(&good, &set), expected("target"));
        }
        assert_eq!(point_sets(&good, &good), Ok(()));
    }

    #[test]
    fn options_outside_their_range_are_rejected() {
        assert!(option_within("slack", 0.2, 0.0, 1.0, "[0, 1]").is_ok());
        for bad in [f64::NAN, -0.1, 1.1, f64::INFINITY] {
            assert!(option_within("slack", bad, 0.0, 1.0, "[0, 1]").is_err());
        }
    }
}
