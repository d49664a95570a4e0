//! The quality of a calibration's fit.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::least_squares::{self, Fit};
use super::options::Robustness;
use super::pair::{Branch, CalibrationPair};
use super::stop::StopReason;
use crate::error::ForceError;
use crate::estimate::{Estimate, Real};

/// The difference between loading and unloading.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
///
/// // Unloading lags by 10 mN everywhere.
/// let pairs: Vec<_> = (0..11)
///     .map(f64::from)
///     .flat_map(|v| [CalibrationPair::loading(v, 0.1 * v), CalibrationPair::unloading(v, 0.1 * v - 0.01)])
///     .collect();
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// let hysteresis = line.report().hysteresis.expect("both branches");
/// assert!((hysteresis.mean_n.value - 0.01).abs() < 1e-12);
/// assert!((hysteresis.share_of_full_scale - 0.01 / 1.01).abs() < 1e-9);
/// // The line lies between the branches, and says so of a force whose branch it is not told.
/// assert!((hysteresis.width_n - 0.005).abs() < 1e-12);
/// assert!((line.standard_error_n(5.0) - 0.005).abs() < 3e-4);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Hysteresis<T> {
    /// Greatest difference of the two branches at one pixel value, loading minus unloading, in newtons.
    pub greatest_n: T,
    /// Mean difference over the range both branches cover, and its standard error, in newtons.
    pub mean_n: Estimate<T>,
    /// Half of the mean difference where it exceeds three times its own error, else zero, in newtons: the standard error of every force
    /// whose branch is not known, common to all of them, and part of what the calibration states.
    pub width_n: T,
    /// |greatest| as a share of the full scale.
    pub share_of_full_scale: T,
}

/// Quality of a calibration.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
///
/// let pairs = [(0.0, 0.01), (1e5, 0.49), (2e5, 1.01), (3e5, 1.49)].map(|(v, f)| CalibrationPair::loading(v, f));
/// let line = LinearCalibration::<f64>::fit(&pairs, &Default::default())?;
/// let report = line.report();
/// assert!(report.r_squared > 0.999 && report.monotone);
/// assert_eq!((report.pairs, report.degrees_of_freedom), (4, 2));
/// // Offset and slope lie within their 95 % intervals.
/// assert!(report.parameters.iter().zip(&report.intervals_95).all(|(p, [low, high])| *low < p.value && p.value < *high));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CalibrationReport<T> {
    /// Number of pairs.
    pub pairs: usize,
    /// Parameters with their standard errors: [offset, slope] of a line (slope alone through the origin), Chebyshev
    /// coefficients of a polynomial, levels of a monotone curve.
    pub parameters: Vec<Estimate<T>>,
    /// 95 % confidence interval of every parameter, by Student's t.
    pub intervals_95: Vec<[T; 2]>,
    /// Pairs less parameters.
    pub degrees_of_freedom: usize,
    /// Coefficient of determination, 1 − Σr²/Σ(F − F̄)².
    pub r_squared: T,
    /// Standard deviation of the residuals, √(Σr²/(n − p)); a robust scale where outliers were discounted. Newtons.
    pub residual_sd_n: T,
    /// Residual of every pair, measured minus fitted, in newtons.
    pub residuals_n: Vec<T>,
    /// Weight of every pair: 1 for a trusted one, 0 for an outlier that counts nothing.
    pub weights: Vec<T>,
    /// Loading against unloading; `None` unless both branches were given and overlap.
    pub hysteresis: Option<Hysteresis<T>>,
    /// Greatest departure of the fitted curve from the straight line through its data, as a share of the full scale; of a
    /// straight line, the greatest departure of a pair.
    pub linearity_error: T,
    /// Mean sensitivity over the range, (F(V₁) − F(V₀))/(V₁ − V₀), in newtons per grey level.
    pub sensitivity_n: T,
    /// Smallest force resolved: three residual standard deviations, in newtons.
    pub smallest_force_n: T,
    /// Greatest force minus least force of the pairs, in newtons.
    pub full_scale_n: T,
    /// The curve rises everywhere in its range.
    pub monotone: bool,
    /// Solves, one if nothing was reweighted.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

impl<T: Real> CalibrationReport<T> {
    /// Standard error of a force whose branch is not known; 0 where the branches were not compared.
    pub(super) fn branch_error_n(&self) -> T {
        self.hysteresis.map_or(T::zero(), |h| h.width_n)
    }
}

/// Properties of the fitted curve that a report states.
pub(super) struct Shape {
    pub(super) linearity_error: f64,
    pub(super) sensitivity: f64,
    pub(super) monotone: bool,
}

/// Parameters and their variances.
pub(super) struct Parameters {
    pub(super) estimates: Vec<(f64, f64)>,
    pub(super) degrees_of_freedom: usize,
}

impl Parameters {
    /// Coefficients as fitted.
    pub(super) fn of(fit: &Fit) -> Self {
        let estimates = fit
            .coefficients
            .iter()
            .zip(fit.covariance.diagonal().iter())
            .map(|(c, v)| (*c, *v))
            .collect();
        Self {
            estimates,
            degrees_of_freedom: fit.residuals.len() - fit.coefficients.len(),
        }
    }

    /// Levels, each of (force, sd of a pair, number of pairs).
    pub(super) fn levels(levels: &[(f64, f64, usize)], pairs: usize) -> Self {
        let estimates = levels
            .iter()
            .map(|(f, sd, n)| (*f, sd * sd / *n as f64))
            .collect();
        Self {
            estimates,
            degrees_of_freedom: pairs.saturating_sub(levels.len()).max(1),
        }
    }

