//! Errors, each with what was expected and what was found.

use tactile_core::InvalidOption;
use tactile_elasticity::ElasticityError;
use tactile_match::MatchError;
use tactile_sfs::SfsError;
use thiserror::Error;

use crate::frame_check::FrameDoubt;

/// Why a gel's sensor has no answer.
///
/// ```
/// use tactile_gel::{GelError, GelSensor};
/// let flat = ndarray::Array3::from_elem((40, 60, 3), 90);
/// let error = GelSensor::calibrate(flat.view(), 5e-5, &[]).unwrap_err();
/// assert_eq!(error, GelError::TooFewPresses { needed: 3, available: 0 });
/// ```
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GelError {
    /// The image has no pixel.
    #[error("the image has no pixels ({rows} rows, {columns} columns)")]
    EmptyImage {
        /// Rows of the image.
        rows: usize,
        /// Columns of the image.
        columns: usize,
    },
    /// Two inputs of one call differ in shape.
    #[error("the {input} has shape {found:?} but {expected:?} (rows, columns) is needed")]
    ShapeMismatch {
        /// The input whose shape is wrong.
        input: &'static str,
        /// Rows and columns needed.
        expected: [usize; 2],
        /// Rows and columns found.
        found: [usize; 2],
    },
    /// An option outside its range.
    #[error(transparent)]
    InvalidOption(#[from] InvalidOption),
    /// Too few presses show a contact.
    #[error("{available} presses show a contact, {needed} are needed")]
    TooFewPresses {
        /// Presses needed.
        needed: usize,
        /// Presses with a contact.
        available: usize,
    },
    /// Presses are no frames of the reference's sensor.
    #[error("{presses} of {given} presses are no frames of the reference's sensor: {doubt}")]
    OtherFrames {
        /// Presses that are none.
        presses: usize,
        /// Presses given.
        given: usize,
        /// What the first of them shows.
        doubt: FrameDoubt,
    },
    /// The presses do not determine the sensor.
    #[error("the presses do not determine the sensor")]
    NoSolution,
    /// A frame of a known weight without contact.
    #[error("a frame of a known weight shows no contact that carries a force")]
    NoContact,
    /// A frame under one reading of a gauge with several contacts.
    #[error("a frame under one reading of a gauge shows several contacts")]
    SeveralContacts,
    /// The face cannot be integrated.
    #[error(transparent)]
    Surface(#[from] SfsError),
    /// Markers cannot be followed.
    #[error("no markers to follow: {0}")]
    Markers(#[from] MatchError),
    /// The law of the layer has no answer.
    #[error(transparent)]
    Law(#[from] ElasticityError),
}

/// Refuses an input of another shape.
pub(crate) fn same_shape(
    input: &'static str,
    expected: (usize, usize),
    found: (usize, usize),
) -> Result<(), GelError> {
    if found == expected {
        return Ok(());
    }
    Err(GelError::ShapeMismatch {
        input,
        expected: expected.into(),
        found: found.into(),
    })
}
