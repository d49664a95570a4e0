//! Presses of known force in addition to the frames.
use crate::arrays;
use ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::PyType;
use tactile_imaging::core::Estimate;
use tactile_imaging::pipeline::{self as rust, CheckedObject, KnownBall};

/// A press of known force, before or after the frames, for `Pipeline.with_checks`.
///
/// Forces are in newtons, lengths in metres and moduli in pascals. Errors are standard errors, with
/// the defaults 0.2 % of a force, 0.5 % of a radius, 2 % of a modulus and 0.01 of Poisson's ratio.
#[pyclass(frozen, module = "tactile_imaging")]
pub(crate) struct CheckPress {
    pub frame: Array2<u8>,
    pub known_n: Estimate,
    pub object: CheckedObject,
}

impl CheckPress {
    fn new(
        frame: &Bound<'_, PyAny>,
        force: f64,
        force_error: Option<f64>,
        object: CheckedObject,
    ) -> PyResult<Self> {
        Ok(Self {
            frame: arrays::frame("frame", frame)?.as_array().to_owned(),
            known_n: rust::CheckPress::force(force, force_error),
            object,
        })
    }
}

#[pymethods]
impl CheckPress {
    /// A press of the measured object, which gives the gain of the light and the optical coupling.
    #[classmethod]
    #[pyo3(signature = (frame, force, *, force_error=None))]
    fn sample(
        _class: &Bound<'_, PyType>,
        frame: &Bound<'_, PyAny>,
        force: f64,
        force_error: Option<f64>,
    ) -> PyResult<Self> {
        Self::new(frame, force, force_error, CheckedObject::Sample)
    }

    /// A press of the calibration object, which gives the gain of the light.
    #[classmethod]
    #[pyo3(signature = (frame, force, *, force_error=None))]
    fn calibrator(
        _class: &Bound<'_, PyType>,
        frame: &Bound<'_, PyAny>,
        force: f64,
        force_error: Option<f64>,
    ) -> PyResult<Self> {
        Self::new(frame, force, force_error, CheckedObject::Calibrator)
    }

    /// A press of a ball of known radius and modulus, which gives the layers of the waveguide. The
    /// ball is rigid if no modulus is given.
    #[classmethod]
    #[pyo3(signature = (
        frame, force, radius, *, force_error=None, radius_error=None, youngs_modulus=None,
        youngs_modulus_error=None, poisson_ratio=0.5, poisson_ratio_error=0.01
    ))]
    fn ball(
        _class: &Bound<'_, PyType>,
        frame: &Bound<'_, PyAny>,
        force: f64,
        radius: f64,
        force_error: Option<f64>,
        radius_error: Option<f64>,
        youngs_modulus: Option<f64>,
        youngs_modulus_error: Option<f64>,
        poisson_ratio: f64,
        poisson_ratio_error: f64,
    ) -> PyResult<Self> {
        let mut ball = KnownBall::rigid(KnownBall::radius(radius, radius_error));
        ball.youngs_modulus_pa =
            youngs_modulus.map(|modulus| KnownBall::modulus(modulus, youngs_modulus_error));
        ball.poisson_ratio = Estimate::new(poisson_ratio, poisson_ratio_error);
        Self::new(frame, force, force_error, CheckedObject::Ball(ball))
    }

    fn __repr__(&self) -> String {
        let object = match self.object {
            CheckedObject::Sample => "sample",
            CheckedObject::Calibrator => "calibrator",
            CheckedObject::Ball(_) => "ball",
            _ => "other",
        };
        format!("CheckPress.{object}({} N)", self.known_n.value)
    }
}
