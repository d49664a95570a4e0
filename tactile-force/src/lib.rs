//! From grey levels to stress, force, contact and shear.
//!
//! The easy call is [`measure_force`]; [`ForceMeter`] with a [`ForceWorkspace`] is the same without allocation.
//!
//! Images are indexed `[row, column]`; x is the column, y the row, and (0, 0) is the centre of the first pixel.
#![forbid(unsafe_code)]

mod calibration;
mod contact;
mod drift;
mod error;
mod estimate;
mod frame;
mod hertz;
mod image;
mod measure;
mod shear;

pub use calibration::{
    Branch, CalibrationOptions, CalibrationPair, CalibrationReport, ForceReading, Hysteresis,
    LinearCalibration, MonotoneCalibration, PolynomialCalibration, Robustness, StopReason, StressCalibration,
};
pub use contact::{Contact, ContactDetector, ContactOptions, Detection, DetectorWorkspace, Polarity};
pub use drift::{Drift, DriftCorrection};
pub use error::{ForceError, Requirement};
pub use estimate::{Estimate, Real};
pub use frame::{BoundingBox, DifferenceNoise, FrameStatistics, NoiseModel, ReferenceFrame};
pub use hertz::{HertzFit, HertzFitOptions, HertzFitter};
pub use image::{
    GaussianProfile, HertzProfile, ImageMoments, MomentStatus, PixelGrid, ProfileMoments, Rectangle,
};
pub use measure::{ForceMeasurement, ForceMeter, ForceOptions, ForceWorkspace, measure_force};
pub use shear::{ShearCalibration, ShearMeasurement, ShearPair, ShearTracker};
