//! Quantiles, and the generalised least-squares mean.

use super::estimate::FitStatistics;
use super::warning::Warning;
use crate::error::{ElasticityError, Quantity};
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};
use tactile_core::{Source, Uncertain};

/// The smallest of the finite degrees of freedom.
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
    /// The mean with its error by source, scaled up if the scatter exceeds the errors. If no errors
    /// were given, all of it is noise, with the degrees of freedom of the scatter.
    pub(crate) mean: Uncertain,
    chi_squared: f64,
    /// χ²/ν, if the error was scaled up by it.
    excess: Option<f64>,
    pub(crate) standardized_residuals: Vec<f64>,
    /// Weight of each number in the mean. The weights sum to one.
    pub(crate) weights: DVector<f64>,
}

impl CommonMean {
    /// Fit of one parameter, the mean.
    pub(crate) fn fit_statistics(&self) -> FitStatistics {
        let observations = self.standardized_residuals.len();
        FitStatistics::new(observations, 1, self.chi_squared)
    }

    /// Whether the error is known or was estimated from the scatter.
    pub(crate) fn has_error(&self) -> bool {
        self.mean.standard_error().is_finite()
    }

    /// Cautions that follow from scatter and errors. `bounded` states whether the interval has an
    /// upper end.
    pub(crate) fn warnings(&self, bounded: bool) -> Vec<Warning> {
        let excess = self.excess;
        let mut warnings: Vec<_> = excess
            .map(|reduced_chi_squared| Warning::ExcessScatter {
                reduced_chi_squared,
            })
            .into_iter()
            .collect();
        if !self.has_error() {
            warnings.push(Warning::NoErrorEstimate);
        } else if !bounded {
            warnings.push(Warning::UnboundedAbove);
        }
        warnings
    }
}

// The errors are scaled up to the scatter if the probability of χ² is below this.
const EXCESS_PROBABILITY: f64 = 1e-3;

/// θ = (1ᵀΣ⁻¹z)/(1ᵀΣ⁻¹1). Σ = 0 means unknown errors: weights are equal, and the error comes from
/// the scatter.
///
/// Errors common to all numbers enter as unknowns s with a standard normal prior, z = θ + U s + ε,
/// so that only the errors of single loads are factorised. After whitening with these, U is split
/// into its weighted mean ū and the rest Ũ. Then ŝ = (1 + ŨᵀŨ)⁻¹Ũᵀz, θ = z̄ − ū·ŝ and var θ =
/// 1/Σw + ūᵀ(1 + ŨᵀŨ)⁻¹ū. This is the Woodbury identity in a form without cancellation if a common
/// error is much larger than the others. O(n k²) with k common errors.
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

    let k = covariance.common().count();
    let mut shift = DVector::zeros(k);
    let mut beyond = DMatrix::zeros(n, k);
    for (j, column) in covariance.common().enumerate() {
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
    let from_scatter = !known || excess;
    let unit = if from_scatter { scale } else { 1.0 };
    let standard_error = match !known && degrees == 0 {
        true => f64::INFINITY,
        false => (unit * variance_of_mean).sqrt(),
    };
    let learnt = (from_scatter && degrees > 0).then_some(degrees as f64);
    Ok(CommonMean {
        mean: match known {
            true => covariance.of_mean(mean, &weights, standard_error, learnt),
            false => Uncertain::exact(mean).by_estimated(Source::Noise, standard_error, learnt),
        },
        chi_squared,
        excess: excess.then_some(scale),
        standardized_residuals: standardized(z, mean, known.then_some(covariance), unit),
        weights,
    })
}

/// Residuals over their standard deviations, with the variances multiplied by `unit`. Without a
/// covariance all have the same variance.
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

/// The numbers that share an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum CommonTo {
    /// Each number has an independent error.
    None,
    /// The numbers of one load.
    Load,
    /// All numbers.
    All,
}

/// Effect of one standard deviation of an error on each number.
#[derive(Debug, Clone)]
struct ErrorOf {
    source: Source,
    common_to: CommonTo,
    effects: DVector<f64>,
    degrees_of_freedom: Option<f64>,
}

