//! Calibrations that hold pixel by pixel.

use super::{ForceReading, GreyHistogram};
use crate::frame::DifferenceNoise;
use tactile_core::Estimate;

/// Grey level to pressure pixel by pixel: f of (5) itself, not only its integral over a contact.
///
/// A [`StressCalibration`](super::StressCalibration) that has one returns it from
/// [`local`](super::StressCalibration::local); a [`ForceMeter`](crate::ForceMeter) then fits the contact's radius to the pressure
/// instead of the light.
///
/// ```
/// use tactile_force::{DifferenceNoise, Estimate, ForceReading, GreyHistogram, LocalCalibration};
///
/// /// Light exactly proportional to the pressure.
/// struct Proportional {
///     pa_per_grey: f64,
/// }
///
/// impl LocalCalibration for Proportional {
///     fn pressure_pa(&self, grey: f64) -> Estimate {
///         Estimate::new(self.pa_per_grey * grey, 0.0)
///     }
///
///     fn read(&self, histogram: &GreyHistogram, _noise: &DifferenceNoise) -> ForceReading {
///         let force_n = Estimate::new(histogram.integral(|g| self.value_pa(g)), 0.0);
///         ForceReading { force_n, noise_n: 0.0, calibration_n: 0.0, degrees_of_freedom: None, out_of_range: false }
///     }
/// }
///
/// let histogram = GreyHistogram::from_differences([50.0; 200].into_iter(), 4e-10);
/// let noise = DifferenceNoise { background: 2.0, gain: 0.0, common: 0.0, scale: 0.0, flat_field: 0.0 };
/// let force = Proportional { pa_per_grey: 100.0 }.read(&histogram, &noise).force_n.value;
/// assert!((force - 4e-4).abs() < 1e-15);
/// ```
pub trait LocalCalibration: Send + Sync {
    /// Pressure in pascals of a grey-level difference, with its standard error. Rises with the grey level and is zero at zero.
    fn pressure_pa(&self, grey: f64) -> Estimate;

    /// The pressure alone, for tables: what [`pressure_pa`](Self::pressure_pa) has as its value.
    fn value_pa(&self, grey: f64) -> f64 {
        self.pressure_pa(grey).value
    }

    /// Force of a contact from its histogram, Σ A(g) f(g), with its errors.
    fn read(&self, histogram: &GreyHistogram, noise: &DifferenceNoise) -> ForceReading;
}
