//! The options of contact detection.

use crate::drift::DriftCorrection;
use crate::error::ForceError;
use tactile_core::Polarity;
use tactile_core::Requirement;

/// The options of contact detection.
///
/// ```
/// use tactile_force::{ContactOptions, DriftCorrection, ForceError, Polarity};
///
/// let options = ContactOptions::default()
///     .with_polarity(Polarity::Brighter)
///     .with_drift(DriftCorrection::Offset)
///     .with_margin_px(6)
///     .with_smoothing_px(3)?
///     .with_minimum_area_px(9)?
///     .with_saturation_limit(0.05)?
///     .with_false_alarm_rate(1e-6)?;
/// assert_ne!(options, ContactOptions::default());
/// assert!(options.with_false_alarm_rate(0.0).is_err());
/// # Ok::<(), ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactOptions {
    pub(crate) polarity: Polarity,
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::false_alarm_rate"))]
    pub(super) false_alarm_rate: f64,
    /// Width of the smoothing box; `None` picks one by the signal.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::smoothing_px"))]
    pub(super) smoothing_px: Option<usize>,
    pub(super) margin_px: usize,
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::minimum_area_px"))]
    pub(super) minimum_area_px: usize,
    pub(super) drift: DriftCorrection,
    #[cfg_attr(feature = "serde", serde(deserialize_with = "read::saturation_limit"))]
    pub(super) saturation_limit: f64,
}

impl Default for ContactOptions {
    /// Brighter contact, one false alarm in a thousand frames, smoothing chosen by the signal, a margin of 4 pixels, at least 4
    /// pixels of contact, no correction of drift, at most 1 % of the contact saturated.
    fn default() -> Self {
        Self {
            polarity: Polarity::Brighter,
            false_alarm_rate: 1e-3,
            smoothing_px: None,
            // Beyond 4 pixels the blurred edge of a sharp lens is below the noise; more adds noise to the force alone.
            margin_px: 4,
            minimum_area_px: 4,
            drift: DriftCorrection::None,
            saturation_limit: 0.01,
        }
    }
}

impl ContactOptions {
    /// Looks for contact that is brighter or darker than the reference.
    pub fn with_polarity(mut self, polarity: Polarity) -> Self {
        self.polarity = polarity;
        self
    }

    /// Allows a frame without contact to be taken for one with contact with this probability.
    ///
    /// # Errors
    /// A rate that is not above zero and below one.
    pub fn with_false_alarm_rate(mut self, rate: f64) -> Result<Self, ForceError> {
        self.false_alarm_rate = Requirement::OpenUnitInterval.check("false_alarm_rate", rate)?;
        Ok(self)
    }

    /// Smooths with a box of this odd width in pixels. By default the narrowest is taken that puts the threshold below a tenth
    /// of the contact's signal (1, no smoothing, for all but faint contacts).
    ///
    /// # Errors
    /// A width that is even.
    pub fn with_smoothing_px(mut self, width: usize) -> Result<Self, ForceError> {
        Requirement::Odd.check("smoothing_px", width as f64)?;
        self.smoothing_px = Some(width);
        Ok(self)
    }

    /// Grows the mask by this number of pixels to the aperture that is summed.
    pub fn with_margin_px(mut self, margin: usize) -> Self {
        self.margin_px = margin;
        self
    }

    /// Takes components of fewer pixels for noise.
    ///
    /// # Errors
    /// An area of zero.
    pub fn with_minimum_area_px(mut self, area: usize) -> Result<Self, ForceError> {
        Requirement::AtLeastOne.check("minimum_area_px", area as f64)?;
        self.minimum_area_px = area;
        Ok(self)
    }

    /// Corrects this change of illumination or stray light.
    pub fn with_drift(mut self, correction: DriftCorrection) -> Self {
        self.drift = correction;
        self
    }

    /// Refuses the force of a contact with a larger share of saturated pixels.
    ///
    /// # Errors
    /// A share outside zero to one.
    pub fn with_saturation_limit(mut self, share: f64) -> Result<Self, ForceError> {
        self.saturation_limit = Requirement::UnitInterval.check("saturation_limit", share)?;
        Ok(self)
    }
}

/// Values read from a file pass the same checks as values set in code.
#[cfg(feature = "serde")]
mod read {
    use serde::{Deserialize, Deserializer, de::Error};

    use super::ContactOptions;

    pub(super) fn false_alarm_rate<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        let options = ContactOptions::default().with_false_alarm_rate(f64::deserialize(d)?);
        options
            .map(|o| o.false_alarm_rate)
            .map_err(D::Error::custom)
    }

    pub(super) fn smoothing_px<'de, D: Deserializer<'de>>(d: D) -> Result<Option<usize>, D::Error> {
        let Some(width) = Option::deserialize(d)? else {
            return Ok(None);
        };
        let options = ContactOptions::default().with_smoothing_px(width);
        options.map(|o| o.smoothing_px).map_err(D::Error::custom)
    }

    pub(super) fn minimum_area_px<'de, D: Deserializer<'de>>(d: D) -> Result<usize, D::Error> {
        let options = ContactOptions::default().with_minimum_area_px(usize::deserialize(d)?);
        options.map(|o| o.minimum_area_px).map_err(D::Error::custom)
    }

    pub(super) fn saturation_limit<'de, D: Deserializer<'de>>(d: D) -> Result<f64, D::Error> {
        let options = ContactOptions::default().with_saturation_limit(f64::deserialize(d)?);
        options
            .map(|o| o.saturation_limit)
            .map_err(D::Error::custom)
    }
}
