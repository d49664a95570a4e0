//! Exceptions: by kind, with the sentence of the error, and with the Python error that caused it.
use pyo3::exceptions::{PyIndexError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::error::Error;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::matching::MatchError;
use tactile_imaging::pipeline::PipelineError;
use tactile_imaging::{StrainBetweenError, tps::TpsError};

pyo3::create_exception!(
    tactile_imaging,
    TactileError,
    PyRuntimeError,
    "A measurement that cannot be made from valid input: no contact, too few matches, a failed stage."
);

/// An error that a caller mends by other arguments.
pub fn invalid(error: impl ToString) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A failure of a measurement, caused by the exception of a stage in Python where one was raised.
pub fn failed(error: &(dyn Error + 'static)) -> PyErr {
    let raised = TactileError::new_err(error.to_string());
    let mut link = Some(error);
    while let Some(error) = link {
        if let Some(cause) = error.downcast_ref::<PyErr>() {
            Python::attach(|py| raised.set_cause(py, Some(cause.clone_ref(py))));
            break;
        }
        link = error.source();
    }
    raised
}

pub fn pipeline(error: PipelineError) -> PyErr {
    use PipelineError as E;
    match error {
        E::NoSuchFrame { .. } => PyIndexError::new_err(error.to_string()),
        E::Sensor(_)
        | E::Calibration(_)
        | E::SurfaceOptions(_)
        | E::WarpOptions(_)
        | E::NoSlopes
        | E::DepthTable(_)
        | E::Material(_)
        | E::ScaleError { .. }
        | E::InputError { .. }
        | E::EvenSmoothing { .. }
        | E::EmptyBlocks
        | E::Contact { .. }
        | E::WrongEstimator { .. } => invalid(error),
        _ => failed(&error),
    }
}

pub fn matching(error: MatchError) -> PyErr {
    match error {
        MatchError::Custom(_) => failed(&error),
        _ => invalid(error),
    }
}

pub fn spline(error: TpsError) -> PyErr {
    invalid(error)
}

pub fn elasticity(error: ElasticityError) -> PyErr {
    invalid(error)
}

pub fn strain_between(error: StrainBetweenError) -> PyErr {
    match error {
        StrainBetweenError::Match(error) => matching(error),
        StrainBetweenError::TooFewPairs { .. } => invalid(error),
        _ => failed(&error),
    }
}
