//! Contact laws of the form F = E* f(x), x the contact radius or the indentation.

use super::EstimatorKind;
use crate::contact::{
    Bond, LayerContact, LayerEquation, LayerKernel, LayerSeries, LayerTable, Squeeze,
};
use crate::error::{ElasticityError, Quantity, poisson};
use crate::numerics::gauss_panels;

/// ln f = ln(F/E*) at one x, with its slopes in ln x and in the logarithm of the indenter's size.
#[derive(Debug, Clone, Copy)]
pub struct LogForce {
    /// ln f.
    pub value: f64,
    /// d ln f / d ln x.
    pub slope: f64,
    /// d ln f / d ln R, R the size of the indenter.
    pub size_slope: f64,
}

impl LogForce {
    /// ln f, d ln f / d ln x and d ln f / d ln R.
    pub const fn new(value: f64, slope: f64, size_slope: f64) -> Self {
        Self {
            value,
            slope,
            size_slope,
        }
    }
}

/// A law F = E* f(x) of a contact, x the contact radius or the indentation. A law of one's own
/// implements [`log_force_at_radius`](Self::log_force_at_radius) and goes into
/// [`ContactEstimator::from_law`](super::ContactEstimator::from_law).
///
/// `compliance_fraction` is the other body's part of 1/E*, in [0, 1]: 0 where it is rigid. Most
/// laws do not depend on it.
pub trait ContactLaw {
    /// ln f of a contact radius (m). None where the law does not depend on it or does not reach so
    /// far.
    fn log_force_at_radius(
        &self,
        contact_radius_m: f64,
        compliance_fraction: f64,
    ) -> Option<LogForce>;

    /// ln f of an indentation (m). None where the law does not depend on it or does not reach so
    /// far, which is the default.
    fn log_force_at_indentation(
        &self,
        _indentation_m: f64,
        _compliance_fraction: f64,
    ) -> Option<LogForce> {
        None
    }

    /// Which estimator the law makes. By default a contact law without a name of its own.
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Other("contact law")
    }

    /// a/R of the lengths measured, for laws with a radius. By default the law has none.
    fn contact_ratio(
        &self,
        _contact_radius_m: Option<f64>,
        _indentation_m: Option<f64>,
    ) -> Option<f64> {
        None
    }

    /// The largest a/R for which the law is meant.
    fn contact_ratio_limit(&self) -> f64 {
        f64::INFINITY
    }

    /// Contact over layer thickness and its limit, for laws with a layer.
    fn layer_ratio(
        &self,
        _contact_radius_m: Option<f64>,
        _indentation_m: Option<f64>,
    ) -> Option<(f64, f64)> {
        None
    }

    /// Whether f depends on the compliance fraction.
    fn depends_on_compliance_fraction(&self) -> bool {
        false
    }

    /// The fraction from which the one that belongs to the answer is sought.
    fn first_compliance_fraction(&self) -> f64 {
        0.0
    }

    /// The sample's part of the compliance of a contact of radius a (m), the other body's depth
    /// counted.
    fn sample_part(&self, _contact_radius_m: Option<f64>, compliance_fraction: f64) -> f64 {
        1.0 - compliance_fraction
    }

    /// Standard error of ln F that is the law's own, the same at every load of one size.
    fn model_error(&self, _contact_radius_m: Option<f64>, _indentation_m: Option<f64>) -> f64 {
        0.0
    }
}

/// Hertz's sphere of (relative) radius R: F = 4E*a³/(3R) = 4⁄3 E*√R δ^{3⁄2}.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HertzLaw {
    radius_m: f64,
}

impl HertzLaw {
    pub(crate) fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Of a sphere of relative radius R (m).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            radius_m: Quantity::Radius.positive(radius_m)?,
        })
    }
}

