#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod calibration;
mod contacts;
mod error;
mod force;
mod gradients;
mod sensor;

pub use calibration::{BallPress, CalibrationReport, CircleFinding};
pub use error::GelError;
pub use force::{GelForce, GelLayer};
pub use sensor::{GelFrame, GelModel, GelSensor};
pub use {nalgebra, ndarray};
