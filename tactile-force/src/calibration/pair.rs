//! Pairs of integrated pixel value and known force.

use crate::error::ForceError;

/// Whether the force was rising or falling when a pair was taken.
///
/// ```
/// use tactile_force::{Branch, CalibrationPair};
///
/// assert_eq!(CalibrationPair::loading(1e5, 0.5).branch, Branch::Loading);
/// assert_eq!(CalibrationPair::unloading(1e5, 0.5).branch, Branch::Unloading);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Branch {
    /// The force was rising.
    #[default]
    Loading,
    /// The force was falling.
    Unloading,
}

/// One calibration measurement.
///
/// ```
/// use tactile_force::CalibrationPair;
///
/// // A gauge's readings up and down again.
/// let readings = [(0.0, 0.0), (1.02e5, 0.5), (2.01e5, 1.0), (0.99e5, 0.5)];
/// let pairs: Vec<_> = readings
///     .iter()
///     .enumerate()
///     .map(|(k, &(v, f))| if k < 3 { CalibrationPair::loading(v, f) } else { CalibrationPair::unloading(v, f) })
///     .collect();
/// assert_eq!(pairs[3].force_n, 0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CalibrationPair {
    /// Sum of the grey-level differences over the contact.
    pub integrated_pixel_value: f64,
    /// Force from a reference instrument, in newtons.
    pub force_n: f64,
    /// Whether the force was rising or falling.
    pub branch: Branch,
}

impl CalibrationPair {
    /// A pair taken while the force was rising.
    pub fn loading(integrated_pixel_value: f64, force_n: f64) -> Self {
        Self {
            integrated_pixel_value,
            force_n,
            branch: Branch::Loading,
        }
    }

    /// A pair taken while the force was falling.
    pub fn unloading(integrated_pixel_value: f64, force_n: f64) -> Self {
        Self {
            integrated_pixel_value,
            force_n,
            branch: Branch::Unloading,
        }
    }
}

/// Refuses pairs that no fit can use: too few for the parameters, or not finite.
pub(super) fn check_pairs(pairs: &[CalibrationPair], parameters: usize) -> Result<(), ForceError> {
    let finite =
        |p: &CalibrationPair| p.integrated_pixel_value.is_finite() && p.force_n.is_finite();
    if let Some(index) = pairs.iter().position(|p| !finite(p)) {
        return Err(ForceError::NonFinitePair { index });
    }
    if pairs.len() <= parameters {
        return Err(ForceError::TooFewPairs {
            required: parameters + 1,
            found: pairs.len(),
        });
    }
    Ok(())
}
