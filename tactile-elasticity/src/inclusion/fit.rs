//! Maximum a posteriori fit of a block's parameters to measured profiles.

use super::forward::{Forward, Linearised};
use super::parameters::{Coordinate, LumpParameters, Parameters};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// What is known of a coordinate beforehand: a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Prior {
    pub(crate) coordinate: Coordinate,
    pub(crate) mean: f64,
    pub(crate) standard_error: f64,
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

/// Measured values with their covariance, and what is known beforehand.
pub(crate) struct Problem {
    pub(crate) forward: Forward,
    pub(crate) measured: Vec<f64>,
    pub(crate) factor: Cholesky<f64, Dyn>,
    pub(crate) priors: Vec<Prior>,
}

/// A local optimum.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) parameters: Parameters,
    /// Of the coordinates, in the order of the priors.
    pub(crate) covariance: DMatrix<f64>,
    /// rᵀ C⁻¹ r.
    pub(crate) misfit: f64,
    /// Logarithm of the evidence by Laplace's approximation, up to what all models share.
    pub(crate) evidence: f64,
    pub(crate) predicted: Vec<f64>,
    pub(crate) converged: bool,
}

/// Gauss–Newton iterations; from a start of the grid four to eight are taken.
const MAX_ITERATIONS: usize = 25;
/// Step over standard errors at which the fit ends: its rest is far below what the data tell.
const STEP_OVER_ERROR: f64 = 0.03;
/// Largest step of a logarithm.
const LARGEST_STEP: f64 = 0.5;

/// The quadratic model of the objective at some parameters.
struct Normal {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    misfit: f64,
    penalty: f64,
    predicted: Vec<f64>,
}

impl Problem {
    pub(crate) fn coordinates(&self) -> Vec<Coordinate> {
        self.priors.iter().map(|prior| prior.coordinate).collect()
    }

    fn residual(&self, predicted: &[f64]) -> DVector<f64> {
        DVector::from_iterator(
            self.measured.len(),
            self.measured.iter().zip(predicted).map(|(a, b)| a - b),
        )
    }

    fn penalty(&self, parameters: &Parameters) -> f64 {
        let squares = self.priors.iter().map(|prior| {
            let distance = parameters.get(prior.coordinate) - prior.mean;
            (distance / prior.standard_error).powi(2)
        });
        squares.sum()
    }

    /// A start with the block's modulus scaled so that the pressures agree on the whole, and how far it
    /// then is from the measured values; `None` where there is no solution.
    ///
    /// Pressures are nearly proportional to the moduli of block and inclusion as long as the guide is
    /// stiffer than they are.
    pub(crate) fn scaled_start(&self, start: &Parameters) -> Option<(f64, Parameters)> {
        let predicted = self.forward.predict(start)?;
        let measured = self.measured.iter().zip(&predicted.values);
        let factor = measured.map(|(y, m)| y * m).sum::<f64>()
            / predicted.values.iter().map(|m| m * m).sum::<f64>();
        if !(factor > 0.0 && factor.is_finite()) {
            return None;
        }
        let scaled: Vec<f64> = predicted.values.iter().map(|m| factor * m).collect();
        let mut parameters = *start;
        parameters.block_modulus_pa *= factor;
        if let Some(lump) = &mut parameters.lump {
            lump.youngs_modulus_pa *= factor;
        }
        let misfit = self.whitened(self.residual(&scaled)).norm_squared();
        Some((misfit + self.penalty(&parameters), parameters))
    }

    fn whitened(&self, vector: DVector<f64>) -> DVector<f64> {
        let solved = self.factor.l_dirty().solve_lower_triangular(&vector);
        // A Cholesky factor has a positive diagonal.
        solved.unwrap_or(vector)
    }

