//! Young's modulus from forces and the contacts they make.
//!
//! Every observation (F, x) gives one ln E* = ln F − ln f(x); their errors are relative, so that logarithms make the
//! problem linear. The common mean is the generalised least squares one, with the covariance of forces (which share a calibration),
//! of lengths (which share a pixel size) and of the indenter's size carried along. E of the sample follows from
//! 1/E* = (1 − ν²)/E + C, C the compliance of the waveguide or indenter; the interval is carried through that curve, and is
//! open above where it reaches C.

mod fit;

use super::law::{
    ConeLaw, ContactLaw, LayerLaw, LayerTheory, Punch, Sphere, TataraLaw, TwoContactsLaw, WaveguideLaw,
};
use super::source::finite;
use crate::contact::{Body, Bond, Waveguide};
use crate::error::{ElasticityError, Quantity, not_negative, poisson, positive};
use crate::scalar::widen;
use nalgebra::{DMatrix, RealField};

/// Which of the observations a contact estimator uses.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::*;
///
/// // The indentation was measured with a zero that is off; the radius knows better.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState::new(Estimate::new(1e-3, 1e-5))
///     .with_contact_radius(Estimate::new(contact.contact_radius_m, 1e-6))
///     .with_indentation(Estimate::new(contact.indentation_m + 2e-5, 1e-6));
/// let modulus = HertzSphere::new(5e-3, 0.5)?.with_evidence(Evidence::ContactRadius).estimate(&[load])?;
/// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Evidence {
    /// Both, each where it was measured.
    #[default]
    All,
    /// The contact radius alone.
    ContactRadius,
    /// The indentation alone.
    Indentation,
}

/// Young's modulus by a law F = E* f(x); see [`HertzSphere`], [`FlatPunch`], [`Cone`].
///
/// ```
/// use nalgebra::DMatrix;
/// use tactile_elasticity::contact::{Body, HertzContact, Layer, Waveguide};
/// use tactile_elasticity::modulus::*;
///
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let loads = [LoadState::new(Estimate::new(1e-3, 1e-5)).with_contact_radius(Estimate::new(contact.contact_radius_m, 1e-6))];
/// let rigid = HertzSphere::new(5e-3, 0.5)?;
/// assert_eq!(rigid.law().kind(), EstimatorKind::HertzSphere);
/// let plain = rigid.estimate(&loads)?;
///
/// // What yields beside the sample makes it stiffer than it looked.
/// let steel = rigid.clone().with_other_body(Body::elastic(200e9, 0.3)?).estimate(&loads)?;
/// let gel = Waveguide::new(vec![Layer { thickness_m: 10e-3, youngs_modulus_pa: 100e3, poisson_ratio: 0.5 }])?;
/// let on_gel = rigid.clone().with_waveguide(&gel).estimate(&loads)?;
/// assert!(steel.youngs_modulus_pa / plain.youngs_modulus_pa - 1.0 < 1e-6);
/// assert!(on_gel.youngs_modulus_pa > 1.3 * plain.youngs_modulus_pa);
///
/// // What all loads share is not averaged away.
/// let careful = rigid
///     .with_force_covariance(&DMatrix::from_element(1, 1, 1e-10))?
///     .with_force_scale_error(0.01)?
///     .with_length_scale_error(0.005)?
///     .with_size_error(0.002)?
///     .estimate(&loads)?;
/// assert!(careful.standard_error_pa > plain.standard_error_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ContactEstimator<L> {
    law: L,
    poisson_ratio: f64,
    other_compliance_per_pa: f64,
    evidence: Evidence,
    force_covariance: Option<DMatrix<f64>>,
    force_scale_error: f64,
    length_scale_error: f64,
    size_error: f64,
}

