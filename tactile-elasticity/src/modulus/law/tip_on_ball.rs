//! A rigid tip on a soft ball that lies on a rigid plate.

use super::{ContactLaw, LogForce, Sphere};
use crate::error::{ElasticityError, Quantity, positive};
use crate::modulus::EstimatorKind;

/// Hertz at both contacts of the ball: the same force flattens it under the tip, with 1/R₁ = 1/R_tip + 1/R_ball, and on the plate,
/// with R₂ = R_ball. Indentations go as (F/E*)^⅔ R^(−⅓) and add up, so that both act as one contact of radius R with
/// R^(−⅓) = R₁^(−⅓) + R₂^(−⅓).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TipOnBallLaw {
    both: Sphere,
    /// Of the contact under the tip, the smaller.
    tip_radius_m: f64,
    /// The tip's part of the indentation.
    tip_part: f64,
}

impl TipOnBallLaw {
    pub(crate) fn new(tip_radius_m: f64, ball_radius_m: f64) -> Result<Self, ElasticityError> {
        let tip = positive(tip_radius_m, Quantity::Radius)?;
        let ball = positive(ball_radius_m, Quantity::Radius)?;
        let relative = tip / (tip + ball) * ball;
        let (under_tip, on_plate) = (relative.cbrt().recip(), ball.cbrt().recip());
        Ok(Self {
            both: Sphere::new((under_tip + on_plate).powi(-3))?,
            tip_radius_m: relative,
            tip_part: under_tip / (under_tip + on_plate),
        })
    }
}

impl ContactLaw for TipOnBallLaw {
    fn kind(&self) -> EstimatorKind {
        EstimatorKind::TipOnBall
    }

    fn of_contact_radius(&self, _: f64, _: f64) -> Option<LogForce> {
        None
    }

    fn of_indentation(&self, d: f64, share: f64) -> Option<LogForce> {
        self.both.of_indentation(d, share)
    }

    fn contact_ratio(&self, _: Option<f64>, indentation: Option<f64>) -> Option<f64> {
        indentation.map(|d| (self.tip_part * d / self.tip_radius_m).sqrt())
    }

    fn contact_ratio_limit(&self) -> f64 {
        self.both.contact_ratio_limit()
    }
}
