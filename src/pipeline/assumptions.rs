//! What presses of known force show of the sensor.
use super::text::with_error;
use crate::core::Estimate;
use std::fmt::{self, Display, Formatter};

/// The gain that presses of known force show. Forces that are read from light are divided by it,
/// and its error stands in place of
/// [`Settings::coupling_error`](crate::pipeline::Settings::coupling_error).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CheckedGain {
    /// Force that is read over force that is known.
    pub gain: Estimate,
    /// Standard deviation of the gain between presses beyond their own errors, relative. The error
    /// of the gain allows for it, and for 0.5 % where it is less.
    pub drift: f64,
    /// The number of presses.
    pub presses: usize,
}

impl Display for CheckedGain {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let gain = with_error(self.gain.value, self.gain.standard_error, 1.0);
        let s = if self.presses == 1 { "" } else { "es" };
        write!(
            f,
            "forces read from light are divided by {gain} ({} press{s} of known force)",
            self.presses
        )?;
        match self.drift {
            0.0 => Ok(()),
            drift => write!(f, ", which drifts by {:.1} %", 100.0 * drift),
        }
    }
}

/// What presses of balls of known modulus show of the guide's layers. The layers of the pipeline
/// and their covariance are those after the presses.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct CheckedGuide {
    /// Stiffness of the guide under contacts of the presses' mean radius, over that as stated.
    pub stiffness: Estimate,
    /// The number of presses.
    pub presses: usize,
}

impl Display for CheckedGuide {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let stiffness = self.stiffness;
        let ratio = with_error(stiffness.value, stiffness.standard_error, 1.0);
        let s = if self.presses == 1 { "" } else { "es" };
        write!(
            f,
            "the guide is {ratio} times as stiff as stated ({} press{s} of known balls)",
            self.presses
        )
    }
}
