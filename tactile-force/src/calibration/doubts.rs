//! Reasons to doubt the pairs of a line.

use nalgebra::{Matrix3, Vector3};
use tactile_core::Estimate;

use super::CalibrationPair;

/// An offset or a pair counts as doubtful beyond this number of standard errors. More are required
/// if few pairs determine the error.
const DOUBTFUL: f64 = 5.0;

/// Smallest offset and smallest distance of a pair from the line, as fractions of the full scale,
/// that are doubted: they matter beside the default error of a gauge, 0.2 %.
const LEAST_OFFSET: f64 = 2e-3;
const LEAST_DISTANCE: f64 = 1e-2;

/// Smallest bend of the pairs that is doubted. Light ∝ p^0.95 or p^1.05 under a ball deviates by
/// 0.6 % and changes the modulus by about 5 %.
const LEAST_BEND: f64 = 6e-3;

/// A reason to doubt the pairs of a calibration.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, LineDoubt};
/// let doubts = |forces: [f64; 7]| {
///     let noise = |k: usize| 1e-4 * [1.0, -1.0, 0.5][k % 3];
///     let pairs: Vec<_> = (0..7)
///         .map(|k| CalibrationPair::loading(1e5 * k as f64, forces[k] + noise(k)))
///         .collect();
///     LinearCalibration::fit(&pairs).map(|line| line.report().doubts.clone())
/// };
/// assert_eq!(doubts([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])?, []);
/// let not_zeroed = doubts([0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65])?;
/// assert!(matches!(not_zeroed[..], [LineDoubt::Offset { offset_n }] if offset_n.value > 0.049));
/// let mistyped = doubts([0.0, 0.1, 0.2, 3.0, 0.4, 0.5, 0.6])?;
/// assert!(matches!(mistyped[..], [LineDoubt::Outlier { pair: 3, .. }]));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum LineDoubt {
    /// The line has a force without light: the gauge was not zeroed, or the sums contain other
    /// light. Every force has this standard error.
    Offset {
        /// The force without light, in newtons.
        offset_n: Estimate,
    },
    /// One pair carries the squares: without it the pairs scatter far less.
    Outlier {
        /// The pair, counted from 0.
        pair: usize,
        /// Its force in newtons.
        force_n: f64,
        /// The force of the line through the other pairs.
        expected_n: f64,
    },
    /// The pairs are not on a line: light is not proportional to pressure.
    Bend {
        /// Deviation of a parabola through the pairs from its chord at half scale, as a fraction of
        /// the full scale.
        departure: f64,
    },
}

impl LineDoubt {
    /// The doubts about pairs and their line. An outlier hides the others. O(pairs).
    pub(super) fn of(
        pairs: &[CalibrationPair],
        offset_n: Estimate,
        full_scale_n: f64,
    ) -> Vec<Self> {
        if let Some(outlier) = Self::outlier(pairs, full_scale_n) {
            return vec![outlier];
        }
        if let Some(departure) = bend_of(pairs) {
            return vec![Self::Bend { departure }];
        }
        let degrees = offset_n.degrees_of_freedom.unwrap_or(0.0);
        let limit = DOUBTFUL * (1.0 + 3.0 / degrees) * offset_n.standard_error;
        let offset = offset_n.value.abs() > limit.max(LEAST_OFFSET * full_scale_n);
        offset
            .then_some(Self::Offset { offset_n })
            .into_iter()
            .collect()
    }

