//! The straight line F = b + s V, its report, and the least squares behind it.

use nalgebra::{DMatrix, DVector};
use tactile_core::{Estimate, StopReason};

use super::{Branch, CalibrationOptions, CalibrationPair, Robustness, StressCalibration};
use crate::error::ForceError;

/// A straight line from integrated pixel value to force, F = b + s V, or F = s V through the
/// origin.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
/// let pairs = [0.0, 1.0, 2.0, 3.0, 4.0].map(|k| CalibrationPair::loading(1e5 * k, 0.5 * k));
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// assert!((line.force_n(2.5e5) - 1.25).abs() < 1e-12);
/// assert!((line.sensitivity_n(1e5) - 5e-6).abs() < 1e-17);
/// assert_eq!(line.range(), [0.0, 4e5]);
/// // A line of frame sums holds for contacts of one shape: it has no local curve.
/// assert!(line.local().is_none());
/// // Offset and slope with their standard errors.
/// let [offset, slope] = line.report().parameters[..] else { unreachable!() };
/// assert!(offset.value.abs() < 1e-12 && (slope.value - 5e-6).abs() < 1e-17);
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
    /// Fewer pairs than parameters + 1, a pair that is not finite, or pairs at one pixel value
    /// only.
    pub fn fit(
        pairs: &[CalibrationPair],
        options: &CalibrationOptions,
    ) -> Result<Self, ForceError> {
        let columns = if options.through_origin { 1 } else { 2 };
        check_pairs(pairs, columns)?;
        let values: Vec<f64> = pairs.iter().map(|p| p.integrated_pixel_value).collect();
        let forces: Vec<f64> = pairs.iter().map(|p| p.force_n).collect();
        // Centre and half width of the pixel values keep the two parameters apart.
        let centre = if options.through_origin {
            0.0
        } else {
            values.iter().sum::<f64>() / values.len() as f64
        };
        let greatest = |from: f64| values.iter().map(|v| (v - from).abs()).fold(0.0, f64::max);
        let scale = greatest(centre);
        // Values that differ by rounding alone do not determine a slope.
        if scale <= 4.0 * f64::EPSILON * greatest(0.0) || scale == 0.0 {
            return Err(ForceError::DegeneratePairs { span: scale });
        }
        let design = DMatrix::from_fn(values.len(), columns, |i, j| {
            if j + 1 == columns {
                (values[i] - centre) / scale
            } else {
                1.0
            }
        });
        let rows = noise_weights(&design, &forces, options)?;
        let fit = Fit::solve(&design, &forces, &rows, options.robustness)?;
        let degrees = (pairs.len() - columns) as f64;
        let estimate = |value: f64, variance: f64| {
            Estimate::from_variance(value, variance).with_degrees_of_freedom(degrees)
        };
        let last = columns - 1;
        let slope_variance = fit.covariance[(last, last)] / (scale * scale);
        let slope_n = estimate(fit.coefficients[last] / scale, slope_variance);
        let (level_n, covariance, parameters) = if options.through_origin {
            (Estimate::exact(0.0), 0.0, vec![slope_n])
        } else {
            let (level, variance) = (fit.coefficients[0], fit.covariance[(0, 0)]);
            let covariance = fit.covariance[(0, 1)] / scale;
            let offset = estimate(
                level - slope_n.value * centre,
                variance - 2.0 * covariance * centre + slope_variance * centre * centre,
            );
            (estimate(level, variance), covariance, vec![offset, slope_n])
        };
        let curve = |v: f64| level_n.value + slope_n.value * (v - centre);
        let mut report = CalibrationReport::new(pairs, curve, columns);
        report.parameters = parameters;
        report.r_squared = r_squared(&forces, &fit.residuals);
        if rows.iter().all(|weight| *weight == 1.0) {
            report.residual_sd_n = fit.residual_sd;
        }
        report.smallest_force_n = 3.0 * fit.residual_sd;
        report.residuals_n = fit.residuals;
        report.weights = fit.weights;
        (report.iterations, report.stop) = (fit.iterations, fit.stop);
        Ok(Self {
            centre,
            level_n,
            slope_n,
            covariance,
            range: extremes(&values),
            report,
        })
    }

    /// How well the line fits its pairs.
    #[must_use]
    pub fn report(&self) -> &CalibrationReport {
        &self.report
    }

    /// The integrated pixel value of a force. `None` for a line without slope.
    ///
    /// ```
    /// use tactile_force::{CalibrationPair, LinearCalibration};
    /// let pairs = [0.0, 1.0, 2.0].map(|k| CalibrationPair::loading(1e5 * k, 0.5 * k));
    /// let line = LinearCalibration::fit(&pairs, &Default::default())?;
    /// assert!((line.integrated_pixel_value(0.75).unwrap() - 1.5e5).abs() < 1e-6);
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    #[must_use]
    pub fn integrated_pixel_value(&self, force_n: f64) -> Option<f64> {
        let v = self.centre + (force_n - self.level_n.value) / self.slope_n.value;
        v.is_finite().then_some(v)
    }
}

