//! What was measured at one load.

use crate::error::{ElasticityError, Quantity};
use tactile_core::Estimate;

/// The estimate, if it is a finite number with an error and degrees of freedom that can be.
pub(crate) fn validated(
    estimate: Estimate,
    quantity: Quantity,
) -> Result<Estimate, ElasticityError> {
    quantity.finite(estimate.value)?;
    Quantity::StandardError.not_negative(estimate.standard_error)?;
    if let Some(degrees) = estimate.degrees_of_freedom {
        Quantity::DegreesOfFreedom.positive(degrees)?;
    }
    Ok(estimate)
}

/// Another value in place of an estimate's, of the same origin: the degrees of freedom stay.
pub(crate) fn derived(from: Estimate, value: f64, standard_error: f64) -> Estimate {
    let mut estimate = from;
    (estimate.value, estimate.standard_error) = (value, standard_error);
    estimate
}

/// One load: the force and what was measured of the contact.
///
/// Pressing forces are positive. Strain is that between the unloaded state (or the first load, see the estimators) and this
/// load, positive where the object is squeezed.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState};
/// let load = LoadState {
///     contact_radius_m: Some(Estimate::new(1.2e-3, 4e-6)),
///     mean_strain: Some(Estimate::exact(0.021)),
///     ..LoadState::new(Estimate::new(0.7, 0.002))
/// };
/// assert!((load.stress_pa().unwrap() - 0.7f64 / (std::f64::consts::PI * 1.44e-6)).abs() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadState {
    /// F.
    pub force_n: Estimate,
    /// a, of a round contact.
    pub contact_radius_m: Option<Estimate>,
    /// The contact's area, where it is not πa².
    pub contact_area_m2: Option<Estimate>,
    /// δ, the approach of the two bodies.
    pub indentation_m: Option<Estimate>,
    /// Mean e_zz, positive where the object is squeezed.
    pub mean_strain: Option<Estimate>,
}

impl LoadState {
    /// A load of which only the force is known yet.
    pub fn new(force_n: Estimate) -> Self {
        Self {
            force_n,
            contact_radius_m: None,
            contact_area_m2: None,
            indentation_m: None,
            mean_strain: None,
        }
    }

    /// F over the area given, or over πa²; None where neither is known or the area is zero.
    pub fn stress_pa(&self) -> Option<f64> {
        let area = match (self.contact_area_m2, self.contact_radius_m) {
            (Some(area), _) => area.value,
            (None, Some(a)) => std::f64::consts::PI * a.value * a.value,
            (None, None) => return None,
        };
        (area > 0.0).then(|| self.force_n.value / area)
    }
}

impl LoadState {
    /// The area given, or πa².
    pub(crate) fn area(&self) -> Option<Estimate> {
        let disc = |a: Estimate| {
            let per_radius = 2.0 * std::f64::consts::PI * a.value.abs();
            let area = std::f64::consts::PI * a.value * a.value;
            derived(a, area, per_radius * a.standard_error)
        };
        self.contact_area_m2
            .or_else(|| self.contact_radius_m.map(disc))
    }
}
