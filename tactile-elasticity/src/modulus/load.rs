//! What was measured at one load.

use super::bodies::Bodies;
use crate::error::{ElasticityError, Quantity};
use nalgebra::DMatrix;
use std::sync::Arc;
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
/// Pressing forces are positive. Strain is that between the unloaded state (or the first load, see
/// the estimators) and this load, positive where the object is squeezed.
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
            ..Self::default()
        }
    }

    /// F over the area given, or over πa². None where neither is known or the area is zero.
    pub fn stress_pa(&self) -> Option<f64> {
        let area = self.area()?.value;
        (area > 0.0).then(|| self.force_n.value / area)
    }

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

/// Standard errors that all loads of a series have in common: averaging over loads does not reduce
/// them. Zero where negligible or unknown.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, SharedErrors,
/// };
///
/// let load = LoadState {
///     contact_radius_m: Some(Estimate::new(0.4543e-3_f64, 1e-6)),
///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
/// };
/// let series = LoadSeries::new([load; 50]);
/// let shared = SharedErrors {
///     force_scale: 0.02,
///     ..SharedErrors::default()
/// };
/// let hertz = HertzSphere::new(5e-3, 0.5)?;
/// let averaged = hertz.estimate(&series)?;
/// let scaled = hertz.estimate(&series.with_shared_errors(shared)?)?;
/// assert!(averaged.standard_error_pa < 0.005 * averaged.youngs_modulus_pa);
/// assert!(scaled.standard_error_pa > 0.02 * scaled.youngs_modulus_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SharedErrors {
    /// Relative error of all forces: the slope of one calibration. Its degrees of freedom are the
    /// fewest that the forces of the loads have.
    pub force_scale: f64,
    /// Relative error of all lengths: the size of a pixel.
    pub length_scale: f64,
    /// Relative error of the indenter's size: radius, or tangent of the half angle.
    pub size: f64,
    /// Error of the sample's Poisson ratio.
    pub poisson_ratio: f64,
    /// Relative error of the other body's compliance: the moduli of a waveguide's layers, all by
    /// one factor.
    pub other_body: f64,
    /// Correlation of the errors of lengths and of the other body's compliance, from -1 to 1.
    /// Above zero where the body was checked by contact radii that the same pixels measured.
    pub length_with_other_body: f64,
    /// 6πwR in newtons, of a work of adhesion w (J/m²) that a ball of radius R may have. Its
    /// contact under a force F looks softer by ½ √(6πwR/F), to first order in √w (Johnson, Kendall
    /// and Roberts 1971): the radius is that of F + √(6πwR F), and of the pressure the rim is
    /// missing.
    pub adhesion_n: f64,
}

impl SharedErrors {
    /// Relative error of E* from adhesion under a force (N).
    pub(super) fn adhesion(&self, force_n: f64) -> f64 {
        0.5 * (self.adhesion_n / force_n).max(0.0).sqrt()
    }

    fn validated(self) -> Result<Self, ElasticityError> {
        let errors = self;
        for error in [
            errors.force_scale,
            errors.length_scale,
            errors.size,
            errors.poisson_ratio,
            errors.other_body,
            errors.adhesion_n,
        ] {
            Quantity::StandardError.not_negative(error)?;
        }
        let correlation = errors.length_with_other_body;
        if !(-1.0..=1.0).contains(&correlation) {
            return Err(Quantity::Correlation.beyond(correlation, 1.0));
        }
        Ok(self)
    }
}

/// The input of an estimator: one or more loads with the errors that they share.
///
/// ```
/// use nalgebra::DMatrix;
/// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState, SharedErrors};
///
/// let load = |force, radius| LoadState {
///     contact_radius_m: Some(Estimate::new(radius, 4e-6)),
///     ..LoadState::new(Estimate::new(force, 1e-3))
/// };
/// let series = LoadSeries::new([load(0.7, 1.2e-3), load(1.2, 1.4e-3)])
///     // The offset of one calibration is in both forces.
///     .with_force_covariance(&DMatrix::from_row_slice(2, 2, &[2e-6, 1e-6, 1e-6, 2e-6]))?
///     .with_shared_errors(SharedErrors {
///         length_scale: 0.002,
///         ..SharedErrors::default()
///     })?;
/// assert_eq!(
///     (series.loads().len(), series.shared_errors().length_scale),
///     (2, 0.002)
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LoadSeries {
    loads: Vec<LoadState>,
    shared: SharedErrors,
    force_covariance: Option<DMatrix<f64>>,
    strain_covariance: Option<DMatrix<f64>>,
    /// Poisson's ratio, where the strains were derived from lateral stretches by it: all are in
    /// inverse proportion to it.
    strained_by: Option<f64>,
    bodies: Option<Arc<Bodies>>,
}

