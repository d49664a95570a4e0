//! The errors that go into moduli, and the check of covariances that are given.

use super::covariance::Covariance;
use crate::error::{ElasticityError, Quantity};
use nalgebra::DMatrix;

/// The covariance of logarithms of moduli from one source of error, and its degrees of freedom: those of the least known error, for
/// repetition does not improve a standard error that all loads take from one calibration.
pub(super) type LogErrors = (Covariance, Option<f64>);

/// The covariance of all sources together, which are independent of one another.
pub(super) fn total(sources: &[LogErrors]) -> Covariance {
    let [first, rest @ ..] = sources else {
        return Covariance::none(std::iter::empty());
    };
    rest.iter()
        .fold(first.0.clone(), |sum, source| sum.plus(&source.0))
}

/// Refuses a covariance with an entry that is not a number.
pub(super) fn finite(covariance: &DMatrix<f64>, quantity: Quantity) -> Result<(), ElasticityError> {
    if covariance.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(ElasticityError::NotFinite { quantity })
    }
}

/// The covariance, if it has a row and a column for every load.
pub(super) fn checked(
    covariance: &DMatrix<f64>,
    loads: usize,
    quantity: Quantity,
) -> Result<&DMatrix<f64>, ElasticityError> {
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