    fn intervals<T: Real>(&self) -> Vec<[T; 2]> {
        let t = StudentsT::new(0.0, 1.0, self.degrees_of_freedom.max(1) as f64)
            .map_or(f64::NAN, |d| d.inverse_cdf(0.975));
        let interval = |(value, variance): &(f64, f64)| {
            [-t, t].map(|t| T::nearest(value + t * variance.sqrt()))
        };
        self.estimates.iter().map(interval).collect()
    }
}

pub(super) fn build<T: Real>(
    pairs: &[CalibrationPair<T>],
    fit: &Fit,
    parameters: Parameters,
    shape: Shape,
) -> CalibrationReport<T> {
    let forces: Vec<f64> = pairs.iter().map(|p| p.force_n.as_f64()).collect();
    let full_scale = full_scale(&forces);
    let cast = |values: &[f64]| values.iter().map(|&v| T::nearest(v)).collect();
    CalibrationReport {
        pairs: pairs.len(),
        intervals_95: parameters.intervals(),
        degrees_of_freedom: parameters.degrees_of_freedom,
        parameters: parameters
            .estimates
            .iter()
            .map(|(c, v)| Estimate::nearest(*c, *v))
            .collect(),
        r_squared: T::nearest(r_squared(&forces, &fit.residuals)),
        residual_sd_n: T::nearest(fit.residual_sd),
        residuals_n: cast(&fit.residuals),
        weights: cast(&fit.weights),
        hysteresis: hysteresis(pairs, &fit.residuals, full_scale),
        linearity_error: T::nearest(shape.linearity_error),
        sensitivity_n: T::nearest(shape.sensitivity),
        smallest_force_n: T::nearest(3.0 * fit.residual_sd),
        full_scale_n: T::nearest(full_scale),
        monotone: shape.monotone,
        iterations: fit.iterations,
        stop: fit.stop,
    }
}

/// 1 − Σr²/Σ(F − F̄)².
fn r_squared(forces: &[f64], residuals: &[f64]) -> f64 {
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    let total: f64 = forces.iter().map(|f| (f - mean).powi(2)).sum();
    let left: f64 = residuals.iter().map(|r| r * r).sum();
    1.0 - left / total
}

pub(super) fn full_scale(forces: &[f64]) -> f64 {
    let least = forces.iter().copied().fold(f64::INFINITY, f64::min);
    forces.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least
}

/// Greatest distance of a curve from the least-squares line of its data, over the full scale.
pub(super) fn linearity_error(
    values: &[f64],
    forces: &[f64],
    grid: &[f64],
    curve: impl Fn(f64) -> f64,
) -> Result<f64, ForceError> {
    let middle = values.iter().sum::<f64>() / values.len() as f64;
    let half = values
        .iter()
        .map(|v| (v - middle).abs())
        .fold(0.0, f64::max);
    let design = DMatrix::from_fn(values.len(), 2, |i, j| {
        if j == 0 {
            1.0
        } else {
            (values[i] - middle) / half
        }
    });
    let line = least_squares::solve(&design, forces, Robustness::None)?.coefficients;
    let distance = |v: &f64| (curve(*v) - line[0] - line[1] * (v - middle) / half).abs();
    Ok(grid.iter().map(distance).fold(0.0, f64::max) / full_scale(forces))
}

/// Compares the residuals of each branch with the other branch's, interpolated at the same pixel value. Residuals are
/// nearly flat where forces are steep, so that interpolation adds next to nothing.
fn hysteresis<T: Real>(
    pairs: &[CalibrationPair<T>],
    residuals: &[f64],
    full_scale: f64,
) -> Option<Hysteresis<T>> {
    let branch = |wanted: Branch| {
        let mut points: Vec<(f64, f64)> = pairs
            .iter()
            .zip(residuals)
            .filter(|(p, _)| p.branch == wanted)
            .map(|(p, &r)| (p.integrated_pixel_value.as_f64(), r))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let (up, down) = (branch(Branch::Loading), branch(Branch::Unloading));
    let at_loading = up
        .iter()
        .filter_map(|&(v, r)| interpolate(&down, v).map(|other| r - other));
    let at_unloading = down
        .iter()
        .filter_map(|&(v, r)| interpolate(&up, v).map(|other| other - r));
    let differences: Vec<f64> = at_loading.chain(at_unloading).collect();
    let greatest = differences
        .iter()
        .copied()
        .max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let variance =
        differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0) / n;
    Some(Hysteresis {
        greatest_n: T::nearest(greatest),
        mean_n: Estimate::nearest(mean, variance),
        width_n: T::nearest(width(mean, variance)),
        share_of_full_scale: T::nearest(greatest.abs() / full_scale),
    })
}

/// Half of a difference that stands out of its error. What noise alone makes must not widen the errors of calibrations without
/// hysteresis: three standard errors let one in 400 through.
fn width(difference: f64, variance: f64) -> f64 {
    const STANDS_OUT: f64 = 3.0;
    let is_real = difference.abs() > STANDS_OUT * variance.sqrt();
    if is_real { 0.5 * difference.abs() } else { 0.0 }
}

/// Piecewise linear through points sorted by abscissa; `None` outside them.
fn interpolate(points: &[(f64, f64)], v: f64) -> Option<f64> {
    let after = points.partition_point(|p| p.0 < v);
    let &(v1, r1) = points.get(after)?;
    if v1 == v {
        return Some(r1);
    }
    let &(v0, r0) = points.get(after.checked_sub(1)?)?;
    Some(r0 + (r1 - r0) * (v - v0) / (v1 - v0))
}
