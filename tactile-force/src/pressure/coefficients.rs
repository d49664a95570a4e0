//! The coefficients of a curve and their covariance.

use super::basis::{Basis, KNOTS, Knots};
use super::nonnegative::Normal;
use crate::estimate::Estimate;

/// Slopes at the knots in Pa per grey level, and their covariance.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Coefficients {
    pub(super) basis: Basis,
    pub(super) slopes: [f64; KNOTS],
    /// Symmetric, column by column.
    pub(super) covariance: [[f64; KNOTS]; KNOTS],
    pub(super) degrees_of_freedom: f64,
}

impl Coefficients {
    pub(super) fn pressure_pa(&self, grey: f64) -> Estimate<f64> {
        let row = self.basis.integrals(grey);
        Estimate::nearest(row.dot(&self.slopes()), self.variance(&row))
    }

    /// Slopes at the knots.
    pub(super) fn slopes(&self) -> Knots {
        Knots::from(self.slopes)
    }

    /// Variance of a sum of slopes with these factors.
    pub(super) fn variance(&self, row: &Knots) -> f64 {
        row.dot(&(Normal::from(self.covariance) * row))
    }
}