impl StressCalibration for LinearCalibration {
    fn force_n(&self, integrated_pixel_value: f64) -> f64 {
        self.level_n.value + self.slope_n.value * (integrated_pixel_value - self.centre)
    }

    fn sensitivity_n(&self, _integrated_pixel_value: f64) -> f64 {
        self.slope_n.value
    }

    fn standard_error_n(&self, integrated_pixel_value: f64) -> f64 {
        let v = integrated_pixel_value;
        self.error_covariance_n2(v, v).max(0.0).sqrt()
    }

    fn degrees_of_freedom(&self) -> Option<f64> {
        Some(self.report.degrees_of_freedom as f64)
    }

    fn error_covariance_n2(&self, a: f64, b: f64) -> f64 {
        let (level, slope) = (self.level_n.standard_error, self.slope_n.standard_error);
        let (a, b) = (a - self.centre, b - self.centre);
        // A force whose branch is not known lies half their difference from the line.
        let branch = self.report.hysteresis.map_or(0.0, |h| h.width_n);
        level * level + slope * a * (slope * b) + self.covariance * (a + b) + branch * branch
    }

    fn range(&self) -> [f64; 2] {
        self.range
    }
}

/// Refuses pairs that no fit can use: too few for the parameters, or not finite.
fn check_pairs(pairs: &[CalibrationPair], parameters: usize) -> Result<(), ForceError> {
    let finite =
        |p: &CalibrationPair| p.integrated_pixel_value.is_finite() && p.force_n.is_finite();
    if let Some(index) = pairs.iter().position(|p| !finite(p)) {
        return Err(ForceError::NonFinitePair { index });
    }
    if pairs.len() <= parameters {
        return Err(ForceError::TooFewPairs {
            required: parameters + 1,
            found: pairs.len(),
        });
    }
    Ok(())
}

/// The difference between loading and unloading.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
///
/// // Unloading lags by 10 mN everywhere.
/// let both = |v: f64| {
///     [CalibrationPair::loading(v, 0.1 * v), CalibrationPair::unloading(v, 0.1 * v - 0.01)]
/// };
/// let pairs: Vec<_> = (0..11).map(f64::from).flat_map(both).collect();
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// let hysteresis = line.report().hysteresis.expect("both branches");
/// assert!((hysteresis.mean_n.value - 0.01).abs() < 1e-12);
/// assert!((hysteresis.share_of_full_scale - 0.01 / 1.01).abs() < 1e-9);
/// // The line lies between the branches: a force of unknown branch is off by half of that.
/// assert!((hysteresis.width_n - 0.005).abs() < 1e-12);
/// assert!((line.standard_error_n(5.0) - 0.005).abs() < 3e-4);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Hysteresis {
    /// Greatest difference of the two branches at one pixel value, loading minus unloading, in
    /// newtons.
    pub greatest_n: f64,
    /// Mean difference over the range of both branches, in newtons.
    pub mean_n: Estimate,
    /// Half of the mean difference where it exceeds three times its own error, else zero, in
    /// newtons. Every force whose branch is not known has this standard error, common to all of
    /// them.
    pub width_n: f64,
    /// |greatest| as a share of the full scale.
    pub share_of_full_scale: f64,
}

