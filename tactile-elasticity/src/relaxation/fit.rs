//! Least squares of moduli on functions of time, and the profile over the time constant.

use super::TimedModulus;
use super::history::memory;
use nalgebra::{Matrix3, Vector3};

/// Which of the two the history is taken of: what varies less is better known between the loads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Form {
    /// E on the history of the deformation.
    Relaxation,
    /// 1/E on the history of the force.
    Creep,
}

/// Moduli ready to be fitted.
pub(super) struct Series {
    pub(super) form: Form,
    pub(super) times_s: Vec<f64>,
    held: Vec<f64>,
    /// E, or 1/E.
    response: Vec<f64>,
    /// Standard errors of the response.
    sigma: Vec<f64>,
    /// What one standard error of the law adds to each response: nothing at the mean load, the whole at e times the mean.
    law: Vec<f64>,
}

/// y = a + b g beside the law's own slope.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) a: f64,
    pub(super) b: f64,
    /// Variances of a and b, and their covariance.
    pub(super) variance: [f64; 3],
    pub(super) chi_squared: f64,
}

impl Line {
    /// A combination of both parameters with its standard error.
    pub(super) fn combination(&self, of_a: f64, of_b: f64) -> (f64, f64) {
        let [aa, bb, ab] = self.variance;
        let variance = of_a * of_a * aa + 2.0 * of_a * of_b * ab + of_b * of_b * bb;
        (of_a * self.a + of_b * self.b, variance.max(0.0).sqrt())
    }
}

impl Series {
    pub(super) fn new(moduli: &[TimedModulus], law_error: f64) -> Self {
        let forces: Vec<f64> = moduli.iter().map(|m| m.force_n).collect();
        let moduli_pa = || moduli.iter().map(|m| m.youngs_modulus_pa);
        let relative: Vec<f64> = moduli_pa().map(|e| e.standard_error / e.value).collect();
        let deformations: Vec<f64> = moduli_pa()
            .zip(&forces)
            .map(|(e, force)| force / e.value)
            .collect();
        let form = match spread_of_logs(&deformations) < spread_of_logs(&forces) {
            true => Form::Relaxation,
            false => Form::Creep,
        };
        let held = match form {
            Form::Relaxation => without_noise(deformations, &relative),
            Form::Creep => forces.clone(),
        };
        let response: Vec<f64> = moduli_pa()
            .map(|e| match form {
                Form::Relaxation => e.value,
                Form::Creep => 1.0 / e.value,
            })
            .collect();
        let mean_log = mean(forces.iter().map(|force| force.ln()));
        let law = (forces.iter().zip(&response))
            .map(|(force, y)| law_error * (force.ln() - mean_log) * y);
        Self {
            form,
            times_s: moduli.iter().map(|m| m.time_s).collect(),
            held,
            sigma: response.iter().zip(&relative).map(|(y, r)| y * r).collect(),
            law: law.collect(),
            response,
        }
    }

    /// y = a.
    pub(super) fn constant(&self) -> Line {
        self.line(&vec![0.0; self.times_s.len()])
    }

    /// y = a + b t.
    pub(super) fn trend(&self) -> Line {
        self.line(&self.times_s)
    }

    /// y = a + b g(τ); None where no solid with this time constant does that: E∞ or E₀ would not be positive, or E would rise.
    pub(super) fn solid(&self, time_constant_s: f64) -> Option<Line> {
        let line = self.line(&memory(&self.times_s, &self.held, time_constant_s));
        let (fresh, settled) = (line.a + line.b, line.a);
        let falls = match self.form {
            Form::Relaxation => line.b >= 0.0,
            Form::Creep => line.b <= 0.0,
        };
        (falls && fresh > 0.0 && settled > 0.0).then_some(line)
    }

    /// Weighted least squares; the law's slope has a standard normal prior. A column that vanishes gets the coefficient zero.
    fn line(&self, column: &[f64]) -> Line {
        let mut normal = Matrix3::zeros();
        let mut right = Vector3::zeros();
        let scale = column.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
        let unit = if scale > 0.0 { scale } else { 1.0 };
        let row = |k: usize| Vector3::new(1.0, column[k] / unit, self.law[k]) / self.sigma[k];
        for k in 0..column.len() {
            let (row, y) = (row(k), self.response[k] / self.sigma[k]);
            normal += row * row.transpose();
            right += row * y;
        }
        normal[(2, 2)] += 1.0;
        // A column without contrast to the mean carries nothing; its coefficient must not blow up with rounding.
        let contrast = normal[(1, 1)] - normal[(0, 1)].powi(2) / normal[(0, 0)];
        let told = contrast > CONTRAST * normal[(1, 1)] && scale > 0.0;
        if !told {
            (normal[(0, 1)], normal[(1, 0)]) = (0.0, 0.0);
            (normal[(1, 2)], normal[(2, 1)]) = (0.0, 0.0);
            (normal[(1, 1)], right[1]) = (1.0, 0.0);
        }
        let inverse = normal.try_inverse().unwrap_or_else(Matrix3::zeros);
        let solution = inverse * right;
        let used = if told {
            solution
        } else {
            Vector3::new(solution[0], 0.0, solution[2])
        };
        let residuals = (0..column.len())
            .map(|k| (self.response[k] / self.sigma[k] - row(k).dot(&used)).powi(2));
        Line {
            a: used[0],
            b: used[1] / unit,
            variance: [
                inverse[(0, 0)],
                inverse[(1, 1)] / (unit * unit),
                inverse[(0, 1)] / unit,
            ],
            chi_squared: residuals.sum::<f64>() + used[2] * used[2],
        }
    }
}

/// Share of a column's weight that must differ from its mean: below, the normal equations have lost half their digits.
const CONTRAST: f64 = 1e-10;

/// A deformation that scatters no more than its errors was held: its mean. Noise in the history would count as relaxation.
fn without_noise(deformations: Vec<f64>, relative_errors: &[f64]) -> Vec<f64> {
    let count = deformations.len() as f64;
    let centre = mean(deformations.iter().copied());
    let chi_squared: f64 = (deformations.iter().zip(relative_errors))
        .map(|(x, error)| ((x / centre - 1.0) / error).powi(2))
        .sum();
    // Three standard deviations above the mean of χ² with n − 1 degrees of freedom.
    let noise = (count - 1.0) + 3.0 * (2.0 * (count - 1.0)).sqrt();
    match chi_squared <= noise {
        true => vec![centre; deformations.len()],
        false => deformations,
    }
}

fn spread_of_logs(values: &[f64]) -> f64 {
    let logs = || values.iter().map(|v| v.ln());
    let centre = mean(logs());
    mean(logs().map(|log| (log - centre).powi(2))).sqrt()
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}
