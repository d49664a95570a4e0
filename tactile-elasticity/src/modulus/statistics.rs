//! Quantiles, and the generalised least squares mean.

use super::estimate::FitStatistics;
use super::warning::Warning;
use crate::error::{ElasticityError, Quantity};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
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
    chi_squared: f64,
    /// Degrees of freedom where the error was learnt from the scatter. None where it was given.
    pub(crate) degrees: Option<f64>,
    /// χ²/ν where it was used to scale the error up.
    excess: Option<f64>,
    pub(crate) standardized_residuals: Vec<f64>,
    /// Of every number in the mean. Their sum is one.
    pub(crate) weights: DVector<f64>,
}

impl CommonMean {
    /// Fit of one parameter, the mean.
    pub(crate) fn fit_statistics(&self) -> FitStatistics {
        let observations = self.standardized_residuals.len();
        FitStatistics::new(observations, 1, self.chi_squared)
    }

    /// Cautions that follow from the scatter and the errors. `bounded` is whether the interval has
    /// an upper end.
    pub(crate) fn warnings(&self, bounded: bool) -> Vec<Warning> {
        let excess = self.excess;
        let mut warnings: Vec<_> = excess
            .map(|reduced_chi_squared| Warning::ExcessScatter {
                reduced_chi_squared,
            })
            .into_iter()
            .collect();
        if self.standard_error.is_infinite() {
            warnings.push(Warning::NoErrorEstimate);
        } else if !bounded {
            warnings.push(Warning::UnboundedAbove);
        }
        warnings
    }

    /// Degrees of freedom of the standard error. Those of its independent sources, each with its
    /// covariance, where the scatter did not tell it.
    pub(crate) fn degrees_from(&self, sources: &[LogErrors]) -> Option<f64> {
        let parts: Vec<_> = sources
            .iter()
            .map(|(covariance, degrees)| (covariance.variance_of_sum(&self.weights), *degrees))
            .collect();
        self.degrees
            .or_else(|| effective_degrees_of_freedom(&parts))
    }
}

// The errors are scaled up to the scatter when χ² is this improbable.
const EXCESS_PROBABILITY: f64 = 1e-3;

/// θ = (1ᵀΣ⁻¹z)/(1ᵀΣ⁻¹1). Σ = 0 means unknown: equal weights and the error from the scatter.
///
/// Errors that all numbers share enter as unknowns s of a standard normal prior, z = θ + U s + ε,
/// so that only the errors of single loads are factorised. With these whitened and U split into its
/// weighted mean ū and the rest Ũ, ŝ = (1 + ŨᵀŨ)⁻¹Ũᵀz, θ = z̄ − ū·ŝ and var θ = 1/Σw + ūᵀ(1 +
/// ŨᵀŨ)⁻¹ū: the Woodbury identity, written so that nothing cancels where a shared error is much
/// larger than the others. O(n k²) with k shared errors.
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
        degrees: (learnt && degrees > 0).then_some(degrees as f64),
        excess: excess.then_some(scale),
        standardized_residuals: standardized(z, mean, known.then_some(covariance), unit),
        weights,
    })
}

/// Residuals over their standard deviations, the variances times `unit`. Without a covariance all
/// have one variance.
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

/// The covariance Σ = diag(v) + Σ_load s sᵀ + U Uᵀ + G of n numbers.
///
/// v are variances of errors that each number has for itself, s standard errors that the numbers of
/// one load have in common, the columns of U those that all have in common, and G is a matrix that
/// was given. Without G, products and solutions take O(n k²) time and O(n k) memory with k columns.
/// A given matrix is factorised in O(n³).
#[derive(Debug, Clone)]
pub(crate) struct Covariance {
    /// The load that each number belongs to. Numbers of one load are neighbours.
    loads: Vec<usize>,
    own: DVector<f64>,
    within_loads: Vec<DVector<f64>>,
    shared: Vec<DVector<f64>>,
    given: Option<DMatrix<f64>>,
}

impl Covariance {
    /// No errors at all, of numbers that belong to these loads.
    pub(crate) fn none(loads: impl Iterator<Item = usize>) -> Self {
        let loads: Vec<usize> = loads.collect();
        Self {
            own: DVector::zeros(loads.len()),
            loads,
            within_loads: Vec::new(),
            shared: Vec::new(),
            given: None,
        }
    }

