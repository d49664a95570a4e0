//! Covariances of many numbers, kept as what makes them up instead of as a matrix of all pairs.

use crate::error::{ElasticityError, Quantity};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// The covariance Σ = diag(v) + Σ_load s sᵀ + U Uᵀ + G of n numbers.
///
/// v are variances of errors that each number has for itself, s standard errors that the numbers of one load have in common, the
/// columns of U those that all have in common, and G is a matrix that was given. Without G, products and solutions take O(n k²) time
/// and O(n k) memory with k columns; a given matrix is factorised in O(n³).
#[derive(Debug, Clone)]
pub(crate) struct Covariance {
    /// The load that each number belongs to; numbers of one load are neighbours.
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

    /// With standard errors that all numbers have in common: what one standard error of the cause does to each.
    pub(crate) fn with_shared(mut self, standard_error: impl Fn(usize) -> f64) -> Self {
        let column = self.column(standard_error);
        if column.iter().any(|&u| u != 0.0) {
            self.shared.push(column);
        }
        self
    }

    /// With standard errors of a law or a table that err the same way at all loads as far as the smallest goes. What they err beyond that at
    /// the others is not known to be in proportion: counted as common, the weighted mean would extrapolate it away.
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
    pub(crate) fn plus(mut self, other: &Self) -> Self {
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

    pub(crate) fn len(&self) -> usize {
        self.loads.len()
    }

    /// What one standard error of each shared cause does to every number.
    pub(crate) fn shared(&self) -> &[DVector<f64>] {
        &self.shared
    }

    /// Σᵢᵢ.
    pub(crate) fn variance(&self, i: usize) -> f64 {
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
    pub(crate) fn is_known(&self) -> bool {
        (0..self.len()).any(|i| self.variance(i) > 0.0)
    }

    /// wᵀΣw, the variance of a weighted sum.
    pub(crate) fn variance_of_sum(&self, weights: &DVector<f64>) -> f64 {
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

    /// The factor L of Σ − U Uᵀ = L Lᵀ. What is perfectly correlated or without error gets a ridge of 10⁻¹² of the mean variance (of
    /// Σ's, where all errors are shared): the answer then depends on it in the twelfth digit, and rounding (10⁻¹⁶) is still far below it.
    pub(crate) fn unshared_factor(&self) -> Result<Factor, ElasticityError> {
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
pub(crate) struct Factor {
    /// First row, and the block.
    blocks: Vec<(usize, DMatrix<f64>)>,
}

impl Factor {
    /// The identity for n numbers, of which nothing is known.
    pub(crate) fn identity(n: usize) -> Self {
        let one = DMatrix::identity(1, 1);
        Self {
            blocks: (0..n).map(|i| (i, one.clone())).collect(),
        }
    }

    /// L⁻¹v: numbers whose errors are independent and one.
    pub(crate) fn whiten(&self, mut v: DVector<f64>) -> DVector<f64> {
        for (start, lower) in &self.blocks {
            let mut part = v.rows_mut(*start, lower.nrows());
            // A Cholesky factor has no zero on its diagonal.
            lower.solve_lower_triangular_mut(&mut part);
        }
        v
    }

    /// L⁻ᵀv: weights of the numbers from those of the whitened ones.
    pub(crate) fn weights(&self, mut v: DVector<f64>) -> DVector<f64> {
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
