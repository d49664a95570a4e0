//! Exceptions: by kind, with the sentence of the error, and with the Python error that caused it.
use pyo3::exceptions::{PyException, PyIndexError, PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::error::Error;
use std::ops::ControlFlow;
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
    "Valid input without an answer: no contact, too few matches, a stage in Python that failed."
);

/// An argument that a caller has to change.
pub(crate) fn invalid(sentence: impl ToString) -> PyErr {
    PyValueError::new_err(sentence.to_string())
}

/// The exception of a stage in Python that an error carries, as the cause of one with the error's
/// sentence. What is no `Exception`, as `KeyboardInterrupt`, is raised itself.
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

/// The failure of a caller's own stage that an error of a crate is.
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

/// A failure of a measurement.
pub(crate) fn failed(error: impl Error + 'static) -> PyErr {
    caused(&error).unwrap_or_else(|| TactileError::new_err(error.to_string()))
}

/// An error that a caller mends by other arguments, unless a stage in Python failed.
pub(crate) fn refused(error: impl Error + 'static) -> PyErr {
    caused(&error).unwrap_or_else(|| invalid(error))
}

pub(crate) fn pipeline(error: PipelineError) -> PyErr {
    let sentence = from_zero(&error.to_string());
    caused(&error).unwrap_or_else(|| match (&error, error.kind()) {
        (PipelineError::NoSuchFrame { .. }, _) => PyIndexError::new_err(sentence),
        (_, PipelineErrorKind::Options | PipelineErrorKind::Input) => invalid(sentence),
        _ => TactileError::new_err(sentence),
    })
}

/// A sentence of the library, which counts frames from one, with the numbers of the calls, which
/// count from zero.
pub(crate) fn from_zero(sentence: &str) -> String {
    let mut after = "";
    let words = sentence.split_inclusive(' ').map(|word| {
        let digits = word.len() - word.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let counts = matches!(after, "frame" | "Frame" | "frames" | "Frames");
        let number = word[..digits]
            .parse::<u64>()
            .ok()
            .filter(|n| counts && *n > 0);
        // "frames 1 and 2".
        if !(counts && (digits > 0 || word.trim() == "and")) {
            after = word.trim_matches(|c: char| !c.is_alphabetic());
        }
        match number {
            Some(number) => format!("{}{}", number - 1, &word[digits..]),
            None => word.to_owned(),
        }
    });
    words.collect()
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

/// Lets `KeyboardInterrupt` end long work: asked at every step of it, which it looks for at times.
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

    /// Whether the work goes on.
    pub(crate) fn check(&mut self) -> ControlFlow<()> {
        // Rare enough to cost nothing, often enough for a person.
        // What was raised once stays raised until `finish`, however often the work asks again.
        if self.raised.is_none() && self.looked.elapsed() > Duration::from_millis(50) {
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

    /// Works without the interpreter's lock, until it is done or `KeyboardInterrupt` ends it.
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
