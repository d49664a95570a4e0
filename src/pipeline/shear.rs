//! Shear along a stream, from the contact's reading.
use super::contact::ContactReading;
use crate::force::{Estimate, ShearCalibration, ShearMeasurement};

/// Follows the centroid from frame to frame, as [`ShearTracker`](crate::force::ShearTracker) does, for any contact stage.
#[derive(Clone, Debug)]
pub(super) struct ShearFollower {
    calibration: ShearCalibration<f64>,
    first: Option<[Estimate<f64>; 2]>,
    last: Option<[Estimate<f64>; 2]>,
}

impl ShearFollower {
    pub(super) fn new(calibration: ShearCalibration<f64>) -> Self {
        Self { calibration, first: None, last: None }
    }

    /// The shear of the next frame, F = K u (equations (11) and (12)), u counted from where contact began. Without contact
    /// there is none, and the next contact starts anew.
    pub(super) fn update(
        &mut self,
        reading: Option<&ContactReading>,
        pixel_size_m: [f64; 2],
    ) -> Option<ShearMeasurement<f64>> {
        let Some(reading) = reading else {
            (self.first, self.last) = (None, None);
            return None;
        };
        let now = std::array::from_fn(|k| reading.centroid_px[k].scaled(pixel_size_m[k]));
        let first = *self.first.get_or_insert(now);
        let displacement_m =
            if self.last.is_some() { difference(now, first) } else { [Estimate::default(); 2] };
        let step_m = self.last.map_or([Estimate::default(); 2], |last| difference(now, last));
        self.last = Some(now);
        Some(ShearMeasurement { displacement_m, step_m, force_n: self.calibration.force_n(displacement_m) })
    }
}

fn difference(to: [Estimate<f64>; 2], from: [Estimate<f64>; 2]) -> [Estimate<f64>; 2] {
    std::array::from_fn(|k| Estimate {
        value: to[k].value - from[k].value,
        standard_error: to[k].standard_error.hypot(from[k].standard_error),
    })
}
