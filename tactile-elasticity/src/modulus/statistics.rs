//! Quantiles, and the generalised least squares mean.

use crate::error::{ElasticityError, Quantity};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal, StudentsT};

/// Two-sided 95 % quantile of Student's t; of the normal distribution where `degrees` is None.
pub(crate) fn quantile_95(degrees: Option<f64>) -> f64 {
    const P: f64 = 0.975;
    match degrees.and_then(|n| StudentsT::new(0.0, 1.0, n).ok()) {
        Some(t) => t.inverse_cdf(P),
        None => Normal::standard().inverse_cdf(P),
    }
}

/// ν = (Σ vᵢ)²/Σ (vᵢ²/νᵢ) of a sum of variances vᵢ, each estimated with νᵢ degrees of freedom (Welch 1947, Satterthwaite 1946); None
/// where all are known.
pub(crate) fn effective_degrees(parts: &[(f64, Option<f64>)]) -> Option<f64> {
    let total: f64 = parts.iter().map(|p| p.0).sum();
    let learnt: f64 = parts
        .iter()
        .filter_map(|(v, degrees)| Some(v * v / (*degrees)?))
        .sum();
    (learnt > 0.0).then(|| total * total / learnt)
}

/// The smallest of the degrees of freedom that are not infinite.
pub(crate) fn fewest(degrees: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    degrees.flatten().reduce(f64::min)
}

/// P(χ²_degrees > x).
pub(crate) fn chi_squared_tail(x: f64, degrees: usize) -> f64 {
    ChiSquared::new(degrees as f64).map_or(1.0, |d| d.sf(x.max(0.0)))
}

/// P(|t| > |x|), two-sided.
pub(crate) fn t_tail(x: f64, degrees: usize) -> f64 {
    StudentsT::new(0.0, 1.0, degrees as f64).map_or(1.0, |d| 2.0 * d.sf(x.abs()))
}

/// The best common mean of correlated numbers.
#[derive(Debug, Clone)]
pub(crate) struct CommonMean {
    pub(crate) mean: f64,
    /// Standard error, scaled up where the scatter exceeds the covariance.
    pub(crate) standard_error: f64,
    pub(crate) chi_squared: f64,
    /// Of the measured forces and lengths with their true values fitted to the law. Given errors enter by χ² and a constant alone:
    /// the covariance of ln E* depends on the law's slope, and would favour flat ones.
    pub(crate) minus_two_log_likelihood: f64,
    /// Degrees of freedom where the error was learnt from the scatter; None where it was given.
    pub(crate) degrees: Option<f64>,
    /// χ²/ν where it was used to scale the error up.
    pub(crate) excess: Option<f64>,
    pub(crate) standardized_residuals: Vec<f64>,
    /// Of every number in the mean; their sum is one.
    pub(crate) weights: DVector<f64>,
}

impl CommonMean {
    /// Degrees of freedom of the standard error; those of its independent sources, each with its covariance, where the scatter
    /// did not tell it.
    pub(crate) fn degrees_from<'a>(
        &self,
        sources: impl Iterator<Item = (&'a DMatrix<f64>, Option<f64>)>,
    ) -> Option<f64> {
        let variance = |c: &DMatrix<f64>| self.weights.dot(&(c * &self.weights));
        let parts: Vec<_> = sources.map(|(c, degrees)| (variance(c), degrees)).collect();
        self.degrees.or_else(|| effective_degrees(&parts))
    }
}

/// The errors are scaled up to the scatter when χ² is this improbable.
const EXCESS_PROBABILITY: f64 = 1e-3;

