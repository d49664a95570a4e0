//! The straight line F = b + s V, its report, and the underlying least-squares fit.

use nalgebra::{Matrix2, Vector2};
use tactile_core::Estimate;

use super::{Branch, CalibrationPair, HYSTERESIS, LineDoubt, StressCalibration};
use crate::error::{ForceError, check_observations};

/// A straight line from integrated pixel value to force, F = b + s V, or F = s V through the
/// origin.
///
/// ```
/// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
/// let pairs = [0.0, 1.0, 2.0, 3.0, 4.0].map(|k| CalibrationPair::loading(1e5 * k, 0.5 * k));
/// let line = LinearCalibration::fit(&pairs)?;
/// assert!((line.force_n(2.5e5) - 1.25).abs() < 1e-12);
/// assert!((line.sensitivity_n(1e5) - 5e-6).abs() < 1e-17);
/// assert_eq!(line.range(), [0.0, 4e5]);
/// // A line of frame sums is valid for contacts of one shape: it has no local curve.
/// assert!(line.local().is_none());
/// // Offset and slope with their standard errors.
/// let [offset, slope] = line.report().parameters[..] else { unreachable!() };
/// assert!(offset.value.abs() < 1e-12 && (slope.value - 5e-6).abs() < 1e-17);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LinearCalibration {
    /// Reference pixel value of the line, at which level and slope are (nearly) uncorrelated.
    centre: f64,
    level_n: Estimate,
    slope_n: Estimate,
    covariance: f64,
    range: [f64; 2],
    report: LineReport,
}

impl LinearCalibration {
    /// Fits the line to pairs of integrated pixel value and force.
    ///
    /// # Errors
    /// An error for fewer than one pair more than parameters, for a pair that is not finite, and
    /// for pairs at a single pixel value.
    pub fn fit(pairs: &[CalibrationPair]) -> Result<Self, ForceError> {
        Self::fitted(pairs, false)
    }

    /// Fits a line with zero force at zero pixel value.
    ///
    /// # Errors
    /// Those of [`fit`](Self::fit).
    ///
    /// ```
    /// use tactile_force::{CalibrationPair, LinearCalibration, StressCalibration};
    ///
    /// let pairs = [1.0, 2.0, 3.0].map(|v| CalibrationPair::loading(v, 2.0 * v + 0.1));
    /// let line = LinearCalibration::through_origin(&pairs)?;
    /// assert_eq!(line.force_n(0.0), 0.0);
    /// // Between the slopes of the last and of the first pair.
    /// assert!((2.0 + 0.1 / 3.0..2.1).contains(&line.sensitivity_n(1.0)));
    /// # Ok::<(), tactile_force::ForceError>(())
    /// ```
    pub fn through_origin(pairs: &[CalibrationPair]) -> Result<Self, ForceError> {
        Self::fitted(pairs, true)
    }

