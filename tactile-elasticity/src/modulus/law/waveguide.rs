//! A soft sphere, the sample, on the layers of a waveguide.

use super::finite_strain::{FiniteStrain, LinearContact};
use super::{ContactLaw, LogForce, Sphere};
use crate::contact::{Bond, LayerKernel, SharedLayerTable, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson, positive};
use crate::modulus::EstimatorKind;

/// F = E* f(a): the linear contact of a ball with bonded layers on a rigid base, solved by its integral equation and tabulated, with
/// what finite strain adds. E* is that of the ball and the touched layer.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveguideLaw {
    sphere: Sphere,
    thickness_m: f64,
    /// None on a rigid flat.
    layers: Option<SharedLayerTable>,
    finite_strain: Option<FiniteStrain>,
}

/// Contact radii tabulated, over the ball's radius; above the second no contact of a ball is meant.
const TABULATED: (f64, f64) = (0.02, 1.6);

/// Indentation over the ball's radius beyond which finite elements and this law part.
const LARGEST_INDENTATION: f64 = 0.8;

impl WaveguideLaw {
    /// Of a ball of radius R (m) and Poisson ratio ν on the layers of a guide.
    ///
    /// # Errors
    /// Those of the layers' contact: [`ElasticityError`].
    pub fn new(
        radius_m: f64,
        poisson_ratio: f64,
        waveguide: &Waveguide,
        bond: Bond,
    ) -> Result<Self, ElasticityError> {
        let radius = positive(radius_m, Quantity::Radius)?;
        let thickness_m = waveguide.thickness_m();
        let layers = if waveguide.layers().is_empty() {
            None
        } else {
            let kernel = LayerKernel::of_layers(waveguide, bond)?;
            let range = (
                TABULATED.0 * radius / thickness_m,
                TABULATED.1 * radius / thickness_m,
            );
            SharedLayerTable::new(&kernel, range)
        };
        Ok(Self {
            sphere: Sphere::new(radius_m)?,
            thickness_m,
            layers,
            finite_strain: Some(FiniteStrain::new(poisson(poisson_ratio)?)),
        })
    }

    pub(crate) fn without_finite_strain(mut self) -> Self {
        self.finite_strain = None;
        self
    }

    /// The contact of radius a; None beyond the table.
    fn contact(&self, a: f64, share: f64) -> Option<Contact> {
        let x = a / self.sphere.radius_m();
        if x > TABULATED.1 {
            return None;
        }
        let mut contact = Contact {
            log_force: self.sphere.of_contact_radius(a, share)?,
            log_indentation: 2.0 * a.ln() - self.sphere.radius_m().ln(),
            indentation_slope: 2.0,
            ball_part: 1.0,
        };
        let mut linear = LinearContact {
            ratio: x,
            ball: 1.0,
            layer_ratio: 0.0,
            log_force: [0.0; 2],
            log_indentation: [0.0; 2],
        };
        if let Some(table) = &self.layers {
            let layers = table.at(a / self.thickness_m, share)?;
            contact.log_force.value += layers.force;
            contact.log_force.slope += layers.force_slope;
            contact.log_indentation += layers.indentation;
            contact.indentation_slope += layers.indentation_slope;
            // The ball's compliance (1 − s)/E* times the stiffness that the contact has, F/F_Hertz times E*.
            linear.ball = ((1.0 - share) * layers.force.exp()).clamp(0.0, 1.0);
            contact.ball_part = linear.ball;
            linear.layer_ratio = a / self.thickness_m;
            linear.log_force = [layers.force, layers.force_slope];
            linear.log_indentation = [layers.indentation, layers.indentation_slope];
        }
        if let Some(strain) = &self.finite_strain {
            let force = strain.force(&linear);
            contact.log_force.value += force.value;
            contact.log_force.slope += force.slope;
            contact.log_force.size_slope -= force.ratio_slope;
            let indentation = strain.indentation(&linear);
            contact.log_indentation += indentation.value;
            contact.indentation_slope += indentation.slope;
        }
        Some(contact)
    }

    /// The contact radius of an indentation, by Newton's method in logarithms.
    fn radius_of(&self, indentation: f64, share: f64) -> Option<(f64, Contact)> {
        let target = indentation.ln();
        let largest = (TABULATED.1 * self.sphere.radius_m()).ln();
        let mut log_a = (0.5 * (target + self.sphere.radius_m().ln())).min(largest);
        for _ in 0..40 {
            let contact = self.contact(log_a.exp(), share)?;
            let step = (contact.log_indentation - target) / contact.indentation_slope;
            if step.abs() < 1e-12 {
                return Some((log_a.exp(), contact));
            }
            // A step into what is not tabulated is halved by the limit.
            log_a = (log_a - step.clamp(-0.5, 0.5)).min(largest);
        }
        None
    }
}

struct Contact {
    log_force: LogForce,
    log_indentation: f64,
    /// d ln δ/d ln a.
    indentation_slope: f64,
    /// The ball's part of the compliance, layers and their depth counted.
    ball_part: f64,
}

impl ContactLaw for WaveguideLaw {
    fn kind(&self) -> EstimatorKind {
        match self.layers {
            Some(_) => EstimatorKind::SphereOnWaveguide,
            None => EstimatorKind::SphereOnFlat,
        }
    }

    fn of_contact_radius(&self, a: f64, share: f64) -> Option<LogForce> {
        Some(self.contact(a, share)?.log_force)
    }

    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        if d > LARGEST_INDENTATION * self.sphere.radius_m() {
            return None;
        }
        let (_, contact) = self.radius_of(d, share)?;
        let slope = contact.log_force.slope / contact.indentation_slope;
        // f has the dimension of an area; layers apart, its slopes in δ and R add up to 2.
        Some(LogForce {
            value: contact.log_force.value,
            slope,
            size_slope: contact.log_force.size_slope + slope,
        })
    }

    fn contact_ratio(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        self.sphere.contact_ratio(contact_radius, indentation)
    }

    fn contact_ratio_limit(&self) -> f64 {
        if self.finite_strain.is_some() {
            FiniteStrain::LARGEST_CONTACT_RATIO
        } else {
            self.sphere.contact_ratio_limit()
        }
    }

    fn layer_ratio(
        &self,
        contact_radius: Option<f64>,
        indentation: Option<f64>,
    ) -> Option<(f64, f64)> {
        self.layers.as_ref()?;
        let a = self.contact_ratio(contact_radius, indentation)? * self.sphere.radius_m();
        Some((a / self.thickness_m, FiniteStrain::LARGEST_LAYER_RATIO))
    }

    fn depends_on_share(&self) -> bool {
        self.layers.is_some()
    }

    fn first_share(&self) -> f64 {
        // A ball that yields alone may not reach an indentation that ball and layers share.
        if self.layers.is_some() { 0.5 } else { 0.0 }
    }

    fn sample_part(&self, contact_radius: Option<f64>, share: f64) -> f64 {
        contact_radius
            .and_then(|a| self.contact(a, share))
            .map_or(1.0 - share, |contact| contact.ball_part)
    }

    fn model_error(&self, contact_radius: Option<f64>, indentation: Option<f64>) -> f64 {
        let Some(strain) = &self.finite_strain else {
            return 0.0;
        };
        let Some(x) = self.contact_ratio(contact_radius, indentation) else {
            return 0.0;
        };
        let layer_ratio = x * self.sphere.radius_m() / self.thickness_m;
        let layer_ratio = self.layers.as_ref().map(|_| layer_ratio);
        strain.model_error(x, layer_ratio, contact_radius.is_none())
    }
}