/// Quality of a calibration.
///
/// ```
/// use tactile_force::{CalibrationPair, CalibrationReport, LinearCalibration};
///
/// let pairs = [(0.0, 0.01), (1e5, 0.49), (2e5, 1.01), (3e5, 1.49)];
/// let pairs = pairs.map(|(v, f)| CalibrationPair::loading(v, f));
/// let line = LinearCalibration::fit(&pairs, &Default::default())?;
/// let report = line.report();
/// assert!(report.r_squared > 0.999 && report.monotone);
/// assert_eq!((report.pairs, report.degrees_of_freedom), (4, 2));
/// // Four pairs: the 95 % interval of the slope by Student's t with two degrees of freedom.
/// let interval = report.parameters[1].interval_95();
/// assert!(
///     interval.contains(5e-6)
///         && interval.upper.unwrap() > 5e-6 + 2.0 * report.parameters[1].standard_error
/// );
/// // The report of a curve of one's own, with one parameter.
/// let own = CalibrationReport::new(&pairs, |v| 4.98e-6 * v, 1);
/// assert!(own.residual_sd_n < 0.02 && own.degrees_of_freedom == 3);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct CalibrationReport {
    /// Number of pairs.
    pub pairs: usize,
    /// Parameters with their standard errors and degrees of freedom: [offset, slope] of a line,
    /// slope alone through the origin.
    pub parameters: Vec<Estimate>,
    /// Pairs less parameters.
    pub degrees_of_freedom: usize,
    /// Coefficient of determination, 1 − Σr²/Σ(F − F̄)².
    pub r_squared: f64,
    /// Standard deviation of the residuals, √(Σr²/(n − p)), in newtons. A robust scale where
    /// outliers were discounted.
    pub residual_sd_n: f64,
    /// Residual of every pair, measured minus fitted, in newtons.
    pub residuals_n: Vec<f64>,
    /// Weight of every pair: 1 for a trusted one, 0 for an outlier that counts nothing.
    pub weights: Vec<f64>,
    /// Loading against unloading. `None` unless both branches were given and overlap.
    pub hysteresis: Option<Hysteresis>,
    /// Greatest distance of a pair from the curve, as a share of the full scale.
    pub linearity_error: f64,
    /// Mean sensitivity over the range, (F(V₁) − F(V₀))/(V₁ − V₀), in newtons per grey level.
    pub sensitivity_n: f64,
    /// Smallest force resolved: three residual standard deviations, in newtons.
    pub smallest_force_n: f64,
    /// Greatest force minus least force of the pairs, in newtons.
    pub full_scale_n: f64,
    /// The curve rises between the pairs' pixel values.
    pub monotone: bool,
    /// Solves, one if nothing was reweighted.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

impl CalibrationReport {
    /// The report of a curve F(V) with this number of fitted parameters, by its residuals from the
    /// pairs. The parameters themselves are not known to it. O(pairs · log pairs).
    #[must_use]
    pub fn new(pairs: &[CalibrationPair], curve: impl Fn(f64) -> f64, parameters: usize) -> Self {
        let forces: Vec<f64> = pairs.iter().map(|p| p.force_n).collect();
        let mut values: Vec<f64> = pairs.iter().map(|p| p.integrated_pixel_value).collect();
        let residual = |p: &CalibrationPair| p.force_n - curve(p.integrated_pixel_value);
        let residuals_n: Vec<f64> = pairs.iter().map(residual).collect();
        values.sort_by(f64::total_cmp);
        let fitted: Vec<f64> = values.iter().map(|v| curve(*v)).collect();
        let ([low, high], [least, greatest]) = (extremes(&values), extremes(&forces));
        let full_scale_n = greatest - least;
        let farthest = residuals_n.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        let degrees_of_freedom = pairs.len().saturating_sub(parameters);
        let squares: f64 = residuals_n.iter().map(|r| r * r).sum();
        let residual_sd_n = (squares / degrees_of_freedom as f64).sqrt();
        let sensitivity_n = (curve(high) - curve(low)) / (high - low);
        Self {
            pairs: pairs.len(),
            parameters: Vec::new(),
            degrees_of_freedom,
            r_squared: r_squared(&forces, &residuals_n),
            residual_sd_n,
            weights: vec![1.0; pairs.len()],
            hysteresis: Hysteresis::of(pairs, &residuals_n, full_scale_n),
            linearity_error: farthest / full_scale_n,
            sensitivity_n,
            smallest_force_n: 3.0 * residual_sd_n,
            full_scale_n,
            monotone: sensitivity_n > 0.0 && fitted.is_sorted(),
            iterations: 1,
            stop: StopReason::Direct,
            residuals_n,
        }
    }
}