/// Hertz's sphere: a = (3FR/4E*)^⅓, δ = a²/R. Right for a/R up to 0.3; beyond, the estimate carries a warning.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadState, ModulusEstimator};
///
/// // 1 mN on a 5 mm sphere makes a contact of 0.4543 mm: 30 kPa.
/// let load = LoadState::new(Estimate::new(1e-3, 1e-5)).with_contact_radius(Estimate::new(0.4543e-3, 1e-6));
/// let modulus = HertzSphere::new(5e-3, 0.5)?.estimate(&[load])?;
/// assert!((modulus.youngs_modulus_pa / 30e3 - 1.0_f64).abs() < 1e-3);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type HertzSphere = ContactEstimator<Sphere>;
/// A flat circular punch, F = 2E*aδ.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, FlatPunch, LoadState, ModulusEstimator};
///
/// // F = 2E*aδ with E* = 40 kPa, a = 1 mm, δ = 0.1 mm.
/// let load = LoadState::new(Estimate::new(8e-3, 1e-5)).with_indentation(Estimate::new(0.1e-3, 1e-7));
/// let modulus = FlatPunch::new(1e-3, 0.5)?.estimate(&[load])?;
/// assert!((modulus.youngs_modulus_pa - 30e3_f64).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type FlatPunch = ContactEstimator<Punch>;
/// A cone, F = (2/π)E* tan α δ².
///
/// ```
/// use tactile_elasticity::contact::cone;
/// use tactile_elasticity::modulus::{Cone, Estimate, LoadState, ModulusEstimator};
///
/// let contact = cone(40e3_f64, 1.0, 0.2e-3)?;
/// let load = LoadState::new(Estimate::new(contact.force_n, 1e-6)).with_indentation(Estimate::new(0.2e-3, 1e-7));
/// let modulus = Cone::new(std::f64::consts::FRAC_PI_4, 0.5)?.estimate(&[load])?;
/// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type Cone = ContactEstimator<ConeLaw>;
/// A sphere pressed into a thin sample on a rigid base.
///
/// ```
/// use tactile_elasticity::contact::{Bond, HertzContact};
/// use tactile_elasticity::modulus::*;
///
/// // Read as a half-space, a sample 1 mm thin looks far too stiff.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = [LoadState::new(Estimate::new(1e-3, 1e-5)).with_indentation(Estimate::new(contact.indentation_m, 1e-7))];
/// let layer = BondedLayer::new(5e-3, 1e-3, 0.5, Bond::Bonded, LayerTheory::IntegralEquation)?.estimate(&load)?;
/// assert!(layer.youngs_modulus_pa < 0.7 * HertzSphere::new(5e-3, 0.5)?.estimate(&load)?.youngs_modulus_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type BondedLayer = ContactEstimator<LayerLaw>;
/// A soft sphere squeezed beyond Hertz's reach.
///
/// ```
/// use tactile_elasticity::contact::tatara_indentation_m;
/// use tactile_elasticity::modulus::{Estimate, LoadState, ModulusEstimator, TataraSphere};
///
/// // A ball of 3 mm squeezed to a/R = 0.5: Hertz's force for E* = 40 kPa at that radius, and Tatara's indentation.
/// let (radius, a) = (3e-3_f64, 1.5e-3_f64);
/// let force = 4.0 / 3.0 * 40e3 * a.powi(3) / radius;
/// let load = LoadState::new(Estimate::new(force, 1e-5))
///     .with_indentation(Estimate::new(tatara_indentation_m(a, radius, 0.5)?, 1e-7));
/// let modulus = TataraSphere::new(radius, 0.5)?.estimate(&[load])?;
/// assert!((modulus.youngs_modulus_pa / 30e3 - 1.0).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type TataraSphere = ContactEstimator<TataraLaw>;
/// A soft sphere squeezed between the other body and a rigid plate: both contacts flatten.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{Estimate, LoadState, ModulusEstimator, SphereBetweenPlates};
///
/// // Between two rigid plates each contact takes half of the approach.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState::new(Estimate::new(1e-3, 1e-5)).with_indentation(Estimate::new(2.0 * contact.indentation_m, 1e-7));
/// let modulus = SphereBetweenPlates::new(5e-3, 0.5)?.estimate(&[load])?;
/// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type SphereBetweenPlates = ContactEstimator<TwoContactsLaw>;
/// A soft sphere on a waveguide that is not deep beside the contact: the integral equation with both bodies yielding.
///
/// ```
/// use tactile_elasticity::contact::{Bond, Layer, Waveguide};
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadState, ModulusEstimator, SphereOnWaveguide};
///
/// // On a gel of 2 mm the depth is felt: as on a deep one the ball would be called stiffer.
/// let gel = Waveguide::new(vec![Layer { thickness_m: 2e-3, youngs_modulus_pa: 100e3, poisson_ratio: 0.5 }])?;
/// let load = [LoadState::new(Estimate::new(5e-3, 1e-5)).with_contact_radius(Estimate::new(0.8e-3_f64, 1e-6))];
/// let layered = SphereOnWaveguide::new(5e-3, 0.5, &gel, Bond::Bonded)?.estimate(&load)?;
/// let deep = HertzSphere::new(5e-3, 0.5)?.with_waveguide(&gel).estimate(&load)?;
/// assert!(layered.youngs_modulus_pa < deep.youngs_modulus_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type SphereOnWaveguide = ContactEstimator<WaveguideLaw>;

impl ContactEstimator<Sphere> {
    /// A sphere of relative radius R (m); the sample, with Poisson ratio ν, is either the sphere or what it is pressed into.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(radius_m: T, poisson_ratio: T) -> Result<Self, ElasticityError> {
        Self::from_law(Sphere::new(radius_m)?, poisson_ratio)
    }
}

impl ContactEstimator<Punch> {
    /// A rigid punch of radius a (m) on a sample with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(radius_m: T, poisson_ratio: T) -> Result<Self, ElasticityError> {
        Self::from_law(Punch::new(radius_m)?, poisson_ratio)
    }
}

impl ContactEstimator<ConeLaw> {
    /// A cone of half opening angle α (rad, from the axis) on a sample with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::OutOfRange`] for an angle outside (0, π/2), [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(half_angle_rad: T, poisson_ratio: T) -> Result<Self, ElasticityError> {
        let (angle, limit) = (widen(half_angle_rad), std::f64::consts::FRAC_PI_2);
        positive(angle, Quantity::HalfAngle)?;
        if angle >= limit {
            return Err(ElasticityError::OutOfRange { quantity: Quantity::HalfAngle, found: angle, limit });
        }
        Self::from_law(ConeLaw::new(angle.tan())?, poisson_ratio)
    }
}

