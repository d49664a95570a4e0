//! The fitted curve and the forces read with it.

use super::basis::Knots;
use super::coefficients::Coefficients;
use super::fit;
use super::{CalibrationFrame, PressureCurveOptions, PressureCurveReport};
use crate::calibration::{
    CalibrationOptions, CalibrationPair, CalibrationReport, ForceReading, GreyHistogram,
    LinearCalibration, LocalCalibration, StressCalibration,
};
use crate::error::ForceError;
use crate::frame::DifferenceNoise;
use tactile_core::Estimate;

/// The local light-to-pressure curve f of (5): pressure in pascals of a pixel's grey-level difference.
///
/// Fitted from frames of contacts under known forces by penalised least squares: f rises, f(0) = 0, smoothness by
/// cross-validation. Standard errors come from the Bayesian covariance σ²(XᵀX + λP)⁻¹ of the coefficients, which includes the
/// bias of smoothing (G. Wahba, J. R. Statist. Soc. B 45 (1983) 133–150). O(frames × grey levels).
///
/// As a [`StressCalibration`] it carries a calibration of the same frames' sums, for integrated pixel values without a frame; a
/// [`ForceMeter`](crate::ForceMeter) uses the curve itself: force, centroid and profile are then those of the pressure.
///
/// ```
/// use tactile_force::{
///     Branch, CalibrationFrame, DifferenceNoise, GreyHistogram, LocalCalibration, PressureCurve,
/// };
///
/// // Discs of even grey whose light goes as the pressure's square root.
/// let frames: Vec<_> = (1..=12)
///     .map(|k| 12.0 * k as f32)
///     .map(|grey| (grey, GreyHistogram::from_differences(std::iter::repeat_n(grey, 1000), 1e-9)))
///     .map(|(grey, h)| CalibrationFrame::new(h, f64::from(grey).powi(2) * 1e-6, Branch::Loading))
///     .collect::<Result<_, _>>()?;
/// let curve = PressureCurve::fit(&frames, &Default::default())?;
/// let pressure = curve.pressure_pa(100.0);
/// assert!((pressure.value / 1e4 - 1.0).abs() < 0.01);
/// assert_eq!(curve.pressure_pa(0.0).value, 0.0);
/// assert_eq!(curve.report.identified_grey[1], 144.0);
/// // Half of a contact at 40 grey levels, half at 120.
/// let greys = (0..1000).map(|k| if k < 500 { 40.0 } else { 120.0 });
/// let noise = DifferenceNoise { background: 2.0, gain: 0.02, common: 0.0, scale: 0.0, flat_field: 0.0 };
/// let reading = curve.read(&GreyHistogram::from_differences(greys, 1e-9), &noise);
/// assert!((reading.force_n.value / 8e-3 - 1.0).abs() < 0.01 && !reading.out_of_range);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Unchecked")
)]
pub struct PressureCurve {
    coefficients: Coefficients,
    /// How well the curve fits its frames, and which grey levels these determine.
    pub report: PressureCurveReport,
    /// F(V) of the same frames, for integrated pixel values without a frame.
    sums: LinearCalibration,
}

/// A curve as a file has it.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    coefficients: Coefficients,
    report: PressureCurveReport,
    sums: LinearCalibration,
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for PressureCurve {
    type Error = ForceError;

    fn try_from(given: Unchecked) -> Result<Self, ForceError> {
        Ok(Self {
            coefficients: given.coefficients.checked()?,
            report: given.report,
            sums: given.sums,
        })
    }
}

impl PressureCurve {
    /// Fits the curve to frames under known forces, loading and unloading.
    ///
    /// # Errors
    /// Fewer than five frames, no force or no light in any of them, or light that falls with the force.
    pub fn fit(
        frames: &[CalibrationFrame],
        options: &PressureCurveOptions,
    ) -> Result<Self, ForceError> {
        let (coefficients, report) = fit::fit(frames, options)?;
        let pair = |f: &CalibrationFrame| CalibrationPair {
            integrated_pixel_value: f.histogram.integral(|grey| grey) / f.histogram.pixel_area_m2(),
            force_n: f.force_n,
            branch: f.branch,
        };
        let pairs: Vec<_> = frames.iter().map(pair).collect();
        let options = CalibrationOptions::default().with_zero_at_origin();
        let sums = LinearCalibration::fit(&pairs, &options)?;
        Ok(Self {
            coefficients,
            report,
            sums,
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

    fn read(&self, histogram: &GreyHistogram, noise: &DifferenceNoise) -> ForceReading {
        let c = &self.coefficients;
        let slopes = c.slopes();
        let mut row = Knots::zeros();
        let (mut white, mut common, mut scale) = (0.0, 0.0, 0.0);
        let (mut force, mut beyond) = (0.0, 0.0);
        for (grey, area) in histogram.bins() {
            let integrals = c.basis.integrals(grey);
            let pressure = integrals.dot(&slopes);
            let slope = c.basis.weights(grey).dot(&slopes);
            row += integrals * area;
            force += area * pressure;
            white += area * slope * slope * (noise.background + noise.gain * grey.max(0.0));
            common += area * slope;
            scale += area * slope * grey;
            if grey > self.report.identified_grey[1] {
                beyond += area * pressure;
            }
        }
        let shared = common * noise.common.sqrt() + scale * noise.scale.sqrt();
        let noise_n = (white * histogram.pixel_area_m2()
            + shared * shared
            + noise.flat_field * scale * scale)
            .sqrt();
        let hysteresis = self.report.hysteresis.map_or(0.0, |h| h.width * force);
        let calibration_n = c.variance(&row).max(0.0).sqrt().hypot(hysteresis);
        let standard_error = noise_n.hypot(calibration_n);
        let share = (calibration_n / standard_error).powi(4);
        ForceReading {
            force_n: Estimate::new(force, standard_error),
            noise_n,
            calibration_n,
            degrees_of_freedom: (share > 0.0).then(|| c.degrees_of_freedom / share),
            // A hundredth of the force from grey levels beyond those identified is within the stated error; more is a guess.
            out_of_range: beyond > 0.01 * force.abs(),
        }
    }
}

impl StressCalibration for PressureCurve {
    fn force_n(&self, integrated_pixel_value: f64) -> f64 {
        self.sums.force_n(integrated_pixel_value)
    }

    fn sensitivity_n(&self, integrated_pixel_value: f64) -> f64 {
        self.sums.sensitivity_n(integrated_pixel_value)
    }

    fn standard_error_n(&self, integrated_pixel_value: f64) -> f64 {
        self.sums.standard_error_n(integrated_pixel_value)
    }

    fn integrated_pixel_value(&self, force_n: f64) -> Option<f64> {
        self.sums.integrated_pixel_value(force_n)
    }

    fn range(&self) -> [f64; 2] {
        self.sums.range()
    }

    fn report(&self) -> &CalibrationReport {
        self.sums.report()
    }

    fn local(&self) -> Option<&dyn LocalCalibration> {
        Some(self)
    }
}
