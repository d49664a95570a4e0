//! Quantiles and degrees of freedom.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Two-sided 95 % quantile of Student's t with so many degrees of freedom, of the normal
/// distribution where `degrees` is `None` or not positive.
///
/// ```
/// use tactile_core::statistics::quantile_95;
/// assert!((quantile_95(Some(4.0)) - 2.776).abs() < 1e-3);
/// assert!((quantile_95(None) - 1.960).abs() < 1e-3);
/// ```
#[must_use]
pub fn quantile_95(degrees: Option<f64>) -> f64 {
    const UPPER_TAIL: f64 = 0.975;
    let z = Normal::standard().inverse_cdf(UPPER_TAIL);
    match degrees.and_then(|n| Some((n, StudentsT::new(0.0, 1.0, n).ok()?))) {
        // The iteration behind the inverse loses digits with the degrees of freedom, and does not
        // end for millions of them, as where a calibration is free of scatter. The expansion about
        // the normal quantile is good to 1e-11 from a thousand on (Fisher & Cornish, Technometrics
        // 2, 1960).
        Some((n, _)) if n > 1e3 => {
            let first = (z.powi(3) + z) / 4.0;
            let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
            let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
            z + (first + (second + third / n) / n) / n
        }
        Some((_, t)) => t.inverse_cdf(UPPER_TAIL),
        None => z,
    }
}

/// Degrees of freedom of a sum of independent variances vᵢ, each estimated with νᵢ degrees of
/// freedom: ν = (Σ vᵢ)²/Σ (vᵢ²/νᵢ) (Welch 1947, Satterthwaite 1946). `None` where all are known.
///
/// ```
/// use tactile_core::statistics::effective_degrees_of_freedom;
/// // One estimated variance beside a known one of the same size.
/// assert_eq!(effective_degrees_of_freedom(&[(1.0, Some(4.0)), (1.0, None)]), Some(16.0));
/// assert_eq!(effective_degrees_of_freedom(&[(1.0, None)]), None);
/// ```
#[must_use]
pub fn effective_degrees_of_freedom(parts: &[(f64, Option<f64>)]) -> Option<f64> {
    let total: f64 = parts.iter().map(|(variance, _)| variance).sum();
    let estimated: f64 = parts
        .iter()
        .filter_map(|(variance, degrees)| Some(variance * variance / (*degrees)?))
        .sum();
    (estimated > 0.0).then(|| total * total / estimated)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Tables of Student's t, to the digits printed there.
    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (degrees, expected) in [
            (None, 1.959_963_984_540_054),
            (Some(1.0), 12.706_204_736_174_7),
            (Some(10.0), 2.228_138_851_964_94),
        ] {
            assert_relative_eq!(quantile_95(degrees), expected, max_relative = 1e-7);
        }
    }

    /// Without a step where the expansion takes over, and with an end.
    #[test]
    fn quantiles_of_many_degrees_reach_the_normal_one() {
        // Two implementations at one place: the iteration has seven digits there.
        let step = quantile_95(Some(1001.0)) - quantile_95(Some(1000.0));
        // −z (z² + 1)/(4 n²) for a step of one.
        assert!((step + 2.4e-6).abs() < 5e-7, "{step:e}");
        for degrees in [1e6, 1e12, 1e25, f64::MAX] {
            // 1.2e-6 at a million.
            assert_relative_eq!(
                quantile_95(Some(degrees)),
                quantile_95(None),
                max_relative = 2e-6
            );
        }
    }
}
