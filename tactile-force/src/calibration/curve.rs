//! The local light-to-pressure curve f of (5), fitted from frames: P = f(I), F_z = ∫ f(I) dS.
//!
//! The force is linear in the coefficients of the curve, and the grey histogram of the contact is
//! the row of the design matrix:
//!
//! F_i = Σ_g A_i(g) f(g), with A_i(g) the area in m² of frame i whose difference from the reference
//! is g grey levels.
//!
//! f is monotone, passes through the origin, and has the smoothness that cross-validation selects.

use nalgebra::{SMatrix, SVector};
#[cfg(feature = "serde")]
use tactile_core::InvalidOption;
use tactile_core::statistics::effective_degrees_of_freedom;
use tactile_core::{Estimate, Requirement};

use super::{
    Branch, CalibrationPair, ForceReading, GreyHistogram, HYSTERESIS, LinearCalibration,
    LocalCalibration, StressCalibration,
};
use crate::error::ForceError;
use crate::noise::DifferenceNoise;

/// The grey histogram of a contact under a known force.
///
/// ```
/// use tactile_force::{Branch, CalibrationFrame, GreyHistogram};
///
/// let histogram = GreyHistogram::from_differences([40.0; 500].into_iter(), 4e-10);
/// assert!(CalibrationFrame::new(histogram.clone(), 0.31, Branch::Loading).is_ok());
/// assert!(CalibrationFrame::new(histogram, f64::NAN, Branch::Loading).is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationFrame {
    histogram: GreyHistogram,
    force_n: f64,
    branch: Branch,
}

impl CalibrationFrame {
    /// Creates a frame from the histogram of its contact and the gauge's force, taken while the
    /// force was rising or falling.
    ///
    /// # Errors
    /// An error for a force that is negative or not finite.
    pub fn new(histogram: GreyHistogram, force_n: f64, branch: Branch) -> Result<Self, ForceError> {
        Requirement::NonNegative.check("force_n", force_n)?;
        Ok(Self {
            histogram,
            force_n,
            branch,
        })
    }
}

/// Options for the weights of the frames.
///
/// ```
/// use tactile_force::PressureCurveOptions;
///
/// // A gauge with an error of 0.5 % of the force and 0.1 % of its range.
/// let options = PressureCurveOptions::default().with_force_error(0.005, 0.001)?;
/// assert!(options.with_force_error(0.005, f64::NAN).is_err());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressureCurveOptions {
    relative_error: f64,
    range_error: f64,
}

impl Default for PressureCurveOptions {
    /// Errors of 1 % of the force and 0.2 % of the largest force.
    fn default() -> Self {
        Self {
            relative_error: 0.01,
            range_error: 0.002,
        }
    }
}

impl PressureCurveOptions {
    /// Weights the frames by these errors: a fraction of the force and a fraction of the largest
    /// force, added in quadrature. Only their ratio matters, because the size is estimated from the
    /// residuals.
    ///
    /// # Errors
    /// An error for a fraction that is negative or not finite, and for a zero error of the range,
    /// which frames without force need.
    pub fn with_force_error(mut self, of_force: f64, of_range: f64) -> Result<Self, ForceError> {
        self.relative_error = Requirement::NonNegative.check("of_force", of_force)?;
        self.range_error = Requirement::Positive.check("of_range", of_range)?;
        Ok(self)
    }
}

/// The difference between the curves of loading and unloading.
///
/// ```
/// use tactile_force::{CurveHysteresis, Estimate};
///
/// let lag = CurveHysteresis::new(Estimate::new(0.02, 0.003));
/// // Half of the difference beyond its error is the relative error of a force of unknown branch.
/// assert!((lag.width - 0.5 * (0.02_f64.powi(2) - 0.003_f64.powi(2)).sqrt()).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct CurveHysteresis {
    /// (f_loading − f_unloading)/f, with each branch scaled to its own frames.
    pub relative: Estimate,
    /// Half of the difference beyond its own error, √(relative² − error²)/2 or zero: the relative
    /// error of a force whose branch is unknown. Every reading includes it.
    pub width: f64,
}

