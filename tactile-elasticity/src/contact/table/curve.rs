//! Contacts of a ball of one modulus.

use super::surface::Sample;
use super::{at_least, growing, log_hertz};
use crate::error::{ElasticityError, Quantity, positive};

/// The contacts of one ball under growing loads, of [`ContactTable`](super::ContactTable)'s example: columns of equal length.
///
/// ```
/// use tactile_elasticity::contact::ContactCurve;
///
/// let curve = ContactCurve {
///     youngs_modulus_pa: 60e3,
///     contact_radius_m: vec![0.3e-3, 0.6e-3],
///     force_n: vec![0.9e-3, 7.1e-3],
/// };
/// assert_eq!(curve.contact_radius_m.len(), curve.force_n.len());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ContactCurve {
    /// E of the ball, in pascals.
    pub youngs_modulus_pa: f64,
    /// Contact radii, growing, in metres.
    pub contact_radius_m: Vec<f64>,
    /// The force at each, in newtons.
    pub force_n: Vec<f64>,
}

impl ContactCurve {
    /// Fewest contacts of a curve.
    pub const FEWEST_CONTACTS: usize = 4;

    pub(super) fn check(&self) -> Result<(), ElasticityError> {
        positive(self.youngs_modulus_pa, Quantity::YoungsModulus)?;
        at_least(
            self.contact_radius_m.len(),
            Self::FEWEST_CONTACTS,
            Quantity::ContactRadius,
        )?;
        if self.force_n.len() != self.contact_radius_m.len() {
            return Err(ElasticityError::LengthMismatch {
                quantity: Quantity::Force,
                expected: self.contact_radius_m.len(),
                found: self.force_n.len(),
            });
        }
        growing(
            self.contact_radius_m.iter().copied(),
            Quantity::ContactRadius,
        )?;
        growing(self.force_n.iter().copied(), Quantity::Force)
    }

    pub(super) fn samples(
        &self,
        radius_m: f64,
        poisson_ratio: f64,
    ) -> impl Iterator<Item = Sample> {
        let log_modulus = self.youngs_modulus_pa.ln();
        let contacts = self.contact_radius_m.iter().zip(&self.force_n);
        contacts.map(move |(a, force)| Sample {
            ratio: a / radius_m,
            log_modulus,
            value: force.ln() - log_hertz(*a, log_modulus, radius_m, poisson_ratio),
        })
    }
}