/// θ = (1ᵀΣ⁻¹z)/(1ᵀΣ⁻¹1). Σ = 0 means unknown: equal weights and the error from the scatter.
pub(crate) fn common_mean(
    z: &[f64],
    covariance: &DMatrix<f64>,
) -> Result<CommonMean, ElasticityError> {
    let n = z.len();
    let known = covariance.diagonal().iter().any(|&v| v > 0.0);
    let sigma = if known {
        covariance.clone()
    } else {
        DMatrix::identity(n, n)
    };
    let factor = ridged_cholesky(sigma)?;
    let z = DVector::from_column_slice(z);
    let ones = DVector::from_element(n, 1.0);
    let weights = factor.solve(&ones);
    let information = weights.sum();
    let mean = weights.dot(&z) / information;
    let residual = &z - &ones * mean;
    let chi_squared = residual.dot(&factor.solve(&residual));
    let degrees = n - 1;
    let scale = chi_squared / degrees.max(1) as f64;
    let excess =
        degrees > 0 && known && chi_squared_tail(chi_squared, degrees) < EXCESS_PROBABILITY;
    let learnt = !known || excess;
    let variance = if learnt {
        scale / information
    } else {
        1.0 / information
    };
    let unit = if learnt { scale } else { 1.0 };
    Ok(CommonMean {
        mean,
        standard_error: if !known && degrees == 0 {
            f64::INFINITY
        } else {
            variance.sqrt()
        },
        chi_squared,
        minus_two_log_likelihood: minus_two_log_likelihood(chi_squared, n, known),
        degrees: (learnt && degrees > 0).then_some(degrees as f64),
        excess: excess.then_some(scale),
        standardized_residuals: standardized(&residual, known.then_some(covariance), unit),
        weights: weights / information,
    })
}

/// Residuals over their standard deviations, the variances times `unit`; without a covariance all have one variance.
fn standardized(residual: &DVector<f64>, covariance: Option<&DMatrix<f64>>, unit: f64) -> Vec<f64> {
    let spread = |i: usize| (covariance.map_or(1.0, |c| c[(i, i)]) * unit).sqrt();
    let over_spread = |i: usize| {
        if spread(i) > 0.0 {
            residual[i] / spread(i)
        } else {
            0.0
        }
    };
    (0..residual.len()).map(over_spread).collect()
}

/// Of a normal sample; where the variance is unknown, at its most likely value.
fn minus_two_log_likelihood(chi_squared: f64, n: usize, known: bool) -> f64 {
    let n = n as f64;
    let full = (2.0 * std::f64::consts::PI).ln() * n;
    if known {
        full + chi_squared
    } else {
        full + n * (1.0 + (chi_squared / n).ln())
    }
}

/// Cholesky of a covariance; perfectly correlated parts get a ridge of 10⁻¹² of the mean variance.
fn ridged_cholesky(
    sigma: DMatrix<f64>,
) -> Result<nalgebra::Cholesky<f64, nalgebra::Dyn>, ElasticityError> {
    let ridge = 1e-12 * sigma.trace() / sigma.nrows() as f64;
    if let Some(factor) = sigma.clone().cholesky() {
        let d = factor.l_dirty().diagonal();
        if d.min() * d.min() > ridge * 1e-3 {
            return Ok(factor);
        }
    }
    let n = sigma.nrows();
    (sigma + DMatrix::identity(n, n) * ridge)
        .cholesky()
        .ok_or(ElasticityError::Covariance {
            quantity: Quantity::Force,
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        assert_relative_eq!(
            quantile_95(None),
            1.959_963_984_540_054,
            max_relative = 1e-9
        );
        assert_relative_eq!(
            quantile_95(Some(1.0)),
            12.706_204_736_174_7,
            max_relative = 1e-7
        );
        assert_relative_eq!(
            quantile_95(Some(10.0)),
            2.228_138_851_964_94,
            max_relative = 1e-7
        );
    }

    #[test]
    fn a_shared_error_is_not_averaged_away() {
        let shared = DMatrix::from_element(4, 4, 0.01) + DMatrix::identity(4, 4) * 0.04;
        let mean = common_mean(&[1.0, 1.2, 0.9, 0.9], &shared).unwrap();
        assert_relative_eq!(mean.mean, 1.0, epsilon = 1e-12);
        assert_relative_eq!(
            mean.standard_error.powi(2),
            0.01 + 0.04 / 4.0,
            max_relative = 1e-12
        );
    }
}