impl CurveHysteresis {
    /// Creates the hysteresis from the relative difference.
    #[must_use]
    pub fn new(relative: Estimate) -> Self {
        let excess = relative.value.powi(2) - relative.standard_error.powi(2);
        Self {
            relative,
            width: 0.5 * excess.max(0.0).sqrt(),
        }
    }
}

/// Quality of the fit, and the grey levels that the frames determine.
///
/// See [`PressureCurve`] for an example.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct PressureCurveReport {
    /// Number of frames.
    pub frames: usize,
    /// Trace of the smoother: the effective number of parameters.
    pub effective_parameters: f64,
    /// Standard deviation of the residuals relative to the errors assumed in
    /// [`PressureCurveOptions`]. It is 1 if these are correct.
    pub residual_sd: f64,
    /// Residual of each frame, known force minus fitted, in newtons.
    pub residuals_n: Vec<f64>,
    /// Smoothness used for the fit.
    pub smoothness: f64,
    /// Root mean square leave-out error of the forces, relative to the assumed errors.
    pub cross_validation_error: f64,
    /// Range of grey levels in which f is known to 5 %. Zero to zero if there is none.
    pub identified_grey: [f64; 2],
    /// Difference between loading and unloading. `None` unless each has three frames.
    pub hysteresis: Option<CurveHysteresis>,
}

/// The local light-to-pressure curve f of (5): pressure in pascals of a pixel's grey-level
/// difference.
///
/// It is fitted to frames of contacts under known forces by penalised least squares: f is monotone,
/// f(0) = 0, and the smoothness follows from cross-validation. Standard errors come from the
/// Bayesian covariance σ²(XᵀX + λP)⁻¹ of the coefficients, which includes the bias of smoothing (G.
/// Wahba, J. R. Statist. Soc. B 45 (1983) 133–150). O(frames × grey levels).
///
/// As a [`StressCalibration`] it contains a line through the origin, fitted to the sums of the same
/// frames, for integrated pixel values without a frame. A [`ForceMeter`](crate::ForceMeter) uses
/// the curve itself: force, centroid and profile are then those of the pressure.
///
/// ```
/// use tactile_force::{
///     Branch, CalibrationFrame, DifferenceNoise, GreyHistogram, LocalCalibration, PressureCurve,
/// };
///
/// // Discs of uniform grey whose light is the square root of the pressure.
/// let disc = |k: i32| {
///     let differences = std::iter::repeat_n(12.0 * k as f32, 1000);
///     let histogram = GreyHistogram::from_differences(differences, 1e-9);
///     CalibrationFrame::new(histogram, (12.0 * f64::from(k)).powi(2) * 1e-6, Branch::Loading)
/// };
/// let frames = (1..=12).map(disc).collect::<Result<Vec<_>, _>>()?;
/// let curve = PressureCurve::fit(&frames, &Default::default())?;
/// let pressure = curve.pressure_pa(100.0);
/// assert!((pressure.value / 1e4 - 1.0).abs() < 0.01);
/// assert_eq!(curve.pressure_pa(0.0).value, 0.0);
/// let report = &curve.report;
/// assert_eq!((report.frames, report.identified_grey[1], report.hysteresis), (12, 144.0, None));
/// // Half of a contact at 40 grey levels, half at 120.
/// let greys = (0..1000).map(|k| if k < 500 { 40.0 } else { 120.0 });
/// let noise = DifferenceNoise::white(2.0);
/// let reading = curve.read(&GreyHistogram::from_differences(greys, 1e-9), &noise)?;
/// assert!((reading.force_n.value / 8e-3 - 1.0).abs() < 0.01 && !reading.out_of_range);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
#[non_exhaustive]
pub struct PressureCurve {
    #[cfg_attr(feature = "serde", serde(deserialize_with = "checked"))]
    coefficients: Coefficients,
    /// Quality of the fit, and the grey levels that the frames determine.
    pub report: PressureCurveReport,
    /// F(V) for the same frames.
    sums: LinearCalibration,
}