/// 1 − Σr²/Σ(F − F̄)².
fn r_squared(forces: &[f64], residuals: &[f64]) -> f64 {
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    let total: f64 = forces.iter().map(|f| (f - mean).powi(2)).sum();
    1.0 - residuals.iter().map(|r| r * r).sum::<f64>() / total
}

fn extremes(values: &[f64]) -> [f64; 2] {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [least, greatest]
}

impl Hysteresis {
    /// Compares the residuals of each branch with the other branch's, interpolated at the same
    /// pixel value. Residuals are nearly flat where forces are steep, so that interpolation adds
    /// next to nothing.
    fn of(pairs: &[CalibrationPair], residuals: &[f64], full_scale_n: f64) -> Option<Self> {
        let branch = |wanted: Branch| {
            let both = pairs.iter().zip(residuals);
            let mut points: Vec<(f64, f64)> = both
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
        // The greatest by size keeps its sign.
        let by_size = |a: &&f64, b: &&f64| a.abs().total_cmp(&b.abs());
        let greatest_n = *differences.iter().max_by(by_size)?;
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let squares: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
        let degrees = (n - 1.0).max(1.0);
        let mean_n =
            Estimate::from_variance(mean, squares / degrees / n).with_degrees_of_freedom(degrees);
        // Noise alone must not widen the errors of calibrations without hysteresis: three standard
        // errors let one in 400 through.
        let is_clear = mean.abs() > 3.0 * mean_n.standard_error;
        Some(Self {
            greatest_n,
            mean_n,
            width_n: if is_clear { 0.5 * mean.abs() } else { 0.0 },
            share_of_full_scale: greatest_n.abs() / full_scale_n,
        })
    }
}

/// Piecewise linear through points sorted by abscissa. `None` outside them.
fn interpolate(points: &[(f64, f64)], v: f64) -> Option<f64> {
    let after = points.partition_point(|p| p.0 < v);
    let &(v1, r1) = points.get(after)?;
    if v1 == v {
        return Some(r1);
    }
    let &(v0, r0) = points.get(after.checked_sub(1)?)?;
    Some(r0 + (r1 - r0) * (v - v0) / (v1 - v0))
}

/// A solved linear model y = X c + e.
struct Fit {
    coefficients: DVector<f64>,
    /// Covariance of the coefficients.
    covariance: DMatrix<f64>,
    residuals: Vec<f64>,
    /// Weight of every observation, 1 for a trusted one.
    weights: Vec<f64>,
    /// Standard deviation of the errors: least squares, or robust scale.
    residual_sd: f64,
    iterations: usize,
    stop: StopReason,
}

impl Fit {
    /// Least squares for the coefficients of the design's columns, reweighted for outliers. `rows`
    /// are the weights that the pairs have by their noise: the residual standard deviation is that
    /// of a pair of weight 1.
    fn solve(
        design: &DMatrix<f64>,
        y: &[f64],
        rows: &[f64],
        robustness: Robustness,
    ) -> Result<Self, ForceError> {
        let root = DVector::from_iterator(y.len(), rows.iter().map(|w| w.sqrt()));
        let y = DVector::from_column_slice(y).component_mul(&root);
        let mut design = design.clone();
        for mut column in design.column_iter_mut() {
            column.component_mul_assign(&root);
        }
        let design = &design;
        let mut weights = vec![1.0; y.len()];
        let mut coefficients = weighted(design, &y, &weights)?;
        let (mut iterations, mut stop, mut scale) = (1, StopReason::Direct, 0.0);
        let stages: &[Robustness] = match robustness {
            Robustness::None => &[],
            Robustness::Huber => &[Robustness::Huber],
            Robustness::Tukey => &[Robustness::Huber, Robustness::Tukey],
        };
        for &stage in stages {
            stop = StopReason::IterationLimit;
            for _ in 0..100 {
                iterations += 1;
                let residuals = &y - design * &coefficients;
                scale = robust_scale(residuals.as_slice(), design.ncols());
                for (w, r) in weights.iter_mut().zip(residuals.iter()) {
                    *w = robust_weight(stage, *r, scale);
                }
                let next = weighted(design, &y, &weights)?;
                let step = (design * (&next - &coefficients)).amax();
                coefficients = next;
                if step <= 1e-10 * scale {
                    stop = StopReason::Converged;
                    break;
                }
            }
        }
        let scaled = &y - design * &coefficients;
        let (variance, residual_sd) =
            error_variance(robustness, scaled.as_slice(), scale, design.ncols());
        let residuals = scaled.component_div(&root).as_slice().to_vec();
        Ok(Self {
            covariance: inverse_gram(design)? * variance,
            coefficients,
            residuals,
            weights,
            residual_sd,
            iterations,
            stop,
        })
    }
}

/// Weights 1/(1 + k F²/F_max²) of pairs whose noise has a constant part and one that grows with the
/// force, as that of a gauge of so many per cent of the reading.
///
/// Of k = 0, 4 (the degrees of freedom, where there are fewer) and 30 the one of the greatest
/// restricted likelihood is taken. Few pairs do not decide. There the middle one is preferred by
/// 0.8 in the likelihood's logarithm. Of its 95 % intervals 92 to 98 % then hold in the middle of
/// the range, whichever noise there is. Robust fits weigh by their residuals.
fn noise_weights(
    design: &DMatrix<f64>,
    forces: &[f64],
    options: &CalibrationOptions,
) -> Result<Vec<f64>, ForceError> {
    let even = vec![1.0; forces.len()];
    let largest = forces.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
    let weighs = options.robustness == Robustness::None && !options.constant_noise;
    if !weighs || largest == 0.0 {
        return Ok(even);
    }
    let mut best = (f64::NEG_INFINITY, even.clone());
    let freedom = (forces.len() - design.ncols()) as f64;
    for (growth, prior) in [(0.0, 0.0), (freedom.min(4.0), 0.8), (30.0, 0.0)] {
        let weight = |f: &f64| 1.0 / (1.0 + growth * (f / largest).powi(2));
        let rows: Vec<f64> = forces.iter().map(weight).collect();
        let fit = Fit::solve(design, forces, &rows, Robustness::None)?;
        // Pairs without noise leave rounding, which has no likelihood.
        if fit.residual_sd <= 1e-12 * largest {
            return Ok(even);
        }
        // The logarithm of the restricted likelihood, but for constants (Patterson and Thompson
        // 1971).
        let of_rows = 0.5 * rows.iter().map(|w| w.ln()).sum::<f64>();
        let gram = &fit.covariance / fit.residual_sd.powi(2);
        let of_fit = 0.5 * gram.determinant().ln() - freedom * fit.residual_sd.ln();
        let likelihood = prior + of_rows + of_fit;
        if likelihood > best.0 {
            best = (likelihood, rows);
        }
    }
    Ok(best.1)
}

fn weighted(
    design: &DMatrix<f64>,
    y: &DVector<f64>,
    weights: &[f64],
) -> Result<DVector<f64>, ForceError> {
    let root = DVector::from_iterator(y.len(), weights.iter().map(|w| w.sqrt()));
    let mut scaled = design.clone();
    for mut column in scaled.column_iter_mut() {
        column.component_mul_assign(&root);
    }
    // By QR, because the normal equations would square the condition number.
    let qr = scaled.qr();
    let rhs = qr.q().transpose() * y.component_mul(&root);
    let r = qr.r();
    check_rank(&r)?;
    r.solve_upper_triangular(&rhs)
        .ok_or(ForceError::DegeneratePairs { span: 0.0 })
}

/// (XᵀX)⁻¹ by QR.
fn inverse_gram(design: &DMatrix<f64>) -> Result<DMatrix<f64>, ForceError> {
    let r = design.clone().qr().r();
    check_rank(&r)?;
    let inverse = r
        .solve_upper_triangular(&DMatrix::identity(r.ncols(), r.ncols()))
        .ok_or(ForceError::DegeneratePairs { span: 0.0 })?;
    Ok(&inverse * inverse.transpose())
}

/// The design's columns are of order one, so a pivot at rounding level means they do not span.
fn check_rank(r: &DMatrix<f64>) -> Result<(), ForceError> {
    let diagonal = r.diagonal().abs();
    let (least, greatest) = (diagonal.min(), diagonal.max());
    if least > 1e-13 * greatest {
        Ok(())
    } else {
        Err(ForceError::DegeneratePairs { span: least })
    }
}

/// Median absolute residual over Φ⁻¹(3/4), with the p residuals that a fit makes zero left out: the
/// standard deviation of a normal sample.
fn robust_scale(residuals: &[f64], parameters: usize) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let kept = &sizes[parameters.min(sizes.len() - 1)..];
    1.482_602_218_505_602 * 0.5 * (kept[kept.len() / 2] + kept[(kept.len() - 1) / 2])
}

