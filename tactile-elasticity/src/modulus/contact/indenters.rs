//! The estimators of this family: which body presses on which.

use super::ContactEstimator;
use crate::contact::{Body, Bond, Waveguide};
use crate::error::{ElasticityError, Quantity, positive};
use crate::modulus::law::{
    ConeLaw, LayerLaw, LayerTheory, Punch, Sphere, TataraLaw, TwoContactsLaw, WaveguideLaw,
};

/// Hertz's sphere: a = (3FR/4E*)^⅓, δ = a²/R. Right for a/R up to 0.3; beyond, the estimate carries a warning.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator};
///
/// // 1 mN on a 5 mm sphere makes a contact of 0.4543 mm: 30 kPa.
/// let load = LoadState { contact_radius_m: Some(Estimate::new(0.4543e-3, 1e-6)), ..LoadState::new(Estimate::new(1e-3, 1e-5)) };
/// let modulus = HertzSphere::new(5e-3, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!((modulus.youngs_modulus_pa / 30e3 - 1.0_f64).abs() < 1e-3);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type HertzSphere = ContactEstimator<Sphere>;
/// A flat circular punch, F = 2E*aδ.
///
/// ```
/// use tactile_elasticity::modulus::{Estimate, FlatPunch, LoadSeries, LoadState, ModulusEstimator};
///
/// // F = 2E*aδ with E* = 40 kPa, a = 1 mm, δ = 0.1 mm.
/// let load = LoadState { indentation_m: Some(Estimate::new(0.1e-3, 1e-7)), ..LoadState::new(Estimate::new(8e-3, 1e-5)) };
/// let modulus = FlatPunch::new(1e-3, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!((modulus.youngs_modulus_pa - 30e3_f64).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type FlatPunch = ContactEstimator<Punch>;
/// A cone, F = (2/π)E* tan α δ².
///
/// ```
/// use tactile_elasticity::contact::cone;
/// use tactile_elasticity::modulus::{Cone, Estimate, LoadSeries, LoadState, ModulusEstimator};
///
/// let contact = cone(40e3_f64, 1.0, 0.2e-3)?;
/// let load = LoadState {
///     indentation_m: Some(Estimate::new(0.2e-3, 1e-7)),
///     ..LoadState::new(Estimate::new(contact.force_n, 1e-6))
/// };
/// let modulus = Cone::new(std::f64::consts::FRAC_PI_4, 0.5)?.estimate(&LoadSeries::new([load]))?;
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
/// let load = LoadSeries::new([LoadState {
///     indentation_m: Some(Estimate::new(contact.indentation_m, 1e-7)),
///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
/// }]);
/// let layer = BondedLayer::new(5e-3, 1e-3, 0.5, Bond::Bonded, LayerTheory::IntegralEquation)?.estimate(&load)?;
/// assert!(layer.youngs_modulus_pa < 0.7 * HertzSphere::new(5e-3, 0.5)?.estimate(&load)?.youngs_modulus_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type BondedLayer = ContactEstimator<LayerLaw>;
/// Tatara's soft sphere: the extension of the far side counted; a/R up to 0.6.
///
/// ```
/// use tactile_elasticity::contact::tatara_indentation_m;
/// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState, ModulusEstimator, TataraSphere};
///
/// // A ball of 3 mm squeezed to a/R = 0.5: Hertz's force for E* = 40 kPa at that radius, and Tatara's indentation.
/// let (radius, a) = (3e-3_f64, 1.5e-3_f64);
/// let force = 4.0 / 3.0 * 40e3 * a.powi(3) / radius;
/// let load = LoadState {
///     indentation_m: Some(Estimate::new(tatara_indentation_m(a, radius, 0.5)?, 1e-7)),
///     ..LoadState::new(Estimate::new(force, 1e-5))
/// };
/// let modulus = TataraSphere::new(radius, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!((modulus.youngs_modulus_pa / 30e3 - 1.0).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type TataraSphere = ContactEstimator<TataraLaw>;
/// A soft sphere squeezed between the other body and a rigid plate: both contacts flatten.
///
/// ```
/// use tactile_elasticity::contact::HertzContact;
/// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState, ModulusEstimator, SphereBetweenPlates};
///
/// // Between two rigid plates each contact takes half of the approach.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState {
///     indentation_m: Some(Estimate::new(2.0 * contact.indentation_m, 1e-7)),
///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
/// };
/// let modulus = SphereBetweenPlates::new(5e-3, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type SphereBetweenPlates = ContactEstimator<TwoContactsLaw>;
/// A soft sphere on the layers of a waveguide, or on a [rigid](Waveguide::rigid) flat: the linear contact with N bonded layers
/// ([`LayerEquation`](crate::contact::LayerEquation)), exact for thick and thin layers, with a correction for finite strain.
///
/// Range: a/R up to 1.2 and a/h up to 1.6, with a warning beyond. Of finite-element contacts (neo-Hookean, ν = 0.495) that the correction was not fitted
/// to, on the paper's guide and on single layers, 30 to 250 kPa, 3 to 20 mm, the modulus from one contact radius is within 0.6 % in the median and
/// 6.1 % at worst (where the guide takes two thirds of the compliance); of an independent program's, within 0.5 % on a rigid flat up to a/R = 0.9 and 1.7 % on the
/// paper's guide up to 1.07. From the indentation, the approach of the ball's centre, it is within 0.4 % on the flat and 12 % on the guide. The law's own
/// error is part of the interval.
///
/// The set-up solves some 45 contact radii for a dozen ratios of stiffness; an estimate then interpolates.
///
/// ```
/// use tactile_elasticity::contact::{Bond, Layer, Waveguide};
/// use tactile_elasticity::modulus::{Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, SphereOnWaveguide};
///
/// // On a gel of 2 mm the depth is felt: as on a deep one the ball would be called stiffer.
/// let gel = Waveguide::new(vec![Layer { thickness_m: 2e-3, youngs_modulus_pa: 100e3, poisson_ratio: 0.5 }])?;
/// let load = LoadSeries::new([LoadState {
///     contact_radius_m: Some(Estimate::new(0.8e-3_f64, 1e-6)),
///     ..LoadState::new(Estimate::new(5e-3, 1e-5))
/// }]);
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
    pub fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Self::from_law(Sphere::new(radius_m)?, poisson_ratio)
    }
}

