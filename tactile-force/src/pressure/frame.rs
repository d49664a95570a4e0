//! One frame of a calibration.

use crate::calibration::{Branch, GreyHistogram};
use crate::error::ForceError;
use tactile_core::Requirement;

/// The grey histogram of a contact under a known force.
///
/// ```
/// use tactile_force::{Branch, CalibrationFrame, GreyHistogram};
///
/// let histogram = GreyHistogram::from_differences([40.0; 500].into_iter(), 4e-10);
/// assert!(CalibrationFrame::new(histogram.clone(), 0.31, Branch::Loading).is_ok());
/// assert!(CalibrationFrame::new(histogram, f64::NAN, Branch::Loading).is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationFrame {
    pub(super) histogram: GreyHistogram,
    pub(super) force_n: f64,
    pub(super) branch: Branch,
}

impl CalibrationFrame {
    /// A frame whose contact has this histogram while a gauge shows this force, rising or falling.
    ///
    /// # Errors
    /// A force that is negative or not finite.
    pub fn new(histogram: GreyHistogram, force_n: f64, branch: Branch) -> Result<Self, ForceError> {
        Requirement::NonNegative.check("force_n", force_n)?;
        Ok(Self {
            histogram,
            force_n,
            branch,
        })
    }
}