    /// With the standard error that each number has for itself.
    pub(crate) fn with_own(mut self, standard_error: impl Fn(usize) -> f64) -> Self {
        self.own
            .iter_mut()
            .enumerate()
            .for_each(|(i, v)| *v += standard_error(i).powi(2));
        self
    }

    /// With standard errors that the numbers of one load have in common.
    pub(crate) fn with_shared_in_load(mut self, standard_error: impl Fn(usize) -> f64) -> Self {
        self.within_loads.push(self.column(standard_error));
        self
    }

    /// With standard errors that all numbers have in common: what one standard error of the cause
    /// does to each.
    pub(crate) fn with_shared(mut self, standard_error: impl Fn(usize) -> f64) -> Self {
        let column = self.column(standard_error);
        if column.iter().any(|&u| u != 0.0) {
            self.shared.push(column);
        }
        self
    }

    /// With standard errors of a law or a table that err the same way at all loads as far as the
    /// smallest goes. What they err beyond that at the others is not known to be in proportion:
    /// counted as common, the weighted mean would extrapolate it away.
    pub(crate) fn with_model_errors(self, standard_error: impl Fn(usize) -> f64) -> Self {
        let least = (0..self.len())
            .map(&standard_error)
            .fold(f64::INFINITY, f64::min);
        self.with_shared(|_| least)
            .with_own(|i| (standard_error(i).powi(2) - least.powi(2)).max(0.0).sqrt())
    }

    /// With a matrix of all pairs.
    pub(crate) fn with_given(mut self, entry: impl FnMut(usize, usize) -> f64) -> Self {
        let matrix = DMatrix::from_fn(self.len(), self.len(), entry);
        self.given = Some(match self.given.take() {
            Some(given) => given + matrix,
            None => matrix,
        });
        self
    }

    /// The sum with the covariance of independent errors of the same numbers.
    fn plus(mut self, other: &Self) -> Self {
        self.own += &other.own;
        self.within_loads.extend_from_slice(&other.within_loads);
        self.shared.extend_from_slice(&other.shared);
        match &other.given {
            Some(given) => self.with_given(|i, j| given[(i, j)]),
            None => self,
        }
    }

    fn column(&self, entry: impl Fn(usize) -> f64) -> DVector<f64> {
        DVector::from_fn(self.len(), |i, _| entry(i))
    }

    fn len(&self) -> usize {
        self.loads.len()
    }

    /// What one standard error of each shared cause does to every number.
    fn shared(&self) -> &[DVector<f64>] {
        &self.shared
    }

    /// Σᵢᵢ.
    fn variance(&self, i: usize) -> f64 {
        let shared = self.shared.iter().map(|u| u[i].powi(2));
        self.unshared_variance(i) + shared.sum::<f64>()
    }

    /// (Σ − U Uᵀ)ᵢᵢ.
    fn unshared_variance(&self, i: usize) -> f64 {
        let given = self.given.as_ref().map_or(0.0, |g| g[(i, i)]);
        let within = self.within_loads.iter().map(|u| u[i].powi(2));
        self.own[i] + given + within.sum::<f64>()
    }

    /// Whether any error is above zero.
    fn is_known(&self) -> bool {
        (0..self.len()).any(|i| self.variance(i) > 0.0)
    }

    /// wᵀΣw, the variance of a weighted sum.
    fn variance_of_sum(&self, weights: &DVector<f64>) -> f64 {
        let own = self.own.component_mul(weights).dot(weights);
        let shared: f64 = self.shared.iter().map(|u| u.dot(weights).powi(2)).sum();
        let given = self
            .given
            .as_ref()
            .map_or(0.0, |g| weights.dot(&(g * weights)));
        let within = |u: &DVector<f64>| -> f64 {
            let sum_of_load =
                |load: std::ops::Range<usize>| load.map(|i| u[i] * weights[i]).sum::<f64>();
            self.ranges().map(|load| sum_of_load(load).powi(2)).sum()
        };
        own + shared + given + self.within_loads.iter().map(within).sum::<f64>()
    }