impl LoadSeries {
    /// Loads whose errors are independent: a vector, an array or a slice of them.
    pub fn new(loads: impl Into<Vec<LoadState>>) -> Self {
        Self {
            loads: loads.into(),
            shared: SharedErrors::default(),
            force_covariance: None,
            strain_covariance: None,
            strained_by: None,
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

    /// With the errors that all loads share.
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_shared_errors(mut self, shared: SharedErrors) -> Result<Self, ElasticityError> {
        self.shared = shared.validated()?;
        Ok(self)
    }

    /// With the covariance of the forces (N²), a row and a column for each load. It replaces their
    /// standard errors.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`], [`ElasticityError::LengthMismatch`].
    pub fn with_force_covariance(
        mut self,
        covariance: &DMatrix<f64>,
    ) -> Result<Self, ElasticityError> {
        self.force_covariance = Some(self.accepted(covariance, Quantity::Force)?);
        Ok(self)
    }

    /// With the covariance of the mean strains, a row and a column for each load (zeros for a load
    /// without a strain). It replaces their standard errors. Strains counted from one frame share
    /// its errors.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`], [`ElasticityError::LengthMismatch`].
    ///
    /// ```
    /// use nalgebra::DMatrix;
    /// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState};
    ///
    /// let load = LoadState {
    ///     mean_strain: Some(Estimate::exact(0.02)),
    ///     ..LoadState::new(Estimate::new(0.12_f64, 1e-3))
    /// };
    /// let series = LoadSeries::new([load; 2]);
    /// assert!(
    ///     series
    ///         .clone()
    ///         .with_strain_covariance(&DMatrix::from_element(3, 3, 1e-8))
    ///         .is_err()
    /// );
    /// assert!(
    ///     series
    ///         .with_strain_covariance(&DMatrix::from_element(2, 2, 1e-8))
    ///         .is_ok()
    /// );
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_strain_covariance(
        mut self,
        covariance: &DMatrix<f64>,
    ) -> Result<Self, ElasticityError> {
        self.strain_covariance = Some(self.accepted(covariance, Quantity::Strain)?);
        Ok(self)
    }

    /// A covariance with a row and a column for every load, all finite.
    fn accepted(
        &self,
        covariance: &DMatrix<f64>,
        quantity: Quantity,
    ) -> Result<DMatrix<f64>, ElasticityError> {
        for &entry in covariance {
            quantity.finite(entry)?;
        }
        quantity.entries(covariance.nrows(), self.loads.len())?;
        quantity.entries(covariance.ncols(), self.loads.len())?;
        Ok(covariance.clone())
    }

    /// The loads, in the order given.
    pub fn loads(&self) -> &[LoadState] {
        &self.loads
    }

    /// The errors that all loads share.
    pub fn shared_errors(&self) -> &SharedErrors {
        &self.shared
    }

    /// The covariance of the forces, where one was given.
    pub fn force_covariance(&self) -> Option<&DMatrix<f64>> {
        self.force_covariance.as_ref()
    }

    /// The covariance of the mean strains, where one was given.
    pub fn strain_covariance(&self) -> Option<&DMatrix<f64>> {
        self.strain_covariance.as_ref()
    }

    /// The series with loads whose strains were derived by a Poisson ratio.
    pub(crate) fn uniaxial(&self, loads: Vec<LoadState>, poisson_ratio: f64) -> Self {
        Self {
            loads,
            strained_by: Some(poisson_ratio),
            ..self.clone()
        }
    }

    /// Relative error that all ratios of stress to strain share beside that of the forces. Areas go
    /// as the square of lengths, strains derived from lateral stretches as one over Poisson's
    /// ratio.
    pub(crate) fn size_scale_error(&self) -> f64 {
        let of_strains = (self.strained_by).map_or(0.0, |ratio| self.shared.poisson_ratio / ratio);
        (2.0 * self.shared.length_scale).hypot(of_strains)
    }
}
