//! Whether the pairs of a calibration lie on a line.
use crate::force::CalibrationPair;
use nalgebra::{Matrix3, Vector3};

/// Least departure that counts, as a share of the full scale: light ∝ p^0.95 or p^1.05 under a ball has 0.6 %, and changes the
/// modulus by some 5 %.
const LEAST: f64 = 6e-3;
/// Standard errors by which it must stand out.
const SIGNIFICANT: f64 = 5.0;
/// Fewest pairs: three parameters and as many degrees of freedom.
const FEWEST: usize = 6;

/// Departure of a parabola through the pairs from its chord at half scale, as a share of the full scale; `None` where it is small or
/// does not stand out of the pairs' scatter. With light ∝ pᵉ under a ball of growing load the sum goes as F^((2+e)/3), a line for e = 1
/// alone. O(pairs).
pub(super) fn of(pairs: &[CalibrationPair]) -> Option<f64> {
    let scale = |value: fn(&CalibrationPair) -> f64| {
        pairs.iter().map(value).map(f64::abs).fold(0.0, f64::max)
    };
    let (sum, force) = (scale(|p| p.integrated_pixel_value), scale(|p| p.force_n));
    if pairs.len() < FEWEST || !(sum > 0.0 && force > 0.0) {
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
    // c v² less its chord c v is −c/4 at one half.
    let departure = 0.25 * parabola[2].abs();
    (departure > LEAST && departure > SIGNIFICANT * 0.25 * error).then_some(departure)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of light ∝ pᵉ under a ball, forces off by a share of the full scale to either side in turn.
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
        assert_eq!(of(&pairs(1.0, 1e-3)), None);
        for exponent in [0.8, 0.9, 1.1, 1.2] {
            assert!(of(&pairs(exponent, 1e-3)).is_some(), "p^{exponent}");
        }
        // Hidden in the scatter, and three pairs.
        assert_eq!(of(&pairs(1.1, 0.02)), None);
        assert_eq!(of(&pairs(1.2, 0.0)[..3]), None);
    }
}
