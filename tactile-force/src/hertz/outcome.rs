//! The fitted profile.

use tactile_core::Estimate;
use tactile_core::StopReason;

/// Whether a fitted contact is that of a ball.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::*;
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let at_rest = Array2::from_elem((120, 120), 12_u8);
/// let shape = |level: &dyn Fn(f64) -> f64| -> Result<Option<ProfileShape>, ForceError> {
///     let frame = Array2::from_shape_fn((120, 120), |(y, x)| {
///         12 + level((x as f64 - 60.2).hypot(y as f64 - 59.7) / 30.0).round() as u8
///     });
///     let m: ForceMeasurement =
///         measure_force(frame.view(), at_rest.view(), [20e-6; 2], &calibration, &Default::default())?;
///     Ok(m.profile.map(|p| p.shape))
/// };
/// assert_eq!(shape(&|r| 150.0 * (1.0 - r * r).max(0.0).sqrt())?, Some(ProfileShape::Hertz));
/// // Even pressure, as under a soft pad.
/// assert_eq!(shape(&|r| if r < 1.0 { 150.0 } else { 0.0 })?, Some(ProfileShape::NotHertz));
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ProfileShape {
    /// The pressure is Hertz's, or with a [`bend`](HertzFit::bend) that of a ball at finite strain, to within the misfit that the noise and a smooth
    /// guide explain.
    Hertz,
    /// Not a ball's profile: the misfit stands out of the noise and exceeds 1 % of the peak along the radius, or 3 % around it.
    /// The contact radius is that of the profile with its `bend`: for a ball at finite strain within 0.03 %, for other objects no more than a
    /// size.
    NotHertz,
}

/// A fitted Hertz profile.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::*;
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let frame = Array2::from_shape_fn((120, 120), |(y, x)| {
///     let r = (x as f64 - 60.3).hypot(y as f64 - 57.8) / 30.0;
///     12 + (150.0 * (1.0 - r * r).max(0.0).sqrt()).round() as u8
/// });
/// let at_rest = Array2::from_elem((120, 120), 12);
/// let measured = measure_force(frame.view(), at_rest.view(), [20e-6; 2], &calibration, &Default::default())?;
/// let fit: HertzFit = measured.profile.expect("a profile");
/// assert!((fit.radius_px.value - 30.0).abs() < 0.02);
/// assert!((fit.centre_px[0].value - 60.3).abs() < 0.01 && (fit.peak.value - 150.0).abs() < 0.3);
/// assert_eq!(fit.stop, StopReason::Converged);
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HertzFit {
    /// Centre [x, y] in pixels.
    pub centre_px: [Estimate; 2],
    /// Contact radius in units of the pixel's width.
    pub radius_px: Estimate,
    /// Contact radius in metres.
    pub radius_m: Estimate,
    /// Grey-level difference at the centre.
    pub peak: Estimate,
    /// Grey-level difference far away; zero if it was not fitted.
    pub background: Estimate,
    /// Standard deviation of the blur, in pixels.
    pub blur_px: f64,
    /// c of p₀ √(1 − r²/a²) (1 − c r²/a²). Zero where the Hertz profile fits to within the noise; balls of finite strain on soft layers
    /// press harder at the rim (c < 0, to −0.3), balls flattened on a stiff base less (c > 0, to 0.15).
    pub bend: Estimate,
    /// Integral of the profile, 2π/3 A a² (1 − 2c/5) in grey levels × pixels.
    pub integrated_pixel_value: Estimate,
    /// Covariance of [peak, background, radius, blur variance, x, y], in grey levels and pixels.
    pub covariance: [[f64; 6]; 6],
    /// Residual variance over the noise model's: near 1 if the contact is that of a ball.
    pub reduced_chi_squared: f64,
    /// Root mean square misfit of the mean level at each radius, the noise's share subtracted, relative to the peak.
    pub radial_misfit: f64,
    /// Root mean square misfit around the centre, the noise's and the radial share subtracted, relative to the peak.
    pub azimuthal_misfit: f64,
    /// Whether the misfits are those of a ball.
    pub shape: ProfileShape,
    /// Steps taken.
    pub iterations: usize,
    /// Why the fit stopped.
    pub stop: StopReason,
}

impl HertzFit {
    /// The fit of a profile in other units of its level, as pressures for grey levels.
    pub(crate) fn with_levels_scaled(mut self, factor: f64) -> Self {
        self.peak = self.peak * factor;
        self.background = self.background * factor;
        self.integrated_pixel_value = self.integrated_pixel_value * factor;
        for k in 0..2 {
            self.covariance[k].iter_mut().for_each(|c| *c = *c * factor);
            self.covariance
                .iter_mut()
                .for_each(|row| row[k] = row[k] * factor);
        }
        self
    }
}
