//! Contact laws of the form F = E* f(x), x the contact radius or the indentation.

use super::EstimatorKind;
use crate::contact::{Bond, LayerContact, LayerEquation, LayerKernel};
use crate::error::{ElasticityError, Quantity};

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

/// The layer is the sample and the sphere presses it: the integral equation, a/h up to 20.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerLaw {
    sphere: HertzLaw,
    thickness_m: f64,
    bond: Bond,
    kernel: LayerKernel,
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
    ) -> Result<Self, ElasticityError> {
        Ok(Self {
            sphere: HertzLaw::new(radius_m)?,
            thickness_m: Quantity::Thickness.positive(thickness_m)?,
            bond,
            kernel: LayerKernel::new(bond, poisson_ratio)?,
        })
    }

    fn equation(&self, share: f64) -> LayerEquation {
        LayerEquation::of_kernel(&self.kernel).with_share(1.0 - share)
    }
}

impl ContactLaw for LayerLaw {
    fn kind(&self) -> EstimatorKind {
        match self.bond {
            Bond::Free => EstimatorKind::FreeLayerIntegralEquation,
            Bond::Bonded => EstimatorKind::LayerIntegralEquation,
        }
    }

    fn log_force_at_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        of_radius(&self.sphere, &self.equation(share), a, self.thickness_m)
    }

    fn log_force_at_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        let hertz = self.sphere.log_force_at_indentation(d, share)?;
        let chi = (self.sphere.radius_m * d).sqrt() / self.thickness_m;
        let (value, slope) = at_chi(&self.equation(share), chi).filter(|c| c.0.is_finite())?;
        Some(corrected(hertz, value, 0.5 * slope, 0.5 * slope))
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        self.sphere.contact_ratio(contact_radius, indentation)
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.sphere.contact_ratio_limit()
    }

    fn depends_on_compliance_fraction(&self) -> bool {
        true
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