    /// The ranges of numbers that belong to one load.
    fn ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let mut next = 0;
        self.loads.chunk_by(|a, b| a == b).map(move |chunk| {
            let start = next;
            next += chunk.len();
            start..next
        })
    }

    /// Σ − U Uᵀ over a range of numbers.
    fn unshared(&self, range: &std::ops::Range<usize>) -> DMatrix<f64> {
        let start = range.start;
        let in_one_load = |i: usize, j: usize| self.loads[i] == self.loads[j];
        DMatrix::from_fn(range.len(), range.len(), |r, c| {
            let (i, j) = (start + r, start + c);
            let own = if i == j { self.own[i] } else { 0.0 };
            let given = self.given.as_ref().map_or(0.0, |g| g[(i, j)]);
            let within = self.within_loads.iter().map(|u| u[i] * u[j]);
            let within: f64 = if in_one_load(i, j) { within.sum() } else { 0.0 };
            own + given + within
        })
    }

    /// The factor L of Σ − U Uᵀ = L Lᵀ. What is perfectly correlated or without error gets a ridge
    /// of 10⁻¹² of the mean variance (of Σ's, where all errors are shared): the answer then depends
    /// on it in the twelfth digit, and rounding (10⁻¹⁶) is still far below it.
    fn unshared_factor(&self) -> Result<Factor, ElasticityError> {
        let mean_of = |variance: &dyn Fn(usize) -> f64| {
            (0..self.len()).map(variance).sum::<f64>() / self.len() as f64
        };
        let unshared = mean_of(&|i| self.unshared_variance(i));
        let scale = if unshared > 0.0 {
            unshared
        } else {
            mean_of(&|i| self.variance(i))
        };
        let ridge = 1e-12 * scale;
        let block = |range: std::ops::Range<usize>| {
            let lower = ridged_cholesky(self.unshared(&range), ridge)?.unpack();
            Ok((range.start, lower))
        };
        let blocks = if self.given.is_some() {
            vec![block(0..self.len())?]
        } else {
            self.ranges().map(block).collect::<Result<_, _>>()?
        };
        Ok(Factor { blocks })
    }
}

/// A lower triangular matrix L of blocks on the diagonal.
struct Factor {
    /// First row, and the block.
    blocks: Vec<(usize, DMatrix<f64>)>,
}

impl Factor {
    /// The identity for n numbers, of which nothing is known.
    fn identity(n: usize) -> Self {
        let one = DMatrix::identity(1, 1);
        Self {
            blocks: (0..n).map(|i| (i, one.clone())).collect(),
        }
    }

    /// L⁻¹v: numbers whose errors are independent and one.
    fn whiten(&self, mut v: DVector<f64>) -> DVector<f64> {
        for (start, lower) in &self.blocks {
            let mut part = v.rows_mut(*start, lower.nrows());
            // A Cholesky factor has no zero on its diagonal.
            lower.solve_lower_triangular_mut(&mut part);
        }
        v
    }

    /// L⁻ᵀv: weights of the numbers from those of the whitened ones.
    fn weights(&self, mut v: DVector<f64>) -> DVector<f64> {
        for (start, lower) in &self.blocks {
            let mut part = v.rows_mut(*start, lower.nrows());
            lower.tr_solve_lower_triangular_mut(&mut part);
        }
        v
    }
}

/// Cholesky of a covariance, with the ridge where it is singular.
fn ridged_cholesky(sigma: DMatrix<f64>, ridge: f64) -> Result<Cholesky<f64, Dyn>, ElasticityError> {
    let n = sigma.nrows();
    if let Some(factor) = sigma.clone().cholesky() {
        let d = factor.l_dirty().diagonal();
        if d.min() * d.min() > ridge * 1e-3 {
            return Ok(factor);
        }
    }
    (sigma + DMatrix::identity(n, n) * ridge)
        .cholesky()
        .ok_or(ElasticityError::Covariance {
            quantity: Quantity::Force,
        })
}

/// The covariance of logarithms of moduli from one source of error, and its degrees of freedom:
/// those of the least known error, for repetition does not improve a standard error that all loads
/// take from one calibration.
pub(crate) type LogErrors = (Covariance, Option<f64>);

/// The covariance of all sources together, which are independent of one another.
pub(crate) fn total(sources: &[LogErrors]) -> Covariance {
    let [first, rest @ ..] = sources else {
        return Covariance::none(std::iter::empty());
    };
    rest.iter()
        .fold(first.0.clone(), |sum, source| sum.plus(&source.0))
}

#[cfg(test)]
#[path = "statistics_tests.rs"]
mod tests;
