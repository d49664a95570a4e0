//! Young's modulus as the slope of stress over strain.

use super::estimate::{FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator};
use super::kind::EstimatorKind;
use super::load::{LoadSeries, LoadState, validated};
use super::ratio::{strain_warnings, stress};
use super::statistics::{chi_squared_tail, fewest, t_tail};
use super::warning::Warning;
use crate::error::{ElasticityError, Quantity};
use tactile_core::statistics::{effective_degrees_of_freedom, quantile_95};
use tactile_core::{Estimate, Interval};

/// S_i = S₀ + E e_i over many loads, with errors in both.
///
/// Each load weighs 1/(σ_S² + E²σ_e²) (York's effective variance without correlation). Without any
/// standard errors all weigh the same and the error is estimated from the scatter. At least two
/// loads, three where neither errors nor a zero intercept are given.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression,
/// };
/// let load = |stress: f64, strain: f64| {
///     LoadState {
///         contact_area_m2: Some(Estimate::exact(1e-6)), // one square millimetre
///         mean_strain: Some(Estimate::new(strain, 1e-4)),
///         ..LoadState::new(Estimate::new(stress * 1e-6, 1e-5))
///     }
/// };
/// let loads = LoadSeries::new([load(600.0, 0.01), load(1200.0, 0.02), load(2400.0, 0.04)]);
/// let modulus = StressStrainRegression::default().estimate(&loads)?;
/// assert!((modulus.youngs_modulus_pa - 60e3).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressStrainRegression {
    zero_at_origin: bool,
}

impl StressStrainRegression {
    /// The line goes through the origin. By default it has an intercept, which is tested: a
    /// significant one is warned of.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{
    ///     Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression, Warning,
    /// };
    ///
    /// // Stress that starts at 300 Pa: a gauge that was not tared.
    /// let loads = [0.01, 0.02, 0.03, 0.04].map(|strain: f64| LoadState {
    ///     contact_area_m2: Some(Estimate::exact(1e-4)),
    ///     mean_strain: Some(Estimate::exact(strain)),
    ///     ..LoadState::new(Estimate::new((300.0 + 60e3 * strain) * 1e-4, 1e-4))
    /// });
    /// let (loads, line) = (LoadSeries::new(loads), StressStrainRegression::default());
    /// let tested = line.estimate(&loads)?;
    /// assert!(
    ///     tested
    ///         .warnings
    ///         .iter()
    ///         .any(|w| matches!(w, Warning::Intercept { .. }))
    /// );
    /// let forced = line.with_zero_at_origin().estimate(&loads)?;
    /// assert!(forced.youngs_modulus_pa > tested.youngs_modulus_pa);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_zero_at_origin(mut self) -> Self {
        self.zero_at_origin = true;
        self
    }

    pub(super) fn points(loads: &[LoadState]) -> Result<Vec<Point>, ElasticityError> {
        let mut points = Vec::new();
        for (load, state) in loads.iter().enumerate() {
            if let Some(strain) = state.mean_strain {
                points.push(Point {
                    load,
                    strain: validated(strain, Quantity::Strain)?,
                    stress: stress(load, state)?,
                });
            }
        }
        Ok(points)
    }

    /// The line with a slope above zero.
    pub(super) fn line(&self, points: &[Point]) -> Result<Line, ElasticityError> {
        let known = Self::known(points);
        self.check(points, known)?;
        let line = Line::fit(points, !self.zero_at_origin, known);
        if line.slope <= 0.0 || !line.slope.is_finite() {
            let p = points
                .last()
                .map_or((0.0, 0.0), |p| (p.stress.value, p.strain.value));
            return Err(ElasticityError::OppositeSigns {
                stress_pa: p.0,
                strain: p.1,
            });
        }
        Ok(line)
    }

    /// Whether any point has an error.
    fn known(points: &[Point]) -> bool {
        points
            .iter()
            .any(|p| p.stress.standard_error > 0.0 || p.strain.standard_error > 0.0)
    }

    fn check(&self, points: &[Point], known: bool) -> Result<(), ElasticityError> {
        let through_origin = self.zero_at_origin;
        let expected = match (through_origin, known) {
            (true, true) => 1,
            (false, false) => 3,
            _ => 2,
        };
        if points.len() < expected {
            return Err(ElasticityError::TooFewLoads {
                expected,
                found: points.len(),
            });
        }
        let same = |f: fn(&Point) -> f64| points.windows(2).all(|w| f(&w[0]) == f(&w[1]));
        if through_origin && points.iter().all(|p| p.strain.value == 0.0) {
            return Err(ElasticityError::ZeroStrain);
        }
        if !through_origin && same(|p| p.stress.value) {
            return Err(ElasticityError::EqualLoads);
        }
        if !through_origin && same(|p| p.strain.value) {
            return Err(ElasticityError::ZeroStrain);
        }
        Ok(())
    }

    /// Degrees of freedom of the slope's error: those of the scatter, or of the sources, the
    /// stresses counted as one. `scales` are the variances that all stresses share, with their
    /// degrees of freedom.
    fn degrees(points: &[Point], line: &Line, scales: [(f64, Option<f64>); 2]) -> Option<f64> {
        if line.learnt {
            return Some(line.degrees as f64);
        }
        let stress = points
            .iter()
            .map(|p| p.stress.standard_error.powi(2))
            .sum::<f64>();
        let strain = points
            .iter()
            .map(|p| (line.slope * p.strain.standard_error).powi(2))
            .sum::<f64>();
        // What the slope's error has of either, in proportion.
        let unit = line.slope_error.powi(2) / (stress + strain);
        effective_degrees_of_freedom(&[
            (
                unit * stress,
                fewest(points.iter().map(|p| p.stress.degrees_of_freedom)),
            ),
            (
                unit * strain,
                fewest(points.iter().map(|p| p.strain.degrees_of_freedom)),
            ),
            scales[0],
            scales[1],
        ])
    }

    fn warnings(&self, loads: &[LoadState], line: &Line) -> Vec<Warning> {
        let mut warnings = strain_warnings(loads);
        warnings.extend(line.excess.map(|x| Warning::ExcessScatter {
            reduced_chi_squared: x,
        }));
        if line.intercept_error > 0.0 {
            let t = line.intercept / line.intercept_error;
            let p_value = t_tail(
                t,
                if line.learnt {
                    line.degrees
                } else {
                    usize::MAX >> 12
                },
            );
            if p_value < 0.05 {
                warnings.push(Warning::Intercept {
                    intercept_pa: line.intercept,
                    p_value,
                });
            }
        }
        warnings
    }
}