/// The covariance Σ = diag(v) + Σ_load s sᵀ + U Uᵀ of n numbers.
///
/// v are variances of independent errors, s standard errors common to the numbers of one load, and
/// the columns of U errors common to all. With k columns, products and solutions take O(n k²) time
/// and O(n k) memory.
#[derive(Debug, Clone)]
pub(crate) struct Covariance {
    /// The load of each number. Numbers of one load, at most two (its radius and its indentation),
    /// are adjacent.
    loads: Vec<usize>,
    errors: Vec<ErrorOf>,
}

impl Covariance {
    /// The covariance of numbers, each with its load. An error source is common to all numbers;
    /// noise is independent.
    pub(crate) fn of(numbers: &[Uncertain], loads: impl Iterator<Item = usize>) -> Self {
        let none = Self {
            loads: loads.collect(),
            errors: Vec::new(),
        };
        Source::ALL.into_iter().fold(none, |sum, source| {
            if numbers.iter().all(|x| x.part(source) == 0.0) {
                return sum;
            }
            let common_to = match source {
                Source::Noise => CommonTo::None,
                _ => CommonTo::All,
            };
            let degrees = fewest(numbers.iter().map(|x| x.degrees_of_freedom(source)));
            sum.with(source, common_to, degrees, |i| numbers[i].part(source))
        })
    }

    /// Adds another error, given by the effect of one standard deviation on each number.
    pub(crate) fn with(
        mut self,
        source: Source,
        common_to: CommonTo,
        degrees_of_freedom: Option<f64>,
        effect: impl Fn(usize) -> f64,
    ) -> Self {
        let effects = DVector::from_fn(self.len(), |i, _| effect(i));
        if effects.iter().any(|&u| u != 0.0) {
            self.errors.push(ErrorOf {
                source,
                common_to,
                effects,
                degrees_of_freedom,
            });
        }
        self
    }

    /// Adds errors of a law or a table. The smallest of them is common to all loads. The excess at
    /// other loads is not known to be proportional: if it were treated as common, the weighted mean
    /// would extrapolate it away.
    pub(crate) fn with_model_errors(
        self,
        source: Source,
        standard_error: impl Fn(usize) -> f64,
    ) -> Self {
        let least = (0..self.len())
            .map(&standard_error)
            .fold(f64::INFINITY, f64::min);
        let beyond = |i| (standard_error(i).powi(2) - least.powi(2)).max(0.0).sqrt();
        self.with(source, CommonTo::All, None, |_| least)
            .with(source, CommonTo::None, None, beyond)
    }

    fn len(&self) -> usize {
        self.loads.len()
    }

    fn effects(&self, common_to: CommonTo) -> impl Iterator<Item = &DVector<f64>> {
        let errors = self.errors.iter();
        errors
            .filter(move |error| error.common_to == common_to)
            .map(|error| &error.effects)
    }

    /// The columns of U.
    fn common(&self) -> impl Iterator<Item = &DVector<f64>> {
        self.effects(CommonTo::All)
    }

    /// A weighted mean with this standard error. Its parts by source are in proportion to their
    /// contributions. `learnt` are the degrees of freedom of an error that was scaled up to the
    /// scatter.
    fn of_mean(
        &self,
        value: f64,
        weights: &DVector<f64>,
        standard_error: f64,
        learnt: Option<f64>,
    ) -> Uncertain {
        let mut mean = Uncertain::exact(value);
        for error in &self.errors {
            let degrees = learnt.or(error.degrees_of_freedom);
            mean = mean.by_estimated(error.source, self.effect_on(weights, error), degrees);
        }
        match mean.standard_error() {
            // The errors cancel to rounding.
            0.0 => mean.by(Source::Noise, standard_error),
            total => mean.map(|value| value, |_| standard_error / total),
        }
    }

    /// Effect of one standard deviation of an error on a weighted sum.
    fn effect_on(&self, weights: &DVector<f64>, error: &ErrorOf) -> f64 {
        let each = error.effects.component_mul(weights);
        match error.common_to {
            CommonTo::None => each.norm(),
            CommonTo::All => each.sum(),
            CommonTo::Load => {
                let loads = self.loads.chunk_by(|a, b| a == b);
                let mut rest = each.as_slice();
                let of_load = loads.map(|load| {
                    let (own, others) = rest.split_at(load.len());
                    rest = others;
                    own.iter().sum::<f64>().powi(2)
                });
                of_load.sum::<f64>().sqrt()
            }
        }
    }

