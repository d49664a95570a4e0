//! Hertz's ball.

use super::{ContactLaw, ContactLength, Limits, LogForce, Reach};
use crate::error::{ElasticityError, Quantity};

/// Hertz's ball of (relative) radius R: F = 4E*a³/(3R) = 4⁄3 E*√R δ^{3⁄2}.
///
/// Assumes linear elasticity, no friction, no adhesion, bodies that are deep compared with the
/// contact, and a contact that is small compared with the ball: a/R up to 0.3. K. L. Johnson,
/// *Contact Mechanics* (1985), §4.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HertzLaw {
    radius_m: f64,
}

/// a/R up to which the pressure of a ball is Hertzian.
pub(super) const SMALL_CONTACT: f64 = 0.3;

impl HertzLaw {
    /// Creates the law of a ball with relative radius R (m).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            radius_m: Quantity::Radius.positive(radius_m)?,
        })
    }

    pub(super) fn radius_m(&self) -> f64 {
        self.radius_m
    }

    pub(super) fn at_radius(&self, a: f64) -> LogForce {
        let value = (4.0 / 3.0f64).ln() - self.radius_m.ln() + 3.0 * a.ln();
        LogForce::new(value).with_slopes(3.0, -1.0)
    }

    pub(super) fn at_indentation(&self, d: f64) -> LogForce {
        let value = (4.0 / 3.0f64).ln() + 0.5 * self.radius_m.ln() + 1.5 * d.ln();
        LogForce::new(value).with_slopes(1.5, 0.5)
    }
}

impl ContactLaw for HertzLaw {
    fn log_force(&self, length: ContactLength, _share: f64) -> Reach {
        Reach::At(match length {
            ContactLength::Radius(a) => self.at_radius(a),
            ContactLength::Indentation(d) => self.at_indentation(d),
        })
    }

    fn limits(&self) -> Limits {
        Limits::of_ball(self.radius_m, SMALL_CONTACT)
    }
}
