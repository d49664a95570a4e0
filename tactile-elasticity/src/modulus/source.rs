//! Errors of forces, areas and strains: independent of one another, each with a covariance over the loads.

use super::load::Estimate;
use super::statistics::fewest;
use crate::error::{ElasticityError, Quantity};
use nalgebra::{DMatrix, DVector, RealField};

/// The covariance of logarithms of moduli from one source of error, and its degrees of freedom.
pub(super) type LogErrors = (DMatrix<f64>, Option<f64>);

/// Errors of one quantity over all loads.
pub(super) struct Source {
    covariance: DMatrix<f64>,
    /// Those of the least known error: repetition does not improve a standard error that all loads take from one calibration.
    degrees: Option<f64>,
}

impl Source {
    /// Of the loads' own standard errors; of `covariance` instead, where it was given.
    pub(super) fn new(
        estimates: &[Option<Estimate<f64>>],
        covariance: Option<&DMatrix<f64>>,
    ) -> Self {
        let degrees = fewest(estimates.iter().flatten().map(|e| e.degrees_of_freedom));
        let own = estimates
            .iter()
            .map(|e| e.map_or(0.0, |e| e.standard_error.powi(2)));
        let covariance = match covariance {
            Some(given) => given.clone(),
            None => DMatrix::from_diagonal(&DVector::from_iterator(estimates.len(), own)),
        };
        Self {
            covariance,
            degrees,
        }
    }

    /// Covariance, with its degrees of freedom, of what follows the quantity with these slopes: a row a result, a column a load.
    pub(super) fn through(&self, slopes: &DMatrix<f64>) -> LogErrors {
        (slopes * &self.covariance * slopes.transpose(), self.degrees)
    }
}

/// Refuses a covariance with an entry that is not a number.
pub(super) fn finite<T: RealField + Copy>(
    covariance: &DMatrix<T>,
    quantity: Quantity,
) -> Result<(), ElasticityError> {
    if covariance.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(ElasticityError::NotFinite { quantity })
    }
}

/// The covariance, if it has a row and a column for every load.
pub(super) fn checked<T: RealField + Copy>(
    covariance: &DMatrix<T>,
    loads: usize,
    quantity: Quantity,
) -> Result<&DMatrix<T>, ElasticityError> {
    match [covariance.nrows(), covariance.ncols()]
        .into_iter()
        .find(|&n| n != loads)
    {
        Some(found) => Err(ElasticityError::LengthMismatch {
            quantity,
            expected: loads,
            found,
        }),
        None => Ok(covariance),
    }
}