impl ContactEstimator<Punch> {
    /// A rigid punch of radius a (m) on a sample with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Self::from_law(Punch::new(radius_m)?, poisson_ratio)
    }
}

impl ContactEstimator<ConeLaw> {
    /// A cone of half opening angle α (rad, from the axis) on a sample with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::OutOfRange`] for an angle outside (0, π/2), [`ElasticityError::PoissonRatio`].
    pub fn new(half_angle_rad: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let (angle, limit) = (half_angle_rad, std::f64::consts::FRAC_PI_2);
        positive(angle, Quantity::HalfAngle)?;
        if angle >= limit {
            return Err(ElasticityError::OutOfRange {
                quantity: Quantity::HalfAngle,
                found: angle,
                limit,
            });
        }
        Self::from_law(ConeLaw::new(angle.tan())?, poisson_ratio)
    }
}

impl ContactEstimator<LayerLaw> {
    /// A sphere of radius R (m) on a sample of thickness h (m) and Poisson ratio ν, bonded to or sliding on its rigid base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(
        radius_m: f64,
        thickness_m: f64,
        poisson_ratio: f64,
        bond: Bond,
        theory: LayerTheory,
    ) -> Result<Self, ElasticityError> {
        Self::from_law(
            LayerLaw::new(radius_m, thickness_m, poisson_ratio, bond, theory)?,
            poisson_ratio,
        )
    }
}

impl ContactEstimator<TataraLaw> {
    /// A soft sphere of radius R (m) and Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Self::from_law(TataraLaw::new(radius_m, poisson_ratio)?, poisson_ratio)
    }
}

impl ContactEstimator<TwoContactsLaw> {
    /// A soft sphere of radius R (m) and Poisson ratio ν between the other body and a rigid plate.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Self::from_law(TwoContactsLaw::new(radius_m)?, poisson_ratio)
    }
}

impl ContactEstimator<WaveguideLaw> {
    /// A soft sphere of radius R (m) and Poisson ratio ν on the layers of a waveguide, or on a [rigid](Waveguide::rigid) flat; `bond`
    /// is that of the lowest layer to its rigid base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(
        radius_m: f64,
        poisson_ratio: f64,
        waveguide: &Waveguide,
        bond: Bond,
    ) -> Result<Self, ElasticityError> {
        let law = WaveguideLaw::new(radius_m, poisson_ratio, waveguide, bond)?;
        let touched = match waveguide.layers().iter().find(|l| l.thickness_m > 0.0) {
            Some(top) => Body::elastic(top.youngs_modulus_pa, top.poisson_ratio)?,
            None => Body::rigid(),
        };
        Ok(Self::from_law(law, poisson_ratio)?.with_other_body(touched))
    }

    /// The linear contact alone, without what finite strain adds and without the model's error in the interval.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, HertzContact, Waveguide};
    /// use tactile_elasticity::modulus::{Estimate, LoadSeries, LoadState, ModulusEstimator, SphereOnWaveguide};
    ///
    /// // On a rigid flat the linear contact is Hertz's.
    /// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
    /// let load = LoadState {
    ///     contact_radius_m: Some(Estimate::new(contact.contact_radius_m, 1e-6)),
    ///     ..LoadState::new(Estimate::new(1e-3, 1e-5))
    /// };
    /// let estimator = SphereOnWaveguide::new(5e-3, 0.5, &Waveguide::rigid(), Bond::Bonded)?.without_finite_strain();
    /// let modulus = estimator.estimate(&LoadSeries::new([load]))?;
    /// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn without_finite_strain(mut self) -> Self {
        self.law = self.law.without_finite_strain();
        self
    }
}