/// Residuals over their standard errors. Over the scatter where no errors are known.
fn diagnostics(points: &[Point], line: &Line, known: bool, loads: usize) -> Vec<LoadDiagnostics> {
    let mut diagnostics = vec![LoadDiagnostics::default(); loads];
    for p in points {
        let residual = p.stress.value - line.intercept - line.slope * p.strain.value;
        let spread = if known {
            p.stress
                .standard_error
                .hypot(line.slope * p.strain.standard_error)
        } else {
            (line.chi_squared / line.degrees.max(1) as f64).sqrt()
        };
        diagnostics[p.load].used = true;
        diagnostics[p.load].standardized_residual = (spread > 0.0).then(|| residual / spread);
    }
    diagnostics
}

impl ModulusEstimator for StressStrainRegression {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let loads = series.loads();
        let points = Self::points(loads)?;
        let known = Self::known(&points);
        let line = self.line(&points)?;
        // The scale of the forces comes from the calibration that their own errors come from.
        let forces = fewest(loads.iter().map(|load| load.force_n.degrees_of_freedom));
        let scales = [
            (series.shared_errors().force_scale, forces),
            (series.size_scale_error(), None),
        ]
        .map(|(relative, degrees)| ((line.slope * relative).powi(2), degrees));
        let error = (line.slope_error.powi(2) + scales[0].0 + scales[1].0).sqrt();
        let reach = error * quantile_95(Self::degrees(&points, &line, scales));
        Ok(ModulusEstimate {
            youngs_modulus_pa: line.slope,
            standard_error_pa: error,
            interval_95: Interval::new((line.slope - reach).max(0.0), Some(line.slope + reach)),
            estimator: EstimatorKind::StressStrainRegression,
            loads: diagnostics(&points, &line, known, loads.len()),
            fit: FitStatistics::new(points.len(), points.len() - line.degrees, line.chi_squared),
            warnings: self.warnings(loads, &line),
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::StressStrainRegression
    }
}

/// A straight line with its errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    pub(super) slope: f64,
    pub(super) intercept: f64,
    slope_error: f64,
    intercept_error: f64,
    chi_squared: f64,
    degrees: usize,
    learnt: bool,
    excess: Option<f64>,
}

pub(super) struct Point {
    load: usize,
    strain: Estimate,
    stress: Estimate,
}

impl Line {
    /// The line through the points, or through them and the origin. Weighted by their errors where
    /// these are known. The weights depend on the slope, so that the fit is iterated.
    fn fit(points: &[Point], free: bool, known: bool) -> Self {
        let mut line = Self::weighted(points, |_| 1.0, free, false);
        if !known {
            return line;
        }
        for _ in 0..50 {
            let slope = line.slope;
            let variance = |p: &Point| {
                p.stress.standard_error.powi(2) + (slope * p.strain.standard_error).powi(2)
            };
            let floor = points.iter().map(variance).fold(0.0, f64::max) * 1e-12;
            line = Self::weighted(points, |p| 1.0 / variance(p).max(floor), free, true);
            if (line.slope - slope).abs() <= 1e-12 * slope.abs() {
                break;
            }
        }
        line
    }

    /// Weighted least squares about the weighted centre, which keeps the two parameters apart.
    fn weighted(points: &[Point], weight: impl Fn(&Point) -> f64, free: bool, known: bool) -> Self {
        let sum = |f: &dyn Fn(&Point) -> f64| points.iter().map(|p| weight(p) * f(p)).sum::<f64>();
        let total = sum(&|_| 1.0);
        let (cx, cy) = if free {
            (
                sum(&|p| p.strain.value) / total,
                sum(&|p| p.stress.value) / total,
            )
        } else {
            (0.0, 0.0)
        };
        let sxx = sum(&|p| (p.strain.value - cx).powi(2));
        let slope = sum(&|p| (p.strain.value - cx) * (p.stress.value - cy)) / sxx;
        let intercept = cy - slope * cx;
        let chi_squared = sum(&|p| (p.stress.value - intercept - slope * p.strain.value).powi(2));
        let degrees = points.len() - if free { 2 } else { 1 };
        let reduced = chi_squared / degrees.max(1) as f64;
        let excess = (known && degrees > 0 && chi_squared_tail(chi_squared, degrees) < 1e-3)
            .then_some(reduced);
        let learnt = !known || excess.is_some();
        let unit = if learnt { reduced } else { 1.0 };
        let intercept_variance = if free {
            unit * (1.0 / total + cx * cx / sxx)
        } else {
            0.0
        };
        Self {
            slope,
            intercept,
            slope_error: (unit / sxx).sqrt(),
            intercept_error: intercept_variance.sqrt(),
            chi_squared,
            degrees,
            learnt,
            excess,
        }
    }
}
