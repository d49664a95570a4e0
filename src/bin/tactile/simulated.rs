//! Presses of the simulator that stand in for a user's own.
use tactile_imaging::pipeline::Trial;
use tactile_imaging::simulate::{CalibrationOptions, PressOptions, SimulateError};

/// No indenter of the calibration is larger.
const LARGEST_RADIUS_M: f64 = 0.1;

/// A press with the calibration of its sensor, by the first rigid ball of 10, 20, 40 or 80 mm that does not saturate the camera: where the object is
/// large or soft, the gain that suits its low pressure is too high for a small one.
pub fn trial(options: PressOptions) -> Result<Trial, SimulateError> {
    let mut calibration = CalibrationOptions::default();
    loop {
        let trial = Trial::new(options.clone(), &calibration);
        let larger_m = 2.0 * calibration.indenter.radius_m;
        match trial {
            Err(SimulateError::CalibrationSaturates { .. }) if larger_m < LARGEST_RADIUS_M => {
                calibration.indenter.radius_m = larger_m;
            }
            done => return done,
        }
    }
}
