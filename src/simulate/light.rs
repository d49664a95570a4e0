//! Pressure to light: how much brighter a pressed pixel is.

use super::error::{SimulateError, finite, not_negative, within};

/// Light that leaks under pressure p, relative to the gain g in grey levels per pascal. Both are monotone up to the
/// largest peak pressure p_max of the scene and exactly averaged over pixels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Response {
    /// g·p: the frame's sum is proportional to the force.
    #[default]
    Linear,
    /// g·p·(1 − κ p/p_max): bends down as fewer trapped rays are left to leak. κ in 0 to 0.5.
    Quadratic {
        /// κ, the share of light lost at p_max.
        droop: f64,
    },
}

impl Response {
    /// κ of g·p·(1 − κ p/p_max).
    pub(super) fn droop(&self) -> f64 {
        match *self {
            Self::Linear => 0.0,
            Self::Quadratic { droop } => droop,
        }
    }

    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        within("droop", self.droop(), 0.0, 0.5)
    }
}

/// The lamps' state during one frame, relative to the reference frame. It scales background and leaked light alike.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Illumination {
    /// Brightness, 1 for unchanged.
    pub level: f64,
    /// Relative change of brightness from the frame's first to its last column (x) and row (y); 0 for unchanged.
    pub tilt: [f64; 2],
}

impl Default for Illumination {
    fn default() -> Self {
        Self { level: 1.0, tilt: [0.0; 2] }
    }
}

impl Illumination {
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        not_negative("level", self.level)?;
        finite("tilt", self.tilt[0])?;
        finite("tilt", self.tilt[1])
    }
}
