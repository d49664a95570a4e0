//! The result of a measurement.

use crate::calibration::ForceReading;
use crate::contact::{Contact, Detection};
use crate::drift::IlluminationDrift;
use crate::frame::{DifferenceNoise, FrameStatistics};
use crate::hertz::HertzFit;
use tactile_core::Estimate;
use tactile_core::statistics::effective_degrees_of_freedom;

/// Force, contact and stress measured in one frame.
///
/// ```
/// use ndarray::Array2;
/// use tactile_force::{CalibrationPair, ForceMeasurement, LinearCalibration, measure_force};
///
/// let pairs = [0.0, 1e5, 2e5].map(|v| CalibrationPair::loading(v, 1e-5 * v));
/// let calibration = LinearCalibration::fit(&pairs, &Default::default())?;
/// let at_rest = Array2::from_elem((64, 64), 12_u8);
/// let m: ForceMeasurement =
///     measure_force(at_rest.view(), at_rest.view(), [20e-6; 2], &calibration, &Default::default())?;
/// // No contact is an answer, not an error.
/// assert_eq!((m.force_n.value, m.contact, m.mean_stress_pa), (0.0, None, None));
/// # Ok::<(), tactile_force::ForceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceMeasurement {
    /// Normal force in newtons, equation (6); zero without contact.
    pub force_n: Estimate,
    /// The parts of the force's error, and whether the calibration was used outside its range; `None` without contact.
    pub reading: Option<ForceReading>,
    /// The contact; `None` if the frame shows none.
    pub contact: Option<Contact>,
    /// The fitted Hertz profile, if it was asked for and could be fitted.
    pub profile: Option<HertzFit>,
    /// Centroid [x, y] in metres from the centre of the first pixel, equations (7) and (8).
    pub centroid_m: Option<[Estimate; 2]>,
    /// Area of the mask in square metres.
    pub contact_area_m2: Option<f64>,
    /// Contact radius in metres: the profile's, else the mask's equivalent radius with half a pixel as its error.
    pub contact_radius_m: Option<Estimate>,
    /// F/(π a²) in pascals.
    pub mean_stress_pa: Option<Estimate>,
    /// Stress at the centre in pascals: the profile's peak, else the greatest difference, through the calibration.
    pub peak_stress_pa: Option<Estimate>,
    /// Longer over shorter half axis of the contact's outline, less one, where that stands out of what whole pixels leave and exceeds
    /// 0.5 %: pixels that are not as stated, a lens that distorts, or an object that is not round.
    pub elongation: Option<f64>,
    /// Sums over the whole frame.
    pub statistics: FrameStatistics,
    /// The correction of illumination and stray light.
    pub drift: IlluminationDrift,
    /// The noise that the errors are computed from; `None` without contact.
    pub noise: Option<DifferenceNoise>,
}

impl ForceMeasurement {
    pub(super) fn without_contact(found: Detection) -> Self {
        Self {
            force_n: Estimate::default(),
            reading: None,
            contact: None,
            profile: None,
            centroid_m: None,
            contact_area_m2: None,
            contact_radius_m: None,
            mean_stress_pa: None,
            peak_stress_pa: None,
            elongation: None,
            statistics: found.statistics,
            drift: found.drift,
            noise: None,
        }
    }
}

/// The profile's radius, else the mask's with half a pixel as its error; `side` is that of a square pixel of equal area.
pub(super) fn contact_radius(contact: &Contact, profile: Option<HertzFit>, side: f64) -> Estimate {
    let half = 0.5 * side;
    let of_mask = Estimate::new(contact.equivalent_radius_px * side, half);
    profile.map_or(of_mask, |p| p.radius_m)
}

/// F/(π a²) with its standard error.
pub(super) fn mean_stress(force: Estimate, radius: Estimate) -> Estimate {
    let pi = std::f64::consts::PI;
    let value = force.value / (pi * radius.value * radius.value);
    let parts = [
        (force.relative_error().powi(2), force.degrees_of_freedom),
        (
            4.0 * radius.relative_error().powi(2),
            radius.degrees_of_freedom,
        ),
    ];
    let variance = value * value * (parts[0].0 + parts[1].0);
    let mut stress = Estimate::from_variance(value, variance);
    stress.degrees_of_freedom = effective_degrees_of_freedom(&parts);
    stress
}
