//! Young's modulus from forces and contacts: the estimator of a contact law, and names for the
//! laws.

use super::bodies::half_angle;
use super::contact_fit::ContactFit;
use super::estimate::{ModulusEstimate, ModulusEstimator};
use super::kind::EstimatorKind;
use super::load::LoadSeries;
use crate::contact::{Body, Bond, Waveguide};
use crate::error::{ElasticityError, poisson};
use crate::laws::{ConeLaw, ContactLaw, HertzLaw, LayerLaw, PunchLaw, WaveguideLaw};

/// Young's modulus by a law F = E* f(x). See [`HertzSphere`], [`FlatPunch`], [`Cone`].
///
/// ```
/// use tactile_elasticity::contact::{Body, HertzContact, Layer, Waveguide};
/// use tactile_elasticity::modulus::*;
///
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadState::new(Estimate::new(1e-3, 1e-5))
///     .with_radius(Estimate::new(contact.contact_radius_m, 1e-6));
/// let loads = LoadSeries::new([load]);
/// let rigid = HertzSphere::new(5e-3, 0.5)?;
/// let plain = rigid.estimate(&loads)?;
///
/// // Subtracting the compliance of the other body makes the sample stiffer.
/// let steel = rigid
///     .clone()
///     .with_other_body(Body::elastic(200e9, 0.3)?)
///     .estimate(&loads)?;
/// let gel = Waveguide::new(vec![Layer {
///     thickness_m: 10e-3,
///     youngs_modulus_pa: 100e3,
///     poisson_ratio: 0.5,
/// }])?;
/// let on_gel = rigid.clone().with_waveguide(&gel).estimate(&loads)?;
/// assert!(steel.youngs_modulus_pa / plain.youngs_modulus_pa - 1.0 < 1e-6);
/// assert!(on_gel.youngs_modulus_pa > 1.3 * plain.youngs_modulus_pa);
///
/// // Errors of the ball are stated with the loads.
/// let ball = Bodies::new(Object::sphere(5e-3), None).with_size_error(0.01)?;
/// let careful = rigid.estimate(&loads.with_bodies(ball))?;
/// assert!(careful.standard_error_pa > plain.standard_error_pa);
/// assert!(careful.by_source.share(Source::ObjectSize) > 0.2);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ContactEstimator<L> {
    law: L,
    kind: EstimatorKind,
    poisson_ratio: f64,
    /// `None` for the other body of the series.
    other: Option<Body>,
}

impl<L: ContactLaw> ContactEstimator<L> {
    /// Creates an estimator from a law and the sample's Poisson ratio. The other body is that of
    /// the loads' [bodies](LoadSeries::bodies), which a pipeline supplies: the guide's layers in
    /// series, or the touched layer for a law with [layers](crate::laws::Limits::layers). It is
    /// rigid if the loads have none.
    ///
    /// # Errors
    /// [`ElasticityError::PoissonRatio`].
    ///
    /// ```
    /// use tactile_elasticity::laws::{ContactLaw, ContactLength, LogForce, Reach};
    /// use tactile_elasticity::modulus::*;
    ///
    /// // Hertz's law written again: ln(F/E*) = ln(4a³/3R).
    /// struct Ball { radius_m: f64 }
    /// impl ContactLaw for Ball {
    ///     fn log_force(&self, length: ContactLength, _share: f64) -> Reach {
    ///         match length {
    ///             ContactLength::Radius(a) => {
    ///                 Reach::At(LogForce::new((4.0 / 3.0 * a.powi(3) / self.radius_m).ln()))
    ///             }
    ///             _ => Reach::NotMine,
    ///         }
    ///     }
    /// }
    /// let load = LoadState::new(Estimate::new(1e-3, 1e-5))
    ///     .with_radius(Estimate::new(0.45e-3, 1e-6));
    /// let loads = LoadSeries::new([load]);
    /// let own = ContactEstimator::from_law(Ball { radius_m: 5e-3 }, 0.5)?.estimate(&loads)?;
    /// let built_in = HertzSphere::new(5e-3, 0.5)?.estimate(&loads)?;
    /// assert!((own.youngs_modulus_pa / built_in.youngs_modulus_pa - 1.0).abs() < 1e-12);
    /// // The slope of the law, which determines the effect of the radius error, is computed by
    /// // differences.
    /// assert!((own.standard_error_pa / built_in.standard_error_pa - 1.0).abs() < 1e-7);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn from_law(law: L, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Self::of_kind(EstimatorKind::Other("contact law"), law, poisson_ratio)
    }

    fn of_kind(kind: EstimatorKind, law: L, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            law,
            kind,
            poisson_ratio: poisson(poisson_ratio)?,
            other: None,
        })
    }

    /// Sets the name of the estimator.
    ///
    /// ```
    /// use tactile_elasticity::laws::HertzLaw;
    /// use tactile_elasticity::modulus::{ContactEstimator, ModulusEstimator};
    ///
    /// let ball = ContactEstimator::from_law(HertzLaw::new(3e-3)?, 0.5)?.named("my ball");
    /// assert_eq!(ball.kind().to_string(), "my ball");
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    #[must_use]
    pub fn named(mut self, name: &'static str) -> Self {
        self.kind = EstimatorKind::Other(name);
        self
    }

    /// Sets the other body, regardless of the series.
    #[must_use]
    pub fn with_other_body(mut self, body: Body) -> Self {
        self.other = Some(body);
        self
    }

    /// Uses a waveguide as the other body, with its layers in series: one half-space of their mean
    /// compliance.
    ///
    /// This is accurate for a contact that is small compared with similar layers.
    /// [`SphereOnWaveguide`] solves the layers.
    #[must_use]
    pub fn with_waveguide(self, waveguide: &Waveguide) -> Self {
        self.with_other_body(waveguide.as_body())
    }

    /// The other body: the one that was set, or that of the series.
    fn other_body(&self, series: &LoadSeries) -> Body {
        self.other.unwrap_or_else(|| match series.bodies() {
            None => Body::rigid(),
            Some(bodies) if self.law.limits().layers.is_some() => bodies.touched(),
            Some(bodies) => bodies.in_series(),
        })
    }
}