    fn fitted(pairs: &[CalibrationPair], through_origin: bool) -> Result<Self, ForceError> {
        let columns = if through_origin { 1 } else { 2 };
        check_observations(pairs, columns + 1, |p| {
            [p.integrated_pixel_value, p.force_n]
        })?;
        let values: Vec<f64> = pairs.iter().map(|p| p.integrated_pixel_value).collect();
        let forces: Vec<f64> = pairs.iter().map(|p| p.force_n).collect();
        // Centring and scaling of the pixel values decorrelate the two parameters.
        let centre = if through_origin {
            0.0
        } else {
            values.iter().sum::<f64>() / values.len() as f64
        };
        let greatest = |from: f64| values.iter().map(|v| (v - from).abs()).fold(0.0, f64::max);
        let scale = greatest(centre);
        // Values that differ only by rounding do not determine a slope.
        if scale <= 4.0 * f64::EPSILON * greatest(0.0) || scale == 0.0 {
            return Err(ForceError::DegeneratePairs { span: scale });
        }
        let x: Vec<f64> = values.iter().map(|v| (v - centre) / scale).collect();
        let fit = Fit::weighted(&x, &forces, through_origin)
            .ok_or(ForceError::DegeneratePairs { span: scale })?;
        let degrees = (pairs.len() - columns) as f64;
        let estimate = |value: f64, variance: f64| {
            Estimate::from_variance(value, variance).with_degrees_of_freedom(degrees)
        };
        let [level, slope] = fit.coefficients.into();
        let errors = fit.inverse * fit.residual_sd.powi(2);
        let slope_variance = errors[(1, 1)] / (scale * scale);
        let slope_n = estimate(slope / scale, slope_variance);
        let (level_n, covariance, parameters) = if through_origin {
            (Estimate::exact(0.0), 0.0, vec![slope_n])
        } else {
            let (variance, covariance) = (errors[(0, 0)], errors[(0, 1)] / scale);
            let offset = estimate(
                level - slope_n.value * centre,
                variance - 2.0 * covariance * centre + slope_variance * centre * centre,
            );
            (estimate(level, variance), covariance, vec![offset, slope_n])
        };
        let curve = |v: f64| level_n.value + slope_n.value * (v - centre);
        let mut report = LineReport::new(pairs, curve, columns);
        report.doubts = match parameters[..] {
            [offset_n, _] => LineDoubt::of(pairs, offset_n, report.full_scale_n),
            _ => Vec::new(),
        };
        report.parameters = parameters;
        report.smallest_force_n = 3.0 * fit.residual_sd;
        Ok(Self {
            centre,
            level_n,
            slope_n,
            covariance,
            range: extremes(&values),
            report,
        })
    }

    /// Quality of the fit.
    #[must_use]
    pub fn report(&self) -> &LineReport {
        &self.report
    }

    /// The integrated pixel value of a force. `None` for a line without slope.
    ///
    /// ```
    /// use tactile_force::{CalibrationPair, LinearCalibration};
    /// let pairs = [0.0, 1.0, 2.0].map(|k| CalibrationPair::loading(1e5 * k, 0.5 * k));
    /// let line = LinearCalibration::fit(&pairs)?;
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
        // A force of unknown branch deviates from the line by half of the difference between the
        // branches.
        let branch = self.report.hysteresis.map_or(0.0, |h| h.width_n);
        let offset = self.report.doubts.iter().find_map(|doubt| match doubt {
            LineDoubt::Offset { offset_n } => Some(offset_n.value),
            _ => None,
        });
        let all = branch * branch + offset.map_or(0.0, |offset| offset * offset);
        level * level + slope * a * (slope * b) + self.covariance * (a + b) + all
    }

    fn range(&self) -> [f64; 2] {
        self.range
    }

    fn unknown_hysteresis(&self) -> f64 {
        if self.report.rising_only {
            HYSTERESIS
        } else {
            0.0
        }
    }
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
/// let line = LinearCalibration::fit(&pairs)?;
/// let hysteresis = line.report().hysteresis.expect("both branches");
/// assert!((hysteresis.mean_n.value - 0.01).abs() < 1e-12);
/// assert!((hysteresis.share_of_full_scale - 0.01 / 1.01).abs() < 1e-9);
/// // The line lies between the branches, so a force of unknown branch is off by half of that.
/// assert!((hysteresis.width_n - 0.005).abs() < 1e-12);
/// assert!((line.standard_error_n(5.0) - 0.005).abs() < 3e-4);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Hysteresis {
    /// Largest difference of the two branches at one pixel value, loading minus unloading, in
    /// newtons.
    pub greatest_n: f64,
    /// Mean difference over the range of both branches, in newtons.
    pub mean_n: Estimate,
    /// Half of the mean difference if it exceeds three times its own error, otherwise zero, in
    /// newtons. Every force of unknown branch has this standard error, which is common to all of
    /// them.
    pub width_n: f64,
    /// |greatest| as a fraction of the full scale.
    pub share_of_full_scale: f64,
}

