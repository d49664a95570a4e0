//! Young's modulus as the slope of stress over strain.

use super::estimate::{FitStatistics, LoadDiagnostics, ModulusEstimate, ModulusEstimator};
use super::kind::EstimatorKind;
use super::load::{LoadSeries, LoadState, validated};
use super::ratio::{strain_warnings, stress};
use super::statistics::{chi_squared_tail, fewest, t_tail};
use super::warning::Warning;
use crate::error::{ElasticityError, Quantity};
use tactile_core::statistics::{effective_degrees_of_freedom, quantile_95};
use tactile_core::{Interval, Source, Uncertain};

/// S_i = S₀ + E e_i over many loads, with errors in both.
///
/// Each load has the weight 1/(σ_S² + E²σ_e²) (York's effective variance without correlation).
/// Without standard errors all weights are equal, and the error is estimated from the scatter. It
/// needs at least two loads, or three without errors. A significant intercept gives a warning, for
/// example of a gauge that was not tared.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, LoadSeries, LoadState, ModulusEstimator, StressStrainRegression,
/// };
/// let load = |stress: f64, strain: f64| {
///     LoadState::new(Estimate::new(stress * 1e-6, 1e-5))
///         .with_area(Estimate::exact(1e-6))
///         .with_strain(Estimate::new(strain, 1e-4))
/// };
/// let loads = LoadSeries::new([load(600.0, 0.01), load(1200.0, 0.02), load(2400.0, 0.04)]);
/// let modulus = StressStrainRegression.estimate(&loads)?;
/// assert!((modulus.youngs_modulus_pa - 60e3).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StressStrainRegression;

impl StressStrainRegression {
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

    /// The line, whose slope must be positive.
    pub(super) fn line(points: &[Point]) -> Result<Line, ElasticityError> {
        let known = Self::known(points);
        Self::check(points, known)?;
        let line = Line::fit(points, known);
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
            .any(|p| [p.stress, p.strain].iter().any(|x| noise(x) > 0.0))
    }

    fn check(points: &[Point], known: bool) -> Result<(), ElasticityError> {
        let expected = if known { 2 } else { 3 };
        if points.len() < expected {
            return Err(ElasticityError::TooFewLoads {
                expected,
                found: points.len(),
            });
        }
        let same = |f: fn(&Point) -> f64| points.windows(2).all(|w| f(&w[0]) == f(&w[1]));
        if same(|p| p.stress.value) {
            return Err(ElasticityError::EqualLoads);
        }
        if same(|p| p.strain.value) {
            return Err(ElasticityError::ZeroStrain);
        }
        Ok(())
    }

    /// The slope with its error by source. Errors of stresses and strains from sources other than
    /// noise change the slope like shifts of the points. Shifts dS of S and de of e change it by Σ
    /// w (e − ē)(dS − E de)/Σ w (e − ē)².
    fn by_source(points: &[Point], line: &Line) -> Uncertain {
        let noise = |of: fn(&Point) -> &Uncertain, scale: f64| {
            let variance = points
                .iter()
                .map(|p| (scale * of(p).part(Source::Noise)).powi(2));
            let degrees = points
                .iter()
                .map(|p| of(p).degrees_of_freedom(Source::Noise));
            (variance.sum::<f64>(), fewest(degrees))
        };
        let parts = [noise(|p| &p.stress, 1.0), noise(|p| &p.strain, line.slope)];
        let degrees = match line.learnt {
            true => Some(line.degrees as f64),
            false => effective_degrees_of_freedom(&parts),
        };
        let moved = |sum: Uncertain, (p, weight): (&Point, &f64)| {
            let shift = p.stress - p.strain * line.slope;
            sum + shift.without(Source::Noise) * *weight
        };
        let weighed = points.iter().zip(&line.weights);
        let common = weighed.fold(Uncertain::exact(0.0), moved);
        let slope = common.map(|_| line.slope, |_| 1.0);
        slope.by_estimated(Source::Noise, line.slope_error, degrees)
    }

