//! A soft ball, the sample, on the layers of a guide.

use super::finite_strain::{Correction, FiniteStrain, LinearContact};
use super::hertz::SMALL_CONTACT;
use super::{ContactLaw, ContactLength, HertzLaw, Limits, LogForce, Reach};
use crate::contact::{Bond, LayerKernel, SharedLayerTable, Waveguide};
use crate::error::{ElasticityError, Quantity, poisson};

/// F = E* f(a): the linear contact of a ball with bonded layers on a rigid base
/// ([`LayerEquation`](crate::contact::LayerEquation)), tabulated, times a finite-strain correction.
/// E* refers to the ball and the touched layer.
///
/// Assumes no friction, no adhesion, neo-Hookean bodies with ν near 0.495, a/R up to 1.2 and a/h up
/// to 1.6. It is fitted to the finite elements of `tactile-fem`, whose scatter is the error of the
/// law.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveguideLaw {
    ball: HertzLaw,
    thickness_m: f64,
    /// `None` on a rigid flat.
    layers: Option<SharedLayerTable>,
    finite_strain: Option<FiniteStrain>,
}

// Tabulated contact radii, relative to the ball's radius. Above the second value no contact of a
// ball is valid.
const TABULATED: (f64, f64) = (0.02, 1.6);

// Indentation relative to the ball's radius above which finite elements and this law differ.
const LARGEST_INDENTATION: f64 = 0.8;

// Newton's method for the contact of an indentation takes about five steps in ln a, each limited to
// the range of the table around the first guess, and stops at rounding.
const STEPS: usize = 40;
const LARGEST_STEP: f64 = 0.5;
const SETTLED: f64 = 1e-12;

impl WaveguideLaw {
    /// Creates the law of a ball with radius R (m) and Poisson ratio ν on the layers of a guide.
    ///
    /// # Errors
    /// Those of the layers' contact: [`ElasticityError`].
    pub fn new(
        radius_m: f64,
        poisson_ratio: f64,
        waveguide: &Waveguide,
        bond: Bond,
    ) -> Result<Self, ElasticityError> {
        let radius = Quantity::Radius.positive(radius_m)?;
        let thickness_m = waveguide.thickness_m();
        let layers = if waveguide.layers().is_empty() {
            None
        } else {
            let kernel = LayerKernel::of_layers(waveguide, bond)?;
            let range = (
                TABULATED.0 * radius / thickness_m,
                TABULATED.1 * radius / thickness_m,
            );
            let table = SharedLayerTable::new(&kernel, range);
            Some(table.ok_or_else(|| Quantity::Radius.beyond(radius_m, thickness_m))?)
        };
        Ok(Self {
            ball: HertzLaw::new(radius_m)?,
            thickness_m,
            layers,
            finite_strain: Some(FiniteStrain::new(poisson(poisson_ratio)?)),
        })
    }

    pub(crate) fn without_finite_strain(mut self) -> Self {
        self.finite_strain = None;
        self
    }

    /// The contact of radius a. `None` outside the table.
    fn contact(&self, a: f64, share: f64) -> Option<Contact> {
        let x = a / self.ball.radius_m();
        if x > TABULATED.1 {
            return None;
        }
        let rigid = LinearContact {
            ratio: x,
            ball: 1.0,
            layer_ratio: 0.0,
            log_force: [0.0; 2],
            log_indentation: [0.0; 2],
        };
        let linear = match &self.layers {
            None => rigid,
            Some(table) => {
                let layers = table.at(a / self.thickness_m, share)?;
                // The ball's compliance (1 − s)/E* times the stiffness of the contact, F/F_Hertz
                // times E*.
                let ball = ((1.0 - share) * layers.force[0].exp()).clamp(0.0, 1.0);
                LinearContact {
                    ball,
                    layer_ratio: a / self.thickness_m,
                    log_force: layers.force,
                    log_indentation: layers.indentation,
                    ..rigid
                }
            }
        };
        let strain = self.finite_strain.as_ref();
        let force = strain.map_or_else(Correction::default, |s| s.force(&linear));
        let depth = strain.map_or_else(Correction::default, |s| s.indentation(&linear));
        let [value, slope] = linear.log_force;
        let hertz = self.ball.at_radius(a).corrected(value, slope, 0.0);
        let hertz_depth = 2.0 * a.ln() - self.ball.radius_m().ln();
        Some(Contact {
            log_force: hertz.corrected(force.value, force.slope, -force.ratio_slope),
            log_indentation: hertz_depth + linear.log_indentation[0] + depth.value,
            indentation_slope: 2.0 + linear.log_indentation[1] + depth.slope,
            ball_part: linear.ball,
        })
    }