    /// The pair without which the scatter falls the most, if it falls to a fifth or less.
    fn outlier(pairs: &[CalibrationPair], full_scale_n: f64) -> Option<Self> {
        let n = pairs.len() as f64;
        if pairs.len() < 5 {
            return None;
        }
        let values = || pairs.iter().map(|p| (p.integrated_pixel_value, p.force_n));
        let [mean, force] = [
            values().map(|p| p.0).sum::<f64>() / n,
            values().map(|p| p.1).sum::<f64>() / n,
        ];
        let sum =
            |f: fn(f64, f64) -> f64| values().map(|(v, p)| f(v - mean, p - force)).sum::<f64>();
        let (squares, products) = (sum(|v, _| v * v), sum(|v, f| v * f));
        let total = sum(|_, f| f * f) - products * products / squares;
        // Without pair i the line is off there by r/(1 − h), and the squares lose r²/(1 − h).
        let without = values().map(|(v, f)| {
            let left = 1.0 - 1.0 / n - (v - mean).powi(2) / squares;
            let residual = f - force - products / squares * (v - mean);
            (
                residual / left,
                (total - residual * residual / left).max(0.0) / (n - 3.0),
            )
        });
        let (pair, (distance, variance)) =
            without.enumerate().min_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        let farther = distance.abs() > LEAST_DISTANCE * full_scale_n;
        // A fifth of the scatter is a twenty-fifth of the variance.
        let carries = DOUBTFUL.powi(2) * (1.0 + 3.0 / (n - 3.0)) * variance < total / (n - 2.0);
        let force_n = pairs[pair].force_n;
        (farther && carries).then_some(Self::Outlier {
            pair,
            force_n,
            expected_n: force_n - distance,
        })
    }
}

/// Deviation of a parabola through the pairs from its chord at half scale, as a fraction of the
/// full scale. `None` if it is small or not significant within the scatter of the pairs. With light
/// ∝ pᵉ under a ball of growing load, the sum is proportional to F^((2+e)/3), which is a line only
/// for e = 1. O(pairs).
fn bend_of(pairs: &[CalibrationPair]) -> Option<f64> {
    let scale = |value: fn(&CalibrationPair) -> f64| {
        pairs.iter().map(value).map(f64::abs).fold(0.0, f64::max)
    };
    let (sum, force) = (scale(|p| p.integrated_pixel_value), scale(|p| p.force_n));
    // Minimum number of pairs: three parameters and three degrees of freedom.
    if pairs.len() < 6 || !(sum > 0.0 && force > 0.0) {
        return None;
    }
    let powers = |pair: &CalibrationPair| {
        let v = pair.integrated_pixel_value / sum;
        (Vector3::new(1.0, v, v * v), pair.force_n / force)
    };
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (row, force) in pairs.iter().map(powers) {
        normal += row * row.transpose();
        right += row * force;
    }
    let inverse = normal.cholesky()?.inverse();
    let parabola = inverse * right;
    let squares = pairs.iter().map(powers);
    let squares: f64 = squares
        .map(|(row, force)| (force - row.dot(&parabola)).powi(2))
        .sum();
    let error = (squares / (pairs.len() - 3) as f64 * inverse[(2, 2)]).sqrt();
    // c v² minus its chord c v is −c/4 at one half.
    let departure = 0.25 * parabola[2].abs();
    (departure > LEAST_BEND && departure > DOUBTFUL * 0.25 * error).then_some(departure)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs with light ∝ pᵉ under a ball. The forces alternate by a fraction of the full scale to
    /// either side.
    fn pairs(exponent: f64, error: f64) -> Vec<CalibrationPair> {
        let pair = |k: i32| {
            let force = f64::from(k) / 12.0;
            let noise = if k % 2 == 0 { error } else { -error };
            CalibrationPair::loading(1e6 * force.powf((2.0 + exponent) / 3.0), force + noise)
        };
        (0..=12).map(pair).collect()
    }

    #[test]
    fn light_that_is_not_proportional_bends_the_pairs() {
        assert_eq!(bend_of(&pairs(1.0, 1e-3)), None);
        for exponent in [0.8, 0.9, 1.1, 1.2] {
            assert!(bend_of(&pairs(exponent, 1e-3)).is_some(), "p^{exponent}");
        }
        // The bend is hidden in the scatter; the second case has only three pairs.
        assert_eq!(bend_of(&pairs(1.1, 0.02)), None);
        assert_eq!(bend_of(&pairs(1.2, 0.0)[..3]), None);
    }
}
