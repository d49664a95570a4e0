//! The options of a curve's fit.

use crate::error::ForceError;
use tactile_core::Requirement;

/// The weights of the frames and the smoothness of the curve.
///
/// ```
/// use tactile_force::PressureCurveOptions;
///
/// // A gauge good to 0.5 % of the force and 0.1 % of its range, and a curve as stiff as a straight line.
/// let options = PressureCurveOptions::default().with_force_error(0.005, 0.001)?.with_smoothness(1e6)?;
/// assert!(options.with_smoothness(f64::NAN).is_err());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressureCurveOptions {
    pub(super) relative_error: f64,
    pub(super) range_error: f64,
    pub(super) smoothness: Option<f64>,
}

impl Default for PressureCurveOptions {
    /// Errors of 1 % of the force and 0.2 % of the largest force; smoothness by cross-validation.
    fn default() -> Self {
        Self {
            relative_error: 0.01,
            range_error: 0.002,
            smoothness: None,
        }
    }
}

impl PressureCurveOptions {
    /// Weights the frames as if their errors were this share of the force and this share of the largest force, added in
    /// quadrature. Only the ratio matters: the size is estimated from the residuals.
    ///
    /// # Errors
    /// A share that is negative or not finite, or no error of the range, which frames without force need.
    pub fn with_force_error(mut self, of_force: f64, of_range: f64) -> Result<Self, ForceError> {
        self.relative_error = Requirement::NonNegative.check("of_force", of_force)?;
        self.range_error = Requirement::Positive.check("of_range", of_range)?;
        Ok(self)
    }

    /// Weighs the second differences of the slopes by this factor, relative to the data, instead of choosing it by
    /// cross-validation.
    ///
    /// # Errors
    /// A factor that is not positive and finite.
    pub fn with_smoothness(mut self, factor: f64) -> Result<Self, ForceError> {
        self.smoothness = Some(Requirement::Positive.check("smoothness", factor)?);
        Ok(self)
    }
}