    fn normal(&self, parameters: &Parameters) -> Option<Normal> {
        let Linearised {
            prediction,
            columns,
        } = self.forward.linearise(parameters, &self.coordinates())?;
        let residual = self.whitened(self.residual(&prediction.values));
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
            predicted: prediction.values,
        })
    }

    /// Standard errors of the coordinates at some parameters; `None` where there is no solution.
    pub(crate) fn errors(&self, parameters: &Parameters) -> Option<Vec<f64>> {
        let covariance = self.normal(parameters)?.matrix.cholesky()?.inverse();
        Some(covariance.diagonal().iter().map(|v| v.sqrt()).collect())
    }

    /// Levenberg–Marquardt from a start; `None` where the start itself has no solution.
    /// `go_on` is asked before each iteration.
    pub(crate) fn fit(&self, start: Parameters, mut go_on: impl FnMut() -> bool) -> Option<Fit> {
        let mut parameters = start;
        let mut normal = self.normal(&parameters)?;
        let mut damping = 1e-3;
        let mut converged = false;
        for _ in 0..MAX_ITERATIONS {
            if converged || !go_on() {
                break;
            }
            let Some((next, next_normal, size)) = self.improved(&parameters, &normal, &mut damping)
            else {
                converged = true;
                break;
            };
            converged = size < STEP_OVER_ERROR;
            (parameters, normal) = (next, next_normal);
        }
        self.finished(parameters, normal, converged)
    }

    /// The next parameters, their normal equations and the step in standard errors; `None` where no
    /// step lowers the objective.
    fn improved(
        &self,
        parameters: &Parameters,
        normal: &Normal,
        damping: &mut f64,
    ) -> Option<(Parameters, Normal, f64)> {
        let now = normal.misfit + normal.penalty;
        for _ in 0..8 {
            let mut matrix = normal.matrix.clone();
            for k in 0..matrix.nrows() {
                matrix[(k, k)] *= 1.0 + *damping;
            }
            let mut step = matrix.cholesky()?.solve(&normal.gradient);
            let scaled = (self.priors.iter().zip(step.iter()))
                .map(|(prior, step)| (step / prior.coordinate.unit()).abs())
                .fold(0.0, f64::max);
            if scaled > LARGEST_STEP {
                step *= LARGEST_STEP / scaled;
            }
            let size = step.dot(&(&normal.matrix * &step)).sqrt();
            let next = self.stepped(parameters, &step);
            let lower = |normal: &Normal| normal.misfit + normal.penalty <= now * (1.0 + 1e-9);
            match self.normal(&next) {
                Some(found) if lower(&found) => {
                    *damping = (0.2 * *damping).max(1e-6);
                    return Some((next, found, size));
                }
                _ if size < STEP_OVER_ERROR => return None,
                _ => *damping = (10.0 * *damping).max(1e-2),
            }
        }
        None
    }

    fn stepped(&self, parameters: &Parameters, step: &DVector<f64>) -> Parameters {
        let steps = self.priors.iter().zip(step.iter());
        steps.fold(*parameters, |moved, (prior, &by)| {
            moved.moved(prior.coordinate, by)
        })
    }

    fn finished(&self, parameters: Parameters, normal: Normal, converged: bool) -> Option<Fit> {
        let cholesky = normal.matrix.cholesky()?;
        let logarithm: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let known: f64 = self
            .priors
            .iter()
            .map(|prior| prior.standard_error.ln())
            .sum();
        Some(Fit {
            parameters,
            covariance: cholesky.inverse(),
            misfit: normal.misfit,
            evidence: -0.5 * (normal.misfit + normal.penalty) - logarithm - known,
            predicted: normal.predicted,
            converged,
        })
    }
}

/// Starts: diameters and depths that a face of this radius can see, in a block of this height.
pub(crate) fn starts(plain: &Parameters, face_radius_m: f64) -> Vec<Parameters> {
    let mut starts = Vec::new();
    for diameter in [0.35, 0.65, 1.05] {
        for depth in [0.15, 0.3, 0.55] {
            for contrast in [2.5, 8.0] {
                let lump = LumpParameters {
                    diameter_m: diameter * face_radius_m,
                    depth_m: depth * face_radius_m,
                    youngs_modulus_pa: contrast * plain.block_modulus_pa,
                };
                if lump.diameter_m + lump.depth_m < 0.95 * plain.height_m {
                    starts.push(Parameters {
                        lump: Some(lump),
                        ..*plain
                    });
                }
            }
        }
    }
    starts
}
