//! Maximum a posteriori fit of a block's parameters to measured profiles.

use crate::forward::{Forward, Solved};
use crate::parameters::{Coordinate, LARGEST_POISSON_RATIO, Parameters};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Distance from the optimum, in standard errors, that may be hidden by the tolerance of the
/// solutions.
const UNRESOLVED: f64 = 1.0;

/// Gain of the objective that a fit may still achieve, relative to its quadratic model. Along a
/// flat valley, steps gain more than the model predicts at their start.
const PREDICTED_GAIN: f64 = 4.0;

/// Initial Levenberg damping, relative to the diagonal of the normal matrix.
const FIRST_DAMPING: f64 = 1e-3;

/// Upper limit of the damping, above which no step lowers the objective.
const LARGEST_DAMPING: f64 = 10.0;

/// Lower limit of the damping, at which steps equal Newton's to six digits.
const LEAST_DAMPING: f64 = 1e-6;

/// Gaussian prior of a coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prior {
    pub coordinate: Coordinate,
    pub mean: f64,
    pub standard_error: f64,
}

impl Prior {
    pub(crate) fn new(coordinate: Coordinate, (mean, standard_error): (f64, f64)) -> Self {
        Self {
            coordinate,
            mean,
            standard_error,
        }
    }
}

/// Measured values with their covariance, and the priors.
#[derive(Clone)]
pub(crate) struct Problem {
    pub forward: Forward,
    pub measured: Vec<f64>,
    pub factor: Cholesky<f64, Dyn>,
    pub priors: Vec<Prior>,
}

/// A local optimum.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub parameters: Parameters,
    /// The quadratic model of the objective there.
    pub normal: Normal,
    /// Covariance of the coordinates, in the order of the priors.
    pub covariance: DMatrix<f64>,
    /// Log-evidence by Laplace's approximation, up to a constant common to all models.
    pub evidence: f64,
    /// Contribution of the posterior's volume relative to the prior's.
    pub volume: f64,
    pub converged: bool,
}

/// Stopping rule of a fit.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ending {
    /// Distance from the optimum, in standard errors, below which the fit has converged. An
    /// undamped step that gains less than its square is the last.
    step: f64,
    /// Maximum number of evaluations of the model with its derivatives.
    evaluations: usize,
    /// Objective that a fit must reach to be useful. A fit that is not predicted to reach it is
    /// stopped.
    needed: f64,
}

impl Ending {
    /// This stopping rule for a fit that is useful only below an objective.
    pub(crate) fn below(self, objective: f64) -> Self {
        Self {
            needed: objective.min(self.needed),
            ..self
        }
    }
}

/// Stopping rule of the final fit: the remaining step is far below the posterior standard error.
pub(crate) const ANSWER_ENDING: Ending = Ending {
    step: 0.2,
    evaluations: 20,
    needed: f64::INFINITY,
};

/// Stopping rule for two inclusions: 0.2 standard errors in each of about 22 coordinates. On moved
/// meshes the objective is not smooth below this.
pub(crate) const PAIR_ENDING: Ending = Ending {
    step: 1.0,
    ..ANSWER_ENDING
};

/// Stopping rule of the first fits, which a finer mesh changes by more. From a start of the grid
/// they take four to eight evaluations; under the wrong assumption about the face, any number.
pub(crate) const FIRST_FIT_ENDING: Ending = Ending {
    step: 0.5,
    evaluations: 12,
    needed: f64::INFINITY,
};

/// Maximum step of a logarithm.
const LARGEST_STEP: f64 = 0.5;

/// A change of the coordinates.
pub(crate) struct FitStep {
    pub by: DVector<f64>,
    /// Size in standard errors, before the step is limited to [`LARGEST_STEP`].
    pub size: f64,
}

/// The quadratic model of the objective at some parameters.
#[derive(Debug, Clone)]
pub(crate) struct Normal {
    pub matrix: DMatrix<f64>,
    pub gradient: DVector<f64>,
    /// rᵀ C⁻¹ r.
    pub misfit: f64,
    /// Contribution of the priors to the objective.
    pub penalty: f64,
    /// Whitened derivatives of the values.
    pub columns: Vec<DVector<f64>>,
    pub predicted: Vec<f64>,
    pub solved: Solved,
}

/// Fixes the step of one coordinate in the equations of all.
fn fix(matrix: &mut DMatrix<f64>, gradient: &mut DVector<f64>, k: usize, step: f64) {
    gradient.axpy(-step, &matrix.column(k), 1.0);
    matrix.row_mut(k).fill(0.0);
    matrix.column_mut(k).fill(0.0);
    matrix[(k, k)] = 1.0;
    gradient[k] = step;
}

