//! A sensor with its lens, light and layers and their errors, calibrated once and kept in a TOML
//! file.
//!
//! ```toml
//! date = "2026-11-22"
//! temperature_c = 22.5                   # may be left out
//! flat_field = true                      # frames are divided by the reference's own brightness
//! gauge_error = 1e-3                     # relative standard error of the gauge of all forces
//! coupling_error = 0.0                   # of the light of other objects than the calibrator, zero
//!                                        # under a fixed diffusing skin, 6 % if absent
//!
//! [geometry]
//! frame_px = [1392, 1042]                # columns and rows
//! covariance = [[…], …]                  # of the pixel's sizes in metres and of k₁, k₂
//! target_error = 5e-4                    # relative standard error of the target's own size
//! lens = { pixel_size_m = […], centre_px = […], radius_px = …, distortion = [k₁, k₂] }
//!
//! [noise]                                # of one pixel, in grey levels
//! read_variance = 0.34
//! gain = 0.017
//!
//! [light]                                # of the calibration's reference: 8 × 8 means and their
//! grey = […]                             # standard error. Forces are divided by the factor by
//! error_grey = 0.005                     # which a later reference is brighter
//!
//! [[layers]]                             # from the object's side to the glass
//! refractive_index = 1.41
//! thickness_m = 2e-3
//! youngs_modulus_pa = 1.36e5
//! poisson_ratio = 0.5
//!
//! # layer_covariance = [[…], …]          # of ln E of all layers, then of ln h, then of ν
//! # [curve]                              # the light-to-pressure curve, from the calibration
//! # [shear]                              # springs K_x and K_y, where they are known
//! ```
//!
//! [`SensorCalibration`] creates the file from presses of balls and punches of known radius. A
//! scene refers to it with `sensor = "sensor.toml"`.
mod calibration;
mod file;
mod findings;
mod gel;
mod input;
mod layers;
mod target;

pub use calibration::CalibratedSensor;
pub use file::{Sensor, SensorGeometry};
pub use findings::{LayerFinding, PressFinding, SensorError};
pub use gel::{CalibratedGel, GelFile, GelPixels, GelPresses};
pub use input::{Indenter, LayerInput, SensorCalibration, SensorPress};