/// Scaled residuals at which Huber's and Tukey's weights begin to fall and end: both are 95 %
/// efficient on normal errors.
const HUBER: f64 = 1.345;
const TUKEY: f64 = 4.685;

fn robust_weight(stage: Robustness, residual: f64, scale: f64) -> f64 {
    if residual == 0.0 {
        return 1.0;
    }
    let u = residual.abs() / scale;
    match stage {
        Robustness::None => 1.0,
        Robustness::Huber => (HUBER / u).min(1.0),
        Robustness::Tukey => (1.0 - (u / TUKEY).powi(2)).max(0.0).powi(2),
    }
}

/// Variance to put before (XᵀX)⁻¹, and the standard deviation of one error.
///
/// Robust fits take Huber's K² [s² Σψ²/(n − p)] / (mean ψ′)² (Huber 1981, section 7.6).
fn error_variance(robustness: Robustness, residuals: &[f64], scale: f64, p: usize) -> (f64, f64) {
    let n = residuals.len() as f64;
    let freedom = n - p as f64;
    if robustness == Robustness::None || scale == 0.0 {
        let variance = residuals.iter().map(|r| r * r).sum::<f64>() / freedom;
        return (variance, variance.sqrt());
    }
    let psi = |r: f64| robust_weight(robustness, r, scale) * r / scale;
    let slope = |r: f64| {
        if robustness == Robustness::Huber {
            return f64::from(r.abs() <= HUBER * scale);
        }
        let q = (r / (TUKEY * scale)).powi(2);
        if q < 1.0 {
            (1.0 - q) * (1.0 - 5.0 * q)
        } else {
            0.0
        }
    };
    let mean = residuals.iter().map(|&r| slope(r)).sum::<f64>() / n;
    let squares: f64 = residuals.iter().map(|&r| (slope(r) - mean).powi(2)).sum();
    let correction = 1.0 + p as f64 / n * (squares / n) / (mean * mean);
    let psi2 = residuals.iter().map(|&r| psi(r).powi(2)).sum::<f64>() / freedom;
    let variance = correction.powi(2) * scale * scale * psi2 / (mean * mean);
    (variance, scale)
}
