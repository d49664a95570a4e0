//! What to fit, and what comes out.

use crate::{Estimate, ForceError, StopReason, error::Requirement};

/// Which parameters of the profile are known and which are fitted.
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
        Self { blur_px: None, fit_background: false, max_iterations: 50 }
    }
}

impl HertzFitOptions {
    pub(super) fn validate(&self) -> Result<(), ForceError> {
        Requirement::AtLeastOne.check("max_iterations", self.max_iterations as f64)?;
        self.blur_px.map_or(Ok(()), |b| Requirement::NonNegative.check("blur_px", b))
    }
}

/// A fitted Hertz profile.
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