impl Normal {
    /// −2 ln of the posterior density, up to a constant.
    pub(crate) fn objective(&self) -> f64 {
        self.misfit + self.penalty
    }
}

impl Problem {
    pub(crate) fn coordinates(&self) -> Vec<Coordinate> {
        self.priors.iter().map(|prior| prior.coordinate).collect()
    }

    /// Index of a coordinate among those fitted.
    pub(crate) fn index(&self, coordinate: Coordinate) -> Option<usize> {
        let mut priors = self.priors.iter();
        priors.position(|prior| prior.coordinate == coordinate)
    }

    pub(crate) fn residual(&self, predicted: &[f64]) -> DVector<f64> {
        DVector::from_iterator(
            self.measured.len(),
            self.measured.iter().zip(predicted).map(|(a, b)| a - b),
        )
    }

    pub(crate) fn penalty(&self, parameters: &Parameters) -> f64 {
        let squares = self.priors.iter().map(|prior| {
            let distance = parameters.get(prior.coordinate) - prior.mean;
            (distance / prior.standard_error).powi(2)
        });
        squares.sum()
    }

    /// −2 ln of the posterior density, up to a constant.
    fn objective(&self, parameters: &Parameters, predicted: &[f64]) -> f64 {
        let misfit = self.whitened(self.residual(predicted)).norm_squared();
        misfit + self.penalty(parameters)
    }

    /// A start whose block modulus is scaled so that the pressures agree on average, and its
    /// distance from the measured values. `predicted` are the pressures of the original start.
    /// `None` if they are not compressive.
    ///
    /// Pressures are nearly proportional to the moduli of block and inclusion if the guide is
    /// stiffer than both.
    pub(crate) fn scaled_start(
        &self,
        start: &Parameters,
        predicted: &[f64],
    ) -> Option<(f64, Parameters)> {
        let measured = self.measured.iter().zip(predicted);
        let factor = measured.map(|(y, m)| y * m).sum::<f64>()
            / predicted.iter().map(|m| m * m).sum::<f64>();
        if !(factor > 0.0 && factor.is_finite()) {
            return None;
        }
        let scaled: Vec<f64> = predicted.iter().map(|m| factor * m).collect();
        let mut parameters = start.clone();
        parameters.block_modulus_pa *= factor;
        if let Some(lump) = &mut parameters.lump {
            lump.youngs_modulus_pa *= factor;
        }
        let misfit = self.whitened(self.residual(&scaled)).norm_squared();
        Some((misfit + self.penalty(&parameters), parameters))
    }

    pub(crate) fn whitened(&self, vector: DVector<f64>) -> DVector<f64> {
        let solved = self.factor.l_dirty().solve_lower_triangular(&vector);
        // A Cholesky factor has a positive diagonal.
        solved.unwrap_or(vector)
    }

    pub(crate) fn normal(&self, parameters: &Parameters, near: Option<&Solved>) -> Option<Normal> {
        let (predicted, solved) = self.forward.predict_near(parameters, near)?;
        self.normal_at(parameters, predicted, solved)
    }

    /// The quadratic model at parameters with a solved scene.
    fn normal_at(
        &self,
        parameters: &Parameters,
        predicted: Vec<f64>,
        solved: Solved,
    ) -> Option<Normal> {
        let columns = (self.forward).derivatives(parameters, &self.coordinates(), &solved)?;
        let residual = self.whitened(self.residual(&predicted));
        let columns: Vec<DVector<f64>> = columns
            .into_iter()
            .map(|column| self.whitened(DVector::from_vec(column)))
            .collect();
        let count = columns.len();
        let mut matrix = DMatrix::from_fn(count, count, |i, k| columns[i].dot(&columns[k]));
        let mut gradient = DVector::from_fn(count, |i, _| columns[i].dot(&residual));
        for (k, prior) in self.priors.iter().enumerate() {
            let weight = prior.standard_error.powi(-2);
            matrix[(k, k)] += weight;
            gradient[k] += weight * (prior.mean - parameters.get(prior.coordinate));
        }
        Some(Normal {
            matrix,
            gradient,
            misfit: residual.norm_squared(),
            penalty: self.penalty(parameters),
            columns,
            predicted,
            solved,
        })
    }

    /// Standard errors of the coordinates at given parameters. `None` if there is no solution.
    pub(crate) fn errors(&self, parameters: &Parameters) -> Option<Vec<f64>> {
        let covariance = self.normal(parameters, None)?.matrix.cholesky()?.inverse();
        Some(covariance.diagonal().iter().map(|v| v.sqrt()).collect())
    }

