//! A ball on a layer.

use super::hertz::SMALL_CONTACT;
use super::{ContactLaw, ContactLength, HertzLaw, Limits, LogForce, Reach};
use crate::contact::{Bond, LayerContact, LayerEquation, LayerKernel};
use crate::error::{ElasticityError, Quantity};

/// A ball on a layer, which is the sample, on a rigid base:
/// [`LayerEquation`](crate::contact::LayerEquation), a/h up to 20.
///
/// Assumes linear elasticity, no friction under the ball, a layer that is bonded to its base or
/// slides on it, and a/R up to 0.3. N. N. Lebedev & Ia. S. Ufliand, J. Appl. Math. Mech. 22 (1958)
/// 442.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerLaw {
    ball: HertzLaw,
    thickness_m: f64,
    kernel: LayerKernel,
}

// Half the step in ln a for the slopes.
const HALF_STEP: f64 = 1e-4;
// Largest ln(a/h) at the start of the search for an indentation: below the largest a/h that is
// solved.
const LARGEST_START: f64 = 2.9;
// Maximum number of secant steps. About five are typical.
const STEPS: usize = 40;
// Gap in ln χ at which the secant method stops.
const SETTLED: f64 = 1e-13;

impl LayerLaw {
    /// Creates the law of a ball with radius R (m) on a layer of thickness h (m) and Poisson ratio
    /// ν.
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
            ball: HertzLaw::new(radius_m)?,
            thickness_m: Quantity::Thickness.positive(thickness_m)?,
            kernel: LayerKernel::new(bond, poisson_ratio)?,
        })
    }

    fn at_radius(&self, a: f64, equation: &LayerEquation) -> Option<LogForce> {
        let ratio = a / self.thickness_m;
        let at = |x: f64| {
            let contact = equation.solve(x).ok()?;
            Some(contact.force_ratio_same_radius.ln())
        };
        let [high, low] = [HALF_STEP, -HALF_STEP].map(|step: f64| at(ratio * step.exp()));
        let slope = (high? - low?) / (2.0 * HALF_STEP);
        Some(self.ball.at_radius(a).corrected(at(ratio)?, slope, 0.0))
    }

    fn at_indentation(&self, d: f64, equation: &LayerEquation) -> Option<LogForce> {
        let chi = (self.ball.radius_m() * d).sqrt() / self.thickness_m;
        let (value, slope) = at_chi(equation, chi).filter(|c| c.0.is_finite())?;
        let hertz = self.ball.at_indentation(d);
        Some(hertz.corrected(value, 0.5 * slope, 0.5 * slope))
    }
}

impl ContactLaw for LayerLaw {
    fn log_force(&self, length: ContactLength, share: f64) -> Reach {
        let equation = LayerEquation::of_kernel(&self.kernel).with_share(1.0 - share);
        Reach::from(match length {
            ContactLength::Radius(a) => self.at_radius(a, &equation),
            ContactLength::Indentation(d) => self.at_indentation(d, &equation),
        })
    }

    fn limits(&self) -> Limits {
        Limits::of_ball(self.ball.radius_m(), SMALL_CONTACT)
    }
}

/// ln(F/F_Hertz) at χ and its slope in ln χ, by the secant method on ln(a/h).
fn at_chi(equation: &LayerEquation, chi: f64) -> Option<(f64, f64)> {
    let at = |log_a: f64| -> Option<LayerContact> { equation.solve(log_a.exp()).ok() };
    let target = chi.ln();
    let mut x = target;
    let mut slope = 1.0;
    let mut contact = at(x.min(LARGEST_START))?;
    for _ in 0..STEPS {
        let gap = contact.chi.ln() - target;
        if gap.abs() < SETTLED {
            break;
        }
        let next = x - gap / slope;
        let after = at(next)?;
        if next != x {
            slope = ((after.chi / contact.chi).ln() / (next - x)).clamp(0.1, 2.0);
        }
        (x, contact) = (next, after);
    }
    let (high, low) = (at(x + HALF_STEP)?, at(x - HALF_STEP)?);
    let derivative = (high.force_ratio / low.force_ratio).ln() / (high.chi / low.chi).ln();
    Some((contact.force_ratio.ln(), derivative))
}