/// Quality of a calibration.
///
/// ```
/// use tactile_force::{CalibrationPair, LineReport, LinearCalibration};
///
/// let pairs = [(0.0, 0.01), (1e5, 0.49), (2e5, 1.01), (3e5, 1.49)];
/// let pairs = pairs.map(|(v, f)| CalibrationPair::loading(v, f));
/// let line = LinearCalibration::fit(&pairs)?;
/// let report = line.report();
/// assert!(report.r_squared > 0.999 && report.monotone);
/// assert_eq!((report.pairs, report.degrees_of_freedom), (4, 2));
/// // Four pairs: the 95 % interval of the slope by Student's t with two degrees of freedom.
/// let interval = report.parameters[1].interval_95();
/// assert!(
///     interval.contains(5e-6)
///         && interval.upper.unwrap() > 5e-6 + 2.0 * report.parameters[1].standard_error
/// );
/// // The report of a user-defined curve with one parameter.
/// let own = LineReport::new(&pairs, |v| 4.98e-6 * v, 1);
/// assert!(own.residual_sd_n < 0.02 && own.degrees_of_freedom == 3);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct LineReport {
    /// Number of pairs.
    pub pairs: usize,
    /// Parameters with their standard errors and degrees of freedom: [offset, slope] for a line,
    /// the slope alone for a line through the origin.
    pub parameters: Vec<Estimate>,
    /// Number of pairs minus number of parameters.
    pub degrees_of_freedom: usize,
    /// Coefficient of determination, 1 − Σr²/Σ(F − F̄)².
    pub r_squared: f64,
    /// Standard deviation of the residuals, √(Σr²/(n − p)), in newtons.
    pub residual_sd_n: f64,
    /// Residual of each pair, measured minus fitted, in newtons.
    pub residuals_n: Vec<f64>,
    /// Difference between loading and unloading. `None` unless both branches were given and
    /// overlap.
    pub hysteresis: Option<Hysteresis>,
    /// Largest distance of a pair from the curve, as a fraction of the full scale.
    pub linearity_error: f64,
    /// Mean sensitivity over the range, (F(V₁) − F(V₀))/(V₁ − V₀), in newtons per grey level.
    pub sensitivity_n: f64,
    /// Smallest force resolved: three residual standard deviations, in newtons.
    pub smallest_force_n: f64,
    /// Largest force minus smallest force of the pairs, in newtons.
    pub full_scale_n: f64,
    /// Whether the curve increases between the pixel values of the pairs.
    pub monotone: bool,
    /// Whether the forces rise to the last pair, so that they do not show the hysteresis.
    pub rising_only: bool,
    /// Reasons to doubt the pairs of a line with an offset.
    pub doubts: Vec<LineDoubt>,
}

impl LineReport {
    /// The report of a curve F(V) with this number of fitted parameters, from its residuals. The
    /// parameters themselves are left empty. O(pairs · log pairs).
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
            hysteresis: Hysteresis::of(pairs, &residuals_n, full_scale_n),
            linearity_error: farthest / full_scale_n,
            sensitivity_n,
            smallest_force_n: 3.0 * residual_sd_n,
            full_scale_n,
            monotone: sensitivity_n > 0.0 && fitted.is_sorted(),
            rising_only: rising_only(pairs),
            doubts: Vec::new(),
            residuals_n,
        }
    }
}

/// 1 − Σr²/Σ(F − F̄)².
/// Whether no pair was taken after the largest force: all loading, and the largest force last.
fn rising_only(pairs: &[CalibrationPair]) -> bool {
    let largest = pairs.iter().fold(0.0, |most: f64, p| most.max(p.force_n));
    let last = pairs.last().is_some_and(|p| p.force_n == largest);
    last && pairs.iter().all(|p| p.branch == Branch::Loading)
}

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
    /// Compares the residuals of each branch with those of the other branch, interpolated at the
    /// same pixel value. Residuals are nearly constant where forces are steep, so interpolation
    /// adds almost no error.
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
        // The largest by absolute value, with its sign.
        let by_size = |a: &&f64, b: &&f64| a.abs().total_cmp(&b.abs());
        let greatest_n = *differences.iter().max_by(by_size)?;
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let squares: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
        let degrees = (n - 1.0).max(1.0);
        let mean_n =
            Estimate::from_variance(mean, squares / degrees / n).with_degrees_of_freedom(degrees);
        // Noise alone must not widen the errors of calibrations without hysteresis: at three
        // standard errors, one in 400 is affected.
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

