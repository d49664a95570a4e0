//! The fit of a curve: penalised least squares on grey histograms, smoothness by cross-validation.

use super::basis::{Basis, KNOTS, Knots};
use super::coefficients::Coefficients;
use super::nonnegative::{self, Normal};
use super::report::{CurveHysteresis, PressureCurveReport};
use super::{CalibrationFrame, PressureCurveOptions};
use crate::calibration::Branch;
use crate::error::ForceError;
use tactile_core::Estimate;

/// Fewest frames: five forces leave degrees of freedom beside a curve of three.
const FEWEST_FRAMES: usize = 5;
/// Parts that cross-validation leaves out in turn; each frame alone where there are fewer.
const FOLDS: usize = 10;
/// Smoothness tried, from a curve that follows every frame to one whose slope is a parabola in the grey level's root.
const SMOOTHNESS: [f64; 10] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0, 1000.0];
/// f counts as identified where its relative standard error is below this.
const IDENTIFIED: f64 = 0.05;

pub(super) fn fit(
    frames: &[CalibrationFrame],
    options: &PressureCurveOptions,
) -> Result<(Coefficients, PressureCurveReport), ForceError> {
    let problem = Problem::new(frames, options)?;
    let (smoothness, cross_validation_error) = match options.smoothness {
        Some(given) => (given, None),
        None => problem.cross_validated(),
    };
    let all = |_: usize| true;
    let solution = problem.solve(smoothness, all);
    let residuals: Vec<f64> = (0..frames.len())
        .map(|i| problem.residual(i, &solution.slopes))
        .collect();
    let squares: f64 = residuals.iter().map(|r| r * r).sum();
    let freedom = (frames.len() as f64 - solution.effective).max(1.0);
    let variance = squares / freedom;
    let unit = problem.unit;
    let coefficients = Coefficients {
        basis: problem.basis,
        slopes: (solution.slopes * unit).into(),
        covariance: (solution.inverse * (variance * unit * unit)).into(),
        degrees_of_freedom: freedom,
    };
    let report = PressureCurveReport {
        frames: frames.len(),
        effective_parameters: solution.effective,
        residual_sd: variance.sqrt(),
        residuals_n: residuals
            .iter()
            .zip(&problem.errors)
            .map(|(r, e)| r * e)
            .collect(),
        smoothness,
        cross_validation_error,
        identified_grey: identified(&coefficients),
        hysteresis: problem.hysteresis(frames, &solution.slopes),
    };
    Ok((coefficients, report))
}

/// Rows and forces, each divided by the frame's assumed error; slopes in units of their mean.
struct Problem {
    basis: Basis,
    rows: Vec<Knots>,
    forces: Vec<f64>,
    errors: Vec<f64>,
    /// Pascals per grey level that fit all frames best.
    unit: f64,
}

struct Solution {
    slopes: Knots,
    /// Inverse of the penalised normal matrix, zero for slopes held at zero.
    inverse: Normal,
    /// Trace of the smoother.
    effective: f64,
}

impl Problem {
    fn new(
        frames: &[CalibrationFrame],
        options: &PressureCurveOptions,
    ) -> Result<Self, ForceError> {
        if frames.len() < FEWEST_FRAMES {
            return Err(ForceError::TooFewPairs {
                required: FEWEST_FRAMES,
                found: frames.len(),
            });
        }
        let largest = frames.iter().map(|f| f.force_n).fold(0.0, f64::max);
        let top = frames
            .iter()
            .map(|f| f.histogram.greatest())
            .fold(0.0, f64::max);
        if largest == 0.0 || top < 1.0 {
            return Err(ForceError::DegeneratePairs {
                span: largest.min(top),
            });
        }
        let basis = Basis { top };
        let errors: Vec<f64> = frames
            .iter()
            .map(|f| (options.relative_error * f.force_n).hypot(options.range_error * largest))
            .collect();
        let (mut vv, mut vf) = (0.0, 0.0);
        for (frame, error) in frames.iter().zip(&errors) {
            let integral = frame.histogram.integral(|grey| grey) / error;
            vv += integral * integral;
            vf += integral * frame.force_n / error;
        }
        let unit = vf / vv;
        if !(unit > 0.0 && unit.is_finite()) {
            return Err(ForceError::NotMonotone { from: 0.0, to: top });
        }
        let row = |frame: &CalibrationFrame, error: f64| {
            let mut row = Knots::zeros();
            for (grey, area) in frame.histogram.bins() {
                row += basis.integrals(grey) * area;
            }
            row * (unit / error)
        };
        Ok(Self {
            basis,
            rows: frames
                .iter()
                .zip(&errors)
                .map(|(f, e)| row(f, *e))
                .collect(),
            forces: frames
                .iter()
                .zip(&errors)
                .map(|(f, e)| f.force_n / e)
                .collect(),
            errors,
            unit,
        })
    }