    /// Levenberg–Marquardt from a start. `None` if the start has no solution. `go_on` is called
    /// before each evaluation.
    pub(crate) fn fit(
        &self,
        start: &Parameters,
        ending: Ending,
        mut go_on: impl FnMut() -> bool,
    ) -> Option<Fit> {
        let mut parameters = start.clone();
        let mut normal = self.normal(&parameters, None)?;
        let mut damping = FIRST_DAMPING;
        let mut evaluations = 1;
        let converged = loop {
            // Distance from the optimum of the quadratic model. Steps shortened by damping are no
            // measure of it.
            let left = self.step(&parameters, &normal, 0.0, None)?.size;
            let reachable = normal.objective() - PREDICTED_GAIN * left.powi(2);
            if left < ending.step || reachable > ending.needed {
                break true;
            }
            if damping > LARGEST_DAMPING {
                // No step lowers the objective, so the rest is the tolerance of the solutions.
                break left < UNRESOLVED;
            }
            if evaluations == ending.evaluations || !go_on() {
                break false;
            }
            evaluations += 1;
            let next = self.stepped(
                &parameters,
                &self.step(&parameters, &normal, damping, None)?.by,
            );
            let now = normal.objective();
            let found = (self.forward).predict_near(&next, Some(&normal.solved));
            // The derivatives of a rejected step are not needed.
            let found = found.filter(|(there, _)| self.objective(&next, there) <= now);
            match found.and_then(|(there, solved)| self.normal_at(&next, there, solved)) {
                Some(found) => {
                    let gain = now - found.objective();
                    let is_undamped = damping < 1e-2;
                    damping = (0.1 * damping).max(LEAST_DAMPING);
                    (parameters, normal) = (next, found);
                    if is_undamped && gain < ending.step.powi(2) {
                        break true;
                    }
                }
                None => damping = (10.0 * damping).max(1e-2),
            }
        };
        self.finished(parameters, normal, converged)
    }

    /// The damped step towards the optimum of the quadratic model, without a coordinate that is
    /// held fixed.
    pub(crate) fn step(
        &self,
        parameters: &Parameters,
        normal: &Normal,
        damping: f64,
        held: Option<usize>,
    ) -> Option<FitStep> {
        let mut matrix = normal.matrix.clone();
        let mut gradient = normal.gradient.clone();
        for k in 0..matrix.nrows() {
            matrix[(k, k)] *= 1.0 + damping;
        }
        if let Some(held) = held {
            fix(&mut matrix, &mut gradient, held, 0.0);
        }
        let mut by = matrix.clone().cholesky()?.solve(&gradient);
        if let Some(k) = self.index(Coordinate::PoissonRatio) {
            // If only ν were limited, the step would not lower the objective: the steps of the
            // others must be those for ν at its limit.
            let room = LARGEST_POISSON_RATIO - parameters.poisson_ratio;
            if by[k] > room {
                fix(&mut matrix, &mut gradient, k, room);
                by = matrix.cholesky()?.solve(&gradient);
            }
        }
        let size = by.dot(&(&normal.matrix * &by)).sqrt();
        let scaled = (self.priors.iter().zip(by.iter()))
            .map(|(prior, by)| (by / prior.coordinate.unit()).abs())
            .fold(0.0, f64::max);
        if scaled > LARGEST_STEP {
            by *= LARGEST_STEP / scaled;
        }
        Some(FitStep { by, size })
    }

    pub(crate) fn stepped(&self, parameters: &Parameters, step: &DVector<f64>) -> Parameters {
        let steps = self.priors.iter().zip(step.iter());
        steps.fold(parameters.clone(), |moved, (prior, &by)| {
            moved.moved(prior.coordinate, by)
        })
    }

    fn finished(&self, parameters: Parameters, normal: Normal, converged: bool) -> Option<Fit> {
        let cholesky = normal.matrix.clone().cholesky()?;
        let logarithm: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let known: f64 = self
            .priors
            .iter()
            .map(|prior| prior.standard_error.ln())
            .sum();
        let volume = -logarithm - known;
        Some(Fit {
            parameters,
            covariance: cholesky.inverse(),
            evidence: -0.5 * normal.objective() + volume - self.noise(),
            normal,
            volume,
            converged,
        })
    }

    /// Half the log-determinant of the error covariance. It is needed because assumptions about the
    /// face have different model errors.
    fn noise(&self) -> f64 {
        let diagonal = self.factor.l_dirty().diagonal();
        diagonal.iter().map(|d| d.ln()).sum()
    }

    /// The objective that corresponds to an evidence, for a posterior of this volume.
    pub(crate) fn objective_at(&self, evidence: f64, volume: f64) -> f64 {
        2.0 * (volume - self.noise() - evidence)
    }
}