/// Least-squares fit of a level and a slope over x, or of a slope alone.
struct Fit {
    coefficients: Vector2<f64>,
    /// (XᵀWX)⁻¹. If the level is not fitted, its entries are taken from the identity.
    inverse: Matrix2<f64>,
    /// Standard deviation of the error of a pair of weight 1.
    residual_sd: f64,
}

impl Fit {
    /// The fit with weights 1/(1 + k F²/F_max²), for noise with a constant part and a part
    /// proportional to the force, as for a gauge specified in per cent of the reading.
    ///
    /// Among k = 0, 4 (or the degrees of freedom, if there are fewer) and 30, the one with the
    /// largest restricted likelihood is used. Few pairs do not decide between them, so the middle
    /// one is preferred by 0.8 in the log-likelihood. The coverage of its 95 % intervals is then 92
    /// to 98 % in the middle of the range, for each kind of noise.
    fn weighted(x: &[f64], forces: &[f64], through_origin: bool) -> Option<Self> {
        let largest = forces.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
        let columns = if through_origin { 1 } else { 2 };
        let freedom = (x.len() - columns) as f64;
        let even = Self::solve(x, forces, &vec![1.0; x.len()], through_origin)?;
        if largest == 0.0 {
            return Some(even);
        }
        let mut best = (f64::NEG_INFINITY, None);
        for (growth, prior) in [(0.0, 0.0), (freedom.min(4.0), 0.8), (30.0, 0.0)] {
            let weight = |f: &f64| 1.0 / (1.0 + growth * (f / largest).powi(2));
            let weights: Vec<f64> = forces.iter().map(weight).collect();
            let fit = Self::solve(x, forces, &weights, through_origin)?;
            // Pairs without noise leave only rounding, which has no likelihood.
            if fit.residual_sd <= 1e-12 * largest {
                return Some(even);
            }
            // Logarithm of the restricted likelihood, apart from constants (Patterson and Thompson
            // 1971).
            let of_weights = 0.5 * weights.iter().map(|w| w.ln()).sum::<f64>();
            let of_fit = 0.5 * fit.inverse.determinant().ln() - freedom * fit.residual_sd.ln();
            let likelihood = prior + of_weights + of_fit;
            if likelihood > best.0 {
                best = (likelihood, Some(fit));
            }
        }
        best.1.or(Some(even))
    }

    /// `None` if x is not finite. Otherwise x is of order one and determines both parameters.
    fn solve(x: &[f64], y: &[f64], weights: &[f64], through_origin: bool) -> Option<Self> {
        let level = if through_origin { 0.0 } else { 1.0 };
        let pairs = || {
            x.iter()
                .map(|x| Vector2::new(level, *x))
                .zip(y)
                .zip(weights)
        };
        let (mut gram, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for ((row, y), w) in pairs() {
            gram += row * row.transpose() * *w;
            right += row * (w * y);
        }
        if through_origin {
            gram[(0, 0)] = 1.0;
        }
        let cholesky = gram.cholesky()?;
        let coefficients = cholesky.solve(&right);
        let of_pair =
            |((row, y), w): ((Vector2<f64>, &f64), &f64)| w * (y - row.dot(&coefficients)).powi(2);
        let squares: f64 = pairs().map(of_pair).sum();
        let columns = if through_origin { 1 } else { 2 };
        Some(Self {
            coefficients,
            inverse: cholesky.inverse(),
            residual_sd: (squares / (x.len() - columns) as f64).sqrt(),
        })
    }
}
