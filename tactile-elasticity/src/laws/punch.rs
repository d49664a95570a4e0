//! A flat punch.

use super::{ContactLaw, ContactLength, LogForce, Reach};
use crate::error::{ElasticityError, Quantity};

/// A flat circular punch of radius a: F = 2E*aδ.
///
/// Assumes linear elasticity, no friction, a rigid end, and a body that is deep compared with it.
/// The contact has the same radius for every force. I. N. Sneddon, Int. J. Eng. Sci. 3 (1965) 47.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PunchLaw {
    radius_m: f64,
}

impl PunchLaw {
    /// Creates the law of a punch with radius a (m).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            radius_m: Quantity::Radius.positive(radius_m)?,
        })
    }
}

impl ContactLaw for PunchLaw {
    fn log_force(&self, length: ContactLength, _share: f64) -> Reach {
        match length {
            ContactLength::Radius(_) => Reach::NotMine,
            ContactLength::Indentation(d) => {
                let value = (2.0 * self.radius_m).ln() + d.ln();
                Reach::At(LogForce::new(value).with_slopes(1.0, 1.0))
            }
        }
    }
}