/// Reads coefficients from a file. Rejects values that no fit can give: a decreasing curve, or
/// non-finite numbers.
#[cfg(feature = "serde")]
fn checked<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Coefficients, D::Error> {
    let c: Coefficients = serde::Deserialize::deserialize(from)?;
    let check = || {
        Requirement::Positive.check("basis.top", c.basis.top)?;
        Requirement::Positive.check("degrees_of_freedom", c.degrees_of_freedom)?;
        for slope in c.slopes {
            Requirement::NonNegative.check("slopes", slope)?;
        }
        Requirement::Positive.check("the greatest of slopes", Knots::from(c.slopes).max())?;
        for (j, row) in c.covariance.iter().enumerate() {
            row.iter()
                .try_for_each(|c| Requirement::Finite.check("covariance", *c).map(drop))?;
            Requirement::NonNegative.check("the diagonal of covariance", row[j])?;
        }
        Ok(())
    };
    check().map_err(|error: InvalidOption| serde::de::Error::custom(error))?;
    Ok(c)
}

impl PressureCurve {
    /// Fits the curve to frames under known forces, loading and unloading.
    ///
    /// # Errors
    /// An error for fewer than five frames, for frames without any force or light, and for light
    /// that decreases with the force.
    pub fn fit(
        frames: &[CalibrationFrame],
        options: &PressureCurveOptions,
    ) -> Result<Self, ForceError> {
        let problem = Problem::new(frames, options)?;
        let (smoothness, cross_validation_error) = problem.cross_validated();
        let solution = problem.solve(smoothness, |_| true);
        let residuals = (0..frames.len()).map(|i| problem.residual(i, &solution.slopes));
        let squares: f64 = residuals.clone().map(|r| r * r).sum();
        let degrees_of_freedom = (frames.len() as f64 - solution.effective).max(1.0);
        let variance = squares / degrees_of_freedom;
        let unit = problem.unit;
        let coefficients = Coefficients {
            basis: problem.basis,
            slopes: (solution.slopes * unit).into(),
            covariance: (solution.inverse * (variance * unit * unit)).into(),
            degrees_of_freedom,
        };
        let report = PressureCurveReport {
            frames: frames.len(),
            effective_parameters: solution.effective,
            residual_sd: variance.sqrt(),
            residuals_n: residuals.zip(&problem.errors).map(|(r, e)| r * e).collect(),
            smoothness,
            cross_validation_error,
            identified_grey: identified(&coefficients),
            hysteresis: problem.hysteresis(frames, &solution.slopes),
        };
        let pair = |f: &CalibrationFrame| CalibrationPair {
            integrated_pixel_value: f.histogram.integral(|grey| grey) / f.histogram.pixel_area_m2,
            force_n: f.force_n,
            branch: f.branch,
        };
        let pairs: Vec<_> = frames.iter().map(pair).collect();
        Ok(Self {
            coefficients,
            report,
            // The curve passes through the origin, and so does the line for the same frames.
            sums: LinearCalibration::through_origin(&pairs)?,
        })
    }
}

impl LocalCalibration for PressureCurve {
    fn pressure_pa(&self, grey: f64) -> Estimate {
        self.coefficients.pressure_pa(grey)
    }

    fn value_pa(&self, grey: f64) -> f64 {
        let c = &self.coefficients;
        c.basis.integrals(grey).dot(&c.slopes())
    }

