//! Measurements at one load.

use super::bodies::Bodies;
use crate::error::{ElasticityError, Quantity};
use std::sync::Arc;
use tactile_core::Uncertain;

/// Returns the number if it is finite and its error and degrees of freedom are valid.
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

/// One load: the force and the measured properties of the contact.
///
/// Pressing forces are positive. Strain is counted from the unloaded state (or from the first load,
/// see the estimators) to this load, and is positive in compression.
///
/// Each number has its error by [`Source`](tactile_core::Source). An error source has the same
/// error in all loads, which averaging does not reduce; noise is independent between loads. The
/// error of an [`Estimate`](tactile_core::Estimate) counts as noise.
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
#[non_exhaustive]
pub struct LoadState {
    /// Force F.
    pub force_n: Uncertain,
    /// Radius a of a round contact.
    pub contact_radius_m: Option<Uncertain>,
    /// Area of the contact, if it is not πa².
    pub contact_area_m2: Option<Uncertain>,
    /// Indentation δ, the approach of the two bodies.
    pub indentation_m: Option<Uncertain>,
    /// Mean e_zz, positive in compression.
    pub mean_strain: Option<Uncertain>,
}

impl LoadState {
    /// A load with only a force.
    pub fn new(force_n: impl Into<Uncertain>) -> Self {
        Self {
            force_n: force_n.into(),
            ..Self::default()
        }
    }

    /// Sets the radius of the contact.
    #[must_use]
    pub fn with_radius(mut self, contact_radius_m: impl Into<Uncertain>) -> Self {
        self.contact_radius_m = Some(contact_radius_m.into());
        self
    }

    /// Sets the area of the contact.
    #[must_use]
    pub fn with_area(mut self, contact_area_m2: impl Into<Uncertain>) -> Self {
        self.contact_area_m2 = Some(contact_area_m2.into());
        self
    }

    /// Sets the indentation.
    #[must_use]
    pub fn with_indentation(mut self, indentation_m: impl Into<Uncertain>) -> Self {
        self.indentation_m = Some(indentation_m.into());
        self
    }

    /// Sets the mean strain.
    #[must_use]
    pub fn with_strain(mut self, mean_strain: impl Into<Uncertain>) -> Self {
        self.mean_strain = Some(mean_strain.into());
        self
    }

    /// F over the stated area, or over πa². `None` if neither is known or the area is zero.
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

    /// The stated area, or πa².
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
    /// Creates a series from a vector, an array or a slice of loads.
    pub fn new(loads: impl Into<Vec<LoadState>>) -> Self {
        Self {
            loads: loads.into(),
            bodies: None,
        }
    }

    /// Adds the sample and the guide that it is pressed against. The series of a pipeline has both.
    #[must_use]
    pub fn with_bodies(mut self, bodies: impl Into<Arc<Bodies>>) -> Self {
        self.bodies = Some(bodies.into());
        self
    }

    /// The sample and the guide that it is pressed against. `None` if they were not stated.
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
