//! Presses of the simulator that stand in for a user's own.
use tactile_simulate::Trial;
use tactile_simulate::{CalibrationRun, PressOptions, SimulateError};

/// A press with the default calibration of its sensor.
pub fn trial(options: PressOptions) -> Result<Trial, SimulateError> {
    Trial::new(options, &CalibrationRun::default())
}