    fn read(
        &self,
        histogram: &GreyHistogram,
        noise: &DifferenceNoise,
    ) -> Result<ForceReading, ForceError> {
        let c = &self.coefficients;
        let slopes = c.slopes();
        let (mut row, mut force, mut beyond) = (Knots::zeros(), 0.0, 0.0);
        for (grey, area) in histogram.bins() {
            let integrals = c.basis.integrals(grey);
            let pressure = integrals.dot(&slopes);
            row += integrals * area;
            force += area * pressure;
            if grey > self.report.identified_grey[1] {
                beyond += area * pressure;
            }
        }
        let noise_n = histogram.noise(noise, |grey| c.basis.weights(grey).dot(&slopes));
        let hysteresis = self.report.hysteresis.map_or(0.0, |h| h.width * force);
        let error = c.variance(&row).max(0.0).sqrt().hypot(hysteresis);
        Ok(ForceReading {
            // Up to a hundredth of the force may come from grey levels outside the identified
            // range, within the stated error. More would be a guess.
            out_of_range: beyond > 0.01 * force.abs(),
            ..ForceReading::new(force, noise_n, error, Some(c.degrees_of_freedom))
        })
    }
}

impl StressCalibration for PressureCurve {
    fn unknown_hysteresis(&self) -> f64 {
        match self.report.hysteresis {
            Some(_) => 0.0,
            None => HYSTERESIS,
        }
    }

    fn force_n(&self, integrated_pixel_value: f64) -> f64 {
        self.sums.force_n(integrated_pixel_value)
    }

    fn sensitivity_n(&self, integrated_pixel_value: f64) -> f64 {
        self.sums.sensitivity_n(integrated_pixel_value)
    }

    fn standard_error_n(&self, integrated_pixel_value: f64) -> f64 {
        self.sums.standard_error_n(integrated_pixel_value)
    }

    fn degrees_of_freedom(&self) -> Option<f64> {
        self.sums.degrees_of_freedom()
    }

    fn error_covariance_n2(&self, a: f64, b: f64) -> f64 {
        self.sums.error_covariance_n2(a, b)
    }

    fn range(&self) -> [f64; 2] {
        self.sums.range()
    }

    fn local(&self) -> Option<&dyn LocalCalibration> {
        Some(self)
    }
}

/// Degrees of freedom that the residuals of a curve must have. Exact forces leave no residual on a
/// curve that follows every frame, and its standard error would then be that of a known curve.
const LEAST_FREEDOM: f64 = 2.0;

/// Number of knots. Twelve intervals represent powers from 0.8 to 1.2 within 10⁻³ of the force.
/// Further knots would be determined by the prior alone.
const KNOTS: usize = 13;

/// One value per knot: slopes, or the integrals by which they are multiplied.
type Knots = SVector<f64, KNOTS>;
type Normal = SMatrix<f64, KNOTS, KNOTS>;

/// f(d) = ∫₀ᵈ s, with s linear between its values at the knots. Non-negative slopes make f
/// monotone.
///
/// Knots are at t_j = top (j/12)², because light that is a power of the pressure bends most near
/// zero. Below zero f continues with the slope at zero, so that noise about zero has no net effect.
/// Above the top it continues with the last slope.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Basis {
    top: f64,
}

impl Basis {
    fn knot(&self, j: usize) -> f64 {
        let share = j as f64 / (KNOTS - 1) as f64;
        self.top * share * share
    }

    /// The interval that contains `d`, and the relative position of `d` in it.
    fn place(&self, d: f64) -> (usize, f64) {
        let intervals = (KNOTS - 1) as f64;
        let at = (intervals * (d / self.top).max(0.0).sqrt()).min(intervals - 1.0) as usize;
        let (from, to) = (self.knot(at), self.knot(at + 1));
        (at, ((d - from) / (to - from)).clamp(0.0, 1.0))
    }

    /// The integral belonging to each knot's slope: f(d) is the scalar product with the slopes.
    fn integrals(&self, d: f64) -> Knots {
        let mut row = Knots::zeros();
        if d <= 0.0 {
            row[0] = d;
            return row;
        }
        let (at, x) = self.place(d);
        for j in 0..=at {
            let width = self.knot(j + 1) - self.knot(j);
            let share = if j == at { x } else { 1.0 };
            row[j] += width * share * (1.0 - 0.5 * share);
            row[j + 1] += 0.5 * width * share * share;
        }
        row[KNOTS - 1] += (d - self.top).max(0.0);
        row
    }

