//! Sphere, punch and cone on bodies that are deep beside the contact.

use super::{ContactLaw, LogForce};
use crate::error::{ElasticityError, Quantity, positive};
use crate::modulus::EstimatorKind;

/// Hertz's sphere of (relative) radius R: F = 4E*a³/(3R) = 4⁄3 E*√R δ^{3⁄2}.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    radius_m: f64,
}

impl Sphere {
    pub(crate) fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// From the relative radius in m.
    pub(crate) fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            radius_m: positive(radius_m, Quantity::Radius)?,
        })
    }
}

impl ContactLaw for Sphere {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::HertzSphere
    }

    fn of_contact_radius(&self, a: f64, _: f64) -> Option<LogForce> {
        let value = (4.0 / 3.0f64).ln() - self.radius_m.ln() + 3.0 * a.ln();
        Some(LogForce {
            value,
            slope: 3.0,
            size_slope: -1.0,
        })
    }

    fn of_indentation(&self, d: f64, _: f64) -> Option<LogForce> {
        let value = (4.0 / 3.0f64).ln() + 0.5 * self.radius_m.ln() + 1.5 * d.ln();
        Some(LogForce {
            value,
            slope: 1.5,
            size_slope: 0.5,
        })
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
pub struct Punch {
    radius_m: f64,
}

impl Punch {
    pub(crate) fn new(radius_m: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            radius_m: positive(radius_m, Quantity::Radius)?,
        })
    }
}

impl ContactLaw for Punch {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::FlatPunch
    }

    fn of_contact_radius(&self, _: f64, _: f64) -> Option<LogForce> {
        None
    }

    fn of_indentation(&self, d: f64, _: f64) -> Option<LogForce> {
        Some(LogForce {
            value: (2.0 * self.radius_m).ln() + d.ln(),
            slope: 1.0,
            size_slope: 1.0,
        })
    }

    fn contact_ratio(&self, _: Option<f64>, _: Option<f64>) -> Option<f64> {
        None
    }
}

/// A cone of half opening angle α: F = (2/π)E* tan α δ² = E* π a²/(2 tan α) (Sneddon 1965).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConeLaw {
    tangent: f64,
}

impl ConeLaw {
    pub(crate) fn new(tangent: f64) -> Result<Self, ElasticityError> {
        Ok(Self {
            tangent: positive(tangent, Quantity::HalfAngle)?,
        })
    }
}

impl ContactLaw for ConeLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::Cone
    }

    fn of_contact_radius(&self, a: f64, _: f64) -> Option<LogForce> {
        let value = (std::f64::consts::FRAC_PI_2 / self.tangent).ln() + 2.0 * a.ln();
        Some(LogForce {
            value,
            slope: 2.0,
            size_slope: -1.0,
        })
    }

    fn of_indentation(&self, d: f64, _: f64) -> Option<LogForce> {
        let value = (std::f64::consts::FRAC_2_PI * self.tangent).ln() + 2.0 * d.ln();
        Some(LogForce {
            value,
            slope: 2.0,
            size_slope: 1.0,
        })
    }

    fn contact_ratio(&self, _: Option<f64>, _: Option<f64>) -> Option<f64> {
        None
    }
}
