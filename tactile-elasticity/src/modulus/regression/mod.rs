//! Young's modulus as the slope of stress over strain.

mod line;

use crate::error::{ElasticityError, Quantity};
use crate::modulus::estimate::{
    EstimatorKind, FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator,
};
use crate::modulus::load::{LoadState, validated};
use crate::modulus::ratio::{strain_warnings, stress};
use crate::modulus::series::LoadSeries;
use crate::modulus::statistics::{fewest, t_tail};
use crate::modulus::warning::Warning;
use line::{Line, Point};
use tactile_core::{
    Interval,
    statistics::{effective_degrees_of_freedom, quantile_95},
};

/// S_i = S₀ + E e_i over many loads, with errors in both.
///
/// Each load weighs 1/(σ_S² + E²σ_e²) (York's effective variance without correlation); without any
/// standard errors all weigh the same and the error is estimated from the scatter. At least two loads, three where neither errors nor a
/// zero intercept are given.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression};
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
    /// The line goes through the origin. By default it has an intercept, which is tested: a significant one is warned of.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression, Warning};
    ///
    /// // Stress that starts at 300 Pa: a gauge that was not tared.
    /// let loads = [0.01, 0.02, 0.03, 0.04].map(|strain: f64| LoadState {
    ///     contact_area_m2: Some(Estimate::exact(1e-4)),
    ///     mean_strain: Some(Estimate::exact(strain)),
    ///     ..LoadState::new(Estimate::new((300.0 + 60e3 * strain) * 1e-4, 1e-4))
    /// });
    /// let (loads, line) = (LoadSeries::new(loads), StressStrainRegression::default());
    /// let tested = line.estimate(&loads)?;
    /// assert!(tested.warnings.iter().any(|w| matches!(w, Warning::Intercept { .. })));
    /// let forced = line.with_zero_at_origin().estimate(&loads)?;
    /// assert!(forced.youngs_modulus_pa > tested.youngs_modulus_pa);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_zero_at_origin(mut self) -> Self {
        self.zero_at_origin = true;
        self
    }

    fn points(loads: &[LoadState]) -> Result<Vec<Point>, ElasticityError> {
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

    /// Slope and intercept of the line through all loads that have a strain.
    pub(crate) fn line_through(&self, series: &LoadSeries) -> Result<(f64, f64), ElasticityError> {
        let line = self.line(&Self::points(series.loads())?)?;
        Ok((line.slope, line.intercept))
    }

    /// The line with a slope above zero.
    fn line(&self, points: &[Point]) -> Result<Line, ElasticityError> {
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

    /// Degrees of freedom of the slope's error: those of the scatter, or of the sources, the stresses counted as one.
    /// `scales` are the variances that all stresses share, with their degrees of freedom.
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
                    p_value: p_value,
                });
            }
        }
        warnings
    }
}

/// Residuals over their standard errors; over the scatter where no errors are known.
fn diagnostics(points: &[Point], line: &Line, known: bool, loads: usize) -> Vec<LoadDiagnostics> {
    let mut diagnostics = vec![LoadDiagnostics::unused(); loads];
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

fn fit_statistics(points: &[Point], line: &Line, known: bool) -> FitStatistics {
    let n = points.len() as f64;
    let minus_two_log = if known {
        line.chi_squared
    } else {
        n * (line.chi_squared / n).ln()
    };
    FitStatistics::new(
        points.len(),
        points.len() - line.degrees,
        line.chi_squared,
        minus_two_log,
    )
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
            fit: fit_statistics(&points, &line, known),
            warnings: self.warnings(loads, &line),
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::StressStrainRegression
    }
}
