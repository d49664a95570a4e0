//! Quantiles, and the generalised least squares mean.

use super::covariance::{Covariance, Factor};
use super::source::LogErrors;
use crate::error::{ElasticityError, Quantity};
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};
use tactile_core::statistics::effective_degrees_of_freedom;

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
    pub(crate) fn degrees_from(&self, sources: &[LogErrors]) -> Option<f64> {
        let parts: Vec<_> = sources
            .iter()
            .map(|(covariance, degrees)| (covariance.variance_of_sum(&self.weights), *degrees))
            .collect();
        self.degrees
            .or_else(|| effective_degrees_of_freedom(&parts))
    }
}

/// The errors are scaled up to the scatter when χ² is this improbable.
const EXCESS_PROBABILITY: f64 = 1e-3;

/// θ = (1ᵀΣ⁻¹z)/(1ᵀΣ⁻¹1). Σ = 0 means unknown: equal weights and the error from the scatter.
///
/// Errors that all numbers share enter as unknowns s of a standard normal prior, z = θ + U s + ε, so that only the errors of
/// single loads are factorised. With these whitened and U split into its weighted mean ū and the rest Ũ,
/// ŝ = (1 + ŨᵀŨ)⁻¹Ũᵀz, θ = z̄ − ū·ŝ and var θ = 1/Σw + ūᵀ(1 + ŨᵀŨ)⁻¹ū: the Woodbury identity, written so that nothing cancels where
/// a shared error is much larger than the others. O(n k²) with k shared errors.
pub(crate) fn common_mean(
    z: &[f64],
    covariance: &Covariance,
) -> Result<CommonMean, ElasticityError> {
    let n = z.len();
    let known = covariance.is_known();
    let factor = if known {
        covariance.unshared_factor()?
    } else {
        Factor::identity(n)
    };
    let ones = factor.whiten(DVector::from_element(n, 1.0));
    let numbers = factor.whiten(DVector::from_column_slice(z));
    let weight = ones.norm_squared();
    let centre = ones.dot(&numbers) / weight;
    let about_centre = numbers - &ones * centre;

    let k = covariance.shared().len();
    let mut shift = DVector::zeros(k);
    let mut beyond = DMatrix::zeros(n, k);
    for (j, column) in covariance.shared().iter().enumerate() {
        let column = factor.whiten(column.clone());
        shift[j] = ones.dot(&column) / weight;
        beyond.set_column(j, &(column - &ones * shift[j]));
    }
    let prior_and_data = DMatrix::identity(k, k) + beyond.tr_mul(&beyond);
    let solver = Cholesky::new(prior_and_data).ok_or(ElasticityError::Covariance {
        quantity: Quantity::Force,
    })?;
    let causes = solver.solve(&beyond.tr_mul(&about_centre));
    let mean = centre - shift.dot(&causes);
    let solved_shift = solver.solve(&shift);
    let variance_of_mean = 1.0 / weight + shift.dot(&solved_shift);
    let weights = factor.weights(&ones / weight - &beyond * solved_shift);
    let chi_squared = (about_centre - &beyond * &causes).norm_squared() + causes.norm_squared();

    let degrees = n - 1;
    let scale = chi_squared / degrees.max(1) as f64;
    let excess =
        degrees > 0 && known && chi_squared_tail(chi_squared, degrees) < EXCESS_PROBABILITY;
    let learnt = !known || excess;
    let unit = if learnt { scale } else { 1.0 };
    Ok(CommonMean {
        mean,
        standard_error: if !known && degrees == 0 {
            f64::INFINITY
        } else {
            (unit * variance_of_mean).sqrt()
        },
        chi_squared,
        minus_two_log_likelihood: minus_two_log_likelihood(chi_squared, n, known),
        degrees: (learnt && degrees > 0).then_some(degrees as f64),
        excess: excess.then_some(scale),
        standardized_residuals: standardized(z, mean, known.then_some(covariance), unit),
        weights,
    })
}

