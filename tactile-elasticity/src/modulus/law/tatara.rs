//! A soft sphere squeezed far beyond Hertz.

use super::{ContactLaw, LogForce, Sphere};
use crate::contact::Squeeze;
use crate::error::{ElasticityError, Quantity, poisson, positive};
use crate::modulus::EstimatorKind;

/// Tatara's sphere: Hertz's radius, and an indentation lessened by the far contact; the sample is the sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TataraLaw {
    sphere: Sphere,
    radius_m: f64,
    poisson_ratio: f64,
}

impl TataraLaw {
    pub(crate) fn new(radius_m: f64, poisson_ratio: f64) -> Result<Self, ElasticityError> {
        let (radius_m, poisson_ratio) = (
            positive(radius_m, Quantity::Radius)?,
            poisson(poisson_ratio)?,
        );
        Ok(Self {
            sphere: Sphere::new(radius_m)?,
            radius_m,
            poisson_ratio,
        })
    }

    fn squeeze(&self, share: f64) -> Squeeze {
        Squeeze::new(self.radius_m, self.poisson_ratio, 1.0 - share)
    }
}

impl ContactLaw for TataraLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::TataraSphere
    }

    fn of_contact_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        self.sphere.of_contact_radius(a, share)
    }

    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        let squeeze = self.squeeze(share);
        let a = squeeze.contact_radius(d)?;
        let hertz = self.sphere.of_contact_radius(a, share)?;
        let slope = hertz.slope * d / (a * squeeze.slope(a));
        // f has the dimension of an area: its slopes in δ and R add up to 2.
        Some(LogForce {
            value: hertz.value,
            slope,
            size_slope: 2.0 - slope,
        })
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        let a = contact_radius
            .or_else(|| indentation.and_then(|d| self.squeeze(0.0).contact_radius(d)));
        a.map(|a| a / self.radius_m)
    }

    fn contact_ratio_limit(&self) -> f64 {
        0.6
    }

    fn depends_on_share(&self) -> bool {
        true
    }
}
