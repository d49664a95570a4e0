//! The options of the profile fit.

use crate::error::ForceError;
use tactile_core::Requirement;

/// The parameters of the profile that are known, and the length of the fit.
///
/// ```
/// use tactile_force::{ForceMeter, ForceOptions, HertzFitOptions};
///
/// // A lens whose blur is known, over a background that is not.
/// let hertz = HertzFitOptions::default().with_blur_px(1.2)?.with_fitted_background().with_max_iterations(20)?;
/// assert!(ForceMeter::new([20e-6; 2], &ForceOptions::default().with_hertz(hertz)).is_ok());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct HertzFitOptions {
    /// Standard deviation of the optical blur; `None` fits it.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::blur_px"))]
    pub(super) blur_px: Option<f64>,
    pub(super) fit_background: bool,
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::max_iterations"))]
    pub(super) max_iterations: usize,
}

impl Default for HertzFitOptions {
    /// Blur fitted, no background, at most 50 steps.
    fn default() -> Self {
        Self {
            blur_px: None,
            fit_background: false,
            // A clean contact takes 5 to 8 steps: `cargo bench -p tactile-benches --bench work_precision` shows the error after 1, 2 and 5.
            max_iterations: 50,
        }
    }
}

impl HertzFitOptions {
    /// Takes the standard deviation of the optical blur, in pixels, as known. By default it is fitted.
    ///
    /// # Errors
    /// A blur that is negative or not finite.
    pub fn with_blur_px(mut self, sd: f64) -> Result<Self, ForceError> {
        self.blur_px = Some(Requirement::NonNegative.check("blur_px", sd)?);
        Ok(self)
    }

    /// Fits a constant background under the profile as well.
    pub fn with_fitted_background(mut self) -> Self {
        self.fit_background = true;
        self
    }

    /// Takes at most this number of steps.
    ///
    /// # Errors
    /// Zero steps.
    pub fn with_max_iterations(mut self, steps: usize) -> Result<Self, ForceError> {
        Requirement::AtLeastOne.check("max_iterations", steps as f64)?;
        self.max_iterations = steps;
        Ok(self)
    }
}

/// Values read from a file pass the same checks as values set in code.
#[cfg(feature = "serde")]
mod read {
    use serde::{Deserialize, Deserializer, de::Error};

    use super::HertzFitOptions;

    pub(super) fn blur_px<'de, D: Deserializer<'de>>(d: D) -> Result<Option<f64>, D::Error> {
        let Some(sd) = Option::deserialize(d)? else {
            return Ok(None);
        };
        let options = HertzFitOptions::default().with_blur_px(sd);
        options.map(|o| o.blur_px).map_err(D::Error::custom)
    }

    pub(super) fn max_iterations<'de, D: Deserializer<'de>>(d: D) -> Result<usize, D::Error> {
        let options = HertzFitOptions::default().with_max_iterations(usize::deserialize(d)?);
        options.map(|o| o.max_iterations).map_err(D::Error::custom)
    }
}
