//! A cone.

use super::{ContactLaw, ContactLength, LogForce, Reach};
use crate::error::{ElasticityError, Quantity};
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

/// A cone of half opening angle α: F = (2/π)E* tan α δ² = E* π a²/(2 tan α).
///
/// Assumes linear elasticity, no friction, a rigid cone, and a body that is deep compared with the
/// contact. The size parameter is tan α. I. N. Sneddon, Int. J. Eng. Sci. 3 (1965) 47.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConeLaw {
    tangent: f64,
}

impl ConeLaw {
    /// Creates the law from the tangent of the half opening angle, measured from the axis.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(tangent: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            tangent: Quantity::HalfAngle.positive(tangent)?,
        })
    }
}

impl ContactLaw for ConeLaw {
    fn log_force(&self, length: ContactLength, _share: f64) -> Reach {
        Reach::At(match length {
            ContactLength::Radius(a) => {
                let value = (FRAC_PI_2 / self.tangent).ln() + 2.0 * a.ln();
                LogForce::new(value).with_slopes(2.0, -1.0)
            }
            ContactLength::Indentation(d) => {
                let value = (FRAC_2_PI * self.tangent).ln() + 2.0 * d.ln();
                LogForce::new(value).with_slopes(2.0, 1.0)
            }
        })
    }
}
