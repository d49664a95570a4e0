//! Whether a block can be plain, before an inclusion is fitted.
//!
//! Rao's score test: with r what the plain block leaves of the measured values, J its derivatives, C and P the
//! covariances of errors and prior, and s what a given inclusion would add to the pressures, the fall of the
//! objective by a multiple of s, the plain block's parameters fitted along, is
//!
//! $$ \frac{(s^T Q r)^2}{s^T Q s}, \qquad Q = C^{-1} - C^{-1} J (J^T C^{-1} J + P^{-1})^{-1} J^T C^{-1} $$
//!
//! and the odds of just that inclusion against none are $\exp(s^T Q r - \tfrac{1}{2} s^T Q s)$ (C. R. Rao, Proc. Cambridge
//! Philos. Soc. 44 (1948) 50). What is added is that of small strain on a coarse mesh, the same with and without the
//! inclusion's modulus: its size is right within some ten percent.

use super::fit::{Fit, Problem};
use super::starts::Start;
use nalgebra::{DMatrix, DVector};

/// Fall of the objective that a grid's inclusion must promise for inclusions to be fitted. One that is found lowers χ² by 36; its
/// neighbour in the grid promises half of that or more.
const LEAST_PROMISE: f64 = 18.0;

/// What a grid of inclusions would change of a plain fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Score {
    /// Largest fall of the objective.
    pub(super) promise: f64,
    /// Logarithm of the odds of an inclusion, those of the grid being equally likely.
    pub(super) log_odds: f64,
}

impl Score {
    /// Of a fit without inclusion; `None` where it has no derivatives.
    pub(super) fn new(problem: &Problem, plain: &Fit, grid: &[Start]) -> Option<Self> {
        let normal = problem.normal(&plain.parameters, Some(&plain.solved))?;
        let residual = problem.whitened(problem.residual(&normal.predicted));
        let columns = DMatrix::from_columns(&normal.columns);
        let precision = normal.matrix.cholesky()?;
        // What the plain block's own parameters cannot take up.
        let left = &residual - &columns * precision.solve(&normal.gradient);
        let mut odds = Vec::new();
        let mut promise = 0.0f64;
        for start in grid {
            let added = (start.added.iter().zip(&normal.predicted)).map(|(part, p)| part * p);
            let added = problem.whitened(DVector::from_iterator(normal.predicted.len(), added));
            let shared = columns.tr_mul(&added);
            let square = added.norm_squared() - shared.dot(&precision.solve(&shared));
            if square <= 0.0 {
                continue;
            }
            let along = added.dot(&left);
            promise = promise.max(along.powi(2) / square);
            odds.push(along - 0.5 * square);
        }
        let largest = odds.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = odds.iter().map(|odds| (odds - largest).exp()).sum();
        Some(Self {
            promise,
            log_odds: largest + (sum / odds.len().max(1) as f64).ln(),
        })
    }

    /// Whether an inclusion can be ruled out.
    pub(super) fn is_plain(&self) -> bool {
        self.promise < LEAST_PROMISE
    }
}
