//! A sphere squeezed between two bodies.

use super::{ContactLaw, LogForce, Sphere};
use crate::error::ElasticityError;
use crate::modulus::EstimatorKind;

/// A soft sphere between the other body (the waveguide) and a rigid plate, Hertz at both contacts; the indentation is the
/// approach of the plate, so that both flatten.
///
/// Both carry F, and δ ∝ (F/E*)^⅔ at each: with s the other body's share of 1/E* at the near contact,
/// δ = δ_near (1 + (1 − s)^⅔). The contact radius is the near one's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoContactsLaw {
    sphere: Sphere,
}

impl TwoContactsLaw {
    pub(crate) fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            sphere: Sphere::new(radius_m)?,
        })
    }

    /// δ over the near contact's own.
    fn contacts(share: f64) -> f64 {
        1.0 + (1.0 - share).cbrt().powi(2)
    }
}

impl ContactLaw for TwoContactsLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::SphereBetweenPlates
    }

    fn of_contact_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        self.sphere.of_contact_radius(a, share)
    }

    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        self.sphere.of_indentation(d / Self::contacts(share), share)
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        self.sphere
            .contact_ratio(contact_radius, indentation.map(|d| 0.5 * d))
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.sphere.contact_ratio_limit()
    }

    fn depends_on_share(&self) -> bool {
        true
    }
}
