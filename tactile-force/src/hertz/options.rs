//! What to fit, and what comes out.

use crate::{Estimate, ForceError, StopReason, error::Requirement};

/// Which parameters of the profile are known and which are fitted.
///
/// ```
/// use tactile_force::{ForceMeter, ForceOptions, HertzFitOptions};
///
/// // A lens whose blur is known, over a background that is not.
/// let hertz = HertzFitOptions { blur_px: Some(1.2), fit_background: true, ..HertzFitOptions::default() };
/// assert!(ForceMeter::<f64>::new([20e-6; 2], &ForceOptions { hertz, ..ForceOptions::default() }).is_ok());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HertzFitOptions {
    /// Standard deviation of the optical blur in pixels if it is known; `None` (the default) fits it.
    pub blur_px: Option<f64>,
    /// Fit a constant background under the profile; default no.
    pub fit_background: bool,
    /// Most steps of the fit; default 50.
    pub max_iterations: usize,
}

impl Default for HertzFitOptions {
    fn default() -> Self {
        Self {
            blur_px: None,
            fit_background: false,
            max_iterations: 50,
        }
    }
}

impl HertzFitOptions {
    pub(super) fn validate(&self) -> Result<(), ForceError> {
        Requirement::AtLeastOne.check("max_iterations", self.max_iterations as f64)?;
        self.blur_px
            .map_or(Ok(()), |b| Requirement::NonNegative.check("blur_px", b))
    }
}

/// A fitted Hertz profile.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::*;
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let blob = HertzProfile::new([60.3_f64, 57.8], 30.0, 150.0)?;
/// let frame = blob
///     .image(&PixelGrid { rows: 120, columns: 120, size: [1.0; 2], first: [0.0; 2] })
///     .mapv(|d| 12 + d.round() as u8);
/// let quiet = Array2::from_elem((120, 120), 12);
/// let measured = measure_force(frame.view(), quiet.view(), [20e-6; 2], &calibration, &Default::default())?;
/// let fit: HertzFit<f64> = measured.profile.expect("a profile");
/// assert!((fit.radius_px.value - 30.0).abs() < 0.02);
/// assert!((fit.centre_px[0].value - 60.3).abs() < 0.01 && (fit.peak.value - 150.0).abs() < 0.3);
/// assert_eq!(fit.stop, StopReason::Converged);
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HertzFit<T> {
    /// Centre [x, y] in pixels.
    pub centre_px: [Estimate<T>; 2],
    /// Contact radius in units of the pixel's width.
    pub radius_px: Estimate<T>,
    /// Contact radius in metres.
    pub radius_m: Estimate<T>,
    /// Grey-level difference at the centre.
    pub peak: Estimate<T>,
    /// Grey-level difference far away; zero if it was not fitted.
    pub background: Estimate<T>,
    /// Standard deviation of the blur, in pixels.
    pub blur_px: T,
    /// Integral of the profile, 2π/3 A a² in grey levels × pixels.
    pub integrated_pixel_value: Estimate<T>,
    /// Covariance of [peak, background, radius, blur variance, x, y], in grey levels and pixels.
    pub covariance: [[T; 6]; 6],
    /// Residual variance over the noise model's: near 1 if the contact is Hertz's.
    pub reduced_chi_squared: T,
    /// Steps taken.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}