impl ContactEstimator<LayerLaw> {
    /// A sphere of radius R (m) on a sample of thickness h (m) and Poisson ratio ν, glued to or sliding on its rigid base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(
        radius_m: T,
        thickness_m: T,
        poisson_ratio: T,
        bond: Bond,
        theory: LayerTheory,
    ) -> Result<Self, ElasticityError> {
        Self::from_law(LayerLaw::new(radius_m, thickness_m, poisson_ratio, bond, theory)?, poisson_ratio)
    }
}

impl ContactEstimator<TataraLaw> {
    /// A soft sphere of radius R (m) and Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(radius_m: T, poisson_ratio: T) -> Result<Self, ElasticityError> {
        Self::from_law(TataraLaw::new(radius_m, poisson_ratio)?, poisson_ratio)
    }
}

impl ContactEstimator<TwoContactsLaw> {
    /// A soft sphere of radius R (m) and Poisson ratio ν between the other body and a rigid plate.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(radius_m: T, poisson_ratio: T) -> Result<Self, ElasticityError> {
        Self::from_law(TwoContactsLaw::new(radius_m)?, poisson_ratio)
    }
}

impl ContactEstimator<WaveguideLaw> {
    /// A soft sphere of radius R (m) and Poisson ratio ν on a waveguide whose layers, taken in series, are one layer of their
    /// whole thickness.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new<T: RealField + Copy>(
        radius_m: T,
        poisson_ratio: T,
        waveguide: &Waveguide<T>,
        bond: Bond,
    ) -> Result<Self, ElasticityError> {
        let law = WaveguideLaw::new(radius_m, waveguide, bond)?;
        Ok(Self::from_law(law, poisson_ratio)?.with_waveguide(waveguide))
    }
}

impl<L: ContactLaw> ContactEstimator<L> {
    pub(crate) fn from_law<T: RealField + Copy>(law: L, poisson_ratio: T) -> Result<Self, ElasticityError> {
        Ok(Self {
            law,
            poisson_ratio: poisson(widen(poisson_ratio))?,
            other_compliance_per_pa: 0.0,
            evidence: Evidence::All,
            force_covariance: None,
            force_scale_error: 0.0,
            length_scale_error: 0.0,
            size_error: 0.0,
        })
    }

    /// The law.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// The other body of the contact yields too.
    pub fn with_other_body<T: RealField + Copy>(mut self, body: Body<T>) -> Self {
        self.other_compliance_per_pa = widen(body.compliance_per_pa());
        self
    }

    /// The sample is pressed on a waveguide, its layers in series and deep beside the contact.
    pub fn with_waveguide<T: RealField + Copy>(self, waveguide: &Waveguide<T>) -> Self {
        self.with_other_body(waveguide.as_body())
    }

    /// Which observations to use.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Estimate, Evidence, HertzSphere, LoadState, ModulusEstimator};
    ///
    /// // Only the radius was measured, and only the indentation is to be used.
    /// let load = LoadState::new(Estimate::new(1e-3, 1e-5)).with_contact_radius(Estimate::new(0.45e-3_f64, 1e-6));
    /// assert!(HertzSphere::new(5e-3, 0.5)?.with_evidence(Evidence::Indentation).estimate(&[load]).is_err());
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_evidence(mut self, evidence: Evidence) -> Self {
        self.evidence = evidence;
        self
    }

    /// Covariance of the forces (N²), one row per load; replaces their standard errors.
    ///
    /// # Errors
    /// [`ElasticityError::NotFinite`]; the size is checked against the loads.
    pub fn with_force_covariance<T: RealField + Copy>(
        mut self,
        covariance: &DMatrix<T>,
    ) -> Result<Self, ElasticityError> {
        self.force_covariance = Some(finite(covariance, Quantity::Force)?);
        Ok(self)
    }

    /// Relative error that all forces share (the slope of one calibration).
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_force_scale_error<T: RealField + Copy>(
        mut self,
        relative: T,
    ) -> Result<Self, ElasticityError> {
        self.force_scale_error = not_negative(widen(relative), Quantity::StandardError)?;
        Ok(self)
    }

    /// Relative error that all lengths share (the size of a pixel).
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_length_scale_error<T: RealField + Copy>(
        mut self,
        relative: T,
    ) -> Result<Self, ElasticityError> {
        self.length_scale_error = not_negative(widen(relative), Quantity::StandardError)?;
        Ok(self)
    }

    /// Relative error of the indenter's size (radius, or tangent of the half angle).
    ///
    /// # Errors
    /// [`ElasticityError::Negative`].
    pub fn with_size_error<T: RealField + Copy>(mut self, relative: T) -> Result<Self, ElasticityError> {
        self.size_error = not_negative(widen(relative), Quantity::StandardError)?;
        Ok(self)
    }
}
