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
    match degrees.and_then(|n| StudentsT::new(0.0, 1.0, n).ok()) {
        Some(t) => t.inverse_cdf(UPPER_TAIL),
        None => Normal::standard().inverse_cdf(UPPER_TAIL),
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
}
