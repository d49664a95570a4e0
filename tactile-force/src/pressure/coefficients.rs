//! The coefficients of a curve and their covariance.

use super::basis::{Basis, KNOTS, Knots};
use super::nonnegative::Normal;
#[cfg(feature = "serde")]
use crate::error::ForceError;
use tactile_core::Estimate;
use tactile_core::Requirement;

/// Slopes at the knots in Pa per grey level, and their covariance.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub(super) struct Coefficients {
    pub(super) basis: Basis,
    pub(super) slopes: [f64; KNOTS],
    /// Symmetric, column by column.
    pub(super) covariance: [[f64; KNOTS]; KNOTS],
    pub(super) degrees_of_freedom: f64,
}

impl Coefficients {
    /// Refuses what no fit gives: a curve that falls, or numbers that are not finite.
    #[cfg(feature = "serde")]
    pub(super) fn checked(self) -> Result<Self, ForceError> {
        Requirement::Positive.check("basis.top", self.basis.top)?;
        Requirement::Positive.check("degrees_of_freedom", self.degrees_of_freedom)?;
        for slope in self.slopes {
            Requirement::NonNegative.check("slopes", slope)?;
        }
        Requirement::Positive.check("the greatest of slopes", self.slopes().max())?;
        for (j, row) in self.covariance.iter().enumerate() {
            row.iter()
                .try_for_each(|c| Requirement::Finite.check("covariance", *c).map(drop))?;
            Requirement::NonNegative.check("the diagonal of covariance", row[j])?;
        }
        Ok(self)
    }

    pub(super) fn pressure_pa(&self, grey: f64) -> Estimate {
        let row = self.basis.integrals(grey);
        Estimate::from_variance(row.dot(&self.slopes()), self.variance(&row))
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