impl<L: ContactLaw> ModulusEstimator for ContactEstimator<L> {
    fn estimate(&self, series: &LoadSeries) -> Result<ModulusEstimate, ElasticityError> {
        let other = self.other_body(series);
        ContactFit::new(&self.law, series, self.poisson_ratio, other)?.estimate(self.kind)
    }

    fn kind(&self) -> EstimatorKind {
        self.kind
    }

    fn needs_strain(&self) -> bool {
        false
    }

    fn counts_guide(&self) -> bool {
        self.other.is_none_or(|body| body.compliance_per_pa() > 0.0)
    }
}

/// Hertz's sphere: a = (3FR/4E*)^⅓, δ = a²/R. It is valid for a/R up to 0.3; above, the estimate
/// carries a warning.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator,
/// };
///
/// // 1 mN on a 5 mm sphere gives a contact of 0.4543 mm at 30 kPa.
/// let load = LoadState::new(Estimate::new(1e-3, 1e-5))
///     .with_radius(Estimate::new(0.4543e-3, 1e-6));
/// let modulus = HertzSphere::new(5e-3, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!((modulus.youngs_modulus_pa / 30e3 - 1.0_f64).abs() < 1e-3);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type HertzSphere = ContactEstimator<HertzLaw>;
/// A flat circular punch, F = 2E*aδ.
///
/// ```
/// use tactile_elasticity::modulus::{
///     Estimate, FlatPunch, LoadSeries, LoadState, ModulusEstimator,
/// };
///
/// // F = 2E*aδ with E* = 40 kPa, a = 1 mm, δ = 0.1 mm.
/// let load = LoadState::new(Estimate::new(8e-3, 1e-5))
///     .with_indentation(Estimate::new(0.1e-3, 1e-7));
/// let modulus = FlatPunch::new(1e-3, 0.5)?.estimate(&LoadSeries::new([load]))?;
/// assert!((modulus.youngs_modulus_pa - 30e3_f64).abs() < 1e-6);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type FlatPunch = ContactEstimator<PunchLaw>;
/// A cone, F = (2/π)E* tan α δ².
///
/// ```
/// use tactile_elasticity::modulus::{Cone, Estimate, LoadSeries, LoadState, ModulusEstimator};
///
/// // F = (2/π)E* δ² with E* = 40 kPa, δ = 0.2 mm, at a half angle of 45°.
/// let force = std::f64::consts::FRAC_2_PI * 40e3 * 0.2e-3_f64.powi(2);
/// let load = LoadState::new(Estimate::new(force, 1e-6))
///     .with_indentation(Estimate::new(0.2e-3, 1e-7));
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
/// // Treated as a half-space, a sample of 1 mm would appear far too stiff.
/// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
/// let load = LoadSeries::new([LoadState::new(Estimate::new(1e-3, 1e-5))
///     .with_indentation(Estimate::new(contact.indentation_m, 1e-7))]);
/// let layer = BondedLayer::new(5e-3, 1e-3, 0.5, Bond::Bonded)?.estimate(&load)?;
/// assert!(
///     layer.youngs_modulus_pa
///         < 0.7
///             * HertzSphere::new(5e-3, 0.5)?
///                 .estimate(&load)?
///                 .youngs_modulus_pa
/// );
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type BondedLayer = ContactEstimator<LayerLaw>;
/// A soft sphere on the layers of a waveguide, or on a [rigid](Waveguide::rigid) flat: the linear
/// contact with N bonded layers ([`LayerEquation`](crate::contact::LayerEquation)), exact for thick
/// and thin layers, with a correction for finite strain.
///
/// Range: a/R up to 1.2 and a/h up to 1.6, with a warning outside. It was tested on finite-element
/// contacts (neo-Hookean, ν = 0.495) that were not used for the correction. They are on the paper's
/// guide and on single layers, with 30 to 250 kPa and 3 to 20 mm. The modulus from one contact
/// radius has a median error of 0.6 % and a maximum of 6.1 % (if the guide has two thirds of the
/// compliance). For contacts of an independent program, the error is below 0.5 % on a rigid flat up
/// to a/R = 0.9, and below 1.7 % on the paper's guide up to 1.07. From the indentation, the
/// approach of the ball's centre, it is below 0.4 % on the flat and 12 % on the guide. The error of
/// the law is part of the interval.
///
/// The set-up solves about 45 contact radii for a dozen ratios of stiffness. An estimate then
/// interpolates.
///
/// ```
/// use tactile_elasticity::contact::{Bond, Layer, Waveguide};
/// use tactile_elasticity::modulus::{
///     Estimate, HertzSphere, LoadSeries, LoadState, ModulusEstimator, SphereOnWaveguide,
/// };
///
/// // A gel of 2 mm stiffens the contact: treated as deep, the ball would appear stiffer.
/// let gel = Waveguide::new(vec![Layer {
///     thickness_m: 2e-3,
///     youngs_modulus_pa: 100e3,
///     poisson_ratio: 0.5,
/// }])?;
/// let load = LoadSeries::new([LoadState::new(Estimate::new(5e-3, 1e-5))
///     .with_radius(Estimate::new(0.8e-3_f64, 1e-6))]);
/// let layered = SphereOnWaveguide::new(5e-3, 0.5, &gel, Bond::Bonded)?.estimate(&load)?;
/// let deep = HertzSphere::new(5e-3, 0.5)?
///     .with_waveguide(&gel)
///     .estimate(&load)?;
/// assert!(layered.youngs_modulus_pa < deep.youngs_modulus_pa);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
pub type SphereOnWaveguide = ContactEstimator<WaveguideLaw>;