    /// Known force minus fitted, in units of the assumed error.
    fn residual(&self, frame: usize, slopes: &Knots) -> f64 {
        self.forces[frame] - self.rows[frame].dot(slopes)
    }

    /// Penalised least squares over the frames that are kept.
    fn solve(&self, smoothness: f64, keep: impl Fn(usize) -> bool) -> Solution {
        let (mut data, mut right) = (Normal::zeros(), Knots::zeros());
        for i in (0..self.rows.len()).filter(|i| keep(*i)) {
            data += self.rows[i] * self.rows[i].transpose();
            right += self.rows[i] * self.forces[i];
        }
        let weight = smoothness * data.trace() / KNOTS as f64;
        // A trace of first differences keeps the matrix definite where the frames leave a straight slope undetermined.
        let normal = data + second_differences() * weight + first_differences() * (1e-6 * weight);
        let (slopes, free) = nonnegative::solve(&normal, &right);
        let mut inverse = nonnegative::bound(&normal, &free)
            .cholesky()
            .map_or(Normal::zeros(), |c| c.inverse());
        for j in (0..KNOTS).filter(|j| !free[*j]) {
            inverse[(j, j)] = 0.0;
        }
        Solution {
            slopes,
            inverse,
            effective: (inverse * data).trace(),
        }
    }

    /// The smoothness with the least error on frames left out, and that error.
    fn cross_validated(&self) -> (f64, Option<f64>) {
        let count = self.rows.len();
        let folds = FOLDS.min(count);
        let error = |smoothness: f64| {
            let mut squares = 0.0;
            for fold in 0..folds {
                let solution = self.solve(smoothness, |i| i % folds != fold);
                for i in (fold..count).step_by(folds) {
                    squares += self.residual(i, &solution.slopes).powi(2);
                }
            }
            (squares / count as f64).sqrt()
        };
        let mut best = (SMOOTHNESS[0], f64::INFINITY);
        for smoothness in SMOOTHNESS {
            let here = error(smoothness);
            if here <= best.1 {
                best = (smoothness, here);
            }
        }
        (best.0, Some(best.1))
    }

    /// Each branch's own scale of the common curve, by least squares.
    fn hysteresis(&self, frames: &[CalibrationFrame], slopes: &Knots) -> Option<CurveHysteresis> {
        let scale = |branch: Branch| {
            let of_branch = (0..frames.len()).filter(|i| frames[*i].branch == branch);
            let (mut count, mut pp, mut pf, mut ff) = (0, 0.0, 0.0, 0.0);
            for i in of_branch {
                let (predicted, force) = (self.rows[i].dot(slopes), self.forces[i]);
                count += 1;
                pp += predicted * predicted;
                pf += predicted * force;
                ff += force * force;
            }
            let scale = pf / pp;
            let variance = (ff - scale * pf).max(0.0) / f64::from(count - 1) / pp;
            (count >= 3).then_some(Estimate::new(scale, variance.sqrt()))
        };
        let (loading, unloading) = (scale(Branch::Loading)?, scale(Branch::Unloading)?);
        let relative = Estimate::new(
            loading.value - unloading.value,
            loading.standard_error.hypot(unloading.standard_error),
        );
        let excess = relative.value.powi(2) - relative.standard_error.powi(2);
        Some(CurveHysteresis {
            relative,
            width: 0.5 * excess.max(0.0).sqrt(),
        })
    }
}

fn second_differences() -> Normal {
    let mut penalty = Normal::zeros();
    for j in 1..KNOTS - 1 {
        let mut row = Knots::zeros();
        (row[j - 1], row[j], row[j + 1]) = (1.0, -2.0, 1.0);
        penalty += row * row.transpose();
    }
    penalty
}

fn first_differences() -> Normal {
    let mut penalty = Normal::zeros();
    for j in 1..KNOTS {
        let mut row = Knots::zeros();
        (row[j - 1], row[j]) = (-1.0, 1.0);
        penalty += row * row.transpose();
    }
    penalty
}

/// The longest run of whole grey levels on which f is known well enough.
fn identified(coefficients: &Coefficients) -> [f64; 2] {
    let known = |grey: f64| {
        let e = coefficients.pressure_pa(grey);
        e.value > 0.0 && e.standard_error <= IDENTIFIED * e.value
    };
    let greys = (1..=coefficients.basis.top as u32).map(f64::from);
    let (mut best, mut run) = ([0.0; 2], None);
    for grey in greys {
        let start: f64 = if known(grey) {
            *run.get_or_insert(grey)
        } else {
            f64::NAN
        };
        if start.is_nan() {
            run = None;
        } else if grey - start >= best[1] - best[0] {
            best = [start, grey];
        }
    }
    best
}
