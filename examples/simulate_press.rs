//! Writes a simulated press as a folder for `tactile measure`: frames, calibration, scene.toml.
//!
//! ```text
//! cargo run --release --example simulate_press -- target/press
//! ```
use std::error::Error;
use std::path::PathBuf;
use tactile_simulate::{CalibrationRun, Camera, PressOptions, PressScene, write_folder};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).unwrap_or("target/press".into());
    // Small frames with the field of view of the paper.
    let camera = Camera::default().coarser(8);
    let scene = PressScene::new(PressOptions {
        camera,
        ..PressOptions::default()
    })?;
    let calibration = scene.calibrate(&CalibrationRun {
        steps: 8,
        ..CalibrationRun::default()
    })?;
    write_folder(&scene, &calibration, &PathBuf::from(folder))?;
    Ok(())
}