impl ContactLaw for HertzLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::HertzSphere
    }

    fn log_force_at_radius(&self, a: f64, _: f64) -> Option<LogForce> {
        let value = (4.0 / 3.0f64).ln() - self.radius_m.ln() + 3.0 * a.ln();
        Some(LogForce::new(value, 3.0, -1.0))
    }

    fn log_force_at_indentation(&self, d: f64, _: f64) -> Option<LogForce> {
        let value = (4.0 / 3.0f64).ln() + 0.5 * self.radius_m.ln() + 1.5 * d.ln();
        Some(LogForce::new(value, 1.5, 0.5))
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        contact_radius
            .or_else(|| indentation.map(|d| (self.radius_m * d).sqrt()))
            .map(|a| a / self.radius_m)
    }

    fn contact_ratio_limit(&self) -> f64 {
        0.3
    }
}

/// A flat circular punch of radius a: F = 2E*aδ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PunchLaw {
    radius_m: f64,
}

impl PunchLaw {
    /// Of a punch of radius a (m).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            radius_m: Quantity::Radius.positive(radius_m)?,
        })
    }
}

impl ContactLaw for PunchLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::FlatPunch
    }

    fn log_force_at_radius(&self, _: f64, _: f64) -> Option<LogForce> {
        None
    }

    fn log_force_at_indentation(&self, d: f64, _: f64) -> Option<LogForce> {
        Some(LogForce::new((2.0 * self.radius_m).ln() + d.ln(), 1.0, 1.0))
    }
}

/// A cone of half opening angle α: F = (2/π)E* tan α δ² = E* π a²/(2 tan α) (Sneddon 1965).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConeLaw {
    tangent: f64,
}

impl ConeLaw {
    /// Of a cone with this tangent of its half opening angle from the axis.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(tangent: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            tangent: Quantity::HalfAngle.positive(tangent)?,
        })
    }
}

impl ContactLaw for ConeLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Cone
    }

    fn log_force_at_radius(&self, a: f64, _: f64) -> Option<LogForce> {
        let value = (std::f64::consts::FRAC_PI_2 / self.tangent).ln() + 2.0 * a.ln();
        Some(LogForce::new(value, 2.0, -1.0))
    }

    fn log_force_at_indentation(&self, d: f64, _: f64) -> Option<LogForce> {
        let value = (std::f64::consts::FRAC_2_PI * self.tangent).ln() + 2.0 * d.ln();
        Some(LogForce::new(value, 2.0, 1.0))
    }
}

/// A soft sphere between the other body (the waveguide) and a rigid plate, Hertz at both contacts.
/// The indentation is the approach of the plate, so that both flatten.
///
/// Both carry F, and δ ∝ (F/E*)^⅔ at each: with s the other body's share of 1/E* at the near
/// contact, δ = δ_near (1 + (1 − s)^⅔). The contact radius is the near one's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoContactsLaw {
    sphere: HertzLaw,
}

impl TwoContactsLaw {
    /// Of a soft sphere of radius R (m).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            sphere: HertzLaw::new(radius_m)?,
        })
    }

    /// δ over the near contact's own.
    fn contacts(share: f64) -> f64 {
        1.0 + (1.0 - share).cbrt().powi(2)
    }
}

impl ContactLaw for TwoContactsLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::SphereBetweenPlates
    }

    fn log_force_at_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        self.sphere.log_force_at_radius(a, share)
    }

    fn log_force_at_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        self.sphere
            .log_force_at_indentation(d / Self::contacts(share), share)
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        self.sphere
            .contact_ratio(contact_radius, indentation.map(|d| 0.5 * d))
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.sphere.contact_ratio_limit()
    }

    fn depends_on_compliance_fraction(&self) -> bool {
        true
    }
}

/// Hertz at both contacts of the ball: the same force flattens it under the tip, with 1/R₁ =
/// 1/R_tip + 1/R_ball, and on the plate, with R₂ = R_ball. Indentations go as (F/E*)^⅔ R^(−⅓) and
/// add up, so that both act as one contact of radius R with R^(−⅓) = R₁^(−⅓) + R₂^(−⅓).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipOnBallLaw {
    both: HertzLaw,
    /// Of the contact under the tip, the smaller.
    tip_radius_m: f64,
    /// The tip's part of the indentation.
    tip_part: f64,
}

