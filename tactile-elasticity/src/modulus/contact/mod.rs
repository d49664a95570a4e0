//! Young's modulus from forces and the contacts they make.
//!
//! Every observation (F, x) gives one ln E* = ln F − ln f(x); their errors are relative, so that logarithms make the
//! problem linear. The common mean is the generalised least squares one, with the covariance of forces (which share a calibration),
//! of lengths (which share a pixel size) and of the indenter's size carried along. E of the sample follows from
//! 1/E* = (1 − ν²)/E + C, C the compliance of the waveguide or indenter; the interval is carried through that curve, and is
//! open above where it reaches C.

mod fit;
mod indenters;

pub use indenters::{
    BondedLayer, Cone, FlatPunch, HertzSphere, SphereBetweenPlates, SphereOnWaveguide, TataraSphere,
};

use super::law::ContactLaw;
use crate::contact::{Body, Waveguide};
use crate::error::{ElasticityError, poisson};

/// Which of the observations a contact estimator uses.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::*;
///
/// // The indentation was measured with a wrong zero: use the radius alone.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState {
///     contact_radius_m: Some(Estimate::new(contact.contact_radius_m, 1e-6)),
///     indentation_m: Some(Estimate::new(contact.indentation_m + 2e-5, 1e-6)),
///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
/// };
/// let modulus = HertzSphere::new(5e-3, 0.5)?.with_evidence(Evidence::ContactRadius).estimate(&LoadSeries::new([load]))?;
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
/// use tactile_elasticity::contact::{Body, HertzContact, Layer, Waveguide};
/// use tactile_elasticity::modulus::*;
///
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState {
///     contact_radius_m: Some(Estimate::new(contact.contact_radius_m, 1e-6)),
///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
/// };
/// let loads = LoadSeries::new([load]);
/// let rigid = HertzSphere::new(5e-3, 0.5)?;
/// let plain = rigid.estimate(&loads)?;
///
/// // The other body's compliance is subtracted: the sample is stiffer than without.
/// let steel = rigid.clone().with_other_body(Body::elastic(200e9, 0.3)?).estimate(&loads)?;
/// let gel = Waveguide::new(vec![Layer { thickness_m: 10e-3, youngs_modulus_pa: 100e3, poisson_ratio: 0.5 }])?;
/// let on_gel = rigid.clone().with_waveguide(&gel).estimate(&loads)?;
/// assert!(steel.youngs_modulus_pa / plain.youngs_modulus_pa - 1.0 < 1e-6);
/// assert!(on_gel.youngs_modulus_pa > 1.3 * plain.youngs_modulus_pa);
///
/// // Errors that all loads share are not reduced by averaging.
/// let shared = SharedErrors { force_scale: 0.01, length_scale: 0.005, size: 0.002, ..SharedErrors::default() };
/// let careful = rigid.estimate(&loads.with_shared_errors(shared)?)?;
/// assert!(careful.standard_error_pa > plain.standard_error_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ContactEstimator<L> {
    law: L,
    poisson_ratio: f64,
    other_compliance_per_pa: f64,
    evidence: Evidence,
}

impl<L: ContactLaw> ContactEstimator<L> {
    pub(crate) fn from_law(law: L, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            law,
            poisson_ratio: poisson(poisson_ratio)?,
            other_compliance_per_pa: 0.0,
            evidence: Evidence::All,
        })
    }

    /// With the other body's compliance.
    pub fn with_other_body(mut self, body: Body) -> Self {
        self.other_compliance_per_pa = body.compliance_per_pa();
        self
    }

    /// With a waveguide as the other body, its layers in series: one half-space of their mean compliance.
    ///
    /// Good for a contact that is small beside layers that are alike; [`SphereOnWaveguide`] solves the layers.
    pub fn with_waveguide(self, waveguide: &Waveguide) -> Self {
        self.with_other_body(waveguide.as_body())
    }

    /// Which observations to use.
    ///
    /// ```
    /// use tactile_elasticity::modulus::{Estimate, Evidence, HertzSphere, LoadSeries, LoadState, ModulusEstimator};
    ///
    /// // Only the radius was measured, and only the indentation is to be used.
    /// let load = LoadState {
    ///     contact_radius_m: Some(Estimate::new(0.45e-3_f64, 1e-6)),
    ///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
    /// };
    /// assert!(HertzSphere::new(5e-3, 0.5)?.with_evidence(Evidence::Indentation).estimate(&LoadSeries::new([load])).is_err());
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn with_evidence(mut self, evidence: Evidence) -> Self {
        self.evidence = evidence;
        self
    }
}
