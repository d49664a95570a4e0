//! Errors with the expected and the found values.

use tactile_core::InvalidOption;
use tactile_elasticity::ElasticityError;
use tactile_match::MatchError;
use tactile_sfs::SfsError;
use thiserror::Error;

use crate::frame_check::FrameDoubt;

/// Why a gel sensor cannot give a result.
///
/// ```
/// use tactile_gel::{GelError, GelSensor};
/// let flat = ndarray::Array3::from_elem((40, 60, 3), 90);
/// let error = GelSensor::calibrate(&flat, 5e-5, &[]).unwrap_err();
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
        /// The input with the wrong shape.
        input: &'static str,
        /// Rows and columns needed.
        expected: [usize; 2],
        /// Rows and columns found.
        found: [usize; 2],
    },
    /// The frame has grey levels and the gel is lit in colours, or the reverse.
    #[error("{}", if *.colours { COLOURS } else { GREY })]
    WrongImage {
        /// Whether colours are needed.
        colours: bool,
    },
    /// An option is outside its range.
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
    /// Most presses do not come from the sensor of the reference.
    #[error("{presses} of {given} presses do not come from the sensor of the reference: {doubt}")]
    OtherFrames {
        /// Number of such presses.
        presses: usize,
        /// Presses given.
        given: usize,
        /// The doubt about the first of them.
        doubt: FrameDoubt,
    },
    /// The frame does not come from this sensor.
    #[error("the frame does not come from this sensor: {0}")]
    OtherFrame(FrameDoubt),
    /// The presses do not determine the sensor.
    #[error("the presses do not determine the sensor")]
    NoSolution,
    /// A frame of a known weight shows no contact.
    #[error("a frame of a known weight shows no contact with a force")]
    NoContact,
    /// A frame under one gauge reading shows several contacts.
    #[error("a frame under one reading of a gauge shows several contacts")]
    SeveralContacts,
    /// The face cannot be integrated.
    #[error(transparent)]
    Surface(#[from] SfsError),
    /// Markers cannot be followed.
    #[error("no markers to follow: {0}")]
    Markers(#[from] MatchError),
    /// The law of the layer failed.
    #[error(transparent)]
    Law(#[from] ElasticityError),
}

const COLOURS: &str = "the frame has grey levels, but the gel is lit in colours: three channels \
                       are needed";
const GREY: &str = "the frame has colours, but the gel darkens: grey levels are needed, converted \
                    as for its table";

/// Rejects an input of another shape.
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