impl TipOnBallLaw {
    /// Of the radii of tip and ball in m.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn new(tip_radius_m: f64, ball_radius_m: f64) -> Result<Self, ElasticityError> {
        let tip = Quantity::Radius.positive(tip_radius_m)?;
        let ball = Quantity::Radius.positive(ball_radius_m)?;
        let relative = tip / (tip + ball) * ball;
        let (under_tip, on_plate) = (relative.cbrt().recip(), ball.cbrt().recip());
        Ok(Self {
            both: HertzLaw::new((under_tip + on_plate).powi(-3))?,
            tip_radius_m: relative,
            tip_part: under_tip / (under_tip + on_plate),
        })
    }
}

impl ContactLaw for TipOnBallLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::TipOnBall
    }

    fn log_force_at_radius(&self, _: f64, _: f64) -> Option<LogForce> {
        None
    }

    fn log_force_at_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        self.both.log_force_at_indentation(d, share)
    }

    fn contact_ratio(&self, _: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        indentation.map(|d| (self.tip_part * d / self.tip_radius_m).sqrt())
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.both.contact_ratio_limit()
    }
}

/// Tatara's sphere: Hertz's radius, and an indentation lessened by the far contact. The sample is
/// the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TataraLaw {
    sphere: HertzLaw,
    poisson_ratio: f64,
}

impl TataraLaw {
    /// Of a soft sphere of radius R (m) and Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`], [`ElasticityError::PoissonRatio`].
    pub fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            sphere: HertzLaw::new(radius_m)?,
            poisson_ratio: poisson(poisson_ratio)?,
        })
    }

    fn squeeze(&self, share: f64) -> Squeeze {
        Squeeze::new(self.sphere.radius_m, self.poisson_ratio, 1.0 - share)
    }
}

impl ContactLaw for TataraLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::TataraSphere
    }

    fn log_force_at_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        self.sphere.log_force_at_radius(a, share)
    }

    fn log_force_at_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        let squeeze = self.squeeze(share);
        let a = squeeze.contact_radius(d)?;
        let hertz = self.sphere.log_force_at_radius(a, share)?;
        let slope = hertz.slope * d / (a * squeeze.slope(a));
        // f has the dimension of an area: its slopes in δ and R add up to 2.
        Some(LogForce::new(hertz.value, slope, 2.0 - slope))
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        let a = contact_radius
            .or_else(|| indentation.and_then(|d| self.squeeze(0.0).contact_radius(d)));
        self.sphere.contact_ratio(a, None)
    }

    fn contact_ratio_limit(&self) -> f64 {
        0.6
    }

    fn depends_on_compliance_fraction(&self) -> bool {
        true
    }
}

// Contact without slip on a half-space.
//
// What touches keeps its place beneath the indenter, so a growing load adds flat punches that
// stick, one of each contact radius (Mossakovskii 1963): with θ = ln(3 − 4ν)/2π,
//
// dF/dδ = 2E* a c, c = (1 − ν) ln(3 − 4ν)/(1 − 2ν) (Spence 1968),
//
// and a surface that a punch of radius b has lifted by 1 − cos(θ ln((t + b)/(t − b))) in Abel's
// transform lies on a profile z = B rᵈ from (Borodich and Keer 2004)
//
// δ(a) I(d) = B aᵈ ∫₀¹ xᵈ⁻¹/√(1 − x²) dx, I(d) = ∫₀¹ sᵈ⁻¹ cos(θ ln((1 + s)/(1 − s))) ds.
//
// F = 2c d/(d + 1) E* a δ therefore differs from a contact without friction, θ = 0 and I(d) = 1/d,
// by factors of ν alone: at ν = ½ by none, for a sphere's force at one indentation by 1.6 % at ν =
// 0.3 and 5.3 % at ν = 0.

/// A law of contact without friction, with the factors by which sticking changes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoSlipLaw<L> {
    frictionless: L,
    kind: EstimatorKind,
    /// ln of the force's factor at one contact radius.
    at_radius: f64,
    /// ln of the force's factor at one indentation.
    at_indentation: f64,
    /// The contact radius's factor at one indentation.
    radius: f64,
}

