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
pub type HertzSphere = ContactEstimator<Sphere>;
/// A flat circular punch, F = 2E*aδ.
pub type FlatPunch = ContactEstimator<Punch>;
/// A cone, F = (2/π)E* tan α δ².
pub type Cone = ContactEstimator<ConeLaw>;
/// A sphere pressed into a thin sample on a rigid base.
pub type BondedLayer = ContactEstimator<LayerLaw>;
/// A soft sphere squeezed beyond Hertz's reach.
pub type TataraSphere = ContactEstimator<TataraLaw>;
/// A soft sphere squeezed between the other body and a rigid plate: both contacts flatten.
pub type SphereBetweenPlates = ContactEstimator<TwoContactsLaw>;
/// A soft sphere on a waveguide that is not deep beside the contact: the integral equation with both bodies yielding.
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
