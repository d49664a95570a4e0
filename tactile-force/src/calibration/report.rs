//! The quality of a calibration's fit.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::least_squares::Fit;
use super::pair::{Branch, CalibrationPair};
use tactile_core::Estimate;
use tactile_core::StopReason;

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
pub struct Hysteresis {
    /// Greatest difference of the two branches at one pixel value, loading minus unloading, in newtons.
    pub greatest_n: f64,
    /// Mean difference over the range both branches cover, and its standard error, in newtons.
    pub mean_n: Estimate,
    /// Half of the mean difference where it exceeds three times its own error, else zero, in newtons: the standard error of every force
    /// whose branch is not known, common to all of them, and part of what the calibration states.
    pub width_n: f64,
    /// |greatest| as a share of the full scale.
    pub share_of_full_scale: f64,
}

/// Quality of a calibration.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
///
/// let pairs = [(0.0, 0.01), (1e5, 0.49), (2e5, 1.01), (3e5, 1.49)].map(|(v, f)| CalibrationPair::loading(v, f));
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// let report = line.report();
/// assert!(report.r_squared > 0.999 && report.monotone);
/// assert_eq!((report.pairs, report.degrees_of_freedom), (4, 2));
/// // Offset and slope lie within their 95 % intervals.
/// assert!(report.parameters.iter().zip(&report.intervals_95).all(|(p, [low, high])| *low < p.value && p.value < *high));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CalibrationReport {
    /// Number of pairs.
    pub pairs: usize,
    /// Parameters with their standard errors: [offset, slope] of a line (slope alone through the origin), Chebyshev
    /// coefficients of a polynomial, levels of a monotone curve.
    pub parameters: Vec<Estimate>,
    /// 95 % confidence interval of every parameter, by Student's t.
    pub intervals_95: Vec<[f64; 2]>,
    /// Pairs less parameters.
    pub degrees_of_freedom: usize,
    /// Coefficient of determination, 1 − Σr²/Σ(F − F̄)².
    pub r_squared: f64,
    /// Standard deviation of the residuals, √(Σr²/(n − p)); a robust scale where outliers were discounted. Newtons.
    pub residual_sd_n: f64,
    /// Residual of every pair, measured minus fitted, in newtons.
    pub residuals_n: Vec<f64>,
    /// Weight of every pair: 1 for a trusted one, 0 for an outlier that counts nothing.
    pub weights: Vec<f64>,
    /// Loading against unloading; `None` unless both branches were given and overlap.
    pub hysteresis: Option<Hysteresis>,
    /// Greatest departure of the fitted curve from the straight line through its data, as a share of the full scale; of a
    /// straight line, the greatest departure of a pair.
    pub linearity_error: f64,
    /// Mean sensitivity over the range, (F(V₁) − F(V₀))/(V₁ − V₀), in newtons per grey level.
    pub sensitivity_n: f64,
    /// Smallest force resolved: three residual standard deviations, in newtons.
    pub smallest_force_n: f64,
    /// Greatest force minus least force of the pairs, in newtons.
    pub full_scale_n: f64,
    /// The curve rises everywhere in its range.
    pub monotone: bool,
    /// Solves, one if nothing was reweighted.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

impl CalibrationReport {
    /// Standard error of a force whose branch is not known; 0 where the branches were not compared.
    pub(super) fn branch_error_n(&self) -> f64 {
        self.hysteresis.map_or(0.0, |h| h.width_n)
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
    fn intervals(&self) -> Vec<[f64; 2]> {
        let t = StudentsT::new(0.0, 1.0, self.degrees_of_freedom.max(1) as f64)
            .map_or(f64::NAN, |d| d.inverse_cdf(0.975));
        let interval =
            |(value, variance): &(f64, f64)| [-t, t].map(|t| value + t * variance.sqrt());
        self.estimates.iter().map(interval).collect()
    }
}

pub(super) fn build(
    pairs: &[CalibrationPair],
    fit: &Fit,
    parameters: Parameters,
    shape: Shape,
) -> CalibrationReport {
    let forces: Vec<f64> = pairs.iter().map(|p| p.force_n).collect();
    let full_scale = full_scale(&forces);
    let cast = |values: &[f64]| values.iter().map(|&v| v).collect();
    CalibrationReport {
        pairs: pairs.len(),
        intervals_95: parameters.intervals(),
        degrees_of_freedom: parameters.degrees_of_freedom,
        parameters: parameters
            .estimates
            .iter()
            .map(|(c, v)| Estimate::from_variance(*c, *v))
            .collect(),
        r_squared: r_squared(&forces, &fit.residuals),
        residual_sd_n: fit.residual_sd,
        residuals_n: cast(&fit.residuals),
        weights: cast(&fit.weights),
        hysteresis: hysteresis(pairs, &fit.residuals, full_scale),
        linearity_error: shape.linearity_error,
        sensitivity_n: shape.sensitivity,
        smallest_force_n: 3.0 * fit.residual_sd,
        full_scale_n: full_scale,
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
    let [least, greatest] = extremes(forces);
    greatest - least
}

pub(super) fn extremes(values: &[f64]) -> [f64; 2] {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [least, greatest]
}

/// Compares the residuals of each branch with the other branch's, interpolated at the same pixel value. Residuals are
/// nearly flat where forces are steep, so that interpolation adds next to nothing.
fn hysteresis(pairs: &[CalibrationPair], residuals: &[f64], full_scale: f64) -> Option<Hysteresis> {
    let branch = |wanted: Branch| {
        let mut points: Vec<(f64, f64)> = pairs
            .iter()
            .zip(residuals)
            .filter(|(p, _)| p.branch == wanted)
            .map(|(p, &r)| (p.integrated_pixel_value, r))
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
        greatest_n: greatest,
        mean_n: Estimate::from_variance(mean, variance),
        width_n: width(mean, variance),
        share_of_full_scale: greatest.abs() / full_scale,
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