impl NoSlipLaw<HertzLaw> {
    /// Of a sphere of radius R (m) on a half-space of Poisson ratio ν.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn sphere(radius_m: f64, nu: f64) -> Result<Self, ElasticityError> {
        // δ I = a²/2R: at one indentation a² grows as 2I.
        let integral = 2.0 * parabola_integral(theta(nu));
        let (law, kind) = (HertzLaw::new(radius_m)?, EstimatorKind::SphereWithoutSlip);
        Ok(Self::new(law, kind, nu, integral, integral.sqrt()))
    }
}

impl NoSlipLaw<PunchLaw> {
    /// Of a flat punch of radius a (m).
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn punch(radius_m: f64, nu: f64) -> Result<Self, ElasticityError> {
        let kind = EstimatorKind::FlatPunchWithoutSlip;
        Ok(Self::new(PunchLaw::new(radius_m)?, kind, nu, 1.0, 1.0))
    }
}

impl NoSlipLaw<ConeLaw> {
    /// Of a cone, by the tangent of its half angle.
    ///
    /// # Errors
    /// [`ElasticityError::NotPositive`].
    pub fn cone(half_angle_tangent: f64, nu: f64) -> Result<Self, ElasticityError> {
        // δ I = (π/2) a cot α: at one indentation a grows as I.
        let integral = cone_integral(theta(nu));
        let law = ConeLaw::new(half_angle_tangent)?;
        let kind = EstimatorKind::ConeWithoutSlip;
        Ok(Self::new(law, kind, nu, integral, integral))
    }
}

impl<L> NoSlipLaw<L> {
    /// With δ's factor at one contact radius, 1/I over its value without friction, and the contact
    /// radius's at one indentation. F is in proportion to c a δ.
    fn new(frictionless: L, kind: EstimatorKind, nu: f64, integral: f64, radius: f64) -> Self {
        Self {
            frictionless,
            kind,
            at_radius: (stiffening(nu) / integral).ln(),
            at_indentation: (stiffening(nu) * radius).ln(),
            radius,
        }
    }
}

impl<L: ContactLaw> ContactLaw for NoSlipLaw<L> {
    fn kind(&self) -> EstimatorKind {
        self.kind
    }

    fn log_force_at_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        let slides = self.frictionless.log_force_at_radius(a, share)?;
        Some(corrected(slides, self.at_radius, 0.0, 0.0))
    }

    fn log_force_at_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        let slides = self.frictionless.log_force_at_indentation(d, share)?;
        Some(corrected(slides, self.at_indentation, 0.0, 0.0))
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        match contact_radius {
            Some(_) => self.frictionless.contact_ratio(contact_radius, None),
            None => Some(self.radius * self.frictionless.contact_ratio(None, indentation)?),
        }
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.frictionless.contact_ratio_limit()
    }
}

/// 2(1 − 2ν), by which 3 − 4ν exceeds one.
fn excess(nu: f64) -> f64 {
    2.0 - 4.0 * nu
}

/// θ = ln(3 − 4ν)/2π.
fn theta(nu: f64) -> f64 {
    excess(nu).ln_1p() / std::f64::consts::TAU
}

/// c = (1 − ν) ln(3 − 4ν)/(1 − 2ν), 1 at ν = ½.
fn stiffening(nu: f64) -> f64 {
    let excess = excess(nu);
    if excess == 0.0 {
        1.0
    } else {
        2.0 * (1.0 - nu) * excess.ln_1p() / excess
    }
}

/// I(1) = πθ/sinh πθ.
fn cone_integral(theta: f64) -> f64 {
    let argument = std::f64::consts::PI * theta;
    if argument == 0.0 {
        1.0
    } else {
        argument / argument.sinh()
    }
}