    /// Σᵢᵢ.
    fn variance(&self, i: usize) -> f64 {
        let all = self.errors.iter().map(|error| error.effects[i].powi(2));
        all.sum()
    }

    /// (Σ − U Uᵀ)ᵢᵢ.
    fn unshared_variance(&self, i: usize) -> f64 {
        let unshared = self.errors.iter().filter(|e| e.common_to != CommonTo::All);
        unshared.map(|error| error.effects[i].powi(2)).sum()
    }

    /// Whether any error is positive.
    fn is_known(&self) -> bool {
        (0..self.len()).any(|i| self.variance(i) > 0.0)
    }

    /// Covariance of number i and the one before, (Σ − U Uᵀ)ᵢ,ᵢ₋₁. `None` if that number belongs to
    /// another load.
    fn within_load(&self, i: usize) -> Option<f64> {
        let before = i.checked_sub(1)?;
        let products = self.effects(CommonTo::Load).map(|u| u[i] * u[before]);
        (self.loads[i] == self.loads[before]).then(|| products.sum())
    }

    /// The factor L of Σ − U Uᵀ = L Lᵀ. Perfectly correlated or exact numbers get a ridge of 10⁻¹²
    /// of the mean variance (of Σ's, if all errors are common). The result then depends on the
    /// ridge in the twelfth digit, and rounding (10⁻¹⁶) is still far below it.
    fn unshared_factor(&self) -> Result<Factor, ElasticityError> {
        let n = self.len();
        let mean_of =
            |variance: &dyn Fn(usize) -> f64| (0..n).map(variance).sum::<f64>() / n as f64;
        let own = DVector::from_fn(n, |i, _| self.unshared_variance(i));
        let unshared = own.mean();
        let scale = match unshared > 0.0 {
            true => unshared,
            false => mean_of(&|i| self.variance(i)),
        };
        let ridge = 1e-12 * scale;
        let mut factor = Factor::identity(n);
        let mut i = 0;
        while i < n {
            let beside = (i + 1 < n).then(|| self.within_load(i + 1)).flatten();
            let block = |ridge: f64| {
                let first = own[i] + ridge;
                let below = beside.map_or(0.0, |b| b / first.sqrt());
                let second = beside.map(|_| own[i + 1] + ridge - below * below);
                (first, below, second)
            };
            let above = |(first, _, second): (f64, f64, Option<f64>), limit: f64| {
                first > limit && second.is_none_or(|second| second > limit)
            };
            let mut found = block(0.0);
            if !above(found, ridge * 1e-3) {
                found = block(ridge);
            }
            if !above(found, 0.0) {
                return Err(ElasticityError::Covariance {
                    quantity: Quantity::Force,
                });
            }
            let (first, below, second) = found;
            factor.diagonal[i] = first.sqrt();
            if let Some(second) = second {
                factor.below[i + 1] = below;
                factor.diagonal[i + 1] = second.sqrt();
            }
            i += 1 + usize::from(second.is_some());
        }
        Ok(factor)
    }
}

/// A lower block-triangular matrix L with blocks of one or two numbers on the diagonal.
struct Factor {
    diagonal: Vec<f64>,
    /// Lᵢ,ᵢ₋₁, or zero at the first number of a block.
    below: Vec<f64>,
}

impl Factor {
    /// The identity for n numbers with unknown errors.
    fn identity(n: usize) -> Self {
        Self {
            diagonal: vec![1.0; n],
            below: vec![0.0; n],
        }
    }

    /// L⁻¹v: numbers with independent errors of size one.
    fn whiten(&self, mut v: DVector<f64>) -> DVector<f64> {
        let mut before = 0.0;
        for (i, v) in v.iter_mut().enumerate() {
            *v = (*v - self.below[i] * before) / self.diagonal[i];
            before = *v;
        }
        v
    }

    /// L⁻ᵀv: weights of the numbers from those of the whitened numbers.
    fn weights(&self, mut v: DVector<f64>) -> DVector<f64> {
        let mut carried = 0.0;
        for (i, v) in v.iter_mut().enumerate().rev() {
            *v = (*v - carried) / self.diagonal[i];
            carried = self.below[i] * *v;
        }
        v
    }
}

#[cfg(test)]
#[path = "statistics_tests.rs"]
mod tests;
