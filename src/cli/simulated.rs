//! Presses of the simulator that stand in for a user's own.
use tactile_imaging::pipeline::Trial;
use tactile_imaging::simulate::{CalibrationOptions, PressOptions, PressScene, SimulateError};

/// A press with the calibration of its sensor by a rigid ball that does not saturate the camera.
pub fn trial(options: PressOptions) -> Result<Trial, SimulateError> {
    let scene = PressScene::new(options.clone())?;
    Trial::new(options, &scene.unsaturated(CalibrationOptions::default())?)
}
