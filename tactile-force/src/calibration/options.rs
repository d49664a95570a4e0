//! The options that all calibration fits share.

/// The weight of pairs far from the curve.
///
/// ```
/// use tactile_force::{CalibrationOptions, CalibrationPair, LinearCalibration, Robustness, StressCalibration};
///
/// // One reading in ten is grossly wrong.
/// let mut pairs: Vec<_> = (0..10).map(|k| CalibrationPair::loading(f64::from(k), 2.0 * f64::from(k))).collect();
/// pairs[7].force_n = 40.0;
/// let slope = |robustness| {
///     let options = CalibrationOptions::default().with_robustness(robustness);
///     LinearCalibration::fit(&pairs, &options).map(|line| line.sensitivity_n(0.0))
/// };
/// assert!((slope(Robustness::None)? - 2.0).abs() > 0.5);
/// assert!((slope(Robustness::Tukey)? - 2.0).abs() < 1e-6);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Robustness {
    /// Least squares: every pair has the same weight.
    #[default]
    None,
    /// Huber's weights, min(1, k/|u|) with k = 1.345: 95 % efficient on normal errors.
    Huber,
    /// Tukey's biweight, (1 − u²/k²)² with k = 4.685, after Huber's: gross outliers have no weight.
    Tukey,
}

/// The options of a calibration fit.
///
/// ```
/// use tactile_force::{CalibrationOptions, CalibrationPair, LinearCalibration, Robustness, StressCalibration};
///
/// let pairs = [1.0, 2.0, 3.0].map(|v| CalibrationPair::loading(v, 2.0 * v + 0.1));
/// let options = CalibrationOptions::default().with_zero_at_origin().with_robustness(Robustness::None);
/// let line = LinearCalibration::fit(&pairs, &options)?;
/// assert_eq!(line.force_n(0.0), 0.0);
/// assert!((line.sensitivity_n(1.0) - (2.0 + 0.1 * 6.0 / 14.0_f64)).abs() < 1e-12);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CalibrationOptions {
    pub(super) through_origin: bool,
    pub(super) robustness: Robustness,
}

impl CalibrationOptions {
    /// Forces the curve through zero force at zero pixel value.
    pub fn with_zero_at_origin(mut self) -> Self {
        self.through_origin = true;
        self
    }

    /// Weights pairs far from the curve in this way; by default all alike.
    pub fn with_robustness(mut self, robustness: Robustness) -> Self {
        self.robustness = robustness;
        self
    }
}