impl ContactEstimator<HertzLaw> {
    /// A sphere of relative radius R (m). The sample, with Poisson ratio ν, is either the sphere or
    /// the body that it is pressed into.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let law = HertzLaw::new(radius_m)?;
        Self::of_kind(EstimatorKind::HertzSphere, law, poisson_ratio)
    }
}

impl ContactEstimator<PunchLaw> {
    /// A rigid punch of radius a (m) on a sample with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let law = PunchLaw::new(radius_m)?;
        Self::of_kind(EstimatorKind::FlatPunch, law, poisson_ratio)
    }
}

impl ContactEstimator<ConeLaw> {
    /// A cone of half opening angle α (rad, from the axis) on a sample with Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::OutOfRange`] for an angle outside (0, π/2),
    /// [`ElasticityError::PoissonRatio`].
    pub fn new(half_angle_rad: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let law = ConeLaw::new(half_angle(half_angle_rad)?.tan())?;
        Self::of_kind(EstimatorKind::Cone, law, poisson_ratio)
    }
}

impl ContactEstimator<LayerLaw> {
    /// A sphere of radius R (m) on a sample of thickness h (m) and Poisson ratio ν, bonded to or
    /// sliding on its rigid base.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(
        radius_m: f64,
        thickness_m: f64,
        poisson_ratio: f64,
        bond: Bond,
    ) -> Result<Self, ElasticityError> {
        let kind = match bond {
            Bond::Bonded => EstimatorKind::LayerIntegralEquation,
            Bond::Free => EstimatorKind::FreeLayerIntegralEquation,
        };
        let law = LayerLaw::new(radius_m, thickness_m, poisson_ratio, bond)?;
        Self::of_kind(kind, law, poisson_ratio)
    }
}

impl ContactEstimator<WaveguideLaw> {
    /// A soft sphere of radius R (m) and Poisson ratio ν on the layers of a waveguide, or on a
    /// [rigid](Waveguide::rigid) flat. `bond` is that of the lowest layer to its rigid base.
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
        let kind = match waveguide.layers().is_empty() {
            true => EstimatorKind::SphereOnFlat,
            false => EstimatorKind::SphereOnWaveguide,
        };
        let estimator = Self::of_kind(kind, law, poisson_ratio)?;
        Ok(estimator.with_other_body(waveguide.touched()))
    }

    /// Uses the linear contact alone, without the finite-strain correction and without the error of
    /// the model in the interval.
    ///
    /// ```
    /// use tactile_elasticity::contact::{Bond, HertzContact, Waveguide};
    /// use tactile_elasticity::modulus::{
    ///     Estimate, LoadSeries, LoadState, ModulusEstimator, SphereOnWaveguide,
    /// };
    ///
    /// // On a rigid flat the linear contact is Hertz's.
    /// let contact = HertzContact::from_force(1e-3_f64, 5e-3, 40e3)?;
    /// let load = LoadState::new(Estimate::new(1e-3, 1e-5))
    ///     .with_radius(Estimate::new(contact.contact_radius_m, 1e-6));
    /// let estimator = SphereOnWaveguide::new(5e-3, 0.5, &Waveguide::rigid(), Bond::Bonded)?
    ///     .without_finite_strain();
    /// let modulus = estimator.estimate(&LoadSeries::new([load]))?;
    /// assert!((modulus.youngs_modulus_pa - 30e3).abs() < 1e-6);
    /// # Ok::<(), tactile_elasticity::ElasticityError>(())
    /// ```
    pub fn without_finite_strain(mut self) -> Self {
        self.law = self.law.without_finite_strain();
        self
    }
}