    /// The interpolation weights of the knots: the slope at `d` is the scalar product with the
    /// slopes.
    fn weights(&self, d: f64) -> Knots {
        let (at, x) = self.place(d);
        let mut row = Knots::zeros();
        row[at] = 1.0 - x;
        row[at + 1] = x;
        row
    }
}

/// Slopes at the knots in Pa per grey level, and their covariance.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
struct Coefficients {
    basis: Basis,
    slopes: [f64; KNOTS],
    /// Symmetric matrix, by columns.
    covariance: [[f64; KNOTS]; KNOTS],
    degrees_of_freedom: f64,
}

impl Coefficients {
    fn pressure_pa(&self, grey: f64) -> Estimate {
        let row = self.basis.integrals(grey);
        Estimate::from_variance(row.dot(&self.slopes()), self.variance(&row))
            .with_degrees_of_freedom(self.degrees_of_freedom)
    }

    fn slopes(&self) -> Knots {
        Knots::from(self.slopes)
    }

    /// Variance of a linear combination of the slopes.
    fn variance(&self, row: &Knots) -> f64 {
        row.dot(&(Normal::from(self.covariance) * row))
    }
}

/// Rows and forces, each divided by the assumed error of the frame. Slopes are in units of their
/// mean.
struct Problem {
    basis: Basis,
    rows: Vec<Knots>,
    forces: Vec<f64>,
    errors: Vec<f64>,
    /// Pascals per grey level of the best straight line.
    unit: f64,
}

struct Solution {
    slopes: Knots,
    /// Inverse of the penalised normal matrix, with zeros for slopes held at zero.
    inverse: Normal,
    /// Trace of the smoother.
    effective: f64,
}

