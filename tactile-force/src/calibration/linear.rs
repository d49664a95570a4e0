//! The straight line F = b + s V.

use nalgebra::DMatrix;

use super::StressCalibration;
use super::least_squares::{self, Fit};
use super::options::CalibrationOptions;
use super::pair::{CalibrationPair, check_pairs};
use super::report::{self, CalibrationReport, Parameters, Shape};
use crate::error::ForceError;
use tactile_core::Estimate;

/// A straight line from integrated pixel value to force, F = b + s V, or F = s V through the origin.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
/// let pairs: Vec<_> = (0..5).map(|k| CalibrationPair::loading(1e5 * k as f64, 0.5 * k as f64)).collect();
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// assert!((line.force_n(2.5e5) - 1.25).abs() < 1e-12);
/// assert!((line.integrated_pixel_value(1.25).unwrap() - 2.5e5).abs() < 1e-6);
/// // Offset and slope with their standard errors.
/// let [offset, slope] = line.report().parameters[..] else { unreachable!() };
/// assert!(offset.value.abs() < 1e-12 && (slope.value - 5e-6_f64).abs() < 1e-17);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LinearCalibration {
    /// Pixel value about which the line is held: there level and slope are (nearly) uncorrelated.
    centre: f64,
    level_n: Estimate,
    slope_n: Estimate,
    covariance: f64,
    range: [f64; 2],
    report: CalibrationReport,
}

impl LinearCalibration {
    /// Fits the line to pairs of integrated pixel value and force.
    ///
    /// # Errors
    /// Fewer pairs than parameters + 1, a pair that is not finite, or pairs at one pixel value only.
    pub fn fit(
        pairs: &[CalibrationPair],
        options: &CalibrationOptions,
    ) -> Result<Self, ForceError> {
        let columns = if options.through_origin { 1 } else { 2 };
        check_pairs(pairs, columns)?;
        let values: Vec<f64> = pairs.iter().map(|p| p.integrated_pixel_value).collect();
        let forces: Vec<f64> = pairs.iter().map(|p| p.force_n).collect();
        let (centre, scale) = axis(&values, options.through_origin)?;
        let entry = |i: usize, j: usize| {
            if j + 1 == columns {
                (values[i] - centre) / scale
            } else {
                1.0
            }
        };
        let design = DMatrix::from_fn(values.len(), columns, entry);
        let fit = least_squares::solve(&design, &forces, options.robustness)?;
        let line = Line::of(&fit, centre, scale);
        let shape = Shape {
            linearity_error: nonlinearity(&forces, &fit.residuals),
            sensitivity: line.slope.0,
            monotone: line.slope.0 > 0.0,
        };
        let parameters = Parameters {
            estimates: line.parameters(),
            degrees_of_freedom: pairs.len() - columns,
        };
        Ok(Self {
            centre: centre,
            level_n: Estimate::from_variance(line.level.0, line.level.1),
            slope_n: Estimate::from_variance(line.slope.0, line.slope.1),
            covariance: line.covariance,
            range: report::extremes(&values),
            report: report::build(pairs, &fit, parameters, shape),
        })
    }
}

/// Centre and half width of the pixel values, which keep the two parameters apart.
fn axis(values: &[f64], through_origin: bool) -> Result<(f64, f64), ForceError> {
    let centre = if through_origin {
        0.0
    } else {
        values.iter().sum::<f64>() / values.len() as f64
    };
    let scale = values
        .iter()
        .map(|v| (v - centre).abs())
        .fold(0.0, f64::max);
    let reach = values.iter().map(|v| v.abs()).fold(0.0, f64::max);
    if scale <= 4.0 * f64::EPSILON * reach || scale == 0.0 {
        return Err(ForceError::DegeneratePairs { span: scale });
    }
    Ok((centre, scale))
}

/// A fitted line in grey levels and newtons; values with their variances.
struct Line {
    centre: f64,
    /// Force at the centre; exactly zero where the line goes through the origin.
    level: (f64, f64),
    slope: (f64, f64),
    covariance: f64,
    through_origin: bool,
}

impl Line {
    fn of(fit: &Fit, centre: f64, scale: f64) -> Self {
        let last = fit.coefficients.len() - 1;
        let through_origin = last == 0;
        let slope = (
            fit.coefficients[last] / scale,
            fit.covariance[(last, last)] / (scale * scale),
        );
        let (level, covariance) = if through_origin {
            ((0.0, 0.0), 0.0)
        } else {
            (
                (fit.coefficients[0], fit.covariance[(0, 0)]),
                fit.covariance[(0, 1)] / scale,
            )
        };
        Self {
            centre,
            level,
            slope,
            covariance,
            through_origin,
        }
    }

    /// [offset, slope], or the slope alone through the origin.
    fn parameters(&self) -> Vec<(f64, f64)> {
        if self.through_origin {
            return vec![self.slope];
        }
        let c = self.centre;
        let variance = self.level.1 - 2.0 * self.covariance * c + self.slope.1 * c * c;
        vec![(self.level.0 - self.slope.0 * c, variance), self.slope]
    }
}

/// The line's own linearity error is that of its data: the greatest residual as a share of the full scale.
fn nonlinearity(forces: &[f64], residuals: &[f64]) -> f64 {
    residuals.iter().fold(0.0_f64, |m, r| m.max(r.abs())) / report::full_scale(forces)
}

impl StressCalibration for LinearCalibration {
    fn force_n(&self, integrated_pixel_value: f64) -> f64 {
        self.level_n.value + self.slope_n.value * (integrated_pixel_value - self.centre)
    }

    fn sensitivity_n(&self, _integrated_pixel_value: f64) -> f64 {
        self.slope_n.value
    }

    fn standard_error_n(&self, integrated_pixel_value: f64) -> f64 {
        self.error_covariance_n2(integrated_pixel_value, integrated_pixel_value)
            .max(0.0)
            .sqrt()
    }

    fn error_covariance_n2(&self, a: f64, b: f64) -> f64 {
        let (level, slope) = (self.level_n.standard_error, self.slope_n.standard_error);
        let (a, b) = (a - self.centre, b - self.centre);
        let branch = self.report.branch_error_n();
        level * level + slope * a * (slope * b) + self.covariance * (a + b) + branch * branch
    }

    fn integrated_pixel_value(&self, force_n: f64) -> Option<f64> {
        let v = self.centre + (force_n - self.level_n.value) / self.slope_n.value;
        v.is_finite().then_some(v)
    }

    fn range(&self) -> [f64; 2] {
        self.range
    }

    fn report(&self) -> &CalibrationReport {
        &self.report
    }
}
