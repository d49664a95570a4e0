//! The options of a force measurement.

use crate::contact::ContactOptions;
use crate::hertz::HertzFitOptions;
use tactile_core::Polarity;

/// The options of a force measurement.
///
/// ```
/// use tactile_force::{ContactOptions, ForceMeter, ForceOptions, HertzFitOptions, Polarity};
///
/// // Force and centroid only, at one false alarm in a million frames.
/// let contact = ContactOptions::default().with_false_alarm_rate(1e-6)?;
/// let options = ForceOptions::default().with_contact(contact).without_profile();
/// assert_eq!(options.polarity(), Polarity::Brighter);
/// assert!(ForceMeter::new([20e-6; 2], &options).is_ok());
/// // The profile over a background that is fitted too.
/// let hertz = HertzFitOptions::default().with_fitted_background();
/// assert_ne!(ForceOptions::default().with_hertz(hertz), ForceOptions::default());
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceOptions {
    pub(super) contact: ContactOptions,
    pub(super) hertz: HertzFitOptions,
    pub(super) skip_profile: bool,
}

impl ForceOptions {
    /// Finds the contact with these options.
    pub fn with_contact(mut self, contact: ContactOptions) -> Self {
        self.contact = contact;
        self
    }

    /// Fits the profile with these options.
    pub fn with_hertz(mut self, hertz: HertzFitOptions) -> Self {
        self.hertz = hertz;
        self
    }

    /// Fits no profile: radius and peak stress then come from the mask.
    pub fn without_profile(mut self) -> Self {
        self.skip_profile = true;
        self
    }

    /// Whether contact is brighter or darker than the reference.
    pub fn polarity(&self) -> Polarity {
        self.contact.polarity
    }
}