/// I(2), with s = tanh x: ∫ tanh x cos(2θx)/cosh² x dx, smooth, and below 10⁻¹⁶ beyond x = 20.
fn parabola_integral(theta: f64) -> f64 {
    let edges: Vec<f64> = (0..=10).map(|k| 2.0 * f64::from(k)).collect();
    let term = |x: f64| x.tanh() * (2.0 * theta * x).cos() / x.cosh().powi(2);
    gauss_panels(&edges).iter().map(|&(x, w)| w * term(x)).sum()
}

/// Which theory of the layer.
///
/// ```
/// use tactile_elasticity::contact::{Bond, HertzContact};
/// use tactile_elasticity::modulus::{
///     BondedLayer, Estimate, LayerTheory, LoadSeries, LoadState, ModulusEstimator,
/// };
///
/// // √(Rδ)/h = 0.75: the published series is 15 % low in force, so its modulus is that much too
/// // high.
/// let delta = (0.75_f64 * 2e-3).powi(2) / 5e-3;
/// let load = LoadSeries::new([LoadState {
///     indentation_m: Some(Estimate::new(delta, 1e-8)),
///     ..LoadState::new(Estimate::new(1e-2, 1e-5))
/// }]);
/// let modulus = |theory| {
///     BondedLayer::new(5e-3, 2e-3, 0.5, Bond::Bonded, theory)?
///         .estimate(&load)
///         .map(|m| m.youngs_modulus_pa)
/// };
/// let ratio = modulus(LayerTheory::PublishedSeries)? / modulus(LayerTheory::IntegralEquation)?;
/// assert!((ratio - 1.0 / 0.85).abs() < 0.02);
/// # Ok::<(), tactile_elasticity::ElasticityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum LayerTheory {
    /// The series in χ as published in 2002: wrong beyond its linear term, kept for comparison.
    PublishedSeries,
    /// The true solution's series: χ up to 0.5.
    CorrectedSeries,
    /// The true solution, a/h up to 20.
    #[default]
    IntegralEquation,
}

/// The layer is the sample and the sphere presses it.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerLaw {
    sphere: HertzLaw,
    thickness_m: f64,
    bond: Bond,
    theory: LayerTheory,
    series: LayerSeries,
    kernel: LayerKernel,
    table: Option<LayerTable>,
}

impl LayerLaw {
    /// Of a sphere of radius R (m) on a layer of thickness h (m) and Poisson ratio ν.
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
        let sphere = HertzLaw::new(radius_m)?;
        let thickness_m = Quantity::Thickness.positive(thickness_m)?;
        let kernel = LayerKernel::new(bond, poisson_ratio)?;
        let series = match theory {
            LayerTheory::PublishedSeries => LayerSeries::published(bond, poisson_ratio)?,
            _ => LayerSeries::of_kernel(&kernel, 1.0),
        };
        Ok(Self {
            sphere,
            thickness_m,
            bond,
            theory,
            series,
            kernel,
            table: None,
        })
    }

    /// With the solution tabulated, for many evaluations against a rigid sphere.
    pub(crate) fn tabulated(mut self) -> Self {
        if self.theory == LayerTheory::IntegralEquation {
            self.table = Some(LayerTable::new(&LayerEquation::of_kernel(&self.kernel)));
        }
        self
    }

    fn chi(&self, d: f64) -> f64 {
        (self.sphere.radius_m * d).sqrt() / self.thickness_m
    }

    /// ln(F/F_Hertz) at χ and its slope in ln χ.
    fn correction(&self, chi: f64, share: f64) -> Option<(f64, f64)> {
        match (self.theory, &self.table) {
            (LayerTheory::IntegralEquation, Some(table)) if share == 0.0 => table.of_chi(chi),
            (LayerTheory::IntegralEquation, _) => at_chi(
                &LayerEquation::of_kernel(&self.kernel).with_share(1.0 - share),
                chi,
            ),
            (LayerTheory::CorrectedSeries, _) if share > 0.0 => {
                let series = LayerSeries::of_kernel(&self.kernel, 1.0 - share);
                Some((series.force_ratio(chi).ln(), series.log_slope(chi)))
            }
            _ => Some((
                self.series.force_ratio(chi).ln(),
                self.series.log_slope(chi),
            )),
        }
        .filter(|c| c.0.is_finite())
    }
}

