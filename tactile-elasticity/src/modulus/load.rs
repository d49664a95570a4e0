//! What was measured at one load.

use super::bodies::Bodies;
use crate::error::{ElasticityError, Quantity};
use std::sync::Arc;
use tactile_core::Uncertain;

/// The number, if it is finite, with an error and degrees of freedom that can be.
pub(crate) fn validated(
    number: Uncertain,
    quantity: Quantity,
) -> Result<Uncertain, ElasticityError> {
    quantity.finite(number.value)?;
    Quantity::StandardError.not_negative(number.standard_error())?;
    for (source, _) in number.parts() {
        if let Some(degrees) = number.degrees_of_freedom(source) {
            Quantity::DegreesOfFreedom.positive(degrees)?;
        }
    }
    Ok(number)
}

/// One load: the force and what was measured of the contact.
///
/// Pressing forces are positive. Strain is that between the unloaded state (or the first load, see
/// the estimators) and this load, positive where the object is squeezed.
///
/// Every number has its error by [`Source`](tactile_core::Source). One source is one error in all loads, which averaging
/// does not reduce, and noise another one in each. The error of an [`Estimate`](tactile_core::Estimate)
/// counts as noise.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, Source, Uncertain,
/// };
///
/// // 1 mN on a ball of 5 mm, with noise of 1 % and a gauge that is known to 2 %.
/// let noisy = Uncertain::from(Estimate::new(1e-3, 1e-5));
/// let load = |force_n: Uncertain| {
///     LoadState::new(force_n).with_radius(Estimate::new(0.4543e-3, 1e-6))
/// };
/// let hertz = HertzSphere::new(5e-3, 0.5)?;
/// let averaged = hertz.estimate(&LoadSeries::new([load(noisy); 50]))?;
/// let gauged = load(noisy.by_relative(Source::Gain, 0.02));
/// let scaled = hertz.estimate(&LoadSeries::new([gauged; 50]))?;
/// assert!(averaged.standard_error_pa < 0.005 * averaged.youngs_modulus_pa);
/// assert!(scaled.standard_error_pa > 0.02 * scaled.youngs_modulus_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LoadState {
    /// F.
    pub force_n: Uncertain,
    /// a, of a round contact.
    pub contact_radius_m: Option<Uncertain>,
    /// The contact's area, where it is not πa².
    pub contact_area_m2: Option<Uncertain>,
    /// δ, the approach of the two bodies.
    pub indentation_m: Option<Uncertain>,
    /// Mean e_zz, positive where the object is squeezed.
    pub mean_strain: Option<Uncertain>,
}

impl LoadState {
    /// A load of which only the force is known yet.
    pub fn new(force_n: impl Into<Uncertain>) -> Self {
        Self {
            force_n: force_n.into(),
            ..Self::default()
        }
    }

    /// With the radius of its contact.
    #[must_use]
    pub fn with_radius(mut self, contact_radius_m: impl Into<Uncertain>) -> Self {
        self.contact_radius_m = Some(contact_radius_m.into());
        self
    }

    /// With the area of its contact.
    #[must_use]
    pub fn with_area(mut self, contact_area_m2: impl Into<Uncertain>) -> Self {
        self.contact_area_m2 = Some(contact_area_m2.into());
        self
    }

    /// With its indentation.
    #[must_use]
    pub fn with_indentation(mut self, indentation_m: impl Into<Uncertain>) -> Self {
        self.indentation_m = Some(indentation_m.into());
        self
    }

    /// With its mean strain.
    #[must_use]
    pub fn with_strain(mut self, mean_strain: impl Into<Uncertain>) -> Self {
        self.mean_strain = Some(mean_strain.into());
        self
    }

    /// F over the area given, or over πa². `None` if neither is known or the area is zero.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Estimate, LoadState};
    /// let load = LoadState::new(Estimate::exact(0.7)).with_radius(Estimate::exact(1.2e-3));
    /// let stress_pa = 0.7 / (std::f64::consts::PI * 1.44e-6);
    /// assert!((load.stress_pa().unwrap() - stress_pa).abs() < 1e-6);
    /// ```
    pub fn stress_pa(&self) -> Option<f64> {
        let area = self.area()?.value;
        (area > 0.0).then(|| self.force_n.value / area)
    }

    /// The area given, or πa².
    pub(crate) fn area(&self) -> Option<Uncertain> {
        let disc = |a: Uncertain| a.powf(2.0) * std::f64::consts::PI;
        self.contact_area_m2
            .or_else(|| self.contact_radius_m.map(disc))
    }
}

/// The input of an estimator: one or more loads, and the bodies that are pressed together.
///
/// ```
/// use tactile_elasticity::modulus::{Bodies, Estimate, LoadSeries, LoadState, Object};
///
/// let load = |force, radius| {
///     LoadState::new(Estimate::new(force, 1e-3)).with_radius(Estimate::new(radius, 4e-6))
/// };
/// // A ball whose radius is known to 1 %.
/// let ball = Bodies::new(Object::sphere(3e-3), None).with_size_error(0.01)?;
/// let series = LoadSeries::new([load(0.7, 1.2e-3), load(1.2, 1.4e-3)]).with_bodies(ball);
/// assert_eq!(series.loads().len(), 2);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LoadSeries {
    loads: Vec<LoadState>,
    bodies: Option<Arc<Bodies>>,
}

impl LoadSeries {
    /// A vector, an array or a slice of loads.
    pub fn new(loads: impl Into<Vec<LoadState>>) -> Self {
        Self {
            loads: loads.into(),
            bodies: None,
        }
    }

    /// With the sample and the guide it is pressed on. A pipeline's series has them.
    #[must_use]
    pub fn with_bodies(mut self, bodies: impl Into<Arc<Bodies>>) -> Self {
        self.bodies = Some(bodies.into());
        self
    }

    /// The sample and the guide it is pressed on. `None` if they were not given.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Bodies, Estimate, LoadSeries, LoadState, Object};
    ///
    /// let series = LoadSeries::new([LoadState::new(Estimate::exact(0.7))]);
    /// assert!(series.bodies().is_none());
    /// let series = series.with_bodies(Bodies::new(Object::sphere(3e-3), None));
    /// assert_eq!(series.bodies().and_then(|b| b.object().sphere_radius_m()), Some(3e-3));
    /// ```
    pub fn bodies(&self) -> Option<&Bodies> {
        self.bodies.as_deref()
    }

    /// The loads, in the order given.
    pub fn loads(&self) -> &[LoadState] {
        &self.loads
    }

    /// Other loads of the same bodies.
    #[must_use]
    pub fn with_loads(&self, loads: impl Into<Vec<LoadState>>) -> Self {
        Self {
            loads: loads.into(),
            bodies: self.bodies.clone(),
        }
    }
}
