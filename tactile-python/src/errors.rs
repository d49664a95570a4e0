//! Exceptions: by kind, with the message of the error and the Python exception that caused it.
use pyo3::exceptions::{PyException, PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::error::Error;
use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tactile_files::io::FileError;
use tactile_files::sensor::SensorError;
use tactile_imaging::StrainBetweenError;
use tactile_imaging::core::CustomError;
use tactile_imaging::elasticity::ElasticityError;
use tactile_imaging::force::ForceError;
use tactile_imaging::matching::MatchError;
use tactile_imaging::pipeline::{PipelineError, PipelineErrorKind};
use tactile_imaging::sfs::SfsError;
use tactile_imaging::tps::TpsError;

pyo3::create_exception!(
    tactile_imaging,
    TactileError,
    PyRuntimeError,
    "Valid input without a result: no contact, too few matches, or a failed stage in Python."
);

/// The exception for an invalid argument.
pub(crate) fn invalid(sentence: impl ToString) -> PyErr {
    PyValueError::new_err(sentence.to_string())
}

/// If an error contains the exception of a stage in Python: an exception with the message of the
/// error, caused by it. Other exceptions than `Exception`, such as `KeyboardInterrupt`, are raised
/// unchanged.
fn caused(error: &(dyn Error + 'static)) -> Option<PyErr> {
    let mut link = error;
    let cause = loop {
        match own_failure(link).and_then(|own| own.get_ref().downcast_ref::<PyErr>()) {
            Some(cause) => break cause,
            None => link = link.source()?,
        }
    };
    Some(Python::attach(|py| {
        let cause = cause.clone_ref(py);
        if !cause.is_instance_of::<PyException>(py) {
            return cause;
        }
        let raised = TactileError::new_err(error.to_string());
        raised.set_cause(py, Some(cause));
        raised
    }))
}

/// The failure of a user-defined stage in an error of a crate.
fn own_failure<'e>(error: &'e (dyn Error + 'static)) -> Option<&'e CustomError> {
    macro_rules! of {
        ($($kind:ident),*) => {
            $(if let Some($kind::Custom(own)) = error.downcast_ref() {
                return Some(own);
            })*
        };
    }
    of!(ForceError, SfsError, MatchError, TpsError, ElasticityError);
    None
}

/// The exception for a failed measurement.
pub(crate) fn failed(error: impl Error + 'static) -> PyErr {
    caused(&error).unwrap_or_else(|| TactileError::new_err(error.to_string()))
}

/// The exception for an error caused by the arguments, unless a stage in Python failed.
pub(crate) fn refused(error: impl Error + 'static) -> PyErr {
    caused(&error).unwrap_or_else(|| invalid(error))
}

pub(crate) fn pipeline(error: PipelineError) -> PyErr {
    caused(&error).unwrap_or_else(|| match error.kind() {
        PipelineErrorKind::Options | PipelineErrorKind::Input => invalid(error),
        _ => TactileError::new_err(error.to_string()),
    })
}

pub(crate) fn strain_between(error: StrainBetweenError) -> PyErr {
    match error {
        StrainBetweenError::Match(MatchError::Custom(_))
        | StrainBetweenError::NotSmooth
        | StrainBetweenError::Doubtful(_) => failed(error),
        _ => refused(error),
    }
}

pub(crate) fn file(error: FileError) -> PyErr {
    match error {
        FileError::Write { .. } | FileError::Read { .. } => PyOSError::new_err(error.to_string()),
        _ => invalid(error),
    }
}

pub(crate) fn sensor(error: SensorError) -> PyErr {
    match error {
        SensorError::File(error) => file(error),
        _ => refused(error),
    }
}

/// Time between two checks for a signal: rare enough for negligible cost, and often enough for a
/// user, who is answered within a tenth of a second.
const BETWEEN_CHECKS: Duration = Duration::from_millis(40);

/// Lets `KeyboardInterrupt` stop long computations: called at every step, it checks from time to time.
pub(crate) struct Signals {
    looked: Instant,
    raised: Option<PyErr>,
}

impl Signals {
    pub(crate) fn new() -> Self {
        Self {
            looked: Instant::now(),
            raised: None,
        }
    }

    /// Whether the computation continues.
    pub(crate) fn check(&mut self) -> ControlFlow<()> {
        // A raised exception is kept until `finish`, however often `check` is called again.
        if self.raised.is_none() && self.looked.elapsed() > BETWEEN_CHECKS {
            self.looked = Instant::now();
            self.raised = Python::attach(|py| py.check_signals().err());
        }
        match self.raised {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    }

    pub(crate) fn finish(&mut self) -> PyResult<()> {
        self.raised.take().map_or(Ok(()), Err)
    }

    /// Runs a computation that cannot be stopped on a thread of its own. `None` after a signal: the
    /// thread then computes to its end without effect.
    pub(crate) fn beside<T: Send + 'static>(
        &mut self,
        work: impl Send + FnOnce() -> T + 'static,
    ) -> Option<T> {
        let (sender, receiver) = mpsc::channel();
        // Nobody receives what is computed after a signal.
        std::thread::spawn(move || sender.send(work()).is_ok());
        loop {
            match receiver.recv_timeout(BETWEEN_CHECKS) {
                Ok(found) => return Some(found),
                Err(RecvTimeoutError::Timeout) if self.check().is_continue() => {}
                Err(_) => return None,
            }
        }
    }

    /// Runs without the interpreter lock, until the end or a `KeyboardInterrupt`.
    pub(crate) fn during<T: Send>(
        py: Python<'_>,
        work: impl Send + FnOnce(&mut Self) -> T,
    ) -> PyResult<T> {
        let mut signals = Self::new();
        let found = py.detach(|| work(&mut signals));
        signals.finish()?;
        Ok(found)
    }
}

/// A check for a signal, for stages that other threads may run.
pub(crate) fn watch_of(
    signals: &Arc<Mutex<Signals>>,
) -> impl Fn() -> ControlFlow<()> + Send + Sync + 'static {
    let signals = Arc::clone(signals);
    move || {
        let mut signals = signals.lock().unwrap_or_else(|broken| broken.into_inner());
        signals.check()
    }
}