    fn warnings(loads: &[LoadState], line: &Line) -> Vec<Warning> {
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

/// Residuals over their standard errors, or over the scatter if the errors are unknown.
fn diagnostics(points: &[Point], line: &Line, known: bool, loads: usize) -> Vec<LoadDiagnostics> {
    let mut diagnostics = vec![LoadDiagnostics::default(); loads];
    for p in points {
        let residual = p.stress.value - line.intercept - line.slope * p.strain.value;
        let spread = if known {
            p.spread(line.slope)
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
        let line = Self::line(&points)?;
        let by_source = Self::by_source(&points, &line);
        let total = by_source.total();
        let reach = total.standard_error * quantile_95(total.degrees_of_freedom);
        Ok(ModulusEstimate {
            youngs_modulus_pa: line.slope,
            standard_error_pa: total.standard_error,
            by_source,
            interval_95: Interval::new((line.slope - reach).max(0.0), Some(line.slope + reach)),
            estimator: EstimatorKind::StressStrainRegression,
            loads: diagnostics(&points, &line, known, loads.len()),
            fit: FitStatistics::new(points.len(), points.len() - line.degrees, line.chi_squared),
            warnings: Self::warnings(loads, &line),
        })
    }

    fn kind(&self) -> EstimatorKind {
        EstimatorKind::StressStrainRegression
    }
}

/// A straight line with its errors.
#[derive(Debug, Clone)]
pub(super) struct Line {
    pub(super) slope: f64,
    pub(super) intercept: f64,
    slope_error: f64,
    intercept_error: f64,
    chi_squared: f64,
    degrees: usize,
    learnt: bool,
    excess: Option<f64>,
    /// Change of the slope per unit change of each stress.
    weights: Vec<f64>,
}

pub(super) struct Point {
    load: usize,
    strain: Uncertain,
    stress: Uncertain,
}

impl Point {
    /// Standard deviation of the stress from the line because of noise.
    fn spread(&self, slope: f64) -> f64 {
        noise(&self.stress).hypot(slope * noise(&self.strain))
    }
}

fn noise(number: &Uncertain) -> f64 {
    number.part(Source::Noise).abs()
}

impl Line {
    /// The line through the points, weighted by their errors if they are known. The weights depend
    /// on the slope, so the fit is iterated.
    fn fit(points: &[Point], known: bool) -> Self {
        let mut line = Self::weighted(points, |_| 1.0, false);
        if !known {
            return line;
        }
        for _ in 0..50 {
            let slope = line.slope;
            let variance = |p: &Point| p.spread(slope).powi(2);
            let floor = points.iter().map(variance).fold(0.0, f64::max) * 1e-12;
            line = Self::weighted(points, |p| 1.0 / variance(p).max(floor), true);
            if (line.slope - slope).abs() <= 1e-12 * slope.abs() {
                break;
            }
        }
        line
    }

    /// Weighted least squares about the weighted centre, which decorrelates the two parameters.
    fn weighted(points: &[Point], weight: impl Fn(&Point) -> f64, known: bool) -> Self {
        let sum = |f: &dyn Fn(&Point) -> f64| points.iter().map(|p| weight(p) * f(p)).sum::<f64>();
        let total = sum(&|_| 1.0);
        let cx = sum(&|p| p.strain.value) / total;
        let cy = sum(&|p| p.stress.value) / total;
        let sxx = sum(&|p| (p.strain.value - cx).powi(2));
        let slope = sum(&|p| (p.strain.value - cx) * (p.stress.value - cy)) / sxx;
        let intercept = cy - slope * cx;
        let chi_squared = sum(&|p| (p.stress.value - intercept - slope * p.strain.value).powi(2));
        let degrees = points.len() - 2;
        let reduced = chi_squared / degrees.max(1) as f64;
        let excess = (known && degrees > 0 && chi_squared_tail(chi_squared, degrees) < 1e-3)
            .then_some(reduced);
        let learnt = !known || excess.is_some();
        let unit = if learnt { reduced } else { 1.0 };
        Self {
            slope,
            intercept,
            slope_error: (unit / sxx).sqrt(),
            intercept_error: (unit * (1.0 / total + cx * cx / sxx)).sqrt(),
            chi_squared,
            degrees,
            learnt,
            excess,
            weights: (points.iter())
                .map(|p| weight(p) * (p.strain.value - cx) / sxx)
                .collect(),
        }
    }
}