/// Residuals over their standard deviations, the variances times `unit`; without a covariance all have one variance.
fn standardized(z: &[f64], mean: f64, covariance: Option<&Covariance>, unit: f64) -> Vec<f64> {
    let over_spread = |(i, z): (usize, &f64)| {
        let spread = (covariance.map_or(1.0, |c| c.variance(i)) * unit).sqrt();
        if spread > 0.0 {
            (z - mean) / spread
        } else {
            0.0
        }
    };
    z.iter().enumerate().map(over_spread).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_shared_error_is_not_averaged_away() {
        let shared = Covariance::none(0..4)
            .with_own(|_| 0.2)
            .with_shared(|_| 0.1);
        let mean = common_mean(&[1.0, 1.2, 0.9, 0.9], &shared).unwrap();
        assert_relative_eq!(mean.mean, 1.0, epsilon = 1e-12);
        assert_relative_eq!(
            mean.standard_error.powi(2),
            0.01 + 0.04 / 4.0,
            max_relative = 1e-12
        );
    }

    /// The mean, its variance, χ² and the weights against the plain formulas with the matrix of all pairs.
    #[test]
    fn shared_errors_give_what_the_matrix_of_all_pairs_gives() {
        let z = [2.0, 2.3, 1.8, 2.1, 2.6, 1.9];
        let loads = [0, 0, 1, 2, 2, 3];
        let own = |i: usize| 0.1 + 0.03 * i as f64;
        let in_load = |i: usize| 0.2 - 0.02 * i as f64;
        let scale = |_: usize| 0.3;
        let slope = |i: usize| 0.05 * (i as f64 - 1.0);
        let covariance = Covariance::none(loads.into_iter())
            .with_own(own)
            .with_shared_in_load(in_load)
            .with_shared(scale)
            .with_shared(slope);
        let dense = DMatrix::from_fn(6, 6, |i, j| {
            let own = if i == j { own(i).powi(2) } else { 0.0 };
            let in_load = if loads[i] == loads[j] {
                in_load(i) * in_load(j)
            } else {
                0.0
            };
            own + in_load + scale(i) * scale(j) + slope(i) * slope(j)
        });
        let inverse = dense.clone().try_inverse().unwrap();
        let information = inverse.sum();
        let weights = inverse.column_sum() / information;
        let mean = weights.dot(&DVector::from_row_slice(&z));
        let residual = DVector::from_row_slice(&z).add_scalar(-mean);
        let chi_squared = residual.dot(&(&inverse * &residual));

        // Inverting a matrix of this condition (10²) costs three of sixteen digits.
        let found = common_mean(&z, &covariance).unwrap();
        assert_relative_eq!(found.mean, mean, max_relative = 1e-12);
        assert_relative_eq!(
            found.standard_error.powi(2),
            1.0 / information,
            max_relative = 1e-12
        );
        assert_relative_eq!(found.chi_squared, chi_squared, max_relative = 1e-11);
        assert_relative_eq!(found.weights, weights, max_relative = 1e-11);
        let variance = weights.dot(&(&dense * &weights));
        assert_relative_eq!(
            covariance.variance_of_sum(&weights),
            variance,
            max_relative = 1e-12
        );
        let given = Covariance::none(loads.into_iter()).with_given(|i, j| dense[(i, j)]);
        let of_matrix = common_mean(&z, &given).unwrap();
        assert_relative_eq!(of_matrix.mean, mean, max_relative = 1e-12);
        assert_relative_eq!(of_matrix.chi_squared, chi_squared, max_relative = 1e-11);
    }

    #[test]
    fn a_shared_error_far_above_all_others_costs_no_digits() {
        let covariance = Covariance::none(0..3)
            .with_own(|_| 1e-9)
            .with_shared(|_| 1.0);
        let found = common_mean(&[1.0, 1.0 + 1e-9, 1.0 - 1e-9], &covariance).unwrap();
        assert_relative_eq!(found.mean, 1.0, max_relative = 1e-15);
        assert_relative_eq!(found.standard_error, 1.0, max_relative = 1e-12);
        // Two residuals of one standard error each; z itself is rounded to 1e-16, a ten-millionth of them.
        assert_relative_eq!(found.chi_squared, 2.0, max_relative = 1e-6);
    }
}