    fn at_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        if d > LARGEST_INDENTATION * self.ball.radius_m() {
            return None;
        }
        let contact = self.of_indentation(d, share)?;
        let [by_radius, by_size] = contact.log_force.slopes()?;
        let slope = by_radius / contact.indentation_slope;
        // f has the dimension of an area. Apart from the layers, its slopes in δ and R add up to 2.
        Some(contact.log_force.with_slopes(slope, by_size + slope))
    }

    /// Standard error of ln F due to the law.
    fn error(&self, length: ContactLength) -> f64 {
        let Some(strain) = &self.finite_strain else {
            return 0.0;
        };
        let radius = self.ball.radius_m();
        let (x, by_indentation) = match length {
            ContactLength::Radius(a) => (a / radius, false),
            ContactLength::Indentation(d) => ((radius * d).sqrt() / radius, true),
        };
        let layer_ratio = x * radius / self.thickness_m;
        let layer_ratio = self.layers.as_ref().map(|_| layer_ratio);
        strain.error(x, layer_ratio, by_indentation)
    }

    /// The contact of an indentation, by Newton's method in logarithms.
    fn of_indentation(&self, indentation: f64, share: f64) -> Option<Contact> {
        let target = indentation.ln();
        let largest = (TABULATED.1 * self.ball.radius_m()).ln();
        let mut log_a = (0.5 * (target + self.ball.radius_m().ln())).min(largest);
        for _ in 0..STEPS {
            let contact = self.contact(log_a.exp(), share)?;
            let step = (contact.log_indentation - target) / contact.indentation_slope;
            if step.abs() < SETTLED {
                return Some(contact);
            }
            // A step outside the table is shortened to the limit.
            log_a = (log_a - step.clamp(-LARGEST_STEP, LARGEST_STEP)).min(largest);
        }
        None
    }
}

/// A contact of one radius, by the linear law with the finite-strain correction.
struct Contact {
    log_force: LogForce,
    log_indentation: f64,
    /// d ln δ/d ln a.
    indentation_slope: f64,
    /// The ball's part of the compliance, with the layers and their depth taken into account.
    ball_part: f64,
}

impl ContactLaw for WaveguideLaw {
    fn log_force(&self, length: ContactLength, share: f64) -> Reach {
        let found = match length {
            ContactLength::Radius(a) => self.contact(a, share).map(|contact| {
                // On a rigid flat the ball has all of the compliance that the other body does not
                // have.
                match self.layers {
                    Some(_) => contact.log_force.with_sample_part(contact.ball_part),
                    None => contact.log_force,
                }
            }),
            ContactLength::Indentation(d) => self.at_indentation(d, share),
        };
        Reach::from(found.map(|log_force| log_force.with_error(self.error(length))))
    }

    fn limits(&self) -> Limits {
        let contact_ratio = match self.finite_strain {
            Some(_) => FiniteStrain::LARGEST_CONTACT_RATIO,
            None => SMALL_CONTACT,
        };
        let layers = self.layers.as_ref();
        Limits {
            layers: layers.map(|_| [self.thickness_m, FiniteStrain::LARGEST_LAYER_RATIO]),
            ..Limits::of_ball(self.ball.radius_m(), contact_ratio)
        }
    }
}
