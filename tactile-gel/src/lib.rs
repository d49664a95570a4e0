#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod ball;
mod calibration;
mod colour;
mod contacts;
mod dark_calibration;
mod darkness;
mod dots;
mod error;
mod face;
mod force;
mod frame_check;
mod gauge;
mod gel_markers;
mod gradients;
mod image;
mod integration;
mod layer;
mod marker_field;
mod markers;
mod model;
mod plane;
mod rest;
mod sensor;
#[cfg(feature = "simulate")]
pub mod simulate;

pub use ball::BallFace;
pub use calibration::{BallPress, CalibrationDoubt, CalibrationReport, CircleFinding};
pub use error::GelError;
pub use face::{GelContact, GelFrame};
pub use force::{GelForce, GelLaw, GelWrench};
pub use frame_check::{FrameDoubt, Turn};
pub use gauge::GaugeForce;
pub use gel_markers::GelMarkers;
pub use image::GelImage;
pub use layer::GelLayer;
pub use marker_field::{MarkerField, MarkerShear, MarkerSlip, MarkerTrack, track_markers};
pub use markers::{Marker, find_markers};
pub use model::{ColourModel, DarkModel, GelModel};
pub use sensor::GelSensor;
pub use {nalgebra, ndarray};