impl Problem {
    fn new(
        frames: &[CalibrationFrame],
        options: &PressureCurveOptions,
    ) -> Result<Self, ForceError> {
        // Five forces leave degrees of freedom even for a curve with three parameters.
        if frames.len() < 5 {
            return Err(ForceError::TooFewPairs {
                required: 5,
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
        // Slopes in units of the best straight line are close to one.
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

    /// Penalised least squares over the frames selected by `keep`.
    fn solve(&self, smoothness: f64, keep: impl Fn(usize) -> bool) -> Solution {
        let (mut data, mut right) = (Normal::zeros(), Knots::zeros());
        for i in (0..self.rows.len()).filter(|i| keep(*i)) {
            data += self.rows[i] * self.rows[i].transpose();
            right += self.rows[i] * self.forces[i];
        }
        let weight = smoothness * data.trace() / KNOTS as f64;
        // A small penalty on first differences keeps the matrix definite if the frames leave a
        // straight slope undetermined. The main penalty is on second differences: a curve whose
        // slope is linear in the knots has no penalty.
        let normal = data
            + differences([1.0, -2.0, 1.0]) * weight
            + differences([-1.0, 1.0]) * (1e-6 * weight);
        let (slopes, free) = nonnegative(&normal, &right);
        // Slopes held at zero are known and have no variance.
        let mut inverse = bound(&normal, &free)
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

    /// The smoothness with the smallest cross-validation error, and that error.
    fn cross_validated(&self) -> (f64, f64) {
        let count = self.rows.len();
        // Groups are left out in turn. With few frames, each group is one frame.
        let folds = count.min(10);
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
        // The tried curves range from one whose slope is a parabola in the root of the grey level
        // to one that follows every frame.
        let mut best = (0.0, f64::INFINITY);
        for smoothness in [1000.0, 100.0, 10.0, 1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
            let free = count as f64 - self.solve(smoothness, |_| true).effective;
            if free < LEAST_FREEDOM && best.1.is_finite() {
                break;
            }
            let here = error(smoothness);
            // If errors are equal, the smoother curve is chosen.
            if here < best.1 {
                best = (smoothness, here);
            }
        }
        best
    }

    /// Scale of each branch relative to the common curve, by least squares.
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
            (count >= 3 && pp > 0.0).then_some(
                Estimate::from_variance(scale, variance)
                    .with_degrees_of_freedom(f64::from(count - 1)),
            )
        };
        let (loading, unloading) = (scale(Branch::Loading)?, scale(Branch::Unloading)?);
        let parts = [loading, unloading];
        let parts = parts.map(|e| (e.standard_error.powi(2), e.degrees_of_freedom));
        let mut relative =
            Estimate::from_variance(loading.value - unloading.value, parts[0].0 + parts[1].0);
        relative.degrees_of_freedom = effective_degrees_of_freedom(&parts);
        Some(CurveHysteresis::new(relative))
    }
}

/// Sum over knots of the outer products of difference rows with these coefficients.
fn differences<const N: usize>(factors: [f64; N]) -> Normal {
    let mut penalty = Normal::zeros();
    for j in 0..=KNOTS - N {
        let mut row = Knots::zeros();
        row.fixed_rows_mut::<N>(j).copy_from_slice(&factors);
        penalty += row * row.transpose();
    }
    penalty
}

/// The longest run of integer grey levels in which f is known well enough.
fn identified(coefficients: &Coefficients) -> [f64; 2] {
    let known = |grey: f64| {
        let e = coefficients.pressure_pa(grey);
        e.value > 0.0 && e.standard_error <= 0.05 * e.value
    };
    let greys = (1..=coefficients.basis.top as u32).map(f64::from);
    let (mut best, mut run): ([f64; 2], Option<f64>) = ([0.0; 2], None);
    for grey in greys {
        run = known(grey).then(|| run.unwrap_or(grey));
        if let Some(start) = run.filter(|start| grey - start >= best[1] - best[0]) {
            best = [start, grey];
        }
    }
    best
}

/// The minimiser of ½ xᵀHx − gᵀx over x ≥ 0, and which coefficients are free (C. Lawson and R.
/// Hanson, *Solving Least Squares Problems*, 1974, chapter 23). H must be positive definite.
fn nonnegative(normal: &Normal, right: &Knots) -> (Knots, [bool; KNOTS]) {
    let mut free = [false; KNOTS];
    let mut x = Knots::zeros();
    // Rounding error of a gradient.
    let tolerance = 1e-12 * right.amax();
    // Each round frees one coefficient. In practice, few are bound again.
    for _ in 0..10 * KNOTS {
        let gradient = right - normal * x;
        let most = (0..KNOTS)
            .filter(|&j| !free[j] && gradient[j] > tolerance)
            .max_by(|&a, &b| gradient[a].total_cmp(&gradient[b]));
        let Some(most) = most else {
            break;
        };
        free[most] = true;
        loop {
            let target = unconstrained(normal, right, &free);
            let leaving = (0..KNOTS).filter(|&j| free[j] && target[j] <= 0.0);
            // The largest step towards the target that keeps every coefficient non-negative.
            let step = leaving
                .map(|j| x[j] / (x[j] - target[j]))
                .fold(f64::INFINITY, f64::min);
            if step == f64::INFINITY {
                x = target;
                break;
            }
            x += (target - x) * step;
            for j in 0..KNOTS {
                if free[j] && target[j] <= 0.0 && x[j] <= 1e-14 * x.amax() {
                    free[j] = false;
                    x[j] = 0.0;
                }
            }
        }
    }
    (x, free)
}

/// The minimiser over the free coefficients, with zeros elsewhere.
fn unconstrained(normal: &Normal, right: &Knots, free: &[bool; KNOTS]) -> Knots {
    let (normal, right) = (
        bound(normal, free),
        Knots::from_fn(|j, _| if free[j] { right[j] } else { 0.0 }),
    );
    normal
        .cholesky()
        .map_or(Knots::zeros(), |c| c.solve(&right))
}

/// H with the rows and columns of bound coefficients replaced by those of the identity.
fn bound(normal: &Normal, free: &[bool; KNOTS]) -> Normal {
    Normal::from_fn(|i, j| match (free[i] && free[j], i == j) {
        (true, _) => normal[(i, j)],
        (false, true) => 1.0,
        (false, false) => 0.0,
    })
}

#[cfg(test)]
mod tests;