impl ContactLaw for LayerLaw {
    fn kind(&self) -> EstimatorKind {
        match self.theory {
            LayerTheory::PublishedSeries => EstimatorKind::LayerPublishedSeries,
            LayerTheory::CorrectedSeries => EstimatorKind::LayerCorrectedSeries,
            LayerTheory::IntegralEquation if self.bond == Bond::Free => {
                EstimatorKind::FreeLayerIntegralEquation
            }
            LayerTheory::IntegralEquation => EstimatorKind::LayerIntegralEquation,
        }
    }

    fn log_force_at_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        if self.theory != LayerTheory::IntegralEquation {
            return None;
        }
        let equation = LayerEquation::of_kernel(&self.kernel).with_share(1.0 - share);
        of_radius(&self.sphere, &equation, a, self.thickness_m)
    }

    fn log_force_at_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        let hertz = self.sphere.log_force_at_indentation(d, share)?;
        let (value, slope) = self.correction(self.chi(d), share)?;
        Some(corrected(hertz, value, 0.5 * slope, 0.5 * slope))
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        self.sphere.contact_ratio(contact_radius, indentation)
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.sphere.contact_ratio_limit()
    }

    fn layer_ratio(
        &self,
        contact_radius: Option<f64>,
        indentation: Option<f64>,
    ) -> Option<(f64, f64)> {
        // Where each theory has erred by about 1 % in the force.
        let limit = match self.theory {
            LayerTheory::PublishedSeries => 0.2,
            LayerTheory::CorrectedSeries => 0.5,
            LayerTheory::IntegralEquation => return None,
        };
        let ratio = indentation
            .map(|d| self.chi(d))
            .or_else(|| contact_radius.map(|a| a / self.thickness_m))?;
        Some((ratio, limit))
    }

    fn depends_on_compliance_fraction(&self) -> bool {
        self.theory != LayerTheory::PublishedSeries
    }
}

/// ln f of a law with a correction and what it adds to the slopes.
pub(super) fn corrected(law: LogForce, value: f64, slope: f64, size_slope: f64) -> LogForce {
    LogForce::new(
        law.value + value,
        law.slope + slope,
        law.size_slope + size_slope,
    )
}

fn of_radius(
    sphere: &HertzLaw,
    equation: &LayerEquation,
    a: f64,
    thickness: f64,
) -> Option<LogForce> {
    let at = |x: f64| {
        equation
            .solve(x)
            .ok()
            .map(|c| c.force_ratio_same_radius.ln())
    };
    let ratio = a / thickness;
    let slope = (at(ratio * 1e-4_f64.exp())? - at(ratio * (-1e-4_f64).exp())?) / 2e-4;
    Some(corrected(
        sphere.log_force_at_radius(a, 0.0)?,
        at(ratio)?,
        slope,
        0.0,
    ))
}

/// ln(F/F_Hertz) at χ and its slope in ln χ, by the secant method on ln(a/h).
fn at_chi(equation: &LayerEquation, chi: f64) -> Option<(f64, f64)> {
    let at = |log_a: f64| -> Option<LayerContact> { equation.solve(log_a.exp()).ok() };
    let target = chi.ln();
    let mut x = target;
    let mut slope = 1.0;
    let mut contact = at(x.min(2.9))?;
    for _ in 0..40 {
        let gap = contact.chi.ln() - target;
        if gap.abs() < 1e-13 {
            break;
        }
        let next = x - gap / slope;
        let after = at(next)?;
        if next != x {
            slope = ((after.chi / contact.chi).ln() / (next - x)).clamp(0.1, 2.0);
        }
        (x, contact) = (next, after);
    }
    let (high, low) = (at(x + 1e-4)?, at(x - 1e-4)?);
    let derivative = (high.force_ratio / low.force_ratio).ln() / (high.chi / low.chi).ln();
    Some((contact.force_ratio.ln(), derivative))
}

#[cfg(test)]
#[path = "law_tests.rs"]
mod tests;
