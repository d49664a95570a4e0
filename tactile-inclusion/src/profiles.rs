//! Measured pressures over the radius.

use crate::error::{Quantity, finite, positive};
use tactile_elasticity::ElasticityError;

/// Mean pressure in rings around the axis, of one frame.
///
/// ```
/// use tactile_inclusion::PressureProfile;
///
/// let frame = PressureProfile {
///     approach_m: 1e-3,
///     force_n: Some(0.35),
///     pressure_pa: vec![348.0; 12],
///     standard_error_pa: vec![0.3; 12],
/// };
/// assert_eq!(frame.pressure_pa.len(), frame.standard_error_pa.len());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PressureProfile {
    /// How far the guide was pressed into the block, in metres.
    pub approach_m: f64,
    /// Force on the guide in newtons, where it is known.
    pub force_n: Option<f64>,
    /// Mean pressure of each ring, in pascals.
    pub pressure_pa: Vec<f64>,
    /// White error of each ring's mean in pascals: a pixel's over the root of their number.
    pub standard_error_pa: Vec<f64>,
}

/// Checks that there are approaches, positive and growing.
pub(crate) fn check_approaches(
    approaches_m: impl Iterator<Item = f64>,
) -> Result<(), ElasticityError> {
    let mut last = 0.0;
    for approach in approaches_m {
        positive(approach, Quantity::Distance)?;
        if approach <= last {
            return Err(ElasticityError::OutOfRange {
                quantity: Quantity::Distance,
                found: approach,
                limit: last,
            });
        }
        last = approach;
    }
    if last == 0.0 {
        return Err(ElasticityError::TooFewLoads {
            expected: 1,
            found: 0,
        });
    }
    Ok(())
}

/// Checks frames against the rings' radii.
pub(crate) fn check(radii_m: &[f64], frames: &[PressureProfile]) -> Result<(), ElasticityError> {
    check_approaches(frames.iter().map(|frame| frame.approach_m))?;
    for &radius in radii_m {
        positive(radius, Quantity::Radius)?;
    }
    for frame in frames {
        if let Some(force) = frame.force_n {
            positive(force, Quantity::Force)?;
        }
        for (values, quantity) in [
            (&frame.pressure_pa, Quantity::Pressure),
            (&frame.standard_error_pa, Quantity::StandardError),
        ] {
            if values.len() != radii_m.len() {
                return Err(ElasticityError::LengthMismatch {
                    quantity,
                    expected: radii_m.len(),
                    found: values.len(),
                });
            }
        }
        for &pressure in &frame.pressure_pa {
            finite(pressure, Quantity::Pressure)?;
        }
        for &error in &frame.standard_error_pa {
            positive(error, Quantity::StandardError)?;
        }
    }
    Ok(())
}
