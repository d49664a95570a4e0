//! The quality of a curve's fit.

use tactile_core::Estimate;

/// The difference between the curves of loading and unloading.
///
/// ```
/// use tactile_force::{CurveHysteresis, Estimate};
///
/// let lag = CurveHysteresis { relative: Estimate::new(0.02, 0.003), width: 0.0099 };
/// // Half of the difference, where it stands out of its error, is what a force of unknown branch is uncertain by.
/// assert!(lag.width < 0.5 * lag.relative.value);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CurveHysteresis {
    /// (f_loading − f_unloading)/f, each branch scaled to its own frames.
    pub relative: Estimate,
    /// Half of the difference beyond its own error, √(relative² − error²)/2 or zero: the relative error of a force whose branch
    /// is unknown. Every reading includes it.
    pub width: f64,
}

/// How well a curve fits its frames, and which grey levels these determine.
///
/// ```
/// use tactile_force::{Branch, CalibrationFrame, GreyHistogram, PressureCurve};
///
/// // Discs of even grey: 2 kPa a grey level.
/// let frames: Vec<_> = (1..=8)
///     .map(|k| 20.0 * k as f32)
///     .map(|grey| (grey, GreyHistogram::from_differences(std::iter::repeat_n(grey, 1000), 1e-9)))
///     .map(|(grey, h)| CalibrationFrame::new(h, 2e3 * f64::from(grey) * 1e-6, Branch::Loading))
///     .collect::<Result<_, _>>()?;
/// let curve = PressureCurve::fit(&frames, &Default::default())?;
/// let report = curve.report;
/// assert_eq!((report.frames, report.hysteresis), (8, None));
/// assert!(report.residual_sd < 1e-6 && report.identified_grey[1] == 160.0);
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PressureCurveReport {
    /// Number of frames.
    pub frames: usize,
    /// Trace of the smoother: the number of parameters that the data determined.
    pub effective_parameters: f64,
    /// Standard deviation of the residuals relative to the frames' assumed errors of
    /// [`PressureCurveOptions`](super::PressureCurveOptions); 1 if these are right.
    pub residual_sd: f64,
    /// Residual of every frame, known force minus fitted, in newtons.
    pub residuals_n: Vec<f64>,
    /// The smoothness used.
    pub smoothness: f64,
    /// Root mean square of the errors of forces that the fit was not shown, relative to the assumed errors; `None` if the
    /// smoothness was given.
    pub cross_validation_error: Option<f64>,
    /// Least and greatest grey level between which f is known to 5 %; zero to zero if nowhere.
    pub identified_grey: [f64; 2],
    /// Loading against unloading; `None` unless each has three frames.
    pub hysteresis: Option<CurveHysteresis>,
}
