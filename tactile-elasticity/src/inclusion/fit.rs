//! Maximum a posteriori fit of a block's parameters to measured profiles.

use super::forward::{Forward, Linearised, Solved};
use super::parameters::{Coordinate, LARGEST_POISSON_RATIO, LumpParameters, Parameters};
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
    /// Of each value, what a finer mesh predicts over what this one does; empty where there is no finer one.
    pub(crate) correction: Vec<f64>,
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
    solved: Solved,
}

/// When a fit ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ending {
    /// Step over standard errors below which it has settled.
    step: f64,
    /// Evaluations of the model with its derivatives.
    evaluations: usize,
}

/// Of an answer: what is left is far below what the data tell.
pub(crate) const SETTLED: Ending = Ending {
    step: 0.03,
    evaluations: 40,
};

/// Of a fit on a mesh that is refined afterwards, which moves it by more.
pub(crate) const NEARLY_SETTLED: Ending = Ending {
    step: 0.3,
    ..SETTLED
};

/// Of the first fits. From a start of the grid, four to eight evaluations are taken, under the wrong
/// assumption about the face any number.
pub(crate) const DRAFTED: Ending = Ending {
    step: 0.3,
    evaluations: 14,
};
/// Corrections by a finer mesh: the second is a tenth of the first.
const MAX_CORRECTIONS: usize = 3;
/// Largest step of a logarithm.
const LARGEST_STEP: f64 = 0.5;

/// The quadratic model of the objective at some parameters.
struct Normal {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    misfit: f64,
    penalty: f64,
    predicted: Vec<f64>,
    solved: Solved,
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

    fn normal(&self, parameters: &Parameters, near: Option<&Solved>) -> Option<Normal> {
        let Linearised {
            mut prediction,
            mut columns,
            solved,
        } = (self.forward).linearise(parameters, &self.coordinates(), near)?;
        for values in columns.iter_mut().chain([&mut prediction.values]) {
            for (value, factor) in values.iter_mut().zip(&self.correction) {
                *value *= factor;
            }
        }
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
            solved,
        })
    }

    /// Standard errors of the coordinates at some parameters; `None` where there is no solution.
    pub(crate) fn errors(&self, parameters: &Parameters) -> Option<Vec<f64>> {
        let covariance = self.normal(parameters, None)?.matrix.cholesky()?.inverse();
        Some(covariance.diagonal().iter().map(|v| v.sqrt()).collect())
    }

    /// Levenberg–Marquardt from a start; `None` where the start itself has no solution. `go_on` is asked
    /// before each evaluation.
    pub(crate) fn fit(
        &self,
        start: Parameters,
        ending: Ending,
        go_on: impl FnMut() -> bool,
    ) -> Option<Fit> {
        self.fit_near(start, None, ending, go_on)
    }

    fn fit_near(
        &self,
        start: Parameters,
        near: Option<&Solved>,
        ending: Ending,
        mut go_on: impl FnMut() -> bool,
    ) -> Option<Fit> {
        let mut parameters = start;
        let mut normal = self.normal(&parameters, near)?;
        let mut damping = 1e-3;
        let mut converged = false;
        for _ in 1..ending.evaluations {
            if !go_on() {
                break;
            }
            let (next, size) = self.step(&parameters, &normal, damping)?;
            let now = normal.misfit + normal.penalty;
            let found = self.normal(&next, Some(&normal.solved));
            match found {
                Some(found) if found.misfit + found.penalty <= now * (1.0 + 1e-9) => {
                    damping = (0.2 * damping).max(1e-6);
                    (parameters, normal) = (next, found);
                    converged = size < ending.step;
                }
                // No step lowers the objective.
                _ if size < ending.step => converged = true,
                _ => damping = (10.0 * damping).max(1e-2),
            }
            if converged {
                break;
            }
        }
        self.finished(parameters, normal, converged)
    }

    /// The next parameters and how far they are, in standard errors.
    fn step(
        &self,
        parameters: &Parameters,
        normal: &Normal,
        damping: f64,
    ) -> Option<(Parameters, f64)> {
        let mut matrix = normal.matrix.clone();
        for k in 0..matrix.nrows() {
            matrix[(k, k)] *= 1.0 + damping;
        }
        let mut step = matrix.clone().cholesky()?.solve(&normal.gradient);
        let poisson = |prior: &Prior| prior.coordinate == Coordinate::PoissonRatio;
        if let Some(k) = self.priors.iter().position(poisson) {
            // A step cut short at the limit of ν alone would not lower the objective: the others' steps
            // are those that go with ν at its limit.
            let room = LARGEST_POISSON_RATIO - parameters.poisson_ratio;
            if step[k] > room {
                let mut gradient = &normal.gradient - room * matrix.column(k);
                matrix.row_mut(k).fill(0.0);
                matrix.column_mut(k).fill(0.0);
                matrix[(k, k)] = 1.0;
                gradient[k] = room;
                step = matrix.cholesky()?.solve(&gradient);
            }
        }
        let scaled = (self.priors.iter().zip(step.iter()))
            .map(|(prior, step)| (step / prior.coordinate.unit()).abs())
            .fold(0.0, f64::max);
        if scaled > LARGEST_STEP {
            step *= LARGEST_STEP / scaled;
        }
        let size = step.dot(&(&normal.matrix * &step)).sqrt();
        Some((self.stepped(parameters, &step), size))
    }

    /// The fit as `finer` would give it, from a fit on this mesh: this mesh's predictions are corrected by
    /// what a finer one changes at the fit, and fitted anew until the correction holds.
    ///
    /// What the meshes differ by changes slowly with the parameters, so that two or three predictions of
    /// the finer one do, and none of its derivatives.
    pub(crate) fn refined(
        &mut self,
        finer: &Forward,
        mut fit: Fit,
        mut go_on: impl FnMut() -> bool,
    ) -> Option<Fit> {
        let mut solved: Option<Solved> = None;
        for _ in 0..MAX_CORRECTIONS {
            if !go_on() {
                break;
            }
            let (fine, fine_solved) = finer.predict_near(&fit.parameters, solved.as_ref())?;
            solved = Some(fine_solved);
            // Corrected by the last factors, if there were any.
            let mut here = fit.predicted.clone();
            for (value, factor) in here.iter_mut().zip(&self.correction) {
                *value /= factor;
            }
            self.correction = fine.values.iter().zip(&here).map(|(a, b)| a / b).collect();
            let next = self.fit_near(fit.parameters, Some(&fit.solved), SETTLED, &mut go_on)?;
            let moved = self.distance(&fit, &next);
            fit = next;
            if moved < NEARLY_SETTLED.step {
                break;
            }
        }
        self.correction.clear();
        Some(fit)
    }

    /// How far two fits are from each other, in standard errors.
    fn distance(&self, a: &Fit, b: &Fit) -> f64 {
        let distances = self.priors.iter().enumerate().map(|(k, prior)| {
            let difference =
                a.parameters.get(prior.coordinate) - b.parameters.get(prior.coordinate);
            difference.abs() / b.covariance[(k, k)].sqrt()
        });
        distances.fold(0.0, f64::max)
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
        // Assumptions about the face differ in what the model errs by, and so in the covariance.
        let noise: f64 = (self.factor.l_dirty().diagonal().iter())
            .map(|d| d.ln())
            .sum();
        Some(Fit {
            parameters,
            covariance: cholesky.inverse(),
            misfit: normal.misfit,
            evidence: -0.5 * (normal.misfit + normal.penalty) - logarithm - known - noise,
            predicted: normal.predicted,
            converged,
            solved: normal.solved,
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
